"""The interaction of touches: the formula compared with the exact model."""

from dataclasses import replace

import numpy as np
import pytest

from eitskin.model.reduction import fold_rows
from eitskin.oracle.discs import Disc, interaction
from eitskin.oracle.round_skin import RoundSkin
from eitskin.scene.random_touches import TrueTouch
from eitskin.skin.skin import paper_skin
from small_models import prebuilt

# middle, turn
PLACES = [((0.0, 0.0), 0.0), ((30.0, 20.0), 1.0), ((0.0, 62.0), 0.0), ((-40.0, 0.0), np.pi / 2)]


@pytest.mark.parametrize(("middle", "turn"), PLACES)
def test_two_touches_differ_from_the_sum_of_each_by_the_interaction(middle, turn):
    """9 mm, contrast 5, 36 mm apart, in the middle and near the rim; a change of 2 (c - 1) / (c +
    1) of the sheet's."""
    skin, model = paper_skin(), prebuilt()[0]
    sheet, fold = skin.conductivity_s_per_m, model.fold
    exact = RoundSkin(skin, model.protocol)
    off = 18 * np.array([np.cos(turn), np.sin(turn)])
    places = [tuple(map(float, middle + side * off)) for side in (-1, 1)]
    touches = [TrueTouch(*place, 9.0, 5.0) for place in places]
    alone_v, one_v, other_v, both_v = (
        exact.voltages(some) for some in ([], touches[:1], touches[1:], touches)
    )
    second_v = both_v - one_v - other_v + alone_v
    second_order = fold_rows(second_v, fold)
    change = 2 * 4 / 6 * sheet
    predicted = interaction(model, [Disc(*place, 9.0, change) for place in places])
    left = np.linalg.norm(second_order - predicted) / np.linalg.norm(second_order)
    assert left < 0.23, f"the interaction leaves {left:.2f} of it"


def test_far_apart_and_alone():
    """One disc has no interaction. Two at the ends of the skin have a small part of the interaction
    of near ones. It is proportional to both changes."""
    model = prebuilt()[0]
    near, far = ([Disc(x, 0.0, 9.0, 0.01) for x in (-at, at)] for at in (12.0, 70.0))
    assert not interaction(model, near[:1]).any()
    sizes = [np.linalg.norm(interaction(model, discs)) for discs in (near, far)]
    assert sizes[0] > 0
    double = [replace(disc, change=2 * disc.change) for disc in near]
    assert interaction(model, double) == pytest.approx(4 * interaction(model, near))
    opposite = [near[0], Disc(12.0, 0.0, 9.0, -0.01)]
    assert interaction(model, opposite) == pytest.approx(-interaction(model, near))
