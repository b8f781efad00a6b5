"""Draw random skins and touches from an [uncertainty], and calculate the relative errors of a
model's data for them, reduced by P.

    e_all = (g o d_true - d_nominal) / |d_nominal|

d_true is the change that discs cause in the random skin, with the row gains g of its tare;
d_nominal is the change that the same discs cause in the skin as described. e_shape compares shaped
touches with discs, both in the skin as described. The part that amplitudes, places and radii of the
discs can explain is removed from both.
"""

from dataclasses import dataclass

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.core.constants_table import MAX_RATIO, MAX_ROW_GAIN, RATIO_DEFINED
from eitskin.fem.cem import ForwardModel
from eitskin.fem.deform import MeshDeformation, Rim
from eitskin.fem.grid import Grid
from eitskin.fem.mesh import Mesh
from eitskin.fem.sensitivity import element_fields
from eitskin.fem.shaped_touch import ShapedTouch, TouchCover
from eitskin.model.model_errors import MIN_DISTANCE, Float32s, as_covariance
from eitskin.model.reduction import fold_rows
from eitskin.skin.protocol import Protocol, Reciprocity
from eitskin.skin.skin import Skin
from eitskin.skin.uncertainty import Range, Uncertainty

COSINES = 64
HARMONICS = (2, 3, 4)
MAX_TOUCHES = 3
MARGIN, GAP = 0.04, 0.12  # in R: least distance of a disc from the rim, and between two discs
TRIES = 200
STEP = 0.1  # of finite differences, as a part of the disc's radius
FIELD_LENGTHS = 8
NUMBERS_AT_ONCE = 2**21
ROW_ERRORS = 24  # strongest vectors of the errors in row space; the others are below the noise
CELL = 0.15  # side of a cell, as a part of the least correlation length of a field


@dataclass(frozen=True, eq=False)
class Request:
    """Everything that a process needs: the ``skin`` under ``protocol`` on ``mesh``, the kind of the
    model's data, their ``fold`` and ``projection`` P (r, k), and the model's ``grid``."""

    skin: Skin
    protocol: Protocol
    mesh: Mesh
    fold: Reciprocity
    data_kind: str
    projection: FloatArray
    grid: Grid
    uncertainty: Uncertainty
    fits_jointly: bool = False  # whether the joint fit of touches works with the model


def sensitivity_of(
    request: Request,
    forward: ForwardModel,
    pairs: FloatArray,
    v0: FloatArray,
    elements: IntArray,
) -> FloatArray:
    """Return the change of the folded data with the conductivity of ``elements`` (e,), (k, e).
    ``pairs`` are the fields of ``forward``, ``v0`` (k,) its voltages."""
    patterns, fold = forward.patterns, request.fold
    drive, measure = patterns.drive[fold.first], patterns.measure[fold.first]
    sign = patterns.drive_sign[fold.first] * patterns.measure_sign[fold.first]
    fields = pairs[elements]
    products = (fields[:, :, drive] * fields[:, :, measure]).sum(axis=1)
    scale = -request.protocol.current_a * forward.thickness_m * sign
    columns = products.T * scale[:, None] * (forward.mesh.true_areas_mm2[elements] * 1e-6)
    if request.data_kind == "normalised":
        weak = np.abs(v0) < RATIO_DEFINED * np.sqrt(np.mean(v0**2))
        columns = np.where(weak, 0.0, 1 / np.where(weak, 1.0, v0))[:, None] * columns
    return np.asarray(columns)


