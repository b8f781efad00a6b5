"""The options of ``import``: where a source holds its frames, and how they differ from ours."""

from dataclasses import dataclass, field

from eitskin.frames.source import SourceOptions
from eitskin.frames.truth import TruthOptions


@dataclass(frozen=True)
class ImportOptions:
    """The options for repairing a source; the defaults change nothing.

    With ``potentials`` a channel is the potential of one electrode against ground, and a row the
    difference of two. With ``differences`` the frames are changes of an unknown reference already,
    in place of which the skin's predicted voltages are put; with ``relative_differences`` they are
    divided by it, too.

    ``order`` is one of ORDERS, or "table" with ``table_file`` (text with four columns) or ``table``
    (rows from 0). ``keep_table`` keeps the source's own table. ``sign`` is "signed"; "reversed",
    which negates; or "magnitude", which takes the sign of each row from the homogeneous prediction.
    ``rotate`` is our number of source electrode 0; with ``mirror`` the numbers then count down.
    ``clockwise`` states that the source counts clockwise, which mirrors it unless the skin does
    too. ``swaps`` are pairs of our electrodes whose wires were exchanged. ``flip_channels``,
    ``impute_channels`` and ``drop_channels`` list rows, in the protocol's order, to negate, to fill
    from their reciprocals, and to leave out; ``drop_electrodes`` leaves out every row that uses
    them. ``equalise`` gives each row the gain that makes the reference equal the homogeneous
    prediction. ``current_a`` replaces the protocol's current.
    """

    source: SourceOptions = field(default_factory=SourceOptions)
    order: str = "fixed"
    table_file: str | None = None
    table: tuple[tuple[int, int, int, int], ...] | None = None
    keep_table: bool = False
    potentials: bool = False
    differences: bool = False
    relative_differences: bool = False
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
