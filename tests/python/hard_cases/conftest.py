"""What the hard cases share."""

from __future__ import annotations

import pytest
from everywhere import SameEverywhere

from cross_build import ROOT
from eitskin_studies.harness.emulated import PROGRAM, build_cortex_m7


@pytest.fixture(scope="session")
def same_everywhere(tmp_path_factory: pytest.TempPathFactory) -> SameEverywhere:
    """Runs steps on host kernels, plain C and the emulated Cortex-M7, and asserts the same bits;
    the program is built once."""
    built = build_cortex_m7(ROOT, tmp_path_factory.mktemp("frames-m7"), "frames_m7")
    return SameEverywhere(built / PROGRAM, lambda: tmp_path_factory.mktemp("board"))
