"""Reconstruct images and touches from frames, with the C core or the oracle."""

from eitskin.core.diagnostics_table import Touch
from eitskin.core.results import Info, LearnedReference, Options, Reconstruction
from eitskin.solve.batch import Batch, reconstruct_many
from eitskin.solve.reconstructor import ENGINES, Reconstructor

__all__ = [
    "ENGINES",
    "Batch",
    "Info",
    "LearnedReference",
    "Options",
    "Reconstruction",
    "Reconstructor",
    "Touch",
    "reconstruct_many",
]  # fmt: skip
