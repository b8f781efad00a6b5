"""The origin of each row of a frame in the order of a source: electrodes are renumbered, rows put
in the order of a protocol, and signs set."""

from dataclasses import dataclass, replace

import numpy as np

from eitskin.arrays import AnyArray, BoolArray, FloatArray, IntArray
from eitskin.errors import FrameError, UsageError
from eitskin.frames.import_options import ImportOptions
from eitskin.frames.orders import (
    GROUND,
    RowMatch,
    electrode_map,
    match_rows,
    relabel,
    source_table,
    swap_map,
    touching,
)
from eitskin.frames.repair import check_range, good_reciprocals
from eitskin.frames.source import electrode_table
from eitskin.frames.tables import read_table
from eitskin.model.model import Model
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin

GROUND_WORDS = ("ground", "gnd", "g", "-")


def source_rows(
    options: ImportOptions,
    own: IntArray | None,
    protocol: Protocol | None,
    skin: Skin | None,
    n: int,
    where: str,
) -> IntArray:
    """Return the rows [I+, I-, V+, V-] of a source in its own order, with our electrode numbers,
    (rows, 4). ``own`` is the source's own table.

    Raises:
        UsageError, FrameError: no protocol is given, or the table names electrodes that do not
            exist.
    """
    given = table_rows(options)
    given = own if given is None else given
    if given is None:
        if protocol is None:
            raise UsageError(
                "say which protocol: --skin FILE, --protocol PATTERN --electrodes N, or a table"
            )
        given = source_table(options.order, protocol, potentials=options.potentials)
    elif _least_electrode(given) < 0 or given.max(initial=0) >= n:
        raise FrameError(
            f"{where}: the table names electrodes {_least_electrode(given)} to {given.max()}, but"
            f" they are 0 to {n - 1}; if it counts from 1 say --table-base 1"
        )
    flipped = options.mirror or (
        options.clockwise and not (skin is not None and skin.electrodes.clockwise)
    )
    return relabel(given, electrode_map(n, options.rotate, flipped))


def table_rows(options: ImportOptions) -> IntArray | None:
    """Return the source's rows as listed in the options themselves or in the file that they name;
    None if there are none."""
    if options.table is not None:
        return np.asarray(options.table, dtype=np.int64).reshape(-1, 4)
    if options.table_file is None:
        return None
    text = read_table(options.table_file)
    if text.n_columns != 4:
        raise FrameError(
            f"{options.table_file}: has {text.n_columns} columns; a table has four: I+, I-, V+, V-"
        )
    base = options.source.table_base
    cells = tuple(
        (*row[:3], str(base + GROUND) if row[3].lower() in GROUND_WORDS else row[3])
        for row in text.cells
    )
    return electrode_table(replace(text, cells=cells).numbers(range(4)), base, options.table_file)


def _least_electrode(rows: IntArray) -> int:
    """Return the least number of an electrode in ``rows``; ground in place of V- is not one."""
    named = np.concatenate([rows[:, :3].ravel(), rows[rows[:, 3] != GROUND, 3]])
    return int(named.min()) if len(named) else 0


@dataclass(frozen=True, eq=False)
class RowPlacement:
    """The map from frames as a source lists them to the rows of a model.

    The rows are those of ``match``, times ``sign`` (with ``magnitude``: their magnitudes times
    ``sign``), plus ``base``, which is the untouched frame of the model where the source sends
    differences and otherwise 0. Row r is unusable if ``blank[r]``. ``channels`` is the number of
    channels in a frame of the source.
    """

    channels: int
    match: RowMatch
    sign: FloatArray
    blank: BoolArray
    magnitude: bool
    base: FloatArray
    relative: bool = False

    def frame(self, values: AnyArray) -> AnyArray:
        """Return the frame (m,) for ``values`` (channels,), real or complex; NaN marks a row that
        cannot be used."""
        placed = self.match.taken_from(values)
        if self.magnitude:
            placed = np.abs(placed)
        placed = placed * self.sign
        placed = self.base * (1 + placed) if self.relative else self.base + placed
        return np.asarray(np.where(self.blank, np.nan, placed))


def place(
    options: ImportOptions, protocol: Protocol | None, model: Model, where: str
) -> RowPlacement:
    """Return how frames in the form that ``options`` describe map to the rows of ``model``.
    ``protocol`` is the source's; None means the model's.

    Raises:
        UsageError, FrameError: an option needs a whole file, names a row that does not exist, or
            the frames lack rows of the model.
    """
    if options.equalise:
        raise UsageError(
            f"{where}: equalise needs a whole file; take it out, or calibrate:  eitskin calibrate"
        )
    n, wanted = model.protocol.n_electrodes, model.protocol
    skin = model.known_skin  # without it, the skin counts as numbered counterclockwise
    rows = source_rows(options, None, protocol or wanted, skin, n, where)
    rows = relabel(rows, swap_map(n, options.swaps))
    measured = np.asarray(wanted.drive_measure, dtype=np.int64)
    try:
        match = match_rows(rows, measured)
    except FrameError:
        raise FrameError(
            f"{where}: its frames lack rows of the model's protocol; name the protocol of the"
            " frames in the layout, or use a model for that protocol"
        ) from None
    refuse_contradictions(options, where)
    sign = np.ones(len(measured))
    magnitude = options.sign == "magnitude"
    if magnitude:
        sign = np.where(_expected(model) < 0, -1.0, 1.0)
    elif options.sign == "reversed":
        sign = -sign
    check_range(options.flip_channels, len(measured), "--flip-channels")
    sign[list(options.flip_channels)] *= -1
    check_range(options.impute_channels, len(measured), "--impute-channels")
    filled = good_reciprocals(options.impute_channels, measured, n)
    for channel, (other, between) in filled.items():
        match = match.filled(channel, other)
        sign[channel] = between * sign[other]
    check_range(options.drop_channels, len(measured), "--drop-channels")
    blank = touching(measured, options.drop_electrodes)
    blank[list(options.drop_channels)] = True
    relative = options.relative_differences
    base = _expected(model) if options.differences or relative else np.zeros(len(measured))
    return RowPlacement(len(rows), match, sign, blank, magnitude, base, relative)


def refuse_contradictions(options: ImportOptions, where: str) -> None:
    """Raise a UsageError if ``options`` say two things of the numbers that cannot both be."""
    differences = options.differences or options.relative_differences
    if options.differences and options.relative_differences:
        raise UsageError(
            f"{where}: --differences and --relative-differences contradict each other; give one"
        )
    if options.sign == "magnitude" and (differences or options.potentials):
        what = "differences" if differences else "potentials"
        raise UsageError(f"{where}: --sign magnitude: {what} need their signs; leave it out")
    if options.equalise and differences:
        raise UsageError(
            f"{where}: --equalise: frames that are differences have no reference of their own;"
            " leave it out"
        )
    if options.potentials and options.source.complex_part == "abs":
        raise UsageError(
            f"{where}: --complex-part abs: potentials are subtracted, so they need their phases;"
            " say  --complex-part in-phase"
        )


def _expected(model: Model) -> FloatArray:
    """Return the model's own voltages of the untouched skin (m,), 0 for rows that it does not
    use."""
    expected = np.zeros(model.protocol.n_rows)
    fold = model.fold
    expected[fold.first] = model.v_ref_v
    second = fold.second >= 0
    expected[fold.second[second]] = (fold.sign * model.v_ref_v)[second]
    return expected
