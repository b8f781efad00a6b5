"""A reference that follows the untouched skin: drift between presses does no harm, a resting hand
does not fade, a slow touch is not taken for drift, and every engine does the same."""

from dataclasses import replace

import numpy as np
import pytest

from all_engines import AllEngines
from eitskin.core.results import Reconstruction
from eitskin.model.model import Model
from eitskin.model.options import default_options, tracking
from eitskin.scene.library_scenes import find_scene
from eitskin.scene.random_touches import TouchScene, TouchSet, TrueTouch
from eitskin.scene.runner import run_scene
from eitskin.scene.simulate import simulate
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin.solve.reconstructor import Reconstructor
from eitskin.teaching.plan import plan_places
from eitskin.teaching.presses import Presses
from eitskin.teaching.teach import teach
from simulated_presses import SKIN, presses

TARE, STREAM = 8, 60
TIME = 32  # frames, of the time constant where frames follow one another closely


@pytest.fixture(scope="module")
def model() -> Model:
    return teach(presses(40), SKIN).model


def noise(count: int, seed: int) -> np.ndarray:
    return 2e-4 * np.random.default_rng(seed).normal(size=(count, presses(1).protocol.n_rows))


def drifting(seed: int = 4) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Frames to tare by; the untouched and the pressed frame of each press on a skin that changes
    by a tenth of a press's noise and more between two; places."""
    some = presses(STREAM, seed=2)
    pattern = np.random.default_rng(seed).normal(size=some.protocol.n_rows)
    creep = 3e-4 * np.arange(STREAM)[:, None] * pattern
    tare_v = some.untouched[:1] + noise(TARE, 9)
    return tare_v, some.untouched + creep, some.pressed + creep, some.place_mm


def strength(result: Reconstruction) -> float:
    return sum(one.strength_s_per_m_mm2 for one in result.touches)


def errors_mm(core: Reconstructor) -> np.ndarray:
    """Return the error of each press in turn; if none is found, it is the width of the skin."""
    tare_v, untouched, pressed, place = drifting()
    core.tare(tare_v)
    found = []
    for before, during in zip(untouched, pressed, strict=True):
        core.reconstruct(before)
        found.append(core.reconstruct(during).touches)
    at = [(t[0].x_mm, t[0].y_mm) if t else (200.0, 0.0) for t in found]
    return np.linalg.norm(np.array(at) - place, axis=1)


def test_drift_between_presses_does_no_harm(model):
    core = Reconstructor(model)
    assert core.options.reference_frames == 512  # taught models ask for it
    late = {}
    for frames in (0, 2):
        core.set_options(reference_frames=frames)
        late[frames] = np.median(errors_mm(core)[-30:])
    assert late[2] < 5 < 10 < late[0]


def test_a_taught_model_tracks_presses_that_come_and_go(model):
    """Each press has one id from its first report until it lifts, another one than those before,
    and is confirmed; nothing is reported of the untouched skin."""
    some = presses(4, seed=11)
    core = Reconstructor(model, options=tracking(default_options(model)))
    core.tare(some.untouched[:1] + noise(TARE, 9))
    ids = []
    for k, place in enumerate(some.place_mm):
        shares = [0, 0, 0, 0.5, *[1] * 10, 0.5, 0, 0, 0]
        volts = some.untouched[k] + np.array(shares)[:, None] * some.difference[k]
        found = [core.follow(one).touches for one in volts + noise(len(shares), 20 + k)]
        held = [one for touches in found[4:14] for one in touches]
        ids.append({one.id for one in held})
        assert len(held) == 10 and len(ids[-1]) == 1
        assert all(one.confirmed for one in held[1:])
        assert np.hypot(held[-1].x_mm - place[0], held[-1].y_mm - place[1]) < 5
        assert not any(found[:3]) and not any(found[-2:])
    assert len(set.union(*ids)) == 4


