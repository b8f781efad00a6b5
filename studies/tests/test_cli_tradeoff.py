"""``eitskin tradeoff``: a small run, what it refuses, and that the model that ``eitskin recommend``
makes is the one that was measured."""

import json
import shlex
from collections.abc import Callable

import pytest

from eitskin.cli.main import main
from eitskin.model.eitm import load_model
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin.tuning.front import load_front
from eitskin_studies.pictures.tradeoff_pictures import DRAWN
from eitskin_studies.tradeoff.engines import ModelShop

TINY_RUN = (
    "--scenes 3 --train 2 --set-scenes 2 --sets pairs --snr-db 60 --elements 1200 --random-skins 2"
    " --no-peers --counted 0 --rounds 1 --only 'tiny,mini,standard rank 32'"
)


@pytest.fixture
def done(capsys) -> Callable[[str], str]:
    """Run the command; it must succeed in silence on stderr. Returns what it printed."""

    def run(command: str) -> str:
        capsys.readouterr()
        code = main(shlex.split(command))
        out, err = capsys.readouterr()
        assert (code, err) == (0, "")
        return out

    return run


@pytest.mark.long("test_tradeoff_front.py, test_the_recommended_model_is_the_measured_one")
def test_run_writes_tables_and_pictures(done, tmp_path):
    out = done(f"tradeoff run -o {tmp_path / 'out'} {TINY_RUN} --front {tmp_path / 'small.json'}")
    assert "standard rank 32" in out and "* " in out
    found = {path.name for path in (tmp_path / "out").iterdir() if path.is_file()}
    pictures = set(DRAWN)
    assert found == {"results.jsonl", "front.json", "table.csv"} | pictures
    assert all((tmp_path / "out" / name).read_bytes().startswith(b"<?xml") for name in pictures)
    assert len(load_front(tmp_path / "out" / "front.json").points) == 3
    front = tmp_path / "small.json"
    assert "MIoU" in done(f"recommend --front {front} --budget 1s --board host")


def test_the_recommended_model_is_the_measured_one(done, tmp_path, monkeypatch):
    """The model errors of 300 random skins are left out of the comparison."""
    monkeypatch.setattr("eitskin.model.build.with_model_errors", lambda model, *_, **__: model)
    path = tmp_path / "model.eitm"
    name = json.loads(done(f"recommend --budget 5ms -o {path} --json"))["name"]
    model, _ = load_model(path)
    settings = next(p for p in load_front().points if p.name == name).configuration
    measured = ModelShop(paper_skin(), adjacent(16)).build(settings).model
    assert (measured.stored.columns == model.stored.columns).all()
    assert (measured.projection == model.projection).all()


@pytest.mark.parametrize(
    ("code", "command", "said"),
    [
        (3, "tradeoff run --set nowhere.toml", "nowhere.toml"),
        (2, "tradeoff run --only standrad", "did you mean 'standard'"),
        (2, "tradeoff run --snr-db 60;80", "--snr-db"),
        (2, "tradeoff run --sets quads", "quads"),
        (2, "tradeoff run --scenes 0", "scenes"),
        (2, "tradeoff run --seed -1", "--seed"),
        (2, "tradeoff run --elements 3", "--elements"),
    ],
)
def test_refusals(capsys, code, command, said):
    assert main(shlex.split(command)) == code
    out, err = capsys.readouterr()
    assert out == "" and err.startswith("eitskin: ") and err.count("\n") == 1 and said in err
