"""Single rows that cannot be used, or must not be believed."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from fault_scenes import COUNT, half, miou, played, quiet_frames, rms_v, simulated, touched

from eitskin.core.results import Options
from eitskin.model.options import default_options
from eitskin_emulator.core_steps import Choose, Load, Play, Step, TareStep
from everywhere import Outcome, SameEverywhere
from margins import Margins
from small_models import prebuilt

OUTLIERS = (0.05, 0.3, 1.0, 5.0)  # of rms(V0)
CHANNELS, ZERO = -11, -12  # eits_status


def options(**changes: object) -> Options:
    return replace(default_options(prebuilt()[0]), **changes)


def run(
    same_everywhere: SameEverywhere, pairs: list[tuple[np.ndarray, np.ndarray]], chosen: Options
) -> list[list[Outcome]]:
    """Outcomes of frames after a tare on untouched frames, pair by pair; all finite."""
    steps: list[Step] = [Load(prebuilt()[1]), Choose(chosen)]
    for untouched, frames in pairs:
        steps += [TareStep(untouched), Play(frames)]
    statuses, outcomes = same_everywhere.steps(steps)
    assert set(statuses) == {0}
    assert all(one.finite() for one in outcomes)
    lengths = np.cumsum([0, *(len(frames) for _, frames in pairs)])
    return [outcomes[a:b] for a, b in pairwise(lengths)]


def in_scene_0(
    same_everywhere: SameEverywhere, frames: list[np.ndarray] | np.ndarray, **changes: object
) -> list[Outcome]:
    """Return the outcomes of frames after a tare on the untouched frames of scene 0."""
    (found,) = run(same_everywhere, [(quiet_frames(0), np.array(frames))], options(**changes))
    return found


def check_loss(
    margins: Margins, case: str, to: str, clean: Outcome, one: Outcome, most: float = 0.02
) -> None:
    """In scene 0."""
    loss = miou(clean.image, 0) - miou(one.image, 0)
    margins.everywhere(case, f"MIoU lost to {to}", loss, most)


def damaged(k: int, amplitude: float) -> np.ndarray:
    """Return the frame of scene k with one row off by ``amplitude`` times rms(V0), up or down."""
    frame, generator = touched(k), np.random.default_rng([k, round(100 * amplitude)])
    frame[generator.integers(len(frame))] += amplitude * rms_v(k) * generator.choice([-1, 1])
    return frame


def test_outlier(same_everywhere, margins):
    """One row of a full scan is off by .05 to 5 times rms(V0): it is left out and counted, and the
    image hardly changes."""
    spoilt = played(lambda k: [touched(k), *(damaged(k, a) for a in OUTLIERS)])
    losses = np.zeros((COUNT, len(OUTLIERS)))
    for k, (clean, *others) in enumerate(run(same_everywhere, spoilt, options())):
        assert clean.info.outliers == 0 and clean.info.masked == 0
        for a, (amplitude, one) in enumerate(zip(OUTLIERS, others, strict=True)):
            losses[k, a] = miou(clean.image, k) - miou(one.image, k)
            assert one.info.outliers == one.info.masked <= 2
            assert one.info.outliers >= (amplitude > 0.05)
    for amplitude, loss in zip(OUTLIERS, losses.mean(axis=0), strict=True):
        margins.everywhere("frames/outlier", f"MIoU lost to {amplitude:g} rms(V0)", loss, 0.02)


def test_outlier_in_half_scans(same_everywhere, margins):
    """Without reciprocals the core finds only outliers that the other rows contradict: the mean
    loss is at most half of the loss without this check."""
    found, blind = [], []
    scans = [
        (half(untouched), half(frames))
        for untouched, frames in played(lambda k: [touched(k), damaged(k, 1.0)])
    ]
    for chosen, losses in ((options(), found), (options(diagnostics=0), blind)):
        for k, (clean, spoilt) in enumerate(run(same_everywhere, scans, chosen)):
            losses.append(miou(clean.image, k) - miou(spoilt.image, k))
    bound = 0.5 * float(np.mean(blind))
    margins.everywhere("frames/outlier", "MIoU lost in half scans", np.mean(found), bound)


def test_outlier_in_the_reference(same_everywhere, margins):
    """One reading of one of 16 untouched frames off by rms(V0) / 2: left out of the reference and
    of its noise."""
    pairs, within = [], margins.of("frames/outlier-while-taring")
    for k in range(COUNT):
        untouched, frames = quiet_frames(k), touched(k)[None]
        untouched[(3 * k) % len(untouched), 17 * k + 5] += 0.5 * rms_v(k)
        pairs += [(quiet_frames(k), frames), (untouched, frames)]
    results = run(same_everywhere, pairs, options())
    for k, ((clean,), (spoilt,)) in enumerate(zip(results[::2], results[1::2], strict=True)):
        off = abs(spoilt.info.lambda_noise - clean.info.lambda_noise) / clean.info.lambda_noise
        within("change of lambda_noise", off, 0.3)
        within("MIoU lost", miou(clean.image, k) - miou(spoilt.image, k), 0.02)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_not_finite(same_everywhere, margins, value):
    """One, 10 or 40 rows are left out. If more than half of the rows are not finite, the frame is
    rejected and its image cleared, and the next frame is not affected."""
    frames, counts, generator = np.tile(touched(0), (6, 1)), (1, 10, 40), np.random.default_rng(5)
    for frame, count in zip(frames[1:5], (*counts, 105), strict=True):
        frame[generator.permutation(len(frame))[:count]] = value
    clean, *spoilt, refused, again = in_scene_0(same_everywhere, frames)
    for count, one in zip(counts, spoilt, strict=True):
        assert one.status == 0 and one.info.masked == count
        check_loss(margins, "frames/not-finite", f"{count} rows", clean, one, 0.1)
    assert refused.status == CHANNELS and not refused.image.any() and refused.touches == ()
    assert (again.image == clean.image).all()


def test_zero_and_denormal(same_everywhere):
    """All zero: a dead front end, refused as such, though every electrode looks open. Denormal
    numbers: no touch."""
    good = touched(0)
    clean, zero, minus, tiny, again = in_scene_0(
        same_everywhere, [good, 0.0 * good, -0.0 * good, 1e-39 * good, good]
    )
    for one in (zero, minus):
        assert one.status == ZERO and not one.image.any() and one.info.diagnostics_by_name == ()
    assert tiny.status in (0, ZERO, CHANNELS) and tiny.touches == ()
    assert (again.image == clean.image).all()


def test_one_denormal_row(same_everywhere, margins):
    """A row that fell to 1e-39 V is an outlier like any other."""
    good = touched(0)
    spoilt = good.copy()
    spoilt[int(np.abs(simulated()[0]["quiet"]).argmax())] = 1e-39
    clean, one = in_scene_0(same_everywhere, [good, spoilt])
    assert one.info.outliers in (1, 2)
    check_loss(margins, "frames/zero-and-denormal", "one row", clean, one)


def test_saturation_in_touch(same_everywhere, margins):
    """Rows at the limit are left out and counted apart."""
    good, rows = touched(0), [3, 50, 171]
    limit = float(np.float32(1.05 * np.abs(quiet_frames(0)).max()))
    spoilt = good.copy()
    spoilt[rows] = limit, -limit, limit
    clean, one = in_scene_0(same_everywhere, [good, spoilt], saturation_v=limit)
    assert one.info.saturated == one.info.masked == len(rows)
    assert one.info.diagnostics_by_name == ("saturated",)
    check_loss(margins, "frames/saturation", "three rows", clean, one)


def test_saturation_in_the_reference(same_everywhere):
    """A saturated untouched frame is rejected as a reference, whether the touched frame is
    saturated or not, with the same status everywhere."""
    untouched, limit = quiet_frames(0), float(np.abs(quiet_frames(0)).max())
    steps: list[Step] = [
        Load(prebuilt()[1]),
        Choose(options(saturation_v=limit)),
        TareStep(untouched),
    ]
    assert same_everywhere.steps(steps)[0] == [0, 0, CHANNELS]


def test_clean_frames_are_left_alone(same_everywhere, margins):
    """Nothing is found, and the bits are those without any diagnostic."""
    clean = played(lambda k: [touched(k)])
    uncrowded = options().diagnostics & ~(1 << 7)  # crowded scenes: test_hard_touches.py
    looked, blind = (
        run(same_everywhere, clean, options(diagnostics=which)) for which in (uncrowded, 0)
    )
    for (one,), (other,) in zip(looked, blind, strict=True):
        seen = one.info.diagnostics + one.info.masked
        margins.everywhere("frames/clean", "diagnostics and rows left out", seen, 0)
        assert (one.coefficients == other.coefficients).all() and one.touches == other.touches
