"""eitskin's own reconstruction under comparison: its image, and its touches painted as discs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from eitskin.errors import UsageError
from eitskin.model.build import BuildSettings, Linearisation, make_model
from eitskin.solve.reconstructor import Reconstructor
from eitskin.solve.results import Reconstruction
from eitskin.study.metrics import pixel_cover
from eitskin.study.methods import Family, Setup

FloatArray = npt.NDArray[np.float64]


@dataclass(eq=False)
class EitskinMethod:
    """The C core, float32, with the model's defaults but for the iterations; ``paint`` "image" or "touches" as discs."""

    reconstructor: Reconstructor
    paint: str
    reference_v: FloatArray | None = None
    _last: tuple[bytes, list[Reconstruction]] | None = field(default=None, repr=False)

    @property
    def name(self) -> str:
        """What the table calls it."""
        what = "image" if self.paint == "image" else "touches as discs"
        return f"eitskin {what}, {self.reconstructor.options.iterations} it"

    def learn(self, quiet_v: FloatArray) -> None:
        """Tare on the session's quiet frames (q, m)."""
        self.reconstructor.tare(quiet_v)
        self.reference_v = np.asarray(quiet_v.mean(axis=0))

    def _results(self, dv: FloatArray) -> list[Reconstruction]:
        if self.reference_v is None:
            raise UsageError("compare: eitskin needs quiet frames before touched ones")
        key = dv.tobytes()
        if self._last is None or self._last[0] != key:
            self._last = key, [self.reconstructor.reconstruct(self.reference_v + row) for row in dv]
        return self._last[1]

    def reconstruct(self, dv: FloatArray) -> FloatArray:
        """Images (k, n) of difference frames (k, m) in V."""
        results = self._results(dv)
        if self.paint == "image":
            return np.array([result.image for result in results], dtype=np.float64)
        grid = self.reconstructor.model.grid
        return np.array(
            [
                pixel_cover(grid, [(t.x_mm, t.y_mm) for t in result.touches], [t.radius_mm for t in result.touches])
                for result in results
            ]
        )

    def touches(self, dv: FloatArray) -> Sequence[FloatArray]:
        """Positions (t, 2) in mm found in each difference frame."""
        return [np.array([(t.x_mm, t.y_mm) for t in result.touches]).reshape(-1, 2) for result in self._results(dv)]


def eitskin_families(setup: Setup) -> tuple[Family, ...]:
    """The image after 30 and 60 iterations, and the touches; nothing is left to choose, so each has one value."""
    linear = Linearisation(setup.grid, setup.jacobian, setup.voltages_v, setup.mesh_elements)
    model = make_model(setup.skin, setup.protocol, linear, BuildSettings())

    def family(paint: str, iterations: int) -> Family:
        def make(_: float) -> EitskinMethod:
            reconstructor = Reconstructor(model)
            reconstructor.with_options(iterations=iterations)
            return EitskinMethod(reconstructor, paint)

        return Family("", (0.0,), make)

    return family("image", 30), family("image", 60), family("touches", 60)
