"""Build a model from a skin's description: mesh, forward model, Jacobian, reduction, storage,
golden frame."""

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin import __version__
from eitskin.arrays import FloatArray
from eitskin.core.engine import CoreEngine
from eitskin.errors import UsageError
from eitskin.fem.grid import Grid, grid_for
from eitskin.model.eitm import encode_model
from eitskin.model.eitm_sections import MAX_PIXELS, MAX_RANK
from eitskin.model.model import DATA_KINDS, Defaults, Fields, Golden, Model
from eitskin.model.reduction import (
    DEFAULT_COLUMN_POWER,
    DEFAULT_REGULARISATION,
    fold_rows,
    noise_gain,
    reduce_jacobian,
    spectral_norm_squared,
)
from eitskin.model.row_form import row_form
from eitskin.model.storage import STORAGES, store
from eitskin.progress import Progress, silent
from eitskin.skin.mirror import rim_mirror
from eitskin.skin.protocol import Protocol, protocol_to_table, require_independent
from eitskin.skin.skin import Skin, size_to_paper, skin_to_table
from eitskin.skin.uncertainty import DEFAULT_UNCERTAINTY, Uncertainty

LIPSCHITZ_MARGIN = 1e-4
FIELD_PEAK = 1024.0
MIN_RATIO_REFERENCE = 1e-6
# A disc of contrast c in a skin of conductivity s acts like a change of 2 (c - 1) / (c + 1) s,
# which is 1.0 to 1.64 s for c = 3 to 10.
TOUCH_CHANGE_RATIO = 1.35
# The logarithm compresses strong touches, so their data say little about the radius, and the
# expected change has to fix it instead.
LOG_RADIUS_WEIGHT = 1.0
# Elements of the mesh for model errors; with 3000, the errors of shaped touches are 15 % too small.
FIELD_ELEMENTS = 12000  # of the mesh of the stored fields, which touches are fitted by
ERROR_ELEMENTS = 6000


# 32 electrodes report model mismatch on perfect frames at rank 64 and none from 96 on.
RANK_PER_ELECTRODE, MIN_RANK = 4, 64


@dataclass(frozen=True)
class BuildSettings:
    """The settings for building a model. ``rank`` 0 takes RANK_PER_ELECTRODE per electrode and at
    least MIN_RANK, or the number of independent rows if that is smaller. ``samples`` is the number
    of random skins that are drawn for the model errors: 0 draws none, and None takes the number
    from the skin's uncertainty."""

    rank: int = 0
    pixels_across: int = 32
    storage: str = "f32"
    data_kind: str = "difference"
    regularisation: float = DEFAULT_REGULARISATION
    column_power: float = DEFAULT_COLUMN_POWER
    elements: int = 3000
    touch_change_ratio: float = TOUCH_CHANGE_RATIO
    defaults: Defaults | None = None
    samples: int | None = None


@dataclass(frozen=True, eq=False)
class Linearisation:
    """The linear response of a skin: ``jacobian`` (m, n) in V per S/m on ``grid``, ``v0_v`` (m,),
    and the number of elements of the mesh.

    ``electrode_fields`` (n, 2, L) in V/m per A serve to calculate the interaction of touches; with
    None the model is built without it.
    """

    grid: Grid
    jacobian: FloatArray
    v0_v: FloatArray
    elements: int
    electrode_fields: FloatArray | None = None


def linearise(
    skin: Skin, protocol: Protocol, *, pixels_across: int = 32, elements: int = 3000
) -> Linearisation:
    """Mesh ``skin`` and calculate the Jacobian of its boundary voltages at its own conductivity.

    Raises:
        GeometryError, UsageError, MissingExtraError: as ``mesh_for_elements``.
    """
    from eitskin.fem.cem import ForwardModel
    from eitskin.fem.fields import electrode_fields
    from eitskin.fem.mesh import mesh_for_elements
    from eitskin.fem.sensitivity import sensitivity

    grid = grid_for(skin.outline, pixels_across)
    mesh = mesh_for_elements(skin, elements)
    forward = ForwardModel(mesh, skin, protocol)
    jacobian, v0 = sensitivity(forward, skin.conductivity_s_per_m, grid)
    fine = ForwardModel(mesh_for_elements(skin, max(elements, FIELD_ELEMENTS)), skin, protocol)
    fields = electrode_fields(fine, skin.conductivity_s_per_m, grid)
    return Linearisation(grid, jacobian, v0, mesh.n_elements, fields)


def default_rank(n_electrodes: int, limits: tuple[int, ...]) -> int:
    """Return the rank of a reduced Jacobian, at most the least of ``limits`` (independent rows,
    rows, pixels). More electrodes see finer changes; those beyond the rank would count as model
    mismatch."""
    return min(max(MIN_RANK, RANK_PER_ELECTRODE * n_electrodes), MAX_RANK, *limits)


