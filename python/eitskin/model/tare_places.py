"""What the tare tells of places: sections GEOM and MOVE of a .eitm file.

Where electrodes lie elsewhere and the outline is another, the untouched skin's voltages differ from
the model's in one way, where the sheet is uneven in another; and both move touches. With causes c
of variances V (``[uncertainty]``: each electrode's shift along the rim, the outline's harmonics,
the sheet's smooth fields), linearised,

    y = log(gain v0 / v_ref) = L c + rest,    c^ = V L' (L V L' + ROUGH^2)^-1 y,

and a touch at p is found off by b(p) c, for data with the row gains of that tare, which b(p) c^
takes back, b a polynomial of DEGREE in p. What that leaves is in proportion to how far the causes
are from 0 on this skin. c^ is smaller than c, by r = V^-1 cov(c^) in the mean square, so that

    sum over causes of left c^^2 / (n r V) = |N y|^2

is what the variance of a place grows by: n causes of a kind leave ``left`` when they are as great
as V says. Of electrodes, which may all turn at once, that is what the regression leaves; the
outline's harmonics are taken back whole, and the sheet's fields not at all. N and M, of which c^ is
made, have the ROWS directions of y that tell most; those that tell least, which no such skin has,
show gains of single rows.
"""

from dataclasses import dataclass

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.constants_table import MAX_ROW_GAIN, RATIO_DEFINED
from eitskin.errors import missing_extra
from eitskin.fem.cem import ForwardModel
from eitskin.fem.mesh import Mesh
from eitskin.fem.sensitivity import element_fields
from eitskin.fem.shaped_touch import ShapedTouch, TouchCover
from eitskin.model.model_errors import TarePlaces
from eitskin.model.random_skins import (
    FIELD_LENGTHS,
    HARMONICS,
    RandomSkins,
    rim_waves,
    sensitivity_of,
)
from eitskin.model.reduction import fold_rows

try:
    from scipy.sparse import csc_matrix
except ModuleNotFoundError as error:
    raise missing_extra("model", "scipy") from error


ROWS = 16  # more tells nothing more, 8 too little: on the tuning family of the worlds, seed 21
DEGREE = 4  # of 3, 4 and 5 the least that takes back what can be, on the tuning family, seed 21
FIELDS = 80  # smooth fields of the sheet: what 20 leave looks like shifted electrodes
MOVING = 12  # of them move touches; the others by less
OUTSIDE = 0.1  # of ROUGH: what directions have of skins that are to tell rows' own gains
ROUGH = 0.01  # rms of what the linearisation leaves of y
SPACING = 0.2  # R: of the places that are looked at
STEP = 0.01  # R: a shift or wave, for its derivatives
FIELD_PLACES = 500  # that tell fields apart
FIELD_STEP = 0.1  # of a field's log conductivity
EDGE_STEP = 0.1  # of the touch's radius, for the slopes of its answer
LEAST_SHARE = 0.05  # r is taken as at least this


def tare_places(skins: RandomSkins) -> TarePlaces:
    """What the tare tells of places on ``skins``."""
    causes = _Causes(skins)
    variance, logs, moves = causes.all()
    electrodes = slice(causes.electrodes)
    covariance = (logs.T * variance) @ logs + ROUGH**2 * np.eye(logs.shape[1])
    found = (variance[:, None] * logs) @ np.linalg.inv(covariance)
    share = np.maximum(np.einsum("ck,ck->c", found, logs), LEAST_SHARE)
    fields = slice(causes.electrodes + causes.waves, None)
    unseen = np.diag(variance[electrodes]) - found[electrodes] @ (logs.T * variance)[:, electrodes]
    size = np.einsum("cpi,dpi->cd", moves, moves) / (2 * moves.shape[1])
    left = np.zeros(len(variance))
    left[electrodes] = np.sum(unseen * size[electrodes, electrodes]) / causes.electrodes
    left[fields] = variance[fields] @ np.diag(size)[fields] / len(left[fields])
    drawn = variance > 0  # what the uncertainty leaves out is not looked for
    rows = np.sqrt(left / np.where(drawn, share * variance, 1.0))[:, None] * found
    # the directions by what they tell of skins as drawn: of rows covariance^1/2
    values, vectors = np.linalg.eigh(covariance)
    root = (vectors * np.sqrt(values)) @ vectors.T
    inverse = (vectors / np.sqrt(values)) @ vectors.T
    told, of_left = _strongest(rows @ root)
    terms = causes.terms()
    polynomials = np.linalg.lstsq(terms, moves.transpose(1, 2, 0).reshape(len(terms), -1), None)[0]
    shift = polynomials.reshape(terms.shape[1], 2, -1).transpose(1, 0, 2) @ found @ root
    _, of_moves = _strongest((terms @ shift).reshape(-1, len(root)))
    return TarePlaces(
        np.asarray(told[:, None] * of_left @ inverse, dtype=np.float32),
        np.asarray(of_moves @ inverse, dtype=np.float32),
        np.asarray(shift @ of_moves.T, dtype=np.float32),
        np.asarray(_outside((logs.T * variance) @ logs), dtype=np.float32),
    )


