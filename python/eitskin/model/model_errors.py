"""Bounds for the differences between the data of a real skin and the model: the sections UNCE,
GEOM, MOVE and ROWE of a .eitm file."""

import struct
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from eitskin.arrays import FloatArray
from eitskin.core.constants_table import SECOND_MOMENT_ROUNDING
from eitskin.errors import ModelError

Float32s = npt.NDArray[np.float32]

HEAD = struct.Struct("<I3f")
MOVE_HEAD = struct.Struct("<III4x")
ROWE_HEAD = struct.Struct("<IIIf")
MAX_ROWS, MAX_MM = 32, 1e6
MIN_DISTANCE = 1e-6
MOVE_TERMS = (1, 3, 6, 10, 15)  # terms of a polynomial in two coordinates, of degree 0 to 4
ROW_GAINS = 1
HUGE = float(np.float32(1e30))  # as the C core compares


@dataclass(frozen=True, eq=False)
class TarePlaces:
    """The information of a tare about errors of places, from y = log(v0 / v_ref) over the k folded
    rows (``tare_places`` has the theory).

    ``left`` is N (p, k) in mm: |N y|^2 is added to the variance of a place. ``seen`` is M (q, k)
    and ``moves`` is U (2, t, q) in mm: a touch is found displaced along x and y by the polynomial
    with the coefficients U M y. ``rest`` (r, k) are directions of y that no change of electrodes,
    outline and skin conductivity can cause.
    """

    left: Float32s
    seen: Float32s
    moves: Float32s
    rest: Float32s

    def encode(self) -> dict[str, bytes]:
        """Return the sections GEOM and MOVE, with rows ordered by fold."""
        left, seen, moves, rest = (
            np.ascontiguousarray(part).astype("<f4").tobytes()
            for part in (self.left.T, self.seen.T, self.moves, self.rest.T)
        )
        head = MOVE_HEAD.pack(len(self.seen), self.moves.shape[1], len(self.rest))
        return {"GEOM": left, "MOVE": head + seen + moves + rest}


@dataclass(frozen=True, eq=False)
class RowErrors:
    """The model errors on the k folded rows, for the joint fit of touches.

    ``vectors`` e (n, k) give the errors' second moment sum e e', relative to |d|^2, in skins whose
    y = log(v0 / v_ref) has the rms ``distance``. ``seen`` (q, k) and ``moves`` (2, 2, t, q) are as
    in :class:`TarePlaces`, ``moves`` for white noise first, then for the metric with errors.
    """

    vectors: Float32s
    distance: float
    seen: Float32s
    moves: Float32s

    def encode(self) -> bytes:
        """Return the bytes of section ROWE, with rows ordered by fold."""
        head = ROWE_HEAD.pack(len(self.vectors), len(self.seen), self.moves.shape[2], self.distance)
        return head + b"".join(
            np.ascontiguousarray(part).astype("<f4").tobytes()
            for part in (self.vectors.T, self.seen.T, self.moves)
        )


def decode_row_errors(
    content: bytes, folds: int, places: TarePlaces | None, where: str
) -> RowErrors:
    """Return the content of section ROWE for a model with ``folds`` folded rows and ``places``.

    Raises:
        ModelError: the model has no ``places``, a length does not fit the counts, or a number is
            out of range.
    """
    headed = len(content) >= ROWE_HEAD.size
    count, rows, terms, distance = ROWE_HEAD.unpack_from(content) if headed else (0, 0, 0, 0.0)
    if (
        not 1 <= count <= MAX_ROWS
        or not 1 <= rows <= MAX_ROWS
        or places is None
        or terms != places.moves.shape[1]
        or len(content) != ROWE_HEAD.size + 4 * (folds * (count + rows) + 4 * terms * rows)
    ):
        raise ModelError(_other_size(where, "ROWE"))
    numbers = np.frombuffer(content, dtype="<f4", offset=ROWE_HEAD.size)
    if not (np.abs(numbers) <= MAX_MM).all() or not np.float32(MIN_DISTANCE) <= distance <= MAX_MM:
        raise ModelError(
            f"{where}: holds a number in section 'ROWE' that is out of range; build the model again"
        )
    vectors, seen, moves = np.split(numbers, np.cumsum([folds * count, folds * rows]))
    return RowErrors(
        np.ascontiguousarray(vectors.reshape(folds, count).T),
        float(distance),
        np.ascontiguousarray(seen.reshape(folds, rows).T),
        moves.reshape(2, 2, terms, rows),
    )


@dataclass(frozen=True, eq=False)
class ModelErrors:
    """Second moments of the data's errors, reduced by P.

    ``error`` is P E P' (r, r), with E for errors relative to the norm |d| of the data. ``drift`` is
    P D P' (r, r), with D for what the drift of the skin itself adds, in squared units of the data.
    Both are float32, symmetric and positive semidefinite. ``rms_error`` and ``rms_shape_error`` are
    sqrt(mean |e|^2) for random skins and for shaped touches over all rows. ``row_gains`` tells that
    each row is to be scaled to the model by the tare. ``places`` states what the tare reveals about
    places; None means unknown. ``rows`` is what the joint fit of touches needs; None if the model
    has no fields for it."""

    error: Float32s
    drift: Float32s
    rms_error: float
    rms_shape_error: float
    row_gains: bool = True
    places: TarePlaces | None = None
    rows: RowErrors | None = None

    def encode(self) -> bytes:
        """Return the bytes of section UNCE."""
        head = HEAD.pack(
            ROW_GAINS if self.row_gains else 0, self.rms_error, self.rms_shape_error, 0.0
        )
        lower = np.tril_indices(len(self.error))
        return head + b"".join(
            matrix[lower].astype("<f4").tobytes() for matrix in (self.error, self.drift)
        )


