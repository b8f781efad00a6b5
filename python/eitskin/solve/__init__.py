"""From frames to images and touches: the C core and the numpy reference."""

from eitskin.core.results import Baseline, Info, Options, Reconstruction, Touch
from eitskin.solve.batch import Batch, reconstruct_many
from eitskin.solve.reconstructor import ENGINES, Reconstructor

__all__ = [
    "ENGINES", "Baseline", "Batch", "Info", "Options", "Reconstruction", "Reconstructor", "Touch",
    "reconstruct_many",
]  # fmt: skip
