"""The stored model as a Python object, with everything that maps the rows of a frame to the pixels
of an image."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.arrays import FloatArray
from eitskin.errors import EitskinError
from eitskin.fem.grid import Grid
from eitskin.model.force_law import ForceLaw
from eitskin.model.model_errors import ModelErrors
from eitskin.model.row_form import RowForm
from eitskin.model.storage import StoredMatrix
from eitskin.skin.protocol import Protocol, Reciprocity
from eitskin.skin.skin import Skin, skin_from_table
from eitskin.surface.surface_map import SurfaceMap

DATA_KINDS = ("difference", "normalised", "log-ratio")
GAIN_DRIFT_KEPT = 8  # a bit of touch_fit_left_out: changes along the reference are kept as data
TRACKS_REFERENCE = 16  # another: between touches the reference tracks the untouched skin


@dataclass(frozen=True)
class Defaults:
    """The default options that the maker of a model chose, in the order of the file;
    csrc/include/eitskin/context.h explains each.

    Lambdas, the detection threshold and the other thresholds are factors without unit.
    ``mask_threshold`` is t of the mask x > t max(x). ``solver`` is one of ``core.results.SOLVERS``.
    ``touch_fit_left_out`` holds the bits of ``Options.touch_fit`` that are not set, and
    ``GAIN_DRIFT_KEPT`` and ``TRACKS_REFERENCE``.
    """

    iterations: int = 60
    max_touches: int = 12
    lambda_rel: float = 0.03
    lambda_noise_factor: float = 0.3
    detection_factor: float = 1.2
    mask_threshold: float = 0.26
    touch_threshold: float = 0.15
    touch_min_fraction: float = 0.003
    touch_min_radius_mm: float = 3.0
    touch_max_radius_mm: float = 30.0
    touch_seed_radius_mm: float = 9.0
    touch_change_s_per_m: float = 0.0135
    follow_mm: float = 25.0
    touch_radius_weight: float = 1e-3
    solver: str = "working-set"
    touch_fit_left_out: int = 0


@dataclass(frozen=True, eq=False)
class Golden:
    """The data of the self-test: ``reference_v`` and ``frame_v`` (m,), and the ``image`` (n,) in
    S/m that the float32 core calculates; all float32."""

    reference_v: npt.NDArray[np.float32]
    frame_v: npt.NDArray[np.float32]
    image: npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Fields:
    """The data for the interaction of touches (section FLDS).

    ``columns`` (n, 2 L + 4) float16 hold for each pixel E_x of each electrode's current, then E_y
    of each, then a_x, a_y, b_x, b_y of the rim's mirror (``skin.mirror``). ``volts`` is the factor
    in dV = -volts change area E . E, in V per (S/m mm2); ``per_sheet`` is 1 / (2 pi sigma) in m/S.
    Both are float32.
    """

    columns: npt.NDArray[np.float16]
    volts: float
    per_sheet: float


@dataclass(frozen=True, eq=False)
class Model:
    """A decoded model.

    ``v_ref_v`` (k,) are the folded voltages of the untouched skin, ``projection`` is P (r, k)
    float32, ``stored`` is S, ``column_weight`` (n,) float32 is in S/m per coefficient, and ``meta``
    describes how the model was made.

    The other fields are optional. ``fields`` serve the interaction of touches. ``force_law``
    converts strengths to forces if the skin was calibrated. ``model_errors`` state how far a real
    skin may differ from the model. ``precision`` (k (k + 1) / 2,) belongs to taught models: the
    lower triangle of the inverse covariance of the rows' noise. ``place_factor`` multiplies the
    covariance of a place from the fit; 0 means unknown. ``surface`` maps the plane of the model to
    the surface that the skin covers; None is a flat skin.
    """

    protocol: Protocol
    fold: Reciprocity
    grid: Grid
    data_kind: str
    rank: int
    v_ref_v: npt.NDArray[np.float32]
    projection: npt.NDArray[np.float32]
    stored: StoredMatrix
    column_weight: npt.NDArray[np.float32]
    lipschitz: float
    noise_gain: float
    defaults: Defaults
    golden: Golden
    meta: dict[str, Any] = field(default_factory=dict)
    fields: Fields | None = None
    force_law: ForceLaw | None = None
    row_form: RowForm | None = None
    model_errors: ModelErrors | None = None
    precision: npt.NDArray[np.float32] | None = None
    place_factor: float = 0.0
    surface: SurfaceMap | None = None

    def __repr__(self) -> str:
        name = self.meta.get("skin", {}).get("skin", {}).get("name", "of a skin without a name")
        scanned = f"{self.protocol.n_electrodes} electrodes, {self.protocol.n_rows} rows"
        return f"<Model {name}, {scanned}, {self.grid.n_pixels} pixels, rank {self.rank}>"

    @cached_property
    def sensitivity(self) -> FloatArray:
        """The decoded S (r, n)."""
        return self.stored.decode(self.rank)

    @cached_property
    def skin(self) -> Skin:
        """The skin that the model was made for.

        Raises:
        ConfigError: the model has no description of its skin.
        """
        skin = skin_from_table(self.meta.get("skin", {}), "the model's own description")
        return skin if self.surface is None else replace(skin, surface=self.surface)

    @cached_property
    def known_skin(self) -> Skin | None:
        """``skin``; None if the model has no description of it that can be read, such as one by a
        newer eitskin."""
        try:
            return self.skin
        except EitskinError:
            return None