def decode_model_errors(
    content: bytes,
    rank: int,
    where: str,
    places: TarePlaces | None = None,
    rows: RowErrors | None = None,
) -> ModelErrors:
    """Return the model errors in section UNCE for a model of ``rank``; ``places`` are those of the
    sections GEOM and MOVE, ``rows`` those of ROWE.

    Raises:
        ModelError: the length does not fit the rank, a number is out of range, or a matrix is not
            positive semidefinite.
    """
    count = rank * (rank + 1) // 2
    if len(content) != HEAD.size + 8 * count:
        raise ModelError(
            f"{where}: holds section 'UNCE' of {len(content)} bytes instead of"
            f" {HEAD.size + 8 * count}; build the model again"
        )
    flags, rms_error, rms_shape_error, _ = HEAD.unpack_from(content)
    packed = np.frombuffer(content, dtype="<f4", offset=HEAD.size).reshape(2, count)
    numbers = np.concatenate([packed.ravel(), [rms_error, rms_shape_error]])
    if not (np.abs(numbers) <= HUGE).all() or min(rms_error, rms_shape_error) < 0:
        raise ModelError(
            f"{where}: holds a number in section 'UNCE' that is out of range; build the model again"
        )
    error, drift = (_whole(lower, rank) for lower in packed)
    for matrix in (error, drift):
        if not is_covariance(matrix):
            raise ModelError(
                f"{where}: holds a matrix in section 'UNCE' that is not a covariance; build the"
                " model again"
            )
    return ModelErrors(
        error,
        drift,
        float(str(np.float32(rms_error))),
        float(str(np.float32(rms_shape_error))),
        bool(flags & ROW_GAINS),
        places,
        rows,
    )


def decode_places(geom: bytes, move: bytes, folds: int, where: str) -> TarePlaces:
    """Return the content of the sections GEOM and MOVE for a model with ``folds`` folded rows.

    Raises:
        ModelError: a length does not fit the counts, or a number is out of range.
    """
    left = check_geom(geom, folds, where)
    headed = len(move) >= MOVE_HEAD.size
    count, terms, rest = MOVE_HEAD.unpack_from(move) if headed else (0, 0, 0)
    if (
        not 1 <= count <= MAX_ROWS
        or terms not in MOVE_TERMS
        or rest > MAX_ROWS
        or len(move) != MOVE_HEAD.size + 4 * (count * (folds + 2 * terms) + rest * folds)
    ):
        raise ModelError(_other_size(where, "MOVE"))
    numbers = np.frombuffer(move, dtype="<f4", offset=MOVE_HEAD.size)
    _check_lengths(numbers, "MOVE", where)
    seen, moves, outside = np.split(numbers, np.cumsum([folds * count, 2 * terms * count]))
    return TarePlaces(
        np.ascontiguousarray(left.T),
        np.ascontiguousarray(seen.reshape(folds, count).T),
        moves.reshape(2, terms, count),
        np.ascontiguousarray(outside.reshape(folds, rest).T),
    )


def check_geom(geom: bytes, folds: int, where: str) -> Float32s:
    """Return the numbers of section GEOM, (folds, p).

    Raises:
        ModelError: the length does not fit, or a number is out of range.
    """
    rows, over = divmod(len(geom), 4 * folds)
    if over or not 1 <= rows <= MAX_ROWS:
        raise ModelError(_other_size(where, "GEOM"))
    left = np.frombuffer(geom, dtype="<f4").reshape(folds, rows)
    _check_lengths(left, "GEOM", where)
    return left


def _check_lengths(values: Float32s, name: str, where: str) -> None:
    if not (np.abs(values) <= MAX_MM).all():
        raise ModelError(
            f"{where}: holds a number in section {name!r} that is out of range; build the model"
            " again"
        )


def _other_size(where: str, name: str) -> str:
    return (
        f"{where}: holds section {name!r} of a size that does not fit its rows; build the model"
        " again"
    )


def is_covariance(matrix: Float32s) -> bool:
    """Return whether ``matrix`` (r, r) is positive semidefinite to rounding, in units in which each
    diagonal element is 1, as the core decides."""
    a = matrix.astype(np.float64)
    own = np.diag(a)
    used = own > 0
    if (own < 0).any() or a[~used].any():
        return False
    scale = np.sqrt(own[used])
    if not len(scale):
        return True
    return bool(
        np.linalg.eigvalsh(a[np.ix_(used, used)] / np.outer(scale, scale))[0]
        >= -SECOND_MOMENT_ROUNDING
    )


def as_covariance(matrix: FloatArray) -> Float32s:
    """Return ``matrix`` (r, r) made symmetric, and positive semidefinite in float32: eigenvalues
    are raised as far as rounding requires."""
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
    least = 1e-6 * max(values[-1], 0.0)
    while True:
        raised = (vectors * np.maximum(values, least)) @ vectors.T
        stored = ((raised + raised.T) / 2).astype(np.float32)
        if least == 0 or np.linalg.eigvalsh(stored.astype(np.float64))[0] >= 0:
            return np.asarray(stored)
        least *= 4


def _whole(lower: Float32s, rank: int) -> Float32s:
    matrix = np.zeros((rank, rank), dtype=np.float32)
    matrix[np.tril_indices(rank)] = lower
    matrix.T[np.tril_indices(rank)] = lower
    return matrix
