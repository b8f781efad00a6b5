"""Where each channel of a frame comes from, in a source's own order: electrodes renumbered, rows in
a protocol's order, signs."""

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
    """The rows [I+, I-, V+, V-] of a source in its own order, in our numbers, (rows, 4). ``own``:
    the source's own table."""
    given = table_rows(options)
    given = own if given is None else given
    if given is None:
        if protocol is None:
            raise UsageError(
                "say which protocol: --skin FILE, --protocol KIND --electrodes N, or a table"
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
    """The source's rows as the options themselves, or the file that they name, list them."""
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
    """From frames as a source lists them to a model's rows: row r is ``sign[r]`` times the source's
    channel ``index[r]`` (``magnitude``: times its size), and unusable where ``blank[r]``.
    ``channels``: of a source's frame."""

    channels: int
    index: IntArray
    sign: FloatArray
    blank: BoolArray
    magnitude: bool

    def frame(self, values: AnyArray) -> AnyArray:
        """A frame (m,) of ``values`` (channels,), real or complex; NaN is a row that cannot be
        used."""
        placed = values[self.index]
        if self.magnitude:
            placed = np.abs(placed)
        return np.asarray(np.where(self.blank, np.nan, placed * self.sign))


def place(
    options: ImportOptions, protocol: Protocol | None, model: Model, where: str
) -> RowPlacement:
    """How frames that stand as ``options`` say come to the rows of ``model``; ``protocol``: the
    source's, None: the model's."""
    if options.equalise:
        raise UsageError(
            f"{where}: equalise needs a whole file; take it out, or calibrate:  eitskin calibrate"
        )
    n, wanted = model.protocol.n_electrodes, model.protocol
    try:
        skin: Skin | None = model.skin
    except Exception:  # a model without a description of its skin: numbered counter-clockwise
        skin = None
    rows = source_rows(options, None, protocol or wanted, skin, n, where)
    rows = relabel(rows, swap_map(n, options.swaps))
    measured = np.asarray(wanted.drive_measure, dtype=np.int64)
    try:
        match = match_rows(rows, measured)
    except FrameError:
        raise FrameError(
            f"{where}: its frames have not all rows of the model's protocol; name the protocol that"
            " they are of in the layout, or take a model for it"
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
    """The model's own voltages of the untouched skin (m,); 0 of rows that it does not use."""
    expected = np.zeros(model.protocol.n_rows)
    fold = model.fold
    expected[fold.first] = model.v_ref_v
    second = fold.second >= 0
    expected[fold.second[second]] = (fold.sign * model.v_ref_v)[second]
    return expected
