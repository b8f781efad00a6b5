"""Compute what the tare reveals about errors of places: the sections GEOM and MOVE of a .eitm file.

If electrodes are displaced or the outline is another, the voltages of the untouched skin differ
from the model's in one way; if the conductivity is uneven, in another way. Both displace the
touches that are found. Let c be the causes with variances V (from ``[uncertainty]``: the shift of
each electrode along the rim, the harmonics of the outline, smooth fields of the conductivity).
Linearised,

    y = log(gain v0 / v_ref) = L c + rest,    c^ = V L' (L V L' + ROUGH^2)^-1 y,

and a touch at p is found displaced by b(p) c, for data with the row gains of this tare. The
correction subtracts b(p) c^, where b is a polynomial of DEGREE in p. The error that remains is
proportional to how far the causes of this skin are from 0. c^ is smaller than c, by r = V^-1
cov(c^) in the mean square, so

    sum over causes of left c^^2 / (n r V) = |N y|^2

is added to the variance of a place: n causes of a kind leave ``left`` if they are as great as V
states. For the electrodes, which may all shift together, that is what the regression leaves. The
harmonics of the outline count as fully corrected, and the fields of the conductivity as not
corrected at all. N and M, from which c^ is made, use the ROWS directions of y with the most
information. The directions with the least variance, which no such skin produces, reveal gains of
single rows.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.constants_table import RATIO_DEFINED
from eitskin.errors import missing_extra
from eitskin.fem.cem import ForwardModel
from eitskin.fem.mesh import Mesh
from eitskin.fem.sensitivity import element_fields
from eitskin.fem.shaped_touch import ShapedTouch, TouchCover
from eitskin.model.model_errors import RowErrors, TarePlaces
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


ROWS = 16  # more gives no gain, and 8 is too few; tuning family of the worlds, seed 21
DEGREE = 4  # the least of 3, 4 and 5 that corrects all that can be; tuning family, seed 21
FIELDS = 80  # smooth fields of conductivity; with 20, the rest looks like shifted electrodes
MOVING = 12  # fields that displace touches notably; the displacement by the others is neglected
OUTSIDE = 0.1  # in ROUGH: greatest deviation by skins in a direction that reveals gains of rows
ROUGH = 0.01  # rms error of the linearisation of y
SPACING = 0.2  # in R: distance between the places that are examined
STEP = 0.01  # in R: finite difference of a shift or wave
FIELD_PLACES = 500  # at most this number of elements is used to separate the fields
FIELD_STEP = 0.1  # finite difference of the log conductivity
EDGE_STEP = 0.1  # finite difference of a touch's place, as a part of its radius
SIGNAL_TO_NOISE = 400.0  # |d| over a row's noise at which the metric with errors is taken
ERROR_SHARE = 0.25  # and the share of the errors in it; a factor of 4 either way changes little
LEAST_SHARE = 0.05  # r is taken as at least this


@dataclass(frozen=True, eq=False)
class PlacesByMetric:
    """The knowledge about places that the tare reveals: for touches that are found in reduced data
    (``reduced``), and for touches that are found in folded rows by each of m metrics: ``seen``
    (q, k) and ``moves`` (m, 2, t, q) as in :class:`TarePlaces`."""

    reduced: TarePlaces
    seen: FloatArray
    moves: FloatArray


def tare_places(skins: RandomSkins, metrics: Sequence[FloatArray] = ()) -> PlacesByMetric:
    """Return what the tare reveals about places on ``skins``. Each of ``metrics`` (k, k) is a
    matrix W for which touches are found by the least |W (data - answers)|^2."""
    causes = _Causes(skins, metrics)
    variance, logs, by_metric = causes.all()
    moves = by_metric[:, 0]
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
    drawn = variance > 0  # causes that the uncertainty leaves out are not estimated
    rows = np.sqrt(left / np.where(drawn, share * variance, 1.0))[:, None] * found
    # directions are ranked by their variance over skins as drawn: by rows @ covariance^1/2
    values, vectors = np.linalg.eigh(covariance)
    root = (vectors * np.sqrt(values)) @ vectors.T
    inverse = (vectors / np.sqrt(values)) @ vectors.T
    strength, of_left = _strongest(rows @ root)
    terms = causes.terms()

    def shift_of(moves: FloatArray) -> FloatArray:
        """Return U M of one metric, (2, t, k), times the square root of the covariance of y."""
        values = moves.transpose(1, 2, 0).reshape(len(terms), -1)
        polynomials = np.linalg.lstsq(terms, values, None)[0]
        by_axis = polynomials.reshape(terms.shape[1], 2, -1).transpose(1, 0, 2)
        return np.asarray(by_axis @ found @ root)

    shift = shift_of(moves)
    _, of_moves = _strongest((terms @ shift).reshape(-1, len(root)))
    shifts = np.array([shift_of(by_metric[:, 1 + m]) for m in range(len(metrics))])
    shifts = shifts.reshape(len(metrics), *shift.shape)
    _, of_shifts = _strongest((terms @ shifts).reshape(-1, len(root)))
    return PlacesByMetric(
        TarePlaces(
            np.asarray(strength[:, None] * of_left @ inverse, dtype=np.float32),
            np.asarray(of_moves @ inverse, dtype=np.float32),
            np.asarray(shift @ of_moves.T, dtype=np.float32),
            np.asarray(_outside((logs.T * variance) @ logs), dtype=np.float32),
        ),
        of_shifts @ inverse,
        shifts @ of_shifts.T,
    )


def metrics_of(errors: FloatArray) -> list[FloatArray]:
    """Return the metrics (k, k) for which the joint fit of touches has corrections of places:
    white noise, and white noise with the model's ``errors`` (n, k) of a skin that is far from the
    model."""
    folds = errors.shape[1]
    covariance = np.eye(folds) / SIGNAL_TO_NOISE**2 + ERROR_SHARE * errors.T @ errors
    values, vectors = np.linalg.eigh(covariance)
    return [np.eye(folds), np.asarray((vectors / np.sqrt(values)).T)]


def row_errors(errors: FloatArray, distance: float, places: PlacesByMetric) -> RowErrors:
    """Return what a model stores for the joint fit of touches."""
    vectors, seen, moves = (
        np.asarray(part, dtype=np.float32) for part in (errors, places.seen, places.moves)
    )
    return RowErrors(vectors, float(np.float32(distance)), seen, moves)


def _displacement_of(metric: FloatArray, parts: Sequence[FloatArray]) -> FloatArray:
    """Return for each of p touches the map (2, k) from data to its displacement, (p, 2, k).
    ``parts`` (k, p) are the answer of each touch and its slopes by x and y; the map is of least
    squares in ``metric`` (r, k)."""
    touches = zip(*((metric @ part).T for part in parts), strict=True)
    return np.array([np.linalg.pinv(np.column_stack(touch))[1:] @ metric for touch in touches])


def _outside(covariance: FloatArray) -> FloatArray:
    """Return those of the ROWS directions (r, k) with the least variance in ``covariance`` (k, k)
    that have almost none."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors[:, :ROWS][:, values[:ROWS] < (OUTSIDE * ROUGH) ** 2].T)


