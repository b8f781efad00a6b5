"""pip installs the product and nothing of the studies. The list is that of the wheel."""

import io
import zipfile
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import pytest

from eitskin.config import load_toml

ROOT = Path(__file__).resolve().parents[3]
BUILT = {".so", ".pyd", ".dylib"}  # compiled in
MAX_BYTES = 2_250_000


@pytest.fixture(scope="module")
def installed() -> dict[str, Path]:
    """The files of the installed wheel by name, without what Python made of them."""
    try:
        found = distribution("eitskin")
    except PackageNotFoundError:
        pytest.skip("eitskin is not installed, only on the path")
    return {
        str(file): Path(str(file.locate()))
        for file in found.files or ()
        if "__pycache__" not in file.parts and file.parts[0] not in ("..", "/")
    }


def test_the_wheel_is_the_package_alone(installed):
    tops = {name.split("/")[0] for name in installed}
    assert {name for name in tops if not name.endswith(".dist-info")} == {"eitskin"}
    table = load_toml(ROOT / "pyproject.toml", "project")
    assert table["tool"]["scikit-build"]["wheel"]["packages"] == ["python/eitskin"]


def test_the_wheel_holds_what_a_user_needs_in_little_room(installed):
    for name in ("tuning/front.json", "model/paper.eitm", "scene/library/demo.toml", "py.typed",
                 "demo/demo_frames.npz",
                 "session/message.schema.json", "sinks/msg/TouchArray.msg"):  # fmt: skip
        assert f"eitskin/{name}" in installed
    assert sum(Path(name).suffix in BUILT for name in installed) == 3  # two cores and a board
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as wheel:
        for name, path in installed.items():
            wheel.write(path, name)
    assert packed.tell() < MAX_BYTES
