"""Elements that the edges of touches cut: frames against the exact model, and the tensors."""

import math
from dataclasses import replace

import numpy as np
import pytest

from eitskin.arrays import FloatArray
from eitskin.errors import UsageError
from eitskin.fem.cem import ForwardModel
from eitskin.fem.mesh import mesh_for_elements
from eitskin.oracle.round_skin import RoundSkin
from eitskin.scene.cover import NO_CHANGE, Cover, with_touches
from eitskin.scene.random_touches import TouchRules, TouchScene, TrueTouch, random_touches
from eitskin.scene.simulate import ELEMENTS
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin

SKIN, PROTOCOL = paper_skin(), adjacent(16)
SCENES = 5
# the error of a frame's change in % of the change at the default mesh: median and worst
BOUNDS = {
    "discs": (TouchRules(), 0.8, 1.5),
    "light": (TouchRules(count=(1, 1), contrast=(1.3, 2.0)), 0.6, 1.2),
    "insulating": (TouchRules(count=(1, 1), contrast=(0.2, 0.6)), 0.9, 1.4),
    "ellipses": (TouchRules(count=(1, 1), shape="ellipse", aspect=(1.2, 2.2)), 1.2, 4.0),
    "fingers": (TouchRules(count=(1, 1), shape="finger"), 1.5, 3.0),
    "gauss": (TouchRules(count=(1, 1), shape="gauss", rim_margin_mm=20.0), 0.6, 1.2),
}


class Both:
    """The simulator on a mesh beside the exact model; changes of frames in V."""

    def __init__(self, elements: int) -> None:
        self.model = ForwardModel(mesh_for_elements(SKIN, elements), SKIN, PROTOCOL)
        self.cover, self.exact = Cover(self.model.mesh), RoundSkin(SKIN, PROTOCOL)
        self.sheet = np.full(self.model.mesh.n_elements, SKIN.conductivity_s_per_m)
        self.untouched_v = self.model.voltages(self.sheet)

    def change_v(self, touches: tuple[TrueTouch, ...]) -> FloatArray:
        conductivity = with_touches(self.sheet, self.cover.change(touches))
        return self.model.voltages(conductivity) - self.untouched_v

    def error_percent(self, touches: tuple[TrueTouch, ...]) -> float:
        true_v = self.exact.voltages(touches, 64) - self.exact.voltages([])
        off = np.linalg.norm(self.change_v(touches) - true_v) / np.linalg.norm(true_v)
        return 100 * float(off)


@pytest.fixture(scope="module")
def usual() -> Both:
    return Both(ELEMENTS)


def _drawn(rules: TouchRules, count: int = SCENES) -> tuple[TouchScene, ...]:
    return random_touches(SKIN.outline, 8, count, "cut", rules).scenes


@pytest.mark.parametrize("kind", BOUNDS)
def test_frames_are_right_at_the_default_mesh(usual, kind):
    rules, median, worst = BOUNDS[kind]
    errors = [usual.error_percent(scene.touches) for scene in _drawn(rules)]
    print(f"{kind}: {np.median(errors):.2f} %, worst {max(errors):.2f} %")
    assert np.median(errors) < median
    assert max(errors) < worst


def test_places_that_are_hard(usual):
    """Discs 2 mm from the rim, two discs 1 mm apart, and contrasts far from those of fingers."""
    at_rim = [
        (TrueTouch(86 * math.cos(turn), 86 * math.sin(turn), 9.0, 8.0),) for turn in (0.1, 1.7, 3.0)
    ]
    pairs = [
        (TrueTouch(x, 10.0, 8.0, 5.0), TrueTouch(x + 19, 10.0, 10.0, 9.0)) for x in (0.0, -70.0)
    ]
    at_once = [(TrueTouch(30.0, -20.0, 9.0, contrast),) for contrast in (100.0, 0.01, 0.001)]
    short = [(TrueTouch(30.0, -20.0, 9.0, contrast),) for contrast in (1e3, 1e4)]
    found = {
        "at the rim": [usual.error_percent(one) for one in at_rim],
        "1 mm apart": [usual.error_percent(one) for one in pairs],
        "contrast 100, .01, .001": [usual.error_percent(one) for one in at_once],
        "contrast 1e3, 1e4": [usual.error_percent(one) for one in short],
    }
    for name, errors in found.items():
        print(f"{name}: {', '.join(f'{one:.2f}' for one in errors)} %")
    assert max(found["at the rim"]) < 2.0
    assert max(found["1 mm apart"]) < 2.0
    assert max(found["contrast 100, .01, .001"]) < 3.0
    assert max(found["contrast 1e3, 1e4"]) < 16.0


