"""What the hard cases share."""

import pytest
from everywhere import SameEverywhere

from eitskin_studies.harness.emulated import PROGRAM


@pytest.fixture(scope="session")
def same_everywhere(cortex_m7, tmp_path_factory) -> SameEverywhere:
    """Runs steps on host kernels, plain C and the emulated Cortex-M7, and asserts the same bits."""
    return SameEverywhere(cortex_m7 / PROGRAM, lambda: tmp_path_factory.mktemp("board"))
