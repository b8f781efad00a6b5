"""What touches do to each other: the formula against fields that are solved."""

import numpy as np
import pytest

from eitskin.fem.cem import ForwardModel
from eitskin.fem.mesh import mesh_for_elements
from eitskin.scene.random_touches import TrueTouch
from eitskin.scene.simulate import conductivity_with
from eitskin.skin.skin import paper_skin
from eitskin_reference.disc_fit import Disc
from eitskin_reference.interaction import interplay
from small_models import prebuilt


def folded(frame_v: np.ndarray) -> np.ndarray:
    """The mean of each row and its reciprocal, (k,) V."""
    fold = prebuilt()[0].fold
    return np.asarray((frame_v[fold.first] + fold.sign * frame_v[fold.second]) / 2)


PLACES = [
    ((0.0, 0.0), 0.0),
    ((30.0, 20.0), 1.0),
    ((0.0, 62.0), 0.0),
    ((-40.0, 0.0), np.pi / 2),
]  # middle, turn


@pytest.mark.parametrize(("middle", "turn"), PLACES)
def test_two_touches_differ_from_the_sum_of_each_by_the_interplay(middle, turn):
    """9 mm, contrast 5, 36 mm apart, in the middle and near the rim; a change of 2 (c - 1) / (c +
    1) of the sheet's."""
    skin, model = paper_skin(), prebuilt()[0]
    sheet = skin.conductivity_s_per_m
    forward = ForwardModel(mesh_for_elements(skin, 11_000), skin, model.protocol)
    off = 18 * np.array([np.cos(turn), np.sin(turn)])
    places = [np.array(middle) - off, np.array(middle) + off]
    touches = [TrueTouch(float(x), float(y), 9.0, 5.0) for x, y in places]
    seen = [
        folded(forward.voltages_of(forward.solve(conductivity_with(forward.mesh, some, sheet))))
        for some in ([], touches[:1], touches[1:], touches)
    ]
    second_order = seen[3] - seen[1] - seen[2] + seen[0]
    change = 2 * 4 / 6 * sheet
    predicted = interplay(model, [Disc(float(x), float(y), 9.0, change, 1.0) for x, y in places])
    left = np.linalg.norm(second_order - predicted) / np.linalg.norm(second_order)
    assert left < 0.2, f"the interplay leaves {left:.2f} of it"


def test_far_apart_and_alone():
    """One disc has none; two at the ends of the sheet have a small part of what near ones have; it
    grows as both changes do."""
    model = prebuilt()[0]
    near = [Disc(-12.0, 0.0, 9.0, 0.01, 1.0), Disc(12.0, 0.0, 9.0, 0.01, 1.0)]
    far = [Disc(-70.0, 0.0, 9.0, 0.01, 1.0), Disc(70.0, 0.0, 9.0, 0.01, 1.0)]
    assert not interplay(model, near[:1]).any()
    sizes = [np.linalg.norm(interplay(model, discs)) for discs in (near, far)]
    assert sizes[0] > 0
    double = [Disc(d.x_mm, d.y_mm, d.radius_mm, 2 * d.change, 1.0) for d in near]
    assert interplay(model, double) == pytest.approx(4 * interplay(model, near))
    opposite = [near[0], Disc(12.0, 0.0, 9.0, -0.01, -1.0)]
    assert interplay(model, opposite) == pytest.approx(-interplay(model, near))
