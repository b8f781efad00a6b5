"""Electrodes, wires and channels that fail between two frames: named in the very frame."""

from collections.abc import Callable

import numpy as np
import pytest
from fault_scenes import ELECTRODES, ROWS, miou, noisy, played, simulated, touched
from test_rows import options, run

from everywhere import Outcome, SameEverywhere
from margins import Margins


def compare(
    same_everywhere: SameEverywhere, spoil: Callable[[int, np.ndarray], np.ndarray]
) -> list[tuple[Outcome, Outcome]]:
    """Return for each scene the outcomes of the touched frame and of the frame that ``spoil`` made
    of it, both with the same noise."""
    both = played(lambda k: [touched(k), noisy(k, spoil(k, simulated()[k]["touched"]), 1)])
    return [(clean, spoilt) for clean, spoilt in run(same_everywhere, both, options())]


def check_named(
    margins: Margins, case: str, what: str, outcomes: list[tuple[Outcome, Outcome]]
) -> None:
    """Every spoilt frame is taken, and said to be a model mismatch."""
    assert all(one.status == 0 for _, one in outcomes)
    unnamed = sum("model mismatch" not in one.info.diagnostics_by_name for _, one in outcomes)
    margins.everywhere(case, f"{what}: frames that were not named", unnamed, 0, "frames")


def pair(k: int) -> tuple[int, ...]:
    return tuple(sorted((k % ELECTRODES, (k + 1) % ELECTRODES)))


def using(*electrodes: int) -> np.ndarray:
    return np.asarray(np.isin(ROWS, electrodes).any(axis=1))


def check_left_out(margins: Margins, case: str, one: Outcome, *electrodes: int) -> None:
    """All rows that use ``electrodes``, and as many rows."""
    assert one.status == 0
    unlike = abs(one.info.masked - int(using(*electrodes).sum()))
    margins.everywhere(case, "rows left out wrongly, or not", unlike, 0, "rows")


def test_detached(same_everywhere, margins):
    """Its number is reported, and its 52 rows are left out."""
    for k, (_, one) in enumerate(compare(same_everywhere, lambda k, _: simulated()[k]["detached"])):
        assert one.info.open_electrodes == (k % ELECTRODES,) and not one.info.bridged_electrodes
        check_left_out(margins, "frames/detached", one, k % ELECTRODES)


def test_bridged(same_everywhere, margins):
    """Neighbours: both are named, and left out. Others: no row is dead, and the frame is named a
    model_mismatch."""
    for k, (_, one) in enumerate(compare(same_everywhere, lambda k, _: simulated()[k]["bridged"])):
        assert one.info.bridged_electrodes == pair(k) and not one.info.open_electrodes
        check_left_out(margins, "frames/bridged", one, *pair(k))
    apart = compare(same_everywhere, lambda k, _: simulated()[k]["bridged apart"])
    check_named(margins, "frames/bridged", "apart", apart)


@pytest.mark.parametrize("which", ["swapped", "swapped apart"])
def test_swapped(same_everywhere, margins, which):
    """A model mismatch, by name."""
    outcomes = compare(same_everywhere, lambda k, _: simulated()[k][which])
    check_named(margins, "frames/swapped", which, outcomes)


def test_noisy(same_everywhere, margins):
    """A contact that rubs, a fifth of each reading at random: named, and left out."""

    def rub(k: int, frame: np.ndarray) -> np.ndarray:
        generator = np.random.default_rng([k, 6])
        rubbed = frame * (1 + 0.2 * generator.standard_normal(len(frame)))
        return np.where(using(k % ELECTRODES), rubbed, frame)

    for k, (_, one) in enumerate(compare(same_everywhere, rub)):
        assert one.info.noisy_electrodes == (k % ELECTRODES,)
        check_left_out(margins, "frames/noisy", one, k % ELECTRODES)


def test_polarity_flip(same_everywhere, margins):
    """A channel's 13 rows with the other sign: its two electrodes are named, the rows left out;
    their reciprocals stand for them."""
    losses = []
    outcomes = compare(
        same_everywhere, lambda k, frame: np.where(ROWS[:, 2] == k % ELECTRODES, -frame, frame)
    )
    for k, (clean, one) in enumerate(outcomes):
        assert {"electrode noisy", "model mismatch"} <= set(one.info.diagnostics_by_name)
        assert one.info.noisy_electrodes == pair(k)
        assert one.info.masked == 13
        losses.append(miou(clean.image, k) - miou(one.image, k))
    margins.everywhere("frames/polarity", "MIoU lost", np.mean(losses), 0.02)


@pytest.mark.parametrize("by", [1, 3, 13, 65])
def test_rotated(same_everywhere, margins, by):
    """All rows in the place of others: a model mismatch, by name."""
    outcomes = compare(same_everywhere, lambda _, frame: np.roll(frame, by))
    check_named(margins, "frames/rotated", f"by {by}", outcomes)