def make_model(
    skin: Skin, protocol: Protocol, linear: Linearisation, settings: BuildSettings
) -> Model:
    """Reduce and store a linearisation. The golden image is calculated by the float32 C core."""
    _refuse_settings(settings, linear.grid)
    fold = protocol.reciprocal_pairs()
    v_ref, jacobian = fold_rows(linear.v0_v, fold), fold_rows(linear.jacobian, fold)
    silent = np.zeros(len(v_ref), dtype=np.bool_)
    if settings.data_kind == "normalised":
        # A ratio to a reference of almost zero carries no information; the solver ignores this row,
        # too.
        silent = np.abs(v_ref) < MIN_RATIO_REFERENCE * np.sqrt(np.mean(v_ref**2))
        jacobian = np.where(silent[:, None], 0.0, jacobian / np.where(silent, 1.0, v_ref)[:, None])
    independent = require_independent(protocol, min(settings.rank, len(fold.first)))
    rank = settings.rank or default_rank(protocol.n_electrodes, (independent, *jacobian.shape))
    reduction = reduce_jacobian(
        jacobian, rank, regularisation=settings.regularisation, column_power=settings.column_power
    )
    projection = np.where(silent, 0.0, reduction.projection).astype(np.float32)
    stored = store(reduction.sensitivity, settings.storage)
    decoded = stored.decode(rank)
    empty = np.zeros(linear.grid.n_pixels, dtype=np.float32)
    reference = linear.v0_v.astype(np.float32)
    model = Model(
        protocol=protocol,
        fold=fold,
        grid=linear.grid,
        data_kind=settings.data_kind,
        rank=rank,
        v_ref_v=v_ref.astype(np.float32),
        projection=projection,
        stored=stored,
        column_weight=reduction.column_weight.astype(np.float32),
        lipschitz=float(np.float32(spectral_norm_squared(decoded) * (1 + LIPSCHITZ_MARGIN))),
        noise_gain=float(np.float32(noise_gain(projection, decoded))),
        defaults=settings.defaults
        or scaled_defaults(skin, settings.data_kind, settings.touch_change_ratio),
        golden=Golden(reference, _golden_frame(skin, linear), empty),
        meta=_meta(skin, protocol, linear, settings, rank),
        fields=(
            stored_fields(skin, protocol, linear) if settings.data_kind == "difference" else None
        ),
        row_form=row_form(projection, stored),
        surface=skin.surface,
    )
    return replace(model, golden=replace(model.golden, image=_golden_image(model)))


def _refuse_settings(settings: BuildSettings, grid: Grid) -> None:
    """Reject settings that no .eitm file can hold, before any work is done."""
    if settings.storage not in STORAGES or settings.data_kind not in DATA_KINDS:
        raise UsageError(
            f"model: storage must be one of {', '.join(STORAGES)}; data one of"
            f" {', '.join(DATA_KINDS)}"
        )
    if not 0 <= settings.rank <= MAX_RANK:
        raise UsageError(
            f"model: rank = {settings.rank} is out of range; use 1 to {MAX_RANK}, or 0 for the"
            " default"
        )
    if grid.n_pixels > MAX_PIXELS:
        raise UsageError(
            f"model: {grid.n_pixels} pixels are more than a model's {MAX_PIXELS}; use fewer pixels"
            " across"
        )


def scaled_defaults(
    skin: Skin, data_kind: str, touch_change_ratio: float = TOUCH_CHANGE_RATIO
) -> Defaults:
    """Return the defaults for ``skin``: lengths in proportion to its size, and the expected change
    in proportion to its conductivity.

    On a surface, a true radius is smaller on the flattened copy where the scale is greater, so the
    range of radii is wider there. The expected change stays: a conformal copy has the same."""
    paper = Defaults()
    scale = size_to_paper(skin.outline)
    least, most = (1.0, 1.0) if skin.surface is None else skin.surface.scale_range
    return replace(
        paper,
        touch_min_radius_mm=_round(paper.touch_min_radius_mm * scale / max(most, 1.0)),
        touch_max_radius_mm=_round(paper.touch_max_radius_mm * scale / min(least, 1.0)),
        touch_seed_radius_mm=_round(paper.touch_seed_radius_mm * scale),
        touch_change_s_per_m=_round(touch_change_ratio * skin.conductivity_s_per_m),
        follow_mm=_round(paper.follow_mm * scale),
        touch_radius_weight=(
            LOG_RADIUS_WEIGHT if data_kind == "log-ratio" else paper.touch_radius_weight
        ),
    )


def _round(value: float) -> float:
    return float(f"{value:.4g}")


