"""Fixtures and settings for all Python tests."""

from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest
from filelock import FileLock

from cross_build import ROOT, shared_build
from kept_meshes import mesher_that_keeps
from margins import (  # noqa: F401
    margins,
    pytest_configure,
    pytest_sessionfinish,
    pytest_terminal_summary,
    pytest_unconfigure,
)

# The files that take longest, first: two workers that share the files then end together.
LONGEST = (
    "emulated/test_same_bits.py", "docs/test_code_blocks.py", "teaching/test_teach.py",
    "page/test_in_a_browser.py", "model/test_model_errors.py", "teaching/test_update.py",
    "hard_cases/test_columns.py", "model/test_build.py", "fem/test_cem.py",
    "cli/test_cli_model.py", "fem/test_mesh.py", "frames/test_doctor.py",
    "emulator/test_emulated_board.py", "hardware/test_spice.py", "hardware/test_stages.py",
)  # fmt: skip
NEEDED = ("matplotlib", "netgen", "scipy", "skfem", "sklearn", "trimesh", "unicorn")


def pytest_sessionstart() -> None:
    """Nothing is left out for want of a package."""
    missing = [name for name in NEEDED if find_spec(name) is None]
    if missing:
        raise pytest.UsageError(f"no {', '.join(missing)} here: pip install -e '.[test]'")


@pytest.hookimpl(hookwrapper=True)
def pytest_collection(session: pytest.Session) -> Iterator[None]:
    """Workers collect one after the other: the first compiles all modules, which takes two thirds
    of its time, and the others read what it compiled."""
    (ROOT / "build").mkdir(exist_ok=True)
    with FileLock(ROOT / "build" / "collecting.lock"):
        yield


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the tests of LONGEST first; all others keep their order."""
    folder = Path(__file__).resolve().parent
    place = {folder / name: k for k, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(item.path, len(place)))


@pytest.fixture(scope="session", autouse=True)
def meshes_are_kept() -> Iterator[None]:
    """A process of its own for each mesh would take most of the time of small models."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("eitskin.fem.mesh.run_mesher", mesher_that_keeps())
        yield


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of measured frames, ``../shared/data`` beside the project's root; without it the
    test is skipped."""
    folder = Path(__file__).resolve().parents[2].parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(
            "the measured frames are not part of the project: no ../shared/data beside its root"
        )
    return folder


@pytest.fixture(scope="session")
def cortex_m7() -> Path:
    """A build of everything for the Cortex-M7: ``firmware/eitskin_BOARD.elf``, ``.bin`` and
    ``.map``, ``tests/emulated``."""
    return shared_build()


@pytest.fixture(scope="session")
def same_everywhere(cortex_m7, tmp_path_factory):
    """Runs steps on host kernels, plain C and the emulated Cortex-M7, and asserts the same bits."""
    from eitskin_emulator.core_on_qemu import PROGRAM
    from everywhere import SameEverywhere

    return SameEverywhere(cortex_m7 / PROGRAM, lambda: tmp_path_factory.mktemp("board"))
