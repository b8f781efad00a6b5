"""docs/reference/error-codes.md: every code in it is provoked at the command line."""

import re
import socket
import sys
from collections.abc import Iterator
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from eitm_bytes import patched, sections_of
from eitskin import errors
from eitskin.cli.main import main
from eitskin.frames.frames import save_frames
from small_models import session, tiny_blob

PAGE = Path(__file__).resolve().parents[3] / "docs" / "reference" / "error-codes.md"
CODES = {
    int(row[1]): row[2]
    for row in re.finditer(r"^- (\d+)(?: `(\w+)`)?:", PAGE.read_text(encoding="utf-8"), re.M)
}
OVERLAPPING = "[skin]\ndiameter_mm = 100\n[electrodes]\ncount = 16\nwidth_mm = 25\n"
COMMANDS = {
    0: "model info",
    1: "model info",  # of a fault that has no kind of its own
    2: "model info --colour",
    3: "model info none.eitm",
    4: "model build unknown.toml -o made.eitm",
    5: "model build overlapping.toml -o made.eitm",
    6: "model info frames.npz",
    7: "reconstruct frames.npz --model tiny.eitm",
    8: "reconstruct words.csv",
    9: "stream --device sim:two_touch --to ws://127.0.0.1:1",  # as if websockets were not there
    10: "model verify golden.eitm",
    11: "doctor dead.npz",
    12: "info --device serial:/dev/none",
    13: "stream --device sim:two_touch --to ws://127.0.0.1:PORT",
    130: "model info",  # by the keyboard
}


@pytest.fixture
def taken(tmp_path, monkeypatch) -> Iterator[int]:
    """In a folder of files that have something wrong; a port that is taken."""
    monkeypatch.chdir(tmp_path)
    Path("unknown.toml").write_text("[skim]\n", encoding="utf-8")
    Path("overlapping.toml").write_text(OVERLAPPING, encoding="utf-8")
    Path("words.csv").write_text("dry\n", encoding="utf-8")
    blob = tiny_blob()
    Path("tiny.eitm").write_bytes(blob)
    image = sections_of(blob)["GOLD"]
    Path("golden.eitm").write_bytes(patched(blob, image.offset + image.size - 4, "<f", 1e3))
    save_frames("frames.npz", session().as_frames())
    fields = dict(np.load("frames.npz"))
    lost = (fields["drive_measure"] == 3).any(axis=1)
    np.savez("dead.npz", **(fields | {"voltage_v": fields["voltage_v"] * ~lost}))
    with socket.socket() as port:
        port.bind(("127.0.0.1", 0))
        port.listen()
        yield port.getsockname()[1]


@pytest.mark.parametrize("code", sorted(CODES))
def test_a_code_is_provoked(code, taken, monkeypatch, capsys):
    raised: dict[int, type[BaseException]] = {1: errors.EitskinError, 130: KeyboardInterrupt}
    if code in raised:
        fault = Mock(side_effect=raised[code])
        monkeypatch.setattr("eitskin.model.prebuilt.load_prebuilt", fault)
    if code == 9:
        for name in ["websockets", *(n for n in sys.modules if n.startswith("websockets"))]:
            monkeypatch.setitem(sys.modules, name, None)
    assert main(COMMANDS[code].replace("PORT", str(taken)).split()) == code
    lines = capsys.readouterr().err.splitlines()
    assert [line[:9] for line in lines] == (["eitskin: "] if code not in (0, 11) else [])


def test_the_page_has_every_class_and_no_other():
    kinds = [errors.EitskinError, *errors.EitskinError.__subclasses__()]
    listed = {name: code for code, name in CODES.items() if name}
    own = [kind for kind in kinds if kind.__module__ == errors.__name__]
    assert listed == {kind.__name__: kind.exit_code for kind in own}
    assert sorted(COMMANDS) == sorted(CODES)