def _outside(covariance: FloatArray) -> FloatArray:
    """The ROWS directions (r, k) that ``covariance`` (k, k) has least of: hardly any."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors[:, :ROWS][:, values[:ROWS] < (OUTSIDE * ROUGH) ** 2].T)


def _strongest(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The ROWS greatest singular values of ``matrix`` (n, k), and its directions (ROWS, k), the
    greatest number of each above 0."""
    _, values, directions = np.linalg.svd(matrix, full_matrices=False)
    most = directions[:ROWS]
    greatest = np.take_along_axis(most, np.abs(most).argmax(axis=1)[:, None], axis=1)
    return values[:ROWS], most * np.where(greatest < 0, -1.0, 1.0)


@dataclass(eq=False)
class _Causes:
    """What each cause changes: y, and where touches are found."""

    skins: RandomSkins
    waves: int = 2 * len(HARMONICS)

    def __post_init__(self) -> None:
        skins = self.skins
        self.electrodes = skins.request.skin.electrodes.count
        asked, outline = skins.request.uncertainty, skins.request.skin.outline
        self.radius_mm = float(np.mean(asked.touch_radius)) * skins.radius_mm
        x0, y0, x1, y1 = outline.bounding_box_mm
        step = SPACING * skins.radius_mm
        x, y = np.meshgrid(np.arange(x0 + step / 2, x1, step), np.arange(y0 + step / 2, y1, step))
        places = np.column_stack([x.ravel(), y.ravel()])
        places = places[outline.contains(places)]
        if not len(places):  # the skin is thinner than the step
            places = skins.request.mesh.centroids_mm()
        rim = skins.request.mesh.nodes_mm[skins.deformation.rim.nodes]
        depth = np.linalg.norm(places[:, None] - rim, axis=2).min(axis=1)
        self.places = places[(depth >= self.radius_mm) | (depth == depth.max())]
        mesh, h = skins.request.mesh, EDGE_STEP * self.radius_mm
        self._weights = self._covered(mesh, (0.0, 0.0))
        ways = ((h, 0.0), (-h, 0.0), (0.0, h), (0.0, -h))
        right, left, up, down = (self._covered(mesh, way) for way in ways)
        slopes = ((right - left) / (2 * h), (up - down) / (2 * h))
        _, columns = self._columns(skins.forward, skins.conductivity)
        self._columns_here = columns
        reduced = [
            skins.request.projection @ columns @ weights for weights in (self._weights, *slopes)
        ]
        # (p, 2, r): what of a place's answer says that it is elsewhere
        self._tells = np.array([np.linalg.pinv(np.column_stack(d))[1:] for d in zip(
            *(part.T for part in reduced), strict=True)])  # fmt: skip
        self._found = self._moved(columns, self._weights)

    def all(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Of c causes: variances (c,), what each adds to y (c, k), and to the places found (c, p,
        2), mm."""
        skins = self.skins
        asked, radius = skins.request.uncertainty, skins.radius_mm
        count, rim = self.electrodes, skins.deformation.rim
        waves, h = rim_waves(rim), STEP * radius
        still, round_ = np.zeros(count), np.zeros(len(rim.nodes))
        made = [self._of_mesh(h * shift, round_, h) for shift in np.eye(count)]
        made += [self._of_mesh(still, h * wave, h) for wave in waves]
        fields = self._fields()
        for field in fields[:MOVING]:
            uneven = skins.conductivity * np.exp(FIELD_STEP * field)
            moves = (self._at(skins.forward, uneven)[1] - self._found) / FIELD_STEP
            made.append((self._log_slope(field), moves))
        made += [(self._log_slope(field), np.zeros_like(self._found)) for field in fields[MOVING:]]
        variances = np.repeat(
            [
                (asked.electrode_position_sd * radius) ** 2,
                (asked.out_of_round * radius) ** 2 / (2 * len(HARMONICS)),
                asked.background_log_sd**2,
            ],
            [count, len(waves), len(made) - count - len(waves)],
        )
        logs, moves = (np.array(part) for part in zip(*made, strict=True))
        return variances, logs, moves

    def terms(self) -> FloatArray:
        """1, x, y, x^2, x y, y^2 ... at ``places``, from the grid's middle over half its longer
        side, (p, t)."""
        grid = self.skins.request.grid
        half = np.array([grid.nx, grid.ny]) * grid.pixel_mm / 2
        x, y = (self.places - grid.origin_mm - half).T / half.max()
        return np.column_stack(
            [x ** (n - j) * y**j for n in range(DEGREE + 1) for j in range(n + 1)]
        )

    def _of_mesh(
        self, shift_mm: FloatArray, outwards_mm: FloatArray, h: float
    ) -> tuple[FloatArray, FloatArray]:
        # both ways: y bends alike for every electrode, which looks like no shift but like a field
        skins, widths = self.skins, np.ones(len(shift_mm))
        ends = []
        for way in (1, -1):
            mesh = skins.deformation.moved(way * shift_mm, widths, way * outwards_mm)
            forward = ForwardModel(mesh, skins.request.skin, skins.request.protocol)
            ends.append(self._at(forward, skins.conductivity))
        (logs, found), (logs_back, found_back) = ends
        return (logs - logs_back) / (2 * h), (found - found_back) / (2 * h)

    def _log_slope(self, field: FloatArray) -> FloatArray:
        """dy / da (k,) of a sheet whose log conductivity is ``field`` (E,) times a."""
        v_ref, normalised = self.skins.v_ref, self.skins.request.data_kind == "normalised"
        weak = np.abs(v_ref) < RATIO_DEFINED * np.sqrt(np.mean(v_ref**2))
        unit = 1.0 if normalised else np.where(weak, 1.0, v_ref)
        relative = np.where(weak, 0.0, self._columns_here @ field / unit)
        return np.asarray(np.where(weak, 0.0, relative - v_ref**2 @ relative / (v_ref @ v_ref)))

    def _at(self, forward: ForwardModel, conductivity: FloatArray) -> tuple[FloatArray, FloatArray]:
        """y (k,) of a skin, and how far from ``places`` touches are found in it (p, 2), mm."""
        skins = self.skins
        same = forward.mesh is skins.request.mesh
        weights = self._weights if same else self._covered(forward.mesh, (0.0, 0.0))
        logs, columns = self._columns(forward, conductivity)
        return logs, self._moved(columns, weights)

    def _moved(self, columns: FloatArray, weights: csc_matrix) -> FloatArray:
        """Where touches are found (p, 2), mm from ``places``, up to a part that all skins share."""
        answers = self.skins.request.projection @ (columns @ weights)
        return np.asarray(np.einsum("pir,rp->pi", self._tells, answers))

    def _columns(
        self, forward: ForwardModel, conductivity: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """y (k,), and the change of the datum, with the tare's gains, with each element's log
        conductivity (k, E)."""
        skins = self.skins
        request, v_ref = skins.request, skins.v_ref
        solution = forward.solve(conductivity)
        v0 = fold_rows(forward.voltages_of(solution), request.fold)
        gain = float(np.linalg.norm(v_ref) / np.linalg.norm(v0))
        weak = (np.abs(v_ref) < RATIO_DEFINED * np.sqrt(np.mean(v_ref**2))) | (v_ref * v0 <= 0)
        ratio = np.clip(gain * v0 / np.where(weak, 1.0, v_ref), 1 / MAX_ROW_GAIN, MAX_ROW_GAIN)
        ratio = np.where(weak, 1.0, ratio)
        pairs = element_fields(forward, solution) @ forward.patterns.mix.T
        elements = np.arange(forward.mesh.n_elements)
        columns = sensitivity_of(request, forward, pairs, v0, elements) * conductivity
        if request.data_kind != "normalised":
            columns *= gain / (ratio if request.uncertainty.row_gains else np.ones(1))[:, None]
        return np.log(ratio), columns

    def _covered(self, mesh: Mesh, by_mm: tuple[float, float]) -> csc_matrix:
        """The mean relative change over each element (E, p) that touches make at ``places`` moved
        ``by_mm``."""
        cover, elements, weights = TouchCover(mesh), [], []
        for x, y in (self.places + by_mm).tolist():
            elements.append(cover.near(x, y, self.radius_mm))
            touch = ShapedTouch(x, y, self.radius_mm, 2.0)
            weights.append(cover.mean_change(touch, elements[-1]))
        begins = np.cumsum([0, *map(len, elements)])
        shape = (mesh.n_elements, len(self.places))
        return csc_matrix((np.concatenate(weights), np.concatenate(elements), begins), shape=shape)

    def _fields(self) -> FloatArray:
        """The FIELDS strongest parts of the sheet's smooth field of variance 1, uncorrelated, over
        the elements (f, E)."""
        skins = self.skins
        low, high = skins.request.uncertainty.background_length
        lengths = low + (high - low) * (np.arange(FIELD_LENGTHS) + 0.5) / FIELD_LENGTHS

        middles = skins.request.mesh.centroids_mm()
        some = middles[:: -(-len(middles) // FIELD_PLACES)]

        def kernel(at: FloatArray) -> FloatArray:
            apart = at[:, None] - some
            square = (apart**2).sum(axis=2) / skins.radius_mm**2
            return np.asarray(
                np.mean([np.exp(square / (-2 * length**2)) for length in lengths], axis=0)
            )

        values, vectors = np.linalg.eigh(kernel(some))
        most = np.argsort(-values)[:FIELDS]
        most = most[values[most] > 1e-6 * values.max()]
        modes = vectors[:, most] / np.sqrt(values[most])
        return np.asarray((kernel(middles) @ modes).T)
