"""What every Python test may use."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of measured frames, ``../shared/data`` beside the project's root; without it the test is skipped."""
    folder = Path(__file__).resolve().parents[2].parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("the measured frames are not part of the project: no ../shared/data beside its root")
    return folder