def _strongest(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the ROWS greatest singular values of ``matrix`` (n, k) and their directions (ROWS, k),
    with signs such that the greatest number of each direction is above 0."""
    _, values, directions = np.linalg.svd(matrix, full_matrices=False)
    most = directions[:ROWS]
    greatest = np.take_along_axis(most, np.abs(most).argmax(axis=1)[:, None], axis=1)
    return values[:ROWS], most * np.where(greatest < 0, -1.0, 1.0)


@dataclass(eq=False)
class _Causes:
    """The effects of each cause: on y, and on the places where touches are found."""

    skins: RandomSkins
    metrics: Sequence[FloatArray] = ()
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
        # for each metric (p, 2, k): the map from the data of a touch to its displacement
        self._displacement_of = [
            _displacement_of(metric, [columns @ weights for weights in (self._weights, *slopes)])
            for metric in (skins.request.projection, *self.metrics)
        ]
        self._found = self._moved(columns, self._weights)

    def all(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return for c causes their variances (c,), the change of y by each (c, k), and the change
        of the places that are found by each metric, the reduced data's first (c, 1 + m, p, 2), in
        mm."""
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
        """Return 1, x, y, x^2, x y, y^2 ... at ``places``, measured from the middle of the grid
        over half its longer side, (p, t)."""
        grid = self.skins.request.grid
        half = np.array([grid.nx, grid.ny]) * grid.pixel_mm / 2
        x, y = (self.places - grid.origin_mm - half).T / half.max()
        return np.column_stack(
            [x ** (n - j) * y**j for n in range(DEGREE + 1) for j in range(n + 1)]
        )

    def _of_mesh(
        self, shift_mm: FloatArray, outwards_mm: FloatArray, h: float
    ) -> tuple[FloatArray, FloatArray]:
        # steps in both directions: the curvature of y is alike for every electrode and would look
        # like a field of conductivity instead of a shift
        skins, widths = self.skins, np.ones(len(shift_mm))
        ends = []
        for way in (1, -1):
            mesh = skins.deformation.moved(way * shift_mm, widths, way * outwards_mm)
            forward = ForwardModel(mesh, skins.request.skin, skins.request.protocol)
            ends.append(self._at(forward, skins.conductivity))
        (logs, found), (logs_back, found_back) = ends
        return (logs - logs_back) / (2 * h), (found - found_back) / (2 * h)

    def _log_slope(self, field: FloatArray) -> FloatArray:
        """Return dy / da (k,) for a skin whose log conductivity is ``field`` (E,) times a."""
        v_ref, normalised = self.skins.v_ref, self.skins.request.data_kind == "normalised"
        weak = np.abs(v_ref) < RATIO_DEFINED * np.sqrt(np.mean(v_ref**2))
        unit = 1.0 if normalised else np.where(weak, 1.0, v_ref)
        relative = np.where(weak, 0.0, self._columns_here @ field / unit)
        return np.asarray(np.where(weak, 0.0, relative - v_ref**2 @ relative / (v_ref @ v_ref)))

    def _at(self, forward: ForwardModel, conductivity: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return y (k,) of a skin, and how far from ``places`` touches are found in it by each
        metric (1 + m, p, 2), mm."""
        skins = self.skins
        same = forward.mesh is skins.request.mesh
        weights = self._weights if same else self._covered(forward.mesh, (0.0, 0.0))
        logs, columns = self._columns(forward, conductivity)
        return logs, self._moved(columns, weights)

    def _moved(self, columns: FloatArray, weights: csc_matrix) -> FloatArray:
        """Return where touches are found by each metric, (1 + m, p, 2) in mm from ``places``, up
        to a part that all skins share."""
        answers = columns @ weights
        return np.array([np.einsum("pik,kp->pi", of, answers) for of in self._displacement_of])

    def _columns(
        self, forward: ForwardModel, conductivity: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return y (k,), and the derivative of the data, with the tare's gains, with respect to
        each element's log conductivity (k, E)."""
        skins = self.skins
        request, v_ref = skins.request, skins.v_ref
        solution = forward.solve(conductivity)
        v0 = fold_rows(forward.voltages_of(solution), request.fold)
        gain = float(np.linalg.norm(v_ref) / np.linalg.norm(v0))
        ratio = skins.row_ratio(v0)
        pairs = element_fields(forward, solution) @ forward.patterns.mix.T
        elements = np.arange(forward.mesh.n_elements)
        columns = sensitivity_of(request, forward, pairs, v0, elements) * conductivity
        if request.data_kind != "normalised":
            columns *= gain / (ratio if request.uncertainty.row_gains else np.ones(1))[:, None]
        return np.log(ratio), columns

    def _covered(self, mesh: Mesh, by_mm: tuple[float, float]) -> csc_matrix:
        """Return the mean relative change in each element (E, p) by touches at ``places`` moved by
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
        """Return the FIELDS strongest components of the skin's smooth field of variance 1,
        uncorrelated, over the elements (f, E)."""
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
