"""Model, options or reference replaced while frames come: what follows is as if it had always been
so."""

from dataclasses import replace
from itertools import product

import numpy as np

from eitskin.core.options_table import SIGNS, SOLVERS
from eitskin.core.results import Options
from eitskin.model.options import default_options
from eitskin_emulator.core_steps import Choose, Forget, Load, Play, Step, TareStep
from everywhere import Outcome, as_printed
from small_models import small, small_blob, small_model

NO_REFERENCE = -13


def of_the_frame(one: Outcome) -> tuple[object, ...]:
    """Every bit but those of what came before: ids, which count on, and the MACs of directions that
    were ready."""
    status, stop, iterations, _, _, image, info, _ = as_printed(one)
    touches = tuple(replace(touch, id=0) for touch in one.touches)
    return status, stop, iterations, image, info, touches


def unlike(some: list[Outcome], others: list[Outcome]) -> int:
    return sum(
        of_the_frame(one) != of_the_frame(other) for one, other in zip(some, others, strict=True)
    )


def test_model_swapped(same_everywhere, margins):
    """A second model takes the first one's memory: until it has a reference of its own no frame is
    taken; then nothing is left of the first, whatever its storage, data and size."""
    s, other = small(), small("l")
    untouched, frames = s.untouched(101, 8), s.frames(100, 2)
    streams = [
        (blob, untouched, frames)
        for blob in (
            small_blob("i8"),
            small_blob("f16", "normalised"),
            small_blob(rank=16),
            small_blob("i16", "log-ratio"),
        )
    ]
    streams.append((small_blob(outline="l"), other.untouched(103, 8), other.frames(102, 2)))
    steps: list[Step] = [Load(small_blob()), TareStep(untouched), Play(frames)]
    fresh: list[Step] = []
    for blob, untouched_v, frames_v in streams:
        steps += [Load(blob), Play(frames_v[:1]), TareStep(untouched_v), Play(frames_v)]
        fresh += [Load(blob), TareStep(untouched_v), Play(frames_v)]
    _, streamed = same_everywhere.steps(steps)
    _, alone = same_everywhere.steps(fresh)
    after = streamed[2:]
    before_tare, taken = after[::3], [one for k, one in enumerate(after) if k % 3]
    assert all(
        one.status == NO_REFERENCE and not one.image.any() and one.touches == ()
        for one in before_tare
    )
    assert all(one.image.any() for one in taken)
    within = margins.of("time/model-swapped")
    within("frames unlike those of the model alone", unlike(taken, alone), 0, "frames")


def changes() -> list[Options]:
    """One option after another, from the usual ones."""
    usual = default_options(small_model())
    named: list[dict[str, object]] = [
        *({"solver": solver} for solver in SOLVERS), *({"sign": sign} for sign in SIGNS),
        {"project_reference": False}, {"lambda_rel": 0.3}, {"lambda_abs": 1e-3},
        {"iterations": 3}, {"gap_rel": 1e-3}, {"mac_limit": 200_000}, {"touch_sweeps": 0},
        {"max_touches": 1}, {"detection_factor": 100.0}, {},
    ]  # fmt: skip
    return [replace(usual, **changed) for changed in named]


def test_options_changed(same_everywhere, margins):
    """Cold starts: each frame is as in a context that never had other options. Warm ones: a sign,
    once changed, leaves nothing that it forbids."""
    s, blob, within = small(), small_blob(), margins.of("time/options-changed")
    untouched, frames = s.untouched(111, 8), s.frames(110, 2)
    stream: list[Step] = [Load(blob), TareStep(untouched)]
    alone: list[Step] = []
    for options in changes():
        stream += [Choose(options), Play(frames)]
        alone += [Load(blob), TareStep(untouched), Choose(options), Play(frames)]
    _, streamed = same_everywhere.steps(stream)
    _, fresh = same_everywhere.steps(alone)
    within("cold frames unlike those of a fresh context", unlike(streamed, fresh), 0, "frames")
    warm: list[Step] = [Load(blob), TareStep(untouched)]
    usual, signs = replace(default_options(small_model()), warm_start=True), [*SIGNS, *SIGNS]
    for sign, solver in product(signs, SOLVERS):
        warm += [Choose(replace(usual, sign=sign, solver=solver)), Play(frames)]
    _, outcomes = same_everywhere.steps(warm)
    each = 2 * len(SOLVERS)
    for k, one in enumerate(outcomes):
        turn = {"increase": 1, "decrease": -1, "both": 0}[signs[k // each]]
        assert one.status == 0 and one.finite()
        wrong = np.count_nonzero(one.image * turn < 0)
        within("pixels of a sign no longer wanted", wrong, 0, "pixels")


def test_tare_in_midstream(same_everywhere, margins):
    """A new reference, at rest or under a held touch: what follows is as in a context that never
    had another, warm starts included; a tare that is refused leaves no reference, and frames are
    refused until one is taken.
    """
    s, blob = small(), small_blob()
    options = replace(default_options(small_model()), warm_start=True)
    untouched, drifted, frames = s.untouched(121, 8), 1.1 * s.untouched(122, 8), s.frames(120, 3)
    held = frames[:1] + s.untouched(123, 8) - s.linear.v0_v
    broken = untouched.copy()
    broken[5, 7] = np.nan
    head: list[Step] = [Load(blob), Choose(options)]
    played = [
        [TareStep(drifted), Play(1.1 * frames)],
        [TareStep(held), Play(frames)],
        [TareStep(untouched), Play(frames)],
    ]
    statuses, outcomes = same_everywhere.steps(
        [*head, *played[2], *played[0], *played[1], TareStep(broken), Play(frames[:1]),
         TareStep(untouched), Forget(), Play(frames)]
    )  # fmt: skip
    _, alone = same_everywhere.steps([step for one in played for step in (*head, *one)])
    assert [status == 0 for status in statuses] == [True] * 5 + [False, True]
    assert outcomes[9].status == NO_REFERENCE and not outcomes[9].image.any()
    after = unlike([*outcomes[3:9], *outcomes[10:13]], alone)
    within = margins.of("time/tare-in-midstream")
    within("frames unlike those of a fresh context", after, 0, "frames")
    assert not outcomes[6].image.any()
