"""The search for touches where they bend each other's field: joined, parted and coupled discs, and
refined images."""

from dataclasses import replace

import numpy as np
import touch_scenes
from test_hard_touches import on_skin
from touch_scenes import entangled, frames_of

from eitskin.core.options_table import ALL_TOUCH_FIT, INTERACTION, LOG_DATA, SPLIT_MERGE
from eitskin.core.results import Options
from eitskin.model.options import default_options
from eitskin_emulator.core_steps import Choose, Forget, Load, Play, Step, TareStep
from small_models import prebuilt

CASE = "physics/entangled"
MAX = 16


def searches() -> list[Options]:
    """All and each part of the search, images refined, any sign, as many touches as there may
    be."""
    own = replace(default_options(prebuilt()[0]), max_touches=MAX, second_pass=True)
    parts = [
        replace(own, touch_fit=bits)
        for bits in (
            ALL_TOUCH_FIT,
            0,
            LOG_DATA,
            SPLIT_MERGE,
            INTERACTION,
            SPLIT_MERGE | INTERACTION,
        )
    ]
    return [
        *parts,
        replace(own, sign="both"),
        replace(own, touch_min_fraction=0.0, detection_factor=0.0, touch_threshold=0.05),
    ]


def test_touches_in_each_others_field(same_everywhere, margins):
    """Same bits everywhere, finite, on the skin, within max_touches; two that overlap lie within
    the outline of both."""
    model, blob = prebuilt()
    steps: list[Step] = [Load(blob), TareStep(touch_scenes.simulated().untouched_v)]
    frames, chosen = frames_of("entangled"), searches()
    for options in chosen:
        steps += [Choose(options), Forget(), Play(frames)]
    statuses, outcomes = same_everywhere.steps(steps)
    assert set(statuses) == {0} and len(outcomes) == len(frames) * len(chosen)
    for k, one in enumerate(outcomes):
        assert one.status == 0 and one.finite()
        options = chosen[k // len(frames)]
        margins.everywhere(
            CASE, "touches beyond max_touches", max(0, len(one.touches) - MAX), 0, "touches"
        )
        margins.everywhere(
            CASE, "touches beyond the skin", sum(not on_skin(t) for t in one.touches), 0, "touches"
        )
        assert one.info.iterations <= 2 * options.iterations
        margins.everywhere(
            CASE, "multiply-accumulates of the search", one.info.touch_macs / 1e6, 60, "million"
        )
    first = outcomes[list(entangled()).index("two that overlap")]
    middle = max(float(np.hypot(t.x_mm, t.y_mm)) for t in first.touches)
    margins.everywhere(CASE, "centre's distance from the middle, overlapping", middle, 15, "mm")
    assert 1 <= len(first.touches) <= 2
    assert all(
        0 < t.radius_mm <= model.defaults.touch_max_radius_mm
        for one in outcomes
        for t in one.touches
    )