def build_model(
    skin: Skin,
    protocol: Protocol,
    settings: BuildSettings | None = None,
    *,
    progress: Progress = silent,
    jacobian: FloatArray | None = None,
) -> Model:
    """Build the model of ``skin`` with all steps, including the model errors that its uncertainty
    asks for.

    ``progress`` and errors are as for ``linearise``, ``make_model`` and ``with_model_errors``.
    ``jacobian`` (m, n) in V per S/m on the settings' grid, if given, replaces the calculated one.
    """
    chosen = settings or BuildSettings()
    asked = skin.uncertainty
    if chosen.samples == 0:
        asked = None
    elif chosen.samples is not None:
        asked = replace(asked or DEFAULT_UNCERTAINTY, samples=chosen.samples)
    _refuse_settings(chosen, grid_for(skin.outline, chosen.pixels_across))
    linear = linearise(skin, protocol, pixels_across=chosen.pixels_across, elements=chosen.elements)
    if jacobian is not None:
        linear = replace(linear, jacobian=jacobian)
    model = make_model(skin, protocol, linear, chosen)
    if asked is None:
        return model
    return with_model_errors(model, skin, asked, chosen.elements, progress=progress)


def with_model_errors(
    model: Model,
    skin: Skin,
    uncertainty: Uncertainty,
    elements: int = 3000,
    *,
    progress: Progress = silent,
) -> Model:
    """Return ``model`` of ``skin`` with the model errors that follow from ``uncertainty``. They are
    drawn on a mesh of twice ``elements``, at most 6000.

    ``progress`` wraps the samples as they are done, and is given their number.
    """
    from eitskin.fem.mesh import mesh_for_elements
    from eitskin.model.monte_carlo import draw_model_errors
    from eitskin.model.random_skins import Request

    request = Request(
        skin=skin,
        protocol=model.protocol,
        mesh=mesh_for_elements(skin, min(2 * elements, ERROR_ELEMENTS)),
        fold=model.fold,
        data_kind=model.data_kind,
        projection=model.projection.astype(np.float64),
        grid=model.grid,
        uncertainty=uncertainty,
        fits_jointly=model.fields is not None,
    )
    return replace(model, model_errors=draw_model_errors(request, progress=progress))


def stored_fields(skin: Skin, protocol: Protocol, linear: Linearisation) -> Fields | None:
    """Return the fields of ``linear`` in the form that a model stores, scaled so that the greatest
    is 1024; None if there are none."""
    if linear.electrode_fields is None:
        return None
    fields = linear.electrode_fields.reshape(linear.grid.n_pixels, -1)
    unit = float(np.abs(fields).max()) / FIELD_PEAK
    a, b = rim_mirror(skin.outline, linear.grid.centres_mm())
    columns = np.column_stack([fields / unit, a.real, a.imag, b.real, b.imag])
    volts = protocol.current_a * skin.thickness_mm * 1e-3 * 1e-6 * unit**2
    per_sheet = 1 / (2 * np.pi * skin.conductivity_s_per_m)
    return Fields(
        columns.astype(np.float16), float(np.float32(volts)), float(np.float32(per_sheet))
    )


def _golden_frame(skin: Skin, linear: Linearisation) -> npt.NDArray[np.float32]:
    """Return the frame of two discs as the linear model predicts it. It can be reproduced from the
    model's own Jacobian, without random numbers."""
    centres = linear.grid.centres_mm()
    middle, size = centres.mean(axis=0), np.ptp(centres, axis=0).min()
    change = np.zeros(len(centres))
    for offset, radius, contrast in (((0.22, 0.13), 0.06, 3.0), ((-0.25, -0.09), 0.05, 2.0)):
        inside = np.linalg.norm(centres - middle - size * np.array(offset), axis=1) <= max(
            radius * size, linear.grid.pixel_mm
        )
        change[inside] = contrast * skin.conductivity_s_per_m
    return np.asarray(linear.v0_v + linear.jacobian @ change, dtype=np.float32)


def _golden_image(model: Model) -> npt.NDArray[np.float32]:
    core = CoreEngine(encode_model(model), "float32")
    core.set_reference(model.golden.reference_v[None].astype(np.float64))
    return np.asarray(
        core.reconstruct(model.golden.frame_v, touches=False).solver_image, dtype=np.float32
    )


def _meta(
    skin: Skin, protocol: Protocol, linear: Linearisation, settings: BuildSettings, rank: int
) -> dict[str, Any]:
    settings_table = {**asdict(settings), "rank": rank}
    for name in ("defaults", "samples"):
        settings_table.pop(name)
    return {
        "made_by": f"eitskin {__version__}",
        "skin": skin_to_table(skin),
        "protocol": protocol_to_table(protocol),
        "build": settings_table,
        "mesh_elements": linear.elements,
    }
