"""From frames to images and touches: the C core, the numpy reference, and baselines to compare with."""

from eitskin.solve.reconstructor import ENGINES, Reconstructor
from eitskin.solve.results import Baseline, Info, Options, Reconstruction, Touch

__all__ = ["ENGINES", "Baseline", "Info", "Options", "Reconstruction", "Reconstructor", "Touch"]
