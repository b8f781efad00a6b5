"""Touches that are hard to see, simulated on another mesh than the model's, in the model's default
settings.

A place may be off by half of a touch's radius, so that the found centre lies well within the touch,
unless a test says otherwise.
"""

from dataclasses import replace

import numpy as np
import pytest
import touch_scenes
from touch_scenes import (
    CONTRASTS,
    PRESS_PLACES,
    PRESSES,
    RIM_MM,
    UNTOUCHED_TRIALS,
    crowds,
    frames_of,
    groups,
    untouched_trials,
)

from eitskin.core.diagnostics_table import Touch as Found
from eitskin.model.options import default_options
from eitskin.scene.random_touches import TrueTouch
from eitskin.scoring.matching import match
from eitskin_emulator.core_steps import Choose, Load, Play, TareStep
from everywhere import Outcome, SameEverywhere
from margins import Margins
from small_models import prebuilt


def reconstruct(
    same_everywhere: SameEverywhere, frames: np.ndarray, sign: str = "increase"
) -> list[Outcome]:
    """Frames after a tare on the scenes' untouched frames; every number finite, no more touches
    than asked for."""
    model, blob = prebuilt()
    options = replace(default_options(model), sign=sign)
    steps = [
        Load(blob),
        Choose(options),
        TareStep(touch_scenes.simulated().untouched_v),
        Play(frames),
    ]
    statuses, outcomes = same_everywhere.steps(steps)
    assert set(statuses) == {0}
    assert all(
        one.status == 0 and one.finite() and len(one.touches) <= options.max_touches
        for one in outcomes
    )
    assert sum(not on_skin(touch) for one in outcomes for touch in one.touches) == 0
    return outcomes


def on_skin(touch: Found) -> bool:
    """Whether its centre lies on a pixel of the image or next to one."""
    grid = prebuilt()[0].grid
    cell = np.floor((np.array([touch.x_mm, touch.y_mm]) - grid.origin_mm) / grid.pixel_mm)
    return bool((np.abs(grid.index - cell) <= 1).all(axis=1).any())


def off_mm(found: Found, truth: TrueTouch) -> float:
    """From one centre to the other."""
    return float(np.hypot(found.x_mm - truth.x_mm, found.y_mm - truth.y_mm))


def check_alone(
    margins: Margins, case: str, what: str, one: Outcome, truth: TrueTouch, share: float = 0.5
) -> None:
    """One touch, its centre within ``share`` of the true radius."""
    margins.everywhere(
        case, f"touches beside the one, {what}", abs(len(one.touches) - 1), 0, "touches"
    )
    margins.everywhere(
        case, f"place, {what}", off_mm(one.touches[0], truth), share * truth.radius_mm, "mm"
    )


@pytest.mark.parametrize("where", ["on an electrode", "between electrodes"])
def test_on_an_electrode(same_everywhere, margins, where):
    """At the rim, over an electrode's middle or in a gap: one touch, inside the skin."""
    for one, (truth,) in zip(
        reconstruct(same_everywhere, frames_of(where)), groups()[where], strict=True
    ):
        check_alone(margins, "physics/on-an-electrode", where, one, truth)
        beyond = max(0.0, np.hypot(one.touches[0].x_mm, one.touches[0].y_mm) - RIM_MM)
        margins.everywhere("physics/on-an-electrode", "centre beyond the rim", beyond, 0, "mm")


def test_merge_and_part(same_everywhere, margins):
    """Two touches of 9 mm: apart by 30 mm (12 mm of sheet between them, two pixels), two; nearer,
    two as near or one between them; then two again. Ids are never shared, and one that stays keeps
    its own."""
    case, outcomes = "physics/merge-and-part", reconstruct(same_everywhere, frames_of("merging"))
    for one, truths, apart in zip(
        outcomes, groups()["merging"], touch_scenes.APART_MM, strict=True
    ):
        if apart >= 30:
            margins.everywhere(
                case, "touches missing or too many, apart", abs(len(one.touches) - 2), 0, "touches"
            )
            for truth in truths:
                margins.everywhere(
                    case, "place, apart", min(off_mm(t, truth) for t in one.touches), 4.5, "mm"
                )
        else:
            assert 1 <= len(one.touches) <= 2
            if len(one.touches) == 1:
                middle = np.hypot(one.touches[0].x_mm, one.touches[0].y_mm)
                margins.everywhere(
                    case, "centre's distance from the middle, merged", middle, apart / 2, "mm"
                )
            for truth in truths if len(one.touches) == 2 else ():
                margins.everywhere(
                    case, "place, near", min(off_mm(t, truth) for t in one.touches), 4.5, "mm"
                )
        assert len({t.id for t in one.touches}) == len(one.touches)
    common = set.intersection(*({t.id for t in one.touches} for one in outcomes))
    assert len(common) == 1


def test_centre(same_everywhere, margins):
    """The middle is farthest from every electrode, and the data contain least about it."""
    (one,), ((truth,),) = reconstruct(same_everywhere, frames_of("centre")), groups()["centre"]
    check_alone(margins, "physics/centre", "centre", one, truth)


def test_small(same_everywhere, margins):
    """3 mm, half of a pixel: found as one touch; its place to its diameter."""
    for one, (truth,) in zip(
        reconstruct(same_everywhere, frames_of("radius 3 mm")), groups()["radius 3 mm"], strict=True
    ):
        check_alone(margins, "physics/sizes", "radius 3 mm", one, truth, share=2.0)


