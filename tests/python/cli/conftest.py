"""Running the command line in this process, and the files that it is given."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eitskin.cli.main import main
from eitskin.frames.frames import save_frames
from fresh_python import words
from small_models import session

Refused = Callable[..., str]
TOUCH_FIELDS = ("touch_frame", "touch_xy_mm", "touch_radius_mm", "touch_strength", "touch_sign")


@pytest.fixture(scope="session")
def frames_file(tmp_path_factory) -> Path:
    """Twenty simulated frames of the paper's skin with their truth."""
    path = tmp_path_factory.mktemp("frames") / "frames.npz"
    save_frames(path, session().as_frames())
    return path


@pytest.fixture
def changed_frames(frames_file, tmp_path) -> Callable[..., Path]:
    """Write the frames file with fields replaced (None: left out), past the checks of
    ``save_frames``; of the ``first`` frames, or without its ``truth``."""

    def write(first: int | None = None, *, truth: bool = True, **changes: Any) -> Path:
        fields = dict(np.load(frames_file)) | changes
        if first is not None:
            kept = fields["touch_frame"] < first
            for key in TOUCH_FIELDS:
                fields[key] = fields[key][kept]
            for key in ("voltage_v", "frame_name"):
                fields[key] = fields[key][:first]
        if not truth:
            fields |= dict.fromkeys(TOUCH_FIELDS)
        path = tmp_path / "changed.npz"
        np.savez(path, **{key: value for key, value in fields.items() if value is not None})
        return path

    return write


@pytest.fixture
def refused(tmp_path, capsys) -> Refused:
    """Run the command; it must give ``code``, one line on stderr, nothing on stdout, and no new
    file. Returns the line."""

    def run(code: int, *arguments: object) -> str:
        before = sorted(tmp_path.rglob("*"))
        capsys.readouterr()
        assert main(words(*arguments)) == code
        out, err = capsys.readouterr()
        assert err.endswith("\n") and err.count("\n") == 1, err
        assert err.startswith("eitskin: ") and "Traceback" not in err
        assert out == ""
        assert sorted(tmp_path.rglob("*")) == before
        return err[len("eitskin: ") : -1]

    return run


@pytest.fixture
def ran(capsys) -> Callable[..., tuple[str, str]]:
    """Run the command; it must give ``code``. Returns what it printed, on stdout and stderr."""

    def run(code: int, *arguments: object) -> tuple[str, str]:
        capsys.readouterr()
        assert main(words(*arguments)) == code
        out, err = capsys.readouterr()
        return out, err

    return run


@pytest.fixture
def done(capsys) -> Callable[..., str]:
    """Run the command; it must succeed in silence on stderr. Returns what it printed."""

    def run(*arguments: object) -> str:
        capsys.readouterr()
        code = main(words(*arguments))
        out, err = capsys.readouterr()
        assert (code, err) == (0, "")
        return out

    return run


@pytest.fixture
def json_of(done) -> Callable[..., Any]:
    """Return the output of a command with ``--json``. It must be standard JSON, without NaN and
    Infinity."""

    def refuse(name: str) -> None:
        raise AssertionError(f"{name} is no JSON")

    return lambda *arguments: json.loads(done(*arguments, "--json"), parse_constant=refuse)
