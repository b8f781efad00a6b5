"""What ``import`` is told of a source: where its frames are, and what differs in them."""

from dataclasses import dataclass, field

from eitskin.frames.source import SourceOptions
from eitskin.frames.truth import TruthOptions


@dataclass(frozen=True)
class ImportOptions:
    """How to repair a source; the defaults change nothing.

    ``order``: of ORDERS, or "table" with ``table_file`` (text, four columns) or ``table`` (rows
    from 0). ``keep_table``: keep the source's own table. ``sign``: "reversed" negates, "magnitude"
    takes each channel's sign from the homogeneous prediction. ``rotate``, ``mirror``: our number of
    source electrode 0, and whether counting then goes down. ``clockwise``: the source counts
    clockwise, so mirror if the skin does not. ``swaps``: pairs of our electrodes whose wires were
    exchanged. ``flip_channels``, ``impute_channels``, ``drop_channels``: channels of the protocol's
    order to negate, to fill from their reciprocals, and to leave out; ``drop_electrodes``: every
    channel that uses them.
    ``equalise``: give each channel the gain that makes the reference the homogeneous prediction.
    ``current_a``: instead of the protocol's.
    """

    source: SourceOptions = field(default_factory=SourceOptions)
    order: str = "fixed"
    table_file: str | None = None
    table: tuple[tuple[int, int, int, int], ...] | None = None
    keep_table: bool = False
    sign: str = "signed"
    rotate: int = 0
    mirror: bool = False
    clockwise: bool = False
    swaps: tuple[tuple[int, int], ...] = ()
    flip_channels: tuple[int, ...] = ()
    impute_channels: tuple[int, ...] = ()
    drop_channels: tuple[int, ...] = ()
    drop_electrodes: tuple[int, ...] = ()
    equalise: bool = False
    current_a: float | None = None
    truth: TruthOptions = field(default_factory=TruthOptions)
