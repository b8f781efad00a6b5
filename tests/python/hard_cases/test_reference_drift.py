"""Changes between the reference and the frame: gain, skin, common mode; and a reference that was
taken under a touch."""

import numpy as np
from fault_scenes import COUNT, frames_of, miou, noisy, played, rms_v, simulated, touched
from test_rows import options, run

GAINS = (0.8, 0.95, 0.99, 1.01, 1.05, 1.2)
JUMPS = (-0.05, -0.01, 0.01, 0.05)  # of rms(V0)
HOUR_S = 3600.0


def test_gain_drift(same_everywhere, margins):
    """The gain of all rows is off by 1 to 20 %. The peak changes in proportion and loses no more;
    at 5 % it loses at most 2 %."""
    within = margins.of("frames/gain-drift")
    gained = played(lambda k: [noisy(k, g * simulated()[k]["touched"], 1) for g in (1.0, *GAINS)])
    lost, worse = np.zeros((COUNT, len(GAINS))), np.zeros((COUNT, len(GAINS)))
    for k, (clean, *drifted) in enumerate(run(same_everywhere, gained, options())):
        for g, one in enumerate(drifted):
            assert one.info.masked == 0
            lost[k, g] = 1 - float(one.image.max() / clean.image.max()) / GAINS[g]
            worse[k, g] = miou(clean.image, k) - miou(one.image, k)
    for g, gain in enumerate(GAINS):
        bound = 0.02 if abs(gain - 1) <= 0.05 else 0.05
        within(f"peak lost at gain {gain:g}", lost[:, g].mean(), bound)
        within(f"MIoU lost at gain {gain:g}", worse[:, g].mean(), 0.02)


def test_drying(same_everywhere, margins):
    """A gel that dries for an hour since the tare: touches stay where they are."""
    hour = {"rate_hz": 3 / HOUR_S, "frames": 4}
    dried = played(lambda k: noisy(k, frames_of(k, {"gel_drying": {}}, **hour)[1:], 2))
    losses = []
    for k, (first, *later) in enumerate(run(same_everywhere, dried, options())):
        assert all(one.info.masked == 0 for one in later)
        losses.append([miou(first.image, k) - miou(one.image, k) for one in later])
        missing = max(abs(len(one.touches) - len(first.touches)) for one in later)
        margins.everywhere("frames/drying", "touches lost or too many", missing, 1, "touches")
    margins.everywhere("frames/drying", "MIoU lost in an hour", np.mean(losses, axis=0).max(), 0.03)


def test_common_mode_jump(same_everywhere, margins):
    """A constant on all rows: nothing is left out for it; 1 % of rms(V0) costs little, and at 5 %
    most frames are named."""
    offset = played(
        lambda k: [noisy(k, simulated()[k]["touched"] + j * rms_v(k), 1) for j in (0.0, *JUMPS)]
    )
    losses, named = np.zeros((COUNT, len(JUMPS))), 0
    for k, (clean, *jumped) in enumerate(run(same_everywhere, offset, options())):
        for j, one in enumerate(jumped):
            assert one.status == 0 and one.info.masked == 0
            losses[k, j] = miou(clean.image, k) - miou(one.image, k)
            named += abs(JUMPS[j]) > 0.01 and one.info.diagnostics != 0
    within = margins.of("frames/common-mode")
    for jump, loss in zip(JUMPS, losses.mean(axis=0), strict=True):
        within(f"MIoU lost to {jump:g} rms(V0)", loss, 0.1 if abs(jump) <= 0.01 else 0.4)
    within("frames of 5 % that nothing was found about", 1 - named / (2 * COUNT), 0.5)


def test_touch_during_tare(same_everywhere, margins):
    """During the touch the fault cannot be noticed. After the lift the frame changes in a way in
    which no touch changes it, and this is reported."""
    lifts = []
    for k in range(COUNT):
        untouched = noisy(k, np.tile(simulated()[k]["touched"], (16, 1)), 0)
        lifts.append((untouched, np.array([touched(k), noisy(k, simulated()[k]["quiet"], 1)])))
    missed = 0
    for held, lifted in run(same_everywhere, lifts, options()):
        assert held.info.diagnostics == 0 and held.touches == ()
        missed += "stale reference" not in lifted.info.diagnostics_by_name
    margins.everywhere("frames/touch-during-tare", "lifts that were not named", missed, 0, "frames")


def test_lift_off(same_everywhere, margins):
    """Held for ten warm-started frames, then lifted: the very next frame is as empty as if nothing
    had been there."""
    held, after = 10, 5
    streams = [("touched", n) for n in range(1, 1 + held)]
    streams += [("quiet", n) for n in range(100, 100 + after)]
    lifts = played(lambda k: [noisy(k, simulated()[k][name], n) for name, n in streams])
    ghosts = 0.0
    for outcomes in run(same_everywhere, lifts, options(warm_start=True)):
        assert outcomes[held - 1].touches
        peak = outcomes[held - 1].image.max()
        ghosts = max(ghosts, *(float(one.image.max() / peak) for one in outcomes[held:]))
    margins.everywhere("frames/lift-off", "what is left of the peak", ghosts, 0.02)