class RandomSkins:
    """Draws samples; what all samples share is computed once."""

    def __init__(self, request: Request) -> None:
        self.request = request
        skin, mesh = request.skin, request.mesh
        self.forward = ForwardModel(mesh, skin, request.protocol)
        self.deformation = MeshDeformation(mesh)
        self.cover = TouchCover(mesh)
        self.radius_mm = float(np.sqrt(skin.outline.area_mm2 / np.pi))
        self.conductivity = np.full(mesh.n_elements, skin.conductivity_s_per_m)
        solution = self.forward.solve(self.conductivity)
        patterns = self.forward.patterns
        self._pairs = element_fields(self.forward, solution) @ patterns.mix.T
        self.v_ref = self._fold(self.forward.voltages_of(solution))

    def sample(self, number: int) -> FloatArray:
        """Return sample ``number``: P e_all (r) and P e_shape (r); e_all (k) and e_shape (k) with
        the part that discs explain; the rms of y = log(v0 / v_ref), which tells how far the skin is
        from the model; |e_all| and |e_shape|. It does not depend on which other samples are
        drawn."""
        request, asked = self.request, self.request.uncertainty
        draw = np.random.default_rng(np.random.SeedSequence(asked.seed, spawn_key=(number,)))
        mesh, conductivity, impedance = self._random_skin(draw)
        touches = self._random_touches(draw)
        discs = tuple(touch.disc() for touch in touches)
        forward = ForwardModel(mesh, request.skin, request.protocol, impedance)
        v0 = self._fold(forward.voltages(conductivity))
        covered = TouchCover(mesh).factors(discs)
        true = self._datum(self._fold(forward.voltages(conductivity * covered)), v0)
        nominal, shaped = (self._nominal(given) for given in (discs, touches))
        size = np.linalg.norm(nominal)
        errors = np.column_stack([true - nominal, shaped - nominal]) / size
        whole = errors.T.ravel()
        explained = np.linalg.qr(np.column_stack([self._columns(disc) for disc in discs]))[0]
        for _ in range(2):
            errors -= explained @ (explained.T @ errors)
        reduced = request.projection @ errors
        distance = np.sqrt(np.mean(np.log(self.row_ratio(v0)) ** 2))
        return np.concatenate(
            [reduced.T.ravel(), whole, [distance], np.linalg.norm(errors, axis=0)]
        )

    def error(self, rows: FloatArray) -> Float32s:
        """Return P E P' (r, r) from samples (s, 2 r + 2 k + 3): the second moment of e_all, plus
        that of e_shape times its weight."""
        rank = len(self.request.projection)
        all_, shape = (
            np.einsum("si,sj->ij", part, part) / len(rows)
            for part in (rows[:, :rank], rows[:, rank : 2 * rank])
        )
        return as_covariance(all_ + self.request.uncertainty.touch_shapes * shape)

    def row_errors(self, rows: FloatArray) -> tuple[FloatArray, float]:
        """Return E = sum of e e' by its strongest vectors e (n, k), and the rms of y, from samples:
        the second moments of e_all and, by its weight, of e_shape, with the part that discs
        explain."""
        begin = 2 * len(self.request.projection)
        folds = self.request.projection.shape[1]
        all_, shape = (
            np.einsum("si,sj->ij", part, part) / len(rows)
            for part in (
                rows[:, begin : begin + folds],
                rows[:, begin + folds : begin + 2 * folds],
            )
        )
        values, vectors = np.linalg.eigh(all_ + self.request.uncertainty.touch_shapes * shape)
        # a skin that is as described has none, and no distance; a file has to state some
        count = min(ROW_ERRORS, max(1, int(np.count_nonzero(values > 0))))
        kept = np.asarray(np.argsort(-values)[:count])
        strongest = (vectors[:, kept] * np.sqrt(np.maximum(values[kept], 0.0))).T
        return strongest, max(float(np.sqrt(np.mean(rows[:, -3] ** 2))), MIN_DISTANCE)

    def drift(self) -> Float32s:
        """Return P D P' (r, r), where D is the covariance, to first order, of the data that a
        smooth change of the skin's conductivity causes."""
        asked, mesh, r = self.request.uncertainty, self.request.mesh, len(self.request.projection)
        blocks = -(-mesh.n_elements * self.request.projection.shape[1] // NUMBERS_AT_ONCE)
        reduced = np.concatenate(
            [
                self.request.projection @ self._sensitivity(block)
                for block in np.array_split(np.arange(mesh.n_elements), blocks)
            ],
            axis=1,
        ) * (asked.drift_log_sd * self.request.skin.conductivity_s_per_m)
        reduced, places = self._gathered(reduced)
        square = ((places[:, None] - places) ** 2).sum(axis=2)
        low, high = asked.background_length
        lengths = low + (high - low) * (np.arange(FIELD_LENGTHS) + 0.5) / FIELD_LENGTHS
        covariance = np.zeros((r, r))
        for length in lengths:
            covariance += reduced @ np.exp(square / (-2 * length**2)) @ reduced.T / FIELD_LENGTHS
        return as_covariance(covariance)

    def _gathered(self, columns: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Sum ``columns`` (r, E) of elements over square cells that are much smaller than the
        length of any field; return the sums (r, c) and the middles of the cells in R, (c, 2)."""
        side = CELL * self.request.uncertainty.background_length[0]
        cells = np.floor(self.request.mesh.centroids_mm() / (side * self.radius_mm))
        kept, number = np.unique(cells, axis=0, return_inverse=True)
        number = number.ravel()
        order = np.argsort(number, kind="stable")
        begins = np.searchsorted(number[order], np.arange(len(kept)))
        return np.add.reduceat(columns[:, order], begins, axis=1), (kept + 0.5) * side

    def _nominal(self, touches: tuple[ShapedTouch, ...]) -> FloatArray:
        factors = self.cover.factors(touches)
        voltages = self.forward.voltages(self.conductivity * factors)
        return self._datum(self._fold(voltages), self.v_ref)

    def _fold(self, voltages: FloatArray) -> FloatArray:
        return fold_rows(voltages, self.request.fold)

    def _datum(self, v: FloatArray, v0: FloatArray) -> FloatArray:
        """Return the folded data that the core calculates from ``v`` with the reference ``v0``
        (k,)."""
        kind, v_ref = self.request.data_kind, self.v_ref
        weak = np.abs(v0) < RATIO_DEFINED * np.sqrt(np.mean(v0**2))
        safe = np.where(weak, 1.0, v0)
        if kind == "normalised":
            return np.where(weak, 0.0, (v - v0) / safe)
        gain = np.linalg.norm(v_ref) / np.linalg.norm(v0)
        if self.request.uncertainty.row_gains:
            row_gains = np.clip(v_ref / (gain * safe), 1 / MAX_ROW_GAIN, MAX_ROW_GAIN)
            gain = gain * np.where((v_ref * v0 > 0) & ~weak, row_gains, 1.0)
        if kind == "log-ratio":
            return np.where(
                weak, 0.0, gain * v0 * np.log(np.clip(v / safe, 1 / MAX_RATIO, MAX_RATIO))
            )
        return np.asarray(gain * (v - v0))

    def row_ratio(self, v0: FloatArray) -> FloatArray:
        """Return gain v0 / v_ref (k,) within the bounds of row gains, 1 if a row has next to no
        reference or another sign. Its logarithm is y."""
        v_ref = self.v_ref
        gain = float(np.linalg.norm(v_ref) / np.linalg.norm(v0))
        defined = (np.abs(v_ref) >= RATIO_DEFINED * np.sqrt(np.mean(v_ref**2))) & (v_ref * v0 > 0)
        ratio = np.where(defined, gain * v0 / np.where(defined, v_ref, 1.0), 1.0)
        return np.clip(ratio, 1 / MAX_ROW_GAIN, MAX_ROW_GAIN)

    def _sensitivity(self, elements: IntArray) -> FloatArray:
        return sensitivity_of(self.request, self.forward, self._pairs, self.v_ref, elements)

    def _columns(self, disc: ShapedTouch) -> FloatArray:
        """Return the changes of the data for small changes of the disc's amplitude, x, y and
        radius, (k, 4), each of norm 1."""
        r, x, y = disc.radius_mm, disc.x_mm, disc.y_mm
        h = STEP * r
        elements = self.cover.near(x, y, r + h)

        def change(x: float, y: float, r: float) -> FloatArray:
            touch = ShapedTouch(x, y, r, 2.0)
            return self.cover.mean_change(touch, elements)

        weights = np.column_stack(
            [
                change(x, y, r),
                change(x + h, y, r) - change(x - h, y, r),
                change(x, y + h, r) - change(x, y - h, r),
                change(x, y, r + h) - change(x, y, r - h),
            ]
        )
        columns = self._sensitivity(elements) @ weights
        return np.asarray(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300))

    def _random_skin(self, draw: np.random.Generator) -> tuple[Mesh, FloatArray, FloatArray]:
        asked, count = self.request.uncertainty, self.request.skin.electrodes.count
        shift = asked.electrode_position_sd * self.radius_mm * draw.standard_normal(count)
        widths = np.exp(asked.electrode_width_log_sd * draw.standard_normal(count))
        contacts = np.exp(asked.contact_log_sd * draw.standard_normal(count))
        waves = rim_waves(self.deformation.rim) / np.sqrt(2 * len(HARMONICS))
        outwards = asked.out_of_round * self.radius_mm * (draw.standard_normal(len(waves)) @ waves)
        mesh = self.deformation.moved(shift, widths, outwards)
        field = self._random_field(draw, _uniform(draw, asked.background_length))
        conductivity = self.conductivity * np.exp(asked.background_log_sd * field)
        impedance = self.request.skin.electrodes.contact_impedance_ohm_m2 * contacts
        return mesh, conductivity, impedance

    def _random_field(self, draw: np.random.Generator, length: float) -> FloatArray:
        """Return the mean over each element of a Gaussian field of variance 1 and covariance
        exp(-d^2 / (2 length^2)), lengths in R. The field is a sum of cosines (random Fourier
        features), evaluated at the nodes."""
        waves = draw.standard_normal((COSINES, 2)) / (length * self.radius_mm)
        phases = draw.uniform(0, 2 * np.pi, COSINES)
        mesh = self.request.mesh
        at_nodes = np.cos(mesh.nodes_mm @ waves.T + phases).sum(axis=1) * np.sqrt(2 / COSINES)
        return np.asarray(at_nodes[mesh.triangles].mean(axis=1))

    def _scales(self, places_mm: FloatArray) -> FloatArray:
        """Return the true mm per mm of the plane at ``places_mm`` (k, 2), (k,)."""
        surface = self.request.skin.surface
        return np.ones(len(places_mm)) if surface is None else surface.at(places_mm).scale

    def _random_touches(self, draw: np.random.Generator) -> tuple[ShapedTouch, ...]:
        """Draw one to three touches, fewer if there is no space for them."""
        asked, outline = self.request.uncertainty, self.request.skin.outline
        rim = self.request.mesh.nodes_mm[self.deformation.rim.nodes]
        x0, y0, x1, y1 = outline.bounding_box_mm
        touches: list[ShapedTouch] = []
        for _ in range(int(draw.integers(1, MAX_TOUCHES, endpoint=True))):
            radius = _uniform(draw, asked.touch_radius) * self.radius_mm
            contrast = _uniform(draw, asked.touch_contrast)
            aspect, angle = draw.uniform(1, asked.touch_aspect_max), draw.uniform(0, np.pi)
            profile = ("uniform", "uniform", "hertz", "gaussian")[int(draw.integers(4))]
            places = np.column_stack([draw.uniform(x0, x1, TRIES), draw.uniform(y0, y1, TRIES)])
            radii = radius / self._scales(places)
            inside = outline.contains(places)
            depth = np.where(
                inside, np.linalg.norm(places[:, None] - rim, axis=2).min(axis=1), -np.inf
            )
            fits = depth >= radii + MARGIN * self.radius_mm
            for other in touches:
                away = np.hypot(places[:, 0] - other.x_mm, places[:, 1] - other.y_mm)
                fits &= away >= radii + other.radius_mm + GAP * self.radius_mm
            if not (fits.any() or not touches):
                continue
            chosen = int(np.argmax(fits) if fits.any() else np.argmax(depth))
            x, y = places[chosen].tolist()
            own = float(radii[chosen])
            touches.append(ShapedTouch(x, y, own, contrast, float(aspect), float(angle), profile))
        return tuple(touches)


def rim_waves(rim: Rim) -> FloatArray:
    """Return the harmonics of the outline at the rim's nodes, (2 h, B)."""
    turns = 2 * np.pi * np.outer(HARMONICS, rim.arc_mm / rim.length_mm)
    return np.vstack([np.cos(turns), np.sin(turns)])


def _uniform(draw: np.random.Generator, ends: Range) -> float:
    return float(draw.uniform(*ends))