def test_errors_fall_with_the_size_of_elements():
    """About linearly in the number of elements, which is the second order in their size."""
    scenes = _drawn(TouchRules(count=(1, 1)), 6)
    errors, counts = [], (1500, 4000, 11_000)
    for elements in counts:
        both = Both(elements)
        errors.append(np.mean([both.error_percent(scene.touches) for scene in scenes]))
    print("errors", errors)
    slope = np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert slope < -0.7


@pytest.fixture(scope="module")
def coarse() -> ForwardModel:
    return ForwardModel(mesh_for_elements(SKIN, 1500), SKIN, PROTOCOL)


@pytest.mark.parametrize("contrast", [6.0, 0.2])
def test_a_straight_edge_between_two_even_halves(coarse, contrast):
    """Each element has the power of the two fields that a straight edge allows: along it that of
    the mean conductivity, through it that of the mean resistivity. An insulating touch is a mixture
    of layers, which has the same power for a field along the edge alone."""
    far, turn = 1e6, 0.4
    normal = np.array([math.cos(turn), math.sin(turn)])
    edge = TrueTouch(*(far * normal), far, contrast)
    change = Cover(coarse.mesh, 24).change([edge])
    cut = np.flatnonzero((change.mean > min(contrast, 1)) & (change.mean < max(contrast, 1)))
    assert len(cut) > 20
    elements, mean = change.elements[cut], change.mean[cut]
    matrices = coarse.element_matrices(elements, change.tensor[cut])
    corners = coarse.mesh.nodes_mm[coarse.mesh.triangles[elements]] * 1e-3
    volumes = coarse.mesh.areas_mm2[elements] * 1e-6 * coarse.thickness_m
    covered = (mean - 1) / (contrast - 1)
    along = corners @ np.array([-normal[1], normal[0]])
    through = corners @ normal
    through = np.where(through > 0, through / contrast, through)
    fields = [(along, mean), (through, 1 - covered + covered / contrast)]
    for potential, expected in fields if contrast > 1 else fields[:1]:
        power = np.einsum("ei,eij,ej->e", potential, matrices, potential)
        # points in an element show its covered part to about 2 %
        assert np.median(np.abs(power / volumes / expected - 1)) < 0.02
    if contrast > 1:
        mixed = np.einsum("ei,eij,ej->e", along, matrices, through) / volumes
        assert np.median(np.abs(mixed)) < 0.02


def test_tensors_stay_between_the_means(coarse):
    """Two touches in one element and an overlap, too: the greater principal value is at most the
    largest conductivity, the lesser at least a thousandth."""
    touches = [
        TrueTouch(0, 0, 9, 5.0),
        TrueTouch(18.5, 0, 9, 0.1),
        TrueTouch(0, 12, 9, 0.3),
        TrueTouch(3, 4, 6, 0.001),
    ]
    change = Cover(coarse.mesh).change(touches)
    values = np.linalg.eigvalsh(change.tensor[:, [[0, 2], [2, 1]]])
    assert values.min() >= 1e-3 - 1e-12
    assert coarse.voltages(with_touches(np.full(coarse.mesh.n_elements, 0.01), change)).all()


def test_nothing_is_computed_without_touches(coarse):
    sheet = np.full(coarse.mesh.n_elements, 0.01)
    cover = Cover(coarse.mesh)
    assert cover.change([]) is NO_CHANGE
    assert cover.change([TrueTouch(0, 0, 9, 1.0)]) is NO_CHANGE
    assert with_touches(sheet, NO_CHANGE) is sheet


def test_a_skin_that_is_turned_as_a_whole_measures_the_same(coarse):
    """A deformation moves the edges of touches with the skin."""
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    mesh = replace(coarse.mesh, nodes_mm=coarse.mesh.nodes_mm @ turn.T)
    turned = ForwardModel(mesh, SKIN, PROTOCOL)
    touches, cover = _drawn(TouchRules(shape="ellipse"), 1)[0].touches, Cover(coarse.mesh)
    sheet = np.full(mesh.n_elements, 0.01)
    flat_v = coarse.voltages(with_touches(sheet, cover.change(touches)))
    turned_v = turned.voltages(with_touches(sheet, cover.deformed(turn).change(touches)))
    assert turned_v == pytest.approx(flat_v, rel=1e-9)


def test_a_tensor_of_one_number_is_the_number(coarse):
    values = np.linspace(0.005, 0.02, coarse.mesh.n_elements)
    tensors = values[:, None] * np.array([1.0, 1.0, 0.0])
    assert coarse.voltages(tensors) == pytest.approx(coarse.voltages(values), rel=1e-12)


def test_a_conductivity_that_lets_current_in_one_direction_only_is_refused(coarse):
    flat = np.tile([1.0, 1.0, 1.0], (coarse.mesh.n_elements, 1))
    with pytest.raises(UsageError, match="finite and above 0"):
        coarse.voltages(flat)
    with pytest.raises(UsageError, match="a tensor"):
        coarse.voltages(flat[:, :2])
