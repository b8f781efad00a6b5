"""A configuration's model and core: each model is made once, from one Jacobian a grid on one
mesh."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from eitskin.errors import UsageError
from eitskin.fem.cem import ForwardModel
from eitskin.fem.fields import electrode_fields
from eitskin.fem.grid import grid_for
from eitskin.fem.mesh import mesh_for_elements
from eitskin.fem.sensitivity import sensitivity
from eitskin.model.build import Linearisation, make_model, with_model_errors
from eitskin.model.eitm import encode_model
from eitskin.model.model import Model
from eitskin.model.model_errors import ModelErrors
from eitskin.progress import Progress
from eitskin.scoring import metrics
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin
from eitskin.skin.uncertainty import DEFAULT_UNCERTAINTY
from eitskin.solve.reconstructor import Reconstructor
from eitskin.tuning.configuration import ELEMENTS, Configuration, build_settings


@dataclass(frozen=True, eq=False)
class Built:
    """A configuration made ready: its model, the file's bytes, and the scorer of its images."""

    model: Model
    blob: bytes
    image_scorer: metrics.ImageScorer

    def reconstructor(self, one: Configuration) -> Reconstructor:
        """The C core in float32 with the configuration's settings."""
        solver = Reconstructor(self.model, blob=self.blob)
        solver.set_options(**one.solver_settings)
        return solver


class ModelShop:
    """Makes the models of configurations for one skin, on one mesh of about 3,000 elements, as
    ``eitskin model build`` does."""

    def __init__(self, skin: Skin, protocol: Protocol) -> None:
        self.skin, self.protocol = skin, protocol
        self._forward: ForwardModel | None = None
        self._linear: dict[int, Linearisation] = {}
        self._image_scorers: dict[int, metrics.ImageScorer] = {}
        self._errors: dict[tuple[Any, ...], ModelErrors] = {}
        self._raster = metrics.raster_inside(skin.outline)

    def refuse(self, one: Configuration) -> None:
        """Reject a configuration whose model could not be made.

        Raises:
            UsageError: its rank exceeds what protocol and grid allow.
        """
        most = min(
            len(self.protocol.reciprocal_pairs().first),
            grid_for(self.skin.outline, one.pixels).n_pixels,
        )
        if one.rank > most:
            raise UsageError(
                f"configuration {one.name!r}: rank = {one.rank} is out of range; use 1 to {most}"
            )

    def draw_errors(
        self, configurations: Sequence[Configuration], samples: int, progress: Progress
    ) -> None:
        """Give the models of ``configurations`` their errors, all from the same ``samples`` random
        skins.

        Raises:
            GeometryError, MissingExtraError, ModelError: as ``with_model_errors``.
        """
        models = {one.model_settings: self._made(one) for one in configurations if one.model_errors}
        if not models:
            return
        ends = np.cumsum([0, *(model.rank for model in models.values())])
        stacked = np.vstack([model.projection for model in models.values()])
        some = next(iter(models.values()))
        uncertainty = replace(self.skin.uncertainty or DEFAULT_UNCERTAINTY, samples=samples)
        drawn = with_model_errors(
            replace(some, projection=stacked),
            self.skin,
            uncertainty,
            progress=lambda items, _: progress(items, "random skins"),
        ).model_errors
        assert drawn is not None
        for key, begin, end in zip(models, ends, ends[1:], strict=False):
            own = slice(begin, end)
            self._errors[key] = replace(
                drawn, error=drawn.error[own, own], drift=drawn.drift[own, own]
            )

    def build(self, one: Configuration) -> Built:
        """The model of a configuration, with its errors where they were drawn.

        Raises:
            UsageError: the model cannot be; see ``refuse``.
            GeometryError, MissingExtraError: from meshing.
        """
        errors = self._errors.get(one.model_settings)
        model = replace(self._made(one), model_errors=errors)
        return Built(model, encode_model(model), self._image_scorer(one.pixels))

    def _made(self, one: Configuration) -> Model:
        return make_model(
            self.skin, self.protocol, self._linearise(one.pixels), build_settings(one, self.skin)
        )

    def _linearise(self, pixels: int) -> Linearisation:
        if self._forward is None:
            self._forward = ForwardModel(
                mesh_for_elements(self.skin, ELEMENTS), self.skin, self.protocol
            )
        if pixels not in self._linear:
            grid = grid_for(self.skin.outline, pixels)
            jacobian, v0_v = sensitivity(self._forward, self.skin.conductivity_s_per_m, grid)
            fields = electrode_fields(self._forward, self.skin.conductivity_s_per_m, grid)
            self._linear[pixels] = Linearisation(
                grid, jacobian, v0_v, self._forward.mesh.n_elements, fields
            )
        return self._linear[pixels]

    def _image_scorer(self, pixels: int) -> metrics.ImageScorer:
        if pixels not in self._image_scorers:
            grid = self._linearise(pixels).grid
            self._image_scorers[pixels] = metrics.ImageScorer(
                self._raster, metrics.lookup_for(self._raster.points_mm, grid), grid.n_pixels
            )
        return self._image_scorers[pixels]
