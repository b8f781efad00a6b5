"""This project's own reconstruction under comparison: the C core that the board runs, on the
host."""

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.results import Reconstruction
from eitskin.errors import FrameError, UsageError
from eitskin.model.build import BuildSettings, make_model
from eitskin.model.eitm import encode_model
from eitskin.scoring.metrics import pixel_cover
from eitskin.solve.batch import Batch
from eitskin.solve.reconstructor import Reconstructor
from eitskin_studies.compare.families import Family, Setup

SHOWN = {"image": "image shown", "solver": "solver's image", "discs": "touches as discs"}


class CoreMethod:
    """The C core in float32, cold for every frame, with the touches that it reports itself.

    Args:
        solver: with the model and the options to compare.
        shows: what is judged: "image", the one that shows the frame, which is drawn of the touches
            where they explain it; "solver", the solver's own; or "discs", touches as even discs.
        threads: how many frames at once; the results are the same.
    """

    def __init__(self, solver: Reconstructor, shows: str = "image", threads: int = 1) -> None:
        self._solver, self._shows = solver, shows
        self._batch = Batch(
            solver.model, threads=threads, engine=solver.engine, options=solver.options
        )
        self._reference: FloatArray | None = None
        self._solved: tuple[FloatArray, list[Reconstruction]] | None = None
        self.name = f"eitskin {solver.options.iterations}, {SHOWN[shows]}"

    @property
    def kept_bytes(self) -> int:
        """The model's bytes and the workspace of one core."""
        engine = self._solver.c_engine
        return len(encode_model(self._solver.model)) + (engine.workspace_bytes if engine else 0)

    def learn(self, untouched_v: FloatArray) -> None:
        """Reference and noise from untouched frames (q, m) in V."""
        self._batch.tare(untouched_v)
        self._reference, self._solved = np.asarray(untouched_v.mean(axis=0)), None

    def reconstruct(self, dv: FloatArray) -> FloatArray:
        """Images (k, n) of difference frames (k, m) in V: in S/m, or for discs the part of each
        pixel in a disc.

        Raises:
            UsageError: nothing was learned yet.
            FrameError: a frame cannot be used.
        """
        if self._shows != "discs":
            solved = self._solve(dv)
            images = [one.image if self._shows == "image" else one.solver_image for one in solved]
            return np.array(images, dtype=np.float64)
        radii = [[touch.radius_mm for touch in result.touches] for result in self._solve(dv)]
        grid = self._solver.model.grid
        return np.array(
            [
                pixel_cover(grid, xy, radius)
                for xy, radius in zip(self.touches(dv), radii, strict=True)
            ]
        )

    def touches(self, dv: FloatArray) -> list[FloatArray]:
        """Positions (t, 2) in mm of the touches of each difference frame; raises as
        :meth:`reconstruct`."""
        return [
            np.array([(t.x_mm, t.y_mm) for t in r.touches]).reshape(-1, 2) for r in self._solve(dv)
        ]

    def macs_of(self, dv: FloatArray) -> FloatArray:
        """Multiply-accumulates of each difference frame, solve and touches, (k,); raises as
        :meth:`reconstruct`."""
        return np.array(
            [result.info.macs + result.info.touch_macs for result in self._solve(dv)],
            dtype=np.float64,
        )

    def _solve(self, dv: FloatArray) -> list[Reconstruction]:
        if self._reference is None:
            raise UsageError(f"{self.name}: no untouched frames were given; call learn first")
        if self._solved is None or self._solved[0] is not dv:
            results = []
            for result in self._batch.each(self._reference + dv):
                if isinstance(result, FrameError):
                    raise result
                results.append(result)
            self._solved = dv, results
        return self._solved[1]


def core_methods(setup: Setup, threads: int = 1) -> tuple[Family, ...]:
    """The solver's image after 30 and after 60 iterations, the image that shows the frame, and the
    touches; all else are the model's defaults.

    The model is made from the same Jacobian as every other method. Nothing is trained but
    thresholds.

    Raises:
        UsageError: the C core is not built.
    """
    model = make_model(setup.skin, setup.protocol, setup.linearisation, BuildSettings())

    def family(iterations: int, shows: str) -> Family:
        def make(_: float) -> CoreMethod:
            solver = Reconstructor(model)
            solver.set_options(iterations=iterations)
            return CoreMethod(solver, shows, threads)

        return Family("", (0.0,), make)

    return family(30, "solver"), family(60, "solver"), family(60, "image"), family(60, "discs")
