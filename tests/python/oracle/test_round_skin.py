"""The exact model of a round skin against a series, against its own finer points, and against what
must hold for every skin."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from disk_series import DWARFING_IMPEDANCE_OHM_M2, exact_voltages
from eitskin.arrays import FloatArray
from eitskin.errors import GeometryError, UsageError
from eitskin.oracle import round_skin
from eitskin.oracle.round_skin import RoundSkin
from eitskin.scene.random_touches import TrueTouch
from eitskin.scene.touch_shape import named_shape
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import disk, polygon
from eitskin.skin.protocol import adjacent, opposite
from eitskin.skin.skin import Skin, paper_skin

PROTOCOL = adjacent(16)
THREE = (
    TrueTouch(40, 20, 8, 6.0),
    TrueTouch(-50, -30, 10, 4.0, named_shape("ellipse", 1.5, 30.0)),
    TrueTouch(-40, 50, 7, 0.2),
)


def _off(found: FloatArray, exact: FloatArray) -> float:
    return float(np.linalg.norm(found - exact) / np.linalg.norm(exact))


@pytest.mark.parametrize(
    ("radius_mm", "inside"), [(48.5, 0.09), (48.5, 0.001), (80.0, 0.05), (9.0, 0.05)]
)
def test_a_concentric_disc_is_that_of_the_series(radius_mm, inside):
    """Wide electrodes, whose contacts dwarf the sheet's own resistance."""
    skin = Skin("turned", disk(194.0), Electrodes(16, 194 * pi / 64, start_angle_deg=360 / 128))
    touch = TrueTouch(0, 0, radius_mm, inside / skin.conductivity_s_per_m)
    for protocol in (PROTOCOL, opposite(16)):
        exact = exact_voltages(skin, protocol, radius_mm, inside)
        found = RoundSkin(skin, protocol, DWARFING_IMPEDANCE_OHM_M2).voltages([touch], 64)
        assert _off(found, exact) < 3e-4


def test_a_touch_alters_voltages_as_in_the_series():
    """The narrow electrodes of the paper's skin; the change alone."""
    skin = paper_skin()
    exact = exact_voltages(skin, PROTOCOL, 9.0, 0.05) - exact_voltages(skin, PROTOCOL, 9.0, 0.01)
    model = RoundSkin(skin, PROTOCOL, DWARFING_IMPEDANCE_OHM_M2)
    assert _off(model.voltages([TrueTouch(0, 0, 9.0, 5.0)]) - model.voltages([]), exact) < 1e-5


@pytest.mark.parametrize("impedance", [0.0, 1e-4, 0.01])
def test_more_points_change_less_than_a_ten_thousandth_of_the_signal(impedance):
    usual = RoundSkin(paper_skin(), PROTOCOL, impedance)
    finer = RoundSkin(paper_skin(), PROTOCOL, impedance, electrode_points=40)
    assert _off(usual.voltages([]), finer.voltages([])) < 3e-5
    change = usual.voltages(THREE) - usual.voltages([])
    assert _off(change, finer.voltages(THREE, 80) - finer.voltages([])) < 1e-4


def test_rings_of_a_smooth_touch_converge(monkeypatch):
    model = RoundSkin(paper_skin(), PROTOCOL)
    for name in ("finger", "gauss"):
        touch = TrueTouch(40, 20, 9, 6.0, named_shape(name, angle_deg=70.0))
        found = []
        for rings in (4, round_skin.RINGS, 13):
            monkeypatch.setattr(round_skin, "RINGS", rings)
            found.append(model.voltages([touch]) - model.voltages([]))
        assert _off(found[0], found[2]) < 0.03
        assert _off(found[1], found[2]) < 0.006
        monkeypatch.undo()


def test_reciprocity_scale_and_contrasts_of_one():
    model = RoundSkin(paper_skin(), PROTOCOL, np.linspace(0.005, 0.02, 16))
    turned = PROTOCOL.drive_measure[:, [2, 3, 0, 1]]
    swapped = replace(PROTOCOL, drive_measure=turned)
    back = RoundSkin(paper_skin(), swapped, np.linspace(0.005, 0.02, 16))
    assert back.voltages(THREE) == pytest.approx(model.voltages(THREE), rel=1e-9, abs=1e-15)
    same = [replace(touch, contrast=1.0) for touch in THREE]
    assert model.voltages(same) == pytest.approx(model.voltages([]), rel=1e-9)
    double = Skin("double", disk(388.0), Electrodes(width_mm=8.0))
    scaled = RoundSkin(double, PROTOCOL, 0.02).voltages([TrueTouch(80, 40, 16, 6.0)])
    plain = RoundSkin(paper_skin(), PROTOCOL, 0.01).voltages([TrueTouch(40, 20, 8, 6.0)])
    assert scaled == pytest.approx(plain, rel=1e-9)


def test_refusals():
    square = Skin("square", polygon([(0, 0), (200, 0), (200, 200), (0, 200)]), Electrodes())
    with pytest.raises(GeometryError, match="round skins only"):
        RoundSkin(square, PROTOCOL)
    with pytest.raises(UsageError, match="at least 0"):
        RoundSkin(paper_skin(), PROTOCOL, -1.0)
    with pytest.raises(UsageError, match="reaches the skin's rim"):
        RoundSkin(paper_skin(), PROTOCOL).voltages([TrueTouch(90, 0, 9, 5.0)])
