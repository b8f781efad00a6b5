"""The project's own reconstruction as a method of the comparison."""

import numpy as np
import pytest

from eitskin.errors import UsageError
from eitskin.fem.mesh import mesh_for_elements
from eitskin.scene.random_touches import TouchScene, TouchSet, TrueTouch
from eitskin.scene.simulate import Simulated, simulate
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin_studies.compare.core_method import core_methods
from eitskin_studies.compare.families import FindsTouches, Learns, Setup, setup_for
from eitskin_studies.compare.methods import methods

SKIN, PROTOCOL = paper_skin(), adjacent(16)
PLACES = [(30.0, 20.0), (-45.0, 10.0)]


@pytest.fixture(scope="module")
def setup() -> Setup:
    return setup_for(SKIN, PROTOCOL, elements=1500)


@pytest.fixture(scope="module")
def session() -> Simulated:
    touches = TouchSet(
        "own",
        1,
        tuple(TouchScene(str(k), (TrueTouch(*place, 9.0, 5.0),)) for k, place in enumerate(PLACES)),
    )
    return simulate(SKIN, PROTOCOL, touches, mesh=mesh_for_elements(SKIN, 3000))


def test_every_form_shows_and_finds_single_touches(setup, session):
    dv = session.differences_v()
    for family in core_methods(setup):
        method = family.make(family.values[0])
        assert isinstance(method, Learns) and isinstance(method, FindsTouches)
        method.learn(session.untouched_v)
        images, found = method.reconstruct(dv), method.touches(dv)
        assert images.shape == (2, setup.grid.n_pixels) and images.min() >= 0
        for image, xy, place in zip(images, found, PLACES, strict=True):
            peak = setup.grid.centres_mm()[np.argmax(image)]
            assert np.hypot(*(peak - place)) < 9.0, method.name
            assert len(xy) == 1 and np.hypot(*(xy[0] - place)) < 2.0, method.name


def test_frames_of_a_set_do_not_depend_on_their_order(setup, session):
    method = core_methods(setup)[0].make(0.0)
    assert isinstance(method, Learns)
    method.learn(session.untouched_v)
    dv = session.differences_v()
    assert (method.reconstruct(dv[::-1].copy())[::-1] == method.reconstruct(dv)).all()


def test_it_must_learn_first(setup):
    with pytest.raises(UsageError, match="untouched frames"):
        core_methods(setup)[0].make(0.0).reconstruct(np.zeros((1, 208)))


def test_it_is_among_the_methods_that_are_compared(setup):
    names = [family.make(family.values[0]).name for family in methods(setup)]
    assert len(set(names)) == len(names)
    assert any(name.startswith("eitskin 30, solver's image") for name in names) and "NOSER" in names
    assert "total variation, non-negative" in names
