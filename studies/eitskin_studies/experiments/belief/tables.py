"""The tables of the study "belief"."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from eitskin.view.pictures import PLACE_90
from eitskin_studies.experiments.experiment import ExperimentSettings, Table
from eitskin_studies.experiments.multitouch.counts import Share, share_of

Sets = Mapping[str, Sequence[Mapping[str, Any]]]

EDGES = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 1.0)
LOW, HIGH = 0.87, 0.93
OWN = (
    "discs_1_to_3",
    "light_touches",
    "eight_at_4_radii",
    "eight_unlike_at_4_radii",
    "five_at_2_5_radii",
    "five_unlike_at_2_5_radii",
)  # of the simulator's world: even discs on an even skin
PAIRS, NEAR = "two_fingers_", "two_fingers_12_to_16_mm"


@dataclass(frozen=True)
class Bin:
    """Touches whose confidence lies in a bin: its mean, and the share of them that are true."""

    low: float
    high: float
    said: float
    true: Share


def curve(sets: Sets) -> list[Bin]:
    """By confidence, over all sets alike."""
    both = [
        (touch[1], touch[0])
        for frames in sets.values()
        for frame in frames
        for touch in frame["touches"]
        if touch[1] is not None
    ]
    said, true = (np.array([one[k] for one in both], dtype=np.float64) for k in range(2))
    bins = []
    for low, high in pairwise(EDGES):
        inside = (said >= low) & ((said < high) | (high == EDGES[-1]))
        if inside.any():
            bins.append(Bin(low, high, float(said[inside].mean()), share_of(true[inside] > 0)))
    return bins


def coverage(frames: Sequence[Mapping[str, Any]]) -> Share:
    """True places that lie in the 90 % ellipses of the found ones."""
    known = [t[3] for frame in frames for t in frame["touches"] if t[0] and t[3] is not None]
    return share_of([value <= PLACE_90 for value in known])


@dataclass(frozen=True)
class Counts:
    """Return the shares of a set's frames: counted right; said to be crowded, of those right and of
    those wrong; counted right or said to be crowded."""

    right: Share
    said_right: Share
    said_wrong: Share
    honest: Share


def counts(frames: Sequence[Mapping[str, Any]]) -> Counts:
    """Return the row of one set."""
    right = np.array([len(one["touches"]) == one["true"] for one in frames], dtype=np.bool_)
    said = np.array([one["crowded"] for one in frames], dtype=np.bool_)
    return Counts(share_of(right), share_of(said[right]), share_of(said[~right]),
                  share_of(right | said))  # fmt: skip


def curve_table(sets: Sets) -> Table:
    """The calibration curve."""
    rows = tuple(
        (
            f"{one.low:g} to {one.high:g}",
            str(one.true.count),
            f"{one.said:.3f}",
            _fraction(one.true),
        )
        for one in curve(sets)
    )
    return Table("curve", ("confidence", "touches", "mean", "true (95 %)"), rows)


def places_table(sets: Sets) -> Table:
    """The fraction of places inside their ellipses, one row per set."""
    rows = []
    for name, frames in sets.items():
        touches = [t for frame in frames for t in frame["touches"] if t[0] and t[3] is not None]
        covered = coverage(frames)
        if not covered.count:
            continue
        off = float(np.median([t[2] for t in touches]))
        rows.append((f"`{name}`", str(covered.count), _percent(covered), f"{off:.2f}"))
    return Table(
        "places", ("set", "touches", "in the ellipse (95 %)", "median error, mm"), tuple(rows)
    )


def counts_table(sets: Sets) -> Table:
    """Return whether frames that are counted wrong are said to be crowded."""
    head = ("set", "count right", "crowded, of right", "crowded, of wrong", "right or crowded")
    rows = []
    for name, frames in sets.items():
        one = counts(frames)
        rows.append(
            (f"`{name}`", *map(_percent, (one.right, one.said_right, one.said_wrong, one.honest)))
        )
    return Table("counts", head, tuple(rows))


def summary(sets: Sets) -> str:
    """Return sentences with numbers about what holds."""
    covered = {
        name: one.mean
        for name, frames in sets.items()
        if (one := coverage(frames)).count and not name.startswith(PAIRS)
    }
    own = [covered[name] for name in OWN if name in covered]
    others = [value for name, value in covered.items() if name not in OWN]
    inside = [name for name, value in covered.items() if LOW <= value <= HIGH]
    bins = curve(sets)
    weight = sum(one.true.count for one in bins)
    error = sum(one.true.count * abs(one.said - one.true.mean) for one in bins) / max(weight, 1)
    near, discs, fingers = (counts(sets[name]) for name in (NEAR, OWN[0], "fingers"))
    return (
        f"The expected calibration error of `confidence` is {error:.3f}, over {weight} touches. The"
        f" 90 % ellipses cover {_range(own)} of the true places in the simulator's world and"
        f" {_range(others)} in other sets; in {len(inside)} of {len(covered)} sets they cover 87 to"
        " 93 %. If two fingers are 12 to 16 mm apart, the count is right in"
        f" {_percent(near.right)} of the frames, and right or called crowded in"
        f" {_percent(near.honest)}. Frames that are counted right are called crowded in"
        f" {_percent(discs.said_right)} of the scenes with discs, and in"
        f" {_percent(fingers.said_right)} of those with fingers."
    )


def conditions(settings: ExperimentSettings, count: int) -> str:
    """How the numbers were made."""
    return (
        'The prebuilt model, float32, default options; scenes of the family "judging" of the [other'
        f" worlds](other-worlds.md), seed {settings.seed}, {count} a set; constants were chosen on"
        ' the family "tuning". A touch is true if it is paired with a true one within 10 mm.'
        " Brackets: Wilson's 95 % intervals."
    )


def _range(values: Sequence[float]) -> str:
    if not values:
        return "-"
    return f"{100 * min(values):.0f} to {100 * max(values):.0f} %"


def _percent(one: Share) -> str:
    if not one.count:
        return "-"
    return f"{100 * one.mean:.0f} % ({100 * one.low:.0f} to {100 * one.high:.0f})"


def _fraction(one: Share) -> str:
    return f"{one.mean:.3f} ({one.low:.3f} to {one.high:.3f})"