def test_large(same_everywhere, margins):
    """40 mm, beyond touch_max_radius_mm of 30: touches, perhaps several, but only within it and a
    pixel around; there, too, lies nearly all of the image's weight."""
    model, _ = prebuilt()
    centres = model.grid.centres_mm()
    for one, (truth,) in zip(
        reconstruct(same_everywhere, frames_of("radius 40 mm")),
        groups()["radius 40 mm"],
        strict=True,
    ):
        assert one.touches
        farthest = max(off_mm(t, truth) for t in one.touches)
        most = truth.radius_mm + model.grid.pixel_mm
        margins.everywhere("physics/sizes", "place, radius 40 mm", farthest, most, "mm")
        away = np.hypot(centres[:, 0] - truth.x_mm, centres[:, 1] - truth.y_mm)
        outside = float(
            one.image[away > truth.radius_mm + model.grid.pixel_mm].sum() / one.image.sum()
        )
        margins.everywhere(
            "physics/sizes", "image outside of it, radius 40 mm", outside, 0.1, "of the image"
        )


def test_contrasts(same_everywhere, margins):
    """1.01 lies within the noise: nothing, or one touch there. 1.1 is found, to a diameter; from
    1.5 to 1,000 each is found in its place, and a stronger one is never given a lesser strength."""
    case, strength = "physics/contrasts", 0.0
    outcomes = reconstruct(same_everywhere, frames_of("contrasts"))
    for one, (truth,), contrast in zip(outcomes, groups()["contrasts"], CONTRASTS, strict=True):
        if contrast <= 1.01:
            assert len(one.touches) <= 1
            continue
        check_alone(
            margins,
            case,
            f"contrast {contrast:g}",
            one,
            truth,
            share=0.5 if contrast >= 1.5 else 2.0,
        )
        lost = (
            max(0.0, strength - one.touches[0].strength_s_per_m_mm2)
            / one.touches[0].strength_s_per_m_mm2
        )
        margins.everywhere(case, "strength lost where the contrast rises", lost, 0, "of it")
        strength = one.touches[0].strength_s_per_m_mm2


@pytest.mark.parametrize("sign", ["decrease", "both"])
def test_insulating(same_everywhere, margins, sign):
    """Found, negative, under the signs that allow it."""
    outcomes = reconstruct(same_everywhere, frames_of("insulating"), sign)
    for one, (truth,) in zip(outcomes, groups()["insulating"], strict=True):
        check_alone(margins, "physics/insulating", f"contrast {truth.contrast:g}", one, truth)
        assert one.touches[0].strength_s_per_m_mm2 < 0


def test_insulating_under_the_other_sign(same_everywhere, margins):
    """If only increases are looked for, an insulating touch looks like increases around it. No
    coefficient may have the other sign, and false touches must come with a diagnostic."""
    for one in reconstruct(same_everywhere, frames_of("insulating")):
        margins.everywhere(
            "physics/insulating",
            "pixels below 0, increases wanted",
            np.count_nonzero(one.image < 0),
            0,
            "pixels",
        )
        assert len(one.touches) < 3 or says_that_there_are_too_many(one)


def test_light_presses(same_everywhere, margins):
    """At the gate, 1.2 times the greatest correlation of 32 untouched frames: of 200 untouched
    frames at most 2 % are taken for a touch; as the press grows it is detected no less often, and
    in all places from twice the gate on."""
    case = "physics/light-presses"
    untouched = reconstruct(same_everywhere, untouched_trials())
    margins.everywhere(
        case,
        "false alarms",
        sum(bool(one.touches) for one in untouched) / UNTOUCHED_TRIALS,
        0.02,
        "of the frames",
    )
    outcomes, before = reconstruct(same_everywhere, frames_of("presses")), 0
    for k, press in enumerate(PRESSES):
        at_it = outcomes[k * PRESS_PLACES : (k + 1) * PRESS_PLACES]
        seen = sum(bool(one.touches) for one in at_it)
        margins.everywhere(
            case, "places lost where the press grows", max(0, before - seen), 0, "places"
        )
        clear = [one for one in at_it if one.info.lambda_max >= 2.4 * one.info.lambda_noise]
        margins.everywhere(
            case, "missed at twice the gate", sum(not one.touches for one in clear), 0, "places"
        )
        assert press < PRESSES[-1] or len(clear) == PRESS_PLACES
        before = seen


def says_that_there_are_too_many(one: Outcome) -> bool:
    """Whether the core reports that touches cannot be separated, or that no touch explains the
    frame."""
    return bool({"crowded", "stale reference"} & set(one.info.diagnostics_by_name))


def is_one_group(one: Outcome, touches: tuple[TrueTouch, ...]) -> bool:
    """Whether a single touch was found in place of a group that it covers."""
    return len(one.touches) == 1 and all(
        np.hypot(t.x_mm - one.touches[0].x_mm, t.y_mm - one.touches[0].y_mm)
        <= one.touches[0].radius_mm + t.radius_mm
        for t in touches
    )


def test_more_touches_than_can_be_told_apart(same_everywhere, margins):
    """All numbers are finite, and touches are on the skin and at most max_touches. The core reports
    that there are too many, unless it finds each of them, or, for a group of the size of one touch,
    a touch that covers the group."""
    outcomes = reconstruct(same_everywhere, frames_of("crowds"))
    for (name, touches), one in zip(crowds().items(), outcomes, strict=True):
        most = default_options(prebuilt()[0]).max_touches
        margins.everywhere(
            "physics/crowds",
            "touches beyond max_touches",
            max(0, len(one.touches) - most),
            0,
            "touches",
        )
        outside = sum(not on_skin(touch) for touch in one.touches)
        margins.everywhere("physics/crowds", "touches beyond the skin", outside, 0, "touches")
        told_apart = match(
            [(t.x_mm, t.y_mm) for t in touches], [(t.x_mm, t.y_mm) for t in one.touches]
        ).exact
        assert says_that_there_are_too_many(one) or told_apart or is_one_group(one, touches), name
