"""The origin of each row of a frame in the order of a source: electrodes are renumbered, rows put
in the order of a protocol, and signs set."""

from dataclasses import dataclass

import numpy as np

from eitskin.arrays import AnyArray, BoolArray, FloatArray, IntArray
from eitskin.errors import FrameError, UsageError
from eitskin.frames.import_options import ImportOptions
from eitskin.frames.orders import (
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
        given = source_table(options.order, protocol)
    elif given.min(initial=0) < 0 or given.max(initial=0) >= n:
        raise FrameError(
            f"{where}: the table names electrodes {given.min()} to {given.max()}, but they are 0 to"
            f" {n - 1}; if it counts from 1 say --table-base 1"
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
    return electrode_table(text.numbers(range(4)), options.source.table_base, options.table_file)


@dataclass(frozen=True, eq=False)
class RowPlacement:
    """The map from frames as a source lists them to the rows of a model.

    Row r is ``sign[r]`` times the source's channel ``index[r]`` (with ``magnitude``: times its
    magnitude), and it is unusable if ``blank[r]``. ``channels`` is the number of channels in a
    frame of the source.
    """

    channels: int
    index: IntArray
    sign: FloatArray
    blank: BoolArray
    magnitude: bool

    def frame(self, values: AnyArray) -> AnyArray:
        """Return the frame (m,) for ``values`` (channels,), real or complex; NaN marks a row that
        cannot be used."""
        placed = values[self.index]
        if self.magnitude:
            placed = np.abs(placed)
        return np.asarray(np.where(self.blank, np.nan, placed * self.sign))


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
    try:
        skin: Skin | None = model.skin
    except Exception:  # without a description, the skin counts as numbered counterclockwise
        skin = None
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
    sign = match.sign.astype(np.float64)
    magnitude = options.sign == "magnitude"
    if magnitude:
        sign = np.where(_expected(model) < 0, -1.0, 1.0)
    elif options.sign == "reversed":
        sign = -sign
    check_range(options.flip_channels, len(measured), "--flip-channels")
    sign[list(options.flip_channels)] *= -1
    index = match.index.copy()
    check_range(options.impute_channels, len(measured), "--impute-channels")
    filled = good_reciprocals(options.impute_channels, measured, n)
    for channel, (other, between) in filled.items():
        index[channel], sign[channel] = index[other], between * sign[other]
    check_range(options.drop_channels, len(measured), "--drop-channels")
    blank = touching(measured, options.drop_electrodes)
    blank[list(options.drop_channels)] = True
    return RowPlacement(len(rows), index, sign, blank, magnitude)


def _expected(model: Model) -> FloatArray:
    """Return the model's own voltages of the untouched skin (m,), 0 for rows that it does not
    use."""
    expected = np.zeros(model.protocol.n_rows)
    fold = model.fold
    expected[fold.first] = model.v_ref_v
    second = fold.second >= 0
    expected[fold.second[second]] = (fold.sign * model.v_ref_v)[second]
    return expected
