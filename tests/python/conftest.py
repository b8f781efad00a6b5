"""What every Python test may use."""

from __future__ import annotations

from pathlib import Path

import pytest

from cross_build import ROOT, build_cortex_m7
from margins import (  # noqa: F401
    margins,
    pytest_addoption,
    pytest_configure,
    pytest_runtest_logreport,
    pytest_sessionfinish,
    pytest_terminal_summary,
    pytest_unconfigure,
)


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
def cortex_m7(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A build of everything for the Cortex-M7: ``firmware/eitskin_BOARD.elf``, ``.bin`` and
    ``.map``, ``tests/emulated``."""
    return build_cortex_m7(ROOT, tmp_path_factory.mktemp("cortex-m7"))
