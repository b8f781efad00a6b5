"""Electrodes, wires and channels that fail between two frames: named in the very frame."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from everywhere import Outcome, SameEverywhere
from fault_scenes import COUNT, ELECTRODES, ROWS, miou, noisy, quiet_frames, simulated
from test_rows import options, run

from margins import Margins


def played(spoil: Callable[[int, np.ndarray], np.ndarray]) -> list[tuple[np.ndarray, np.ndarray]]:
    """By scene: quiet frames; then the touched frame, and that with ``spoil`` applied, both with
    the same noise."""
    pairs = []
    for k in range(COUNT):
        clean = simulated()[k]["touched"]
        frames = np.array([noisy(k, clean, 1), noisy(k, spoil(k, clean), 1)])
        pairs.append((quiet_frames(k), frames))
    return pairs


def compare(
    same_everywhere: SameEverywhere, spoil: Callable[[int, np.ndarray], np.ndarray]
) -> list[tuple[Outcome, Outcome]]:
    """Clean and spoilt outcome of each scene."""
    return [(clean, spoilt) for clean, spoilt in run(same_everywhere, played(spoil), options())]


def unnamed(outcomes: list[tuple[Outcome, Outcome]]) -> int:
    """Spoilt frames that are not said to be a model mismatch."""
    return sum("model mismatch" not in one.info.diagnostics_by_name for _, one in outcomes)


def pair(k: int) -> tuple[int, ...]:
    """The electrodes beside each other with which scene k's fault is."""
    return tuple(sorted((k % ELECTRODES, (k + 1) % ELECTRODES)))


def using(*electrodes: int) -> np.ndarray:
    """Rows (m,) that use any of them."""
    return np.asarray(np.isin(ROWS, electrodes).any(axis=1))


def test_detached(same_everywhere: SameEverywhere, margins: Margins) -> None:
    """Its number is told, and its 52 rows are left out."""
    for k, (_, one) in enumerate(compare(same_everywhere, lambda k, _: simulated()[k]["detached"])):
        assert one.status == 0
        assert one.info.open_electrodes == (k % ELECTRODES,)
        assert one.info.bridged_electrodes == ()
        unlike = abs(one.info.masked - int(using(k % ELECTRODES).sum()))
        margins.everywhere("frames/detached", "rows left out wrongly, or not", unlike, 0, "rows")


def test_bridged(same_everywhere: SameEverywhere, margins: Margins) -> None:
    """Neighbours: both are named, and left out. Others: no row is dead, and the frame is named a
    model_mismatch."""
    for k, (_, one) in enumerate(compare(same_everywhere, lambda k, _: simulated()[k]["bridged"])):
        assert one.status == 0
        assert one.info.bridged_electrodes == pair(k)
        assert one.info.open_electrodes == ()
        unlike = abs(one.info.masked - int(using(*pair(k)).sum()))
        margins.everywhere("frames/bridged", "rows left out wrongly, or not", unlike, 0, "rows")
    for _, one in compare(same_everywhere, lambda k, _: simulated()[k]["bridged apart"]):
        assert one.status == 0 and "model mismatch" in one.info.diagnostics_by_name


@pytest.mark.parametrize("which", ["swapped", "swapped apart"])
def test_swapped(same_everywhere: SameEverywhere, margins: Margins, which: str) -> None:
    """A model mismatch, by name."""
    outcomes = compare(same_everywhere, lambda k, _: simulated()[k][which])
    assert all(one.status == 0 for _, one in outcomes)
    margins.everywhere(
        "frames/swapped", f"{which}: frames that were not named", unnamed(outcomes), 0, "frames"
    )


def test_noisy(same_everywhere: SameEverywhere, margins: Margins) -> None:
    """A contact that rubs, a fifth of each reading at random: named, and left out."""

    def rub(k: int, frame: np.ndarray) -> np.ndarray:
        generator = np.random.default_rng([k, 6])
        return np.asarray(
            np.where(
                using(k % ELECTRODES),
                frame * (1 + 0.2 * generator.standard_normal(len(frame))),
                frame,
            )
        )

    for k, (_, one) in enumerate(compare(same_everywhere, rub)):
        assert one.status == 0 and one.info.noisy_electrodes == (k % ELECTRODES,)
        unlike = abs(one.info.masked - int(using(k % ELECTRODES).sum()))
        margins.everywhere("frames/noisy", "rows left out wrongly, or not", unlike, 0, "rows")


def test_polarity_flip(same_everywhere: SameEverywhere, margins: Margins) -> None:
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
def test_rotated(same_everywhere: SameEverywhere, margins: Margins, by: int) -> None:
    """All rows in the place of others: a model mismatch, by name."""
    outcomes = compare(same_everywhere, lambda _, frame: np.roll(frame, by))
    assert all(one.status == 0 for _, one in outcomes)
    margins.everywhere(
        "frames/rotated", f"by {by}: frames that were not named", unnamed(outcomes), 0, "frames"
    )