def test_both_widths_follow_alike(model):
    """Presses on a skin that drifts, and a hand that rests while it dries; one frame to tare by, so
    that false touches are held back by what they explain."""
    tare_v, untouched, pressed, _ = drifting()
    presses_in_turn = np.stack([untouched, pressed], axis=1).reshape(2 * STREAM, -1)[:12]
    frames = [*presses_in_turn, *np.linspace(1, 1.003, 6)[:, None] * pressed[5]]
    cores = AllEngines(model, engines=("c", "c64"), reference_frames=3)
    cores.tare(tare_v[:1])
    held_back = 0
    for frame in frames:
        results = cores.reconstruct(frame)
        wide, narrow = results["c64"], results["c"]
        assert wide.info.found == narrow.info.found
        held_back += any("stale reference" in text for text in wide.info.found) and not wide.touches
        assert len(wide.touches) == len(narrow.touches)
        for a, b in zip(narrow.touches, wide.touches, strict=True):
            assert a.strength_s_per_m_mm2 == pytest.approx(b.strength_s_per_m_mm2, rel=1e-2)
    assert held_back > 0


def test_a_resting_hand_does_not_fade_while_the_sheet_dries(model):
    """A hold of 600 frames, in which an even sheet dries by 5 %: the mean force of 10 frames."""
    one, core, worst = presses(1, seed=5), Reconstructor(model), {}
    untouched, press = one.untouched[0], one.difference[0]
    for frames in (0, TIME):
        core.set_options(reference_frames=frames)
        core.forget()
        core.tare(untouched + noise(16, 1))
        for frame in untouched + noise(2 * TIME, 2):
            assert not core.reconstruct(frame).touches
        hold = np.linspace(1, 1.05, 600)[:, None] * (untouched + press) + noise(600, 3)
        force = np.reshape([strength(core.reconstruct(frame)) for frame in hold], (-1, 10))
        worst[frames] = np.abs(force.mean(axis=1) / force[0].mean() - 1).max()
    assert worst[TIME] < 0.05 < 0.2 < worst[0]


@pytest.mark.long("test_a_resting_hand_does_not_fade_while_the_sheet_dries")
def test_the_librarys_resting_hand_does_not_fade():
    """Ten minutes on a gel that dries, a frame each 16 s, on a skin taught by 12 simulated
    presses."""
    skin, protocol = paper_skin(), adjacent(16)
    place = plan_places(skin, protocol, 12).place_mm
    scenes = tuple(
        TouchScene(str(k), (TrueTouch(float(x), float(y), 8.0, 5.0),))
        for k, (x, y) in enumerate(place)
    )
    made = simulate(skin, protocol, TouchSet("presses", 1, scenes))
    tare_v = np.repeat(made.untouched_v[:1], len(place), axis=0)
    core = Reconstructor(teach(Presses(protocol, tare_v, made.frames_v, place), skin).model)
    scene = replace(find_scene("resting_hand"), rate_hz=1 / 16, frames=50, elements=1000)
    frames, time_s, worst = run_scene(scene), 16 * np.arange(scene.frames), {}
    for constant in (0, 4):
        core.set_options(reference_frames=constant)
        core.tare(frames.reference_voltage_v)
        force = np.array([strength(core.reconstruct(frame)) for frame in frames.voltage_v])
        assert not force[time_s < 120].any() and (constant == 0 or not force[time_s > 724].any())
        force = force[(time_s > 124) & (time_s < 720)]
        worst[constant] = np.abs(force / force[:3].mean() - 1).max()
    assert worst[4] < 0.02 < 0.15 < worst[0]


@pytest.mark.parametrize(("share", "grows"), [(1.0, 8), (0.3, 4)])
def test_a_slow_light_touch_is_not_taken_for_drift(model, share, grows):
    """It grows for so many time constants, and is as strong in the end as one that came at once;
    nothing is left behind when it lifts."""
    one, core = presses(1, seed=5), Reconstructor(model)
    core.set_options(reference_frames=TIME)
    in_the_end = []
    for frames in (1, grows * TIME):
        core.tare(one.untouched[0] + noise(16, 1))
        rising = share * np.linspace(1 / frames, 1, frames)
        level = np.concatenate([np.zeros(2 * TIME), rising, np.full(10, share)])
        for frame in one.untouched[0] + level[:, None] * one.difference[0] + noise(len(level), 4):
            last = core.reconstruct(frame)
        in_the_end.append(strength(last))
        after = [core.reconstruct(f).touches for f in one.untouched[0] + noise(20, 5)]
        assert not any(after)
    assert in_the_end[1] == pytest.approx(in_the_end[0], rel=0.05) and in_the_end[0] > 0
