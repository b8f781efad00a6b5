"""The image of the NUCLEO-F767ZI, built once."""

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def elf(cortex_m7) -> Path:
    return cortex_m7 / "firmware" / "eitskin_nucleo_f767zi.elf"
