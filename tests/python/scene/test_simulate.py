"""Simulated sessions: areas, noise, converter, and the independence of their sources."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from eitskin.errors import UsageError
from eitskin.fem.mesh import Mesh, mesh_for_elements
from eitskin.scene.cover import Cover
from eitskin.scene.random_touches import TouchScene, TouchSet, TrueTouch, random_touches
from eitskin.scene.simulate import (
    Measurement,
    Simulated,
    conductivity_with,
    simulate,
)
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin

SKIN, PROTOCOL = paper_skin(), adjacent(16)
TOUCHES = random_touches(SKIN.outline, 5, 4)
CLEAN = Measurement(snr_db=None, adc_bits=None, contact_spread=0.0, quiet_frames=2)


@pytest.fixture(scope="module")
def mesh() -> Mesh:
    return mesh_for_elements(SKIN, 1500)


@pytest.fixture(scope="module")
def session(mesh) -> Simulated:
    return simulate(SKIN, PROTOCOL, TOUCHES, mesh=mesh)


def scenes_of(*touches: tuple[TrueTouch, ...]) -> TouchSet:
    scenes = tuple(TouchScene(str(k), each) for k, each in enumerate(touches))
    return TouchSet("made", 0, scenes)


@pytest.mark.parametrize(
    "touch", [TrueTouch(0, 0, 9, 5), TrueTouch(40.3, -51.7, 6, 3), TrueTouch(2, 80, 12, 8)]
)
def test_a_touch_covers_its_area(mesh, touch):
    elements, part = Cover(mesh).of(touch)
    assert part.min() > 0 and 0.5 < part.max() <= 1.0
    covered_mm2 = (part * mesh.areas_mm2[elements]).sum()
    assert covered_mm2 == pytest.approx(math.pi * touch.radius_mm**2, rel=0.01)


def test_a_touch_smaller_than_an_element_is_not_lost(mesh):
    elements, part = Cover(mesh, subdivision=32).of(TrueTouch(10.0, 3.0, 1.0, 5.0))
    assert (part * mesh.areas_mm2[elements]).sum() == pytest.approx(math.pi, rel=0.1)
    assert part.max() < 0.5


def test_conductivity_inside_and_outside_and_the_mean_over_an_element(mesh):
    touch = TrueTouch(20, 10, 9, 5.0)
    sigma, change = conductivity_with(mesh, [touch], 0.01), Cover(mesh).change([touch])
    elements, part = Cover(mesh).of(touch)
    assert np.array_equal(change.elements, elements)
    assert change.mean == pytest.approx(1 + 4 * part)
    assert sigma[elements] == pytest.approx(0.01 * change.tensor)
    within = elements[part == 1]
    assert sigma[within] == pytest.approx(np.tile([0.05, 0.05, 0.0], (len(within), 1)))
    assert (np.delete(sigma, elements, axis=0) == [0.01, 0.01, 0.0]).all()
    both = conductivity_with(mesh, [TrueTouch(20, 10, 12, 5.0), TrueTouch(-40, 0, 12, 0.2)], 0.01)
    values = np.linalg.eigvalsh(both[:, [[0, 2], [2, 1]]])
    assert values.min() == pytest.approx(0.002)
    # a kink that is not parallel to the element's edges lets slightly more current along the edge
    assert 0.05 <= values.max() < 0.055
    assert (conductivity_with(mesh, [], 0.02) == 0.02).all()


def test_a_touch_without_contrast_changes_nothing(mesh):
    touches = scenes_of((TrueTouch(10, 10, 9, 1.0),), ())
    clean = simulate(SKIN, PROTOCOL, touches, measurement=CLEAN, mesh=mesh)
    assert np.abs(clean.differences_v()).max() < 1e-12 * np.abs(clean.exact_untouched_v).max()
    assert (clean.noise_v, clean.lsb_v, clean.clipped) == (0.0, 0.0, 0)
    assert (clean.contact_impedance_ohm_m2 == 0.01).all()


def test_conductive_touches_lower_the_voltages_that_drive(mesh):
    """The power that a current source puts in falls when conductivity rises; adjacent rows sum to a
    drop across."""
    touches = scenes_of((TrueTouch(0, 60, 10, 8.0),), (TrueTouch(0, 60, 10, 0.1),))
    clean = simulate(SKIN, PROTOCOL, touches, measurement=CLEAN, mesh=mesh)
    v = np.array([clean.exact_untouched_v, *clean.exact_v])
    across = np.abs(v.reshape(-1, 16, 13).sum(axis=2)).sum(axis=1)
    assert across[1] < across[0] < across[2]


def test_noise_has_the_stated_ratio(mesh):
    how = Measurement(snr_db=50.0, adc_bits=None, quiet_frames=64)
    noisy = simulate(SKIN, PROTOCOL, TOUCHES, measurement=how, mesh=mesh)
    noise = np.concatenate(
        [noisy.frames_v - noisy.exact_v, noisy.untouched_v - noisy.exact_untouched_v]
    )
    rms = np.sqrt((noisy.exact_untouched_v**2).mean())
    assert noisy.noise_v == pytest.approx(rms / 10**2.5)
    assert noise.std() == pytest.approx(noisy.noise_v, rel=0.02)
    assert abs(noise.mean()) < 4 * noisy.noise_v / np.sqrt(noise.size)
    assert 20 * np.log10(rms / noise.std()) == pytest.approx(50.0, abs=0.2)


def test_converter_steps_are_whole_and_as_stated(session):
    span = 1.25 * np.abs(session.exact_untouched_v).max()
    assert session.lsb_v == pytest.approx(2 * span / 4096)
    steps = session.frames_v / session.lsb_v
    assert np.abs(steps - np.round(steps)).max() < 1e-6
    assert session.clipped == 0
    off = np.abs(session.untouched_v - session.exact_untouched_v).max()
    assert off < 5 * session.noise_v + session.lsb_v


def test_a_small_converter_clips_and_says_so(mesh):
    how = replace(CLEAN, adc_bits=12, adc_headroom=0.5)
    tight = simulate(SKIN, PROTOCOL, TOUCHES, measurement=how, mesh=mesh)
    span = 0.5 * np.abs(tight.exact_untouched_v).max()
    seen = (*tight.exact_v, tight.exact_untouched_v, tight.exact_untouched_v)
    assert tight.clipped == np.count_nonzero(np.abs(seen) > span) > 0
    assert tight.frames_v.min() >= -span and tight.frames_v.max() < span


def test_contacts_are_spread_within_bounds_and_shared(session):
    ratio = session.contact_impedance_ohm_m2 / 0.01
    assert (np.abs(ratio - 1) <= 0.2).all() and ratio.std() > 0.05
    assert len(set(ratio)) == 16


def test_sessions_repeat_and_are_independent_of_their_length(session, mesh):
    again = simulate(SKIN, PROTOCOL, TOUCHES, mesh=mesh)
    assert (again.frames_v == session.frames_v).all() and (
        again.untouched_v == session.untouched_v
    ).all()
    short = simulate(SKIN, PROTOCOL, random_touches(SKIN.outline, 5, 2), mesh=mesh)
    assert (short.frames_v == session.frames_v[:2]).all()


def test_sources_do_not_disturb_each_other(session, mesh):
    def noise_of(one: Simulated) -> np.ndarray:
        return np.asarray((one.frames_v - one.exact_v) / one.noise_v)

    analog = replace(session.measurement, adc_bits=None)
    with_contacts, without, louder = (
        simulate(SKIN, PROTOCOL, TOUCHES, measurement=replace(analog, **changes), mesh=mesh)
        for changes in ({}, {"contact_spread": 0.0}, {"snr_db": 40.0, "quiet_frames": 3})
    )
    assert noise_of(without) == pytest.approx(noise_of(with_contacts), abs=1e-6)
    assert noise_of(louder) == pytest.approx(noise_of(with_contacts), abs=1e-6)
    assert (louder.contact_impedance_ohm_m2 == session.contact_impedance_ohm_m2).all()
    other = simulate(SKIN, PROTOCOL, TOUCHES, measurement=analog, seed=6, mesh=mesh)
    assert abs(np.corrcoef(noise_of(other).ravel(), noise_of(without).ravel())[0, 1]) < 0.15
    assert (other.contact_impedance_ohm_m2 != session.contact_impedance_ohm_m2).all()
    untouched = (
        with_contacts.untouched_v[:4] - with_contacts.exact_untouched_v
    ) / with_contacts.noise_v
    assert abs(np.corrcoef(untouched.ravel(), noise_of(with_contacts).ravel())[0, 1]) < 0.15


def test_training_and_test_share_nothing(session, mesh):
    train = simulate(SKIN, PROTOCOL, random_touches(SKIN.outline, 5, 4, "train"), mesh=mesh)
    assert (train.contact_impedance_ohm_m2 != session.contact_impedance_ohm_m2).all()
    assert not set(train.touches.scenes[0].touches) & set(session.touches.scenes[0].touches)


def test_reference_is_the_mean_untouched_frame(session):
    assert session.untouched_v.shape == (64, 208)
    untouched_v = session.untouched_v.sum(axis=0) / 64
    assert session.differences_v() == pytest.approx(session.frames_v - untouched_v)


def test_as_frames_carries_the_truth(session):
    frames = session.as_frames()
    assert (frames.voltage_v == session.frames_v).all()
    assert frames.reference_voltage_v.shape == (64, 208)
    assert frames.frame_name[1] == "test-s5-1"
    of = [k for k, s in enumerate(TOUCHES.scenes) for _ in s.touches]
    assert frames.touch_frame.tolist() == of
    first = TOUCHES.scenes[0].touches[0]
    assert frames.touch_strength[0] == first.contrast - 1
    assert frames.touch_xy_mm[0].tolist() == [first.x_mm, first.y_mm]


def test_progress_sees_every_scene(mesh):
    seen: list[TouchScene] = []

    def watch(scenes: Iterable[TouchScene]) -> Iterator[TouchScene]:
        for scene in scenes:
            seen.append(scene)
            yield scene

    simulate(SKIN, PROTOCOL, TOUCHES, measurement=CLEAN, mesh=mesh, progress=watch)
    assert tuple(seen) == TOUCHES.scenes


@pytest.mark.parametrize("given", [{"contact_spread": 1.0}, {"adc_bits": 0}])
def test_impossible_measurements_are_refused(given):
    with pytest.raises(UsageError, match=next(iter(given))):
        Measurement(**given)
