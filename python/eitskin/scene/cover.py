"""Compute which elements of a mesh touches cover, and how they change the conductivity of each.

The mean conductivity of an element that the edge of a touch cuts makes the touch too large: at
11,000 elements a frame is 8 to 12 % off. In an immersed finite element (Li, Lin and Wu, Numer.
Math. 96, 2003) the potential has a kink on the edge, such that the current through the edge and the
voltage along it are continuous. With linear functions, this is an ordinary element with a tensor as
its conductivity. For a conductivity that depends only on the distance d along the edge's normal n,

    tensor = mean(sigma) M'M + mean(1 / sigma) n n' / (n'W)^2,  M = 1 - W n' / (n'W)

where W is the gradient of the linear function that equals Phi(d) at the corners, dPhi/dd = 1 /
sigma. W = mean(1 / sigma) n is a mixture of thin layers: the arithmetic mean along them, and the
harmonic mean across. It is used for smooth profiles, for elements that several touches share, and
for insulating touches, where it is better. tests/python/scene/test_cut_elements.py states the
errors.
"""

from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np

from eitskin.arrays import BoolArray, FloatArray, IntArray
from eitskin.fem.mesh import Mesh
from eitskin.fem.shaped_touch import centres_of_parts
from eitskin.scene.chart import PlaneChart, SurfaceChart
from eitskin.scene.random_touches import TrueTouch

SUBDIVISION = 8
MIN_FACTOR = 1e-3
ISOTROPIC = np.array([1.0, 1.0, 0.0])


@dataclass(frozen=True, eq=False)
class Change:
    """The elements (e,), ascending, whose conductivity touches multiply by ``tensor`` (e, 3), in
    the order xx, yy, xy; ``mean`` (e,) is the mean factor over the area of each element."""

    elements: IntArray
    mean: FloatArray
    tensor: FloatArray


NO_CHANGE = Change(np.zeros(0, np.int64), np.zeros(0), np.zeros((0, 3)))


def with_touches(background: FloatArray, change: Change) -> FloatArray:
    """Return the conductivity of a skin with ``background`` (E,) and touches: (E, 3), or (E,)
    without touches."""
    if not len(change.elements):
        return background
    conductivity = background[:, None] * ISOTROPIC
    conductivity[change.elements] = background[change.elements, None] * change.tensor
    return np.asarray(conductivity)


class Cover:
    """Finds the elements under touches on one mesh. Whatever does not depend on the touch is
    computed once.

    Each element near the disc is split into ``subdivision`` squared equal triangles; the touch is
    evaluated at their centres. On a surface, a touch has its centre at a place of the flattened
    copy and its shape on the surface, by distances in space.
    """

    def __init__(self, mesh: Mesh, subdivision: int = SUBDIVISION) -> None:
        self.mesh, self._weights = mesh, centres_of_parts(subdivision)
        self._chart: PlaneChart | SurfaceChart = (
            PlaneChart(mesh) if mesh.surface is None else SurfaceChart(mesh, mesh.surface)
        )
        self._corners = self._chart.element_corners
        self._deformation: FloatArray | None = None

    def deformed(self, matrix: FloatArray) -> "Cover":
        """Return the cover of the skin that is deformed by ``matrix`` (2, 2) from what it is here.
        Touches move with the material."""
        other = copy(self)
        other._deformation = matrix if self._deformation is None else matrix @ self._deformation
        return other

    def of(self, touch: TrueTouch) -> tuple[IntArray, FloatArray]:
        """Return the elements (e,) that ``touch`` meets, ascending, and the covered part of each
        (e,), in (0, 1]. For a shape this is its mean change in the element relative to that in its
        middle."""
        near = self._chart.near(touch)
        part = touch.change_at(self._chart.around(touch, near, self._weights)).mean(axis=1)
        met = part > 0
        return near[met], part[met]

    def change(self, touches: Iterable[TrueTouch]) -> Change:
        """Return how ``touches`` change the conductivity.

        If touches share an element, their changes add; the factor is at least a thousandth
        everywhere.
        """
        given = [touch for touch in touches if touch.contrast != 1.0]
        near = [self._chart.near(touch) for touch in given]
        if not sum(map(len, near)):
            return NO_CHANGE
        elements = np.unique(np.concatenate(near))
        places = [np.searchsorted(elements, own) for own in near]
        sigma, normal, sharp = self._inside(elements, given, places)
        met = np.flatnonzero((sigma != 1.0).any(axis=1))
        elements, sigma, normal = elements[met], sigma[met], normal[met]
        corners = self._corners[elements]
        if self._deformation is not None:
            corners = corners @ self._deformation.T
            normal = normal @ np.linalg.inv(self._deformation)
        normal = _unit(normal)
        tensor = _tensors(corners, sigma, normal, sharp[met])
        return Change(elements, sigma.mean(axis=1), tensor)

    def _inside(
        self, elements: IntArray, touches: Sequence[TrueTouch], places: Sequence[IntArray]
    ) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Return the factor at the points of each of ``elements`` (e, s), the direction in which it
        grows most (e, 2), and whether one touch alone varies within the element and conducts better
        than the skin (e,). ``places`` are those of the elements near each touch."""
        sigma = np.ones((len(elements), len(self._weights)))
        edges = np.zeros(len(elements), np.int64)
        normal, most = np.zeros((len(elements), 2)), np.zeros(len(elements))
        conducts = np.zeros(len(elements), np.bool_)
        for touch, near in zip(touches, places, strict=True):
            points = self._chart.around(touch, elements[near], self._weights)
            own = (touch.contrast - 1.0) * touch.change_at(points)
            sigma[near] += own
            step = np.ptp(own, axis=1)
            edges[near] += step > 0
            wins = near[step > most[near]]
            most[near] = np.maximum(most[near], step)
            conducts[wins] = touch.contrast > 1
            outward = self._chart.outward(touch, elements[wins])
            normal[wins] = np.sign(1.0 - touch.contrast) * outward
        return np.maximum(sigma, MIN_FACTOR), normal, conducts & (edges == 1)


def _tensors(
    corners: FloatArray, sigma: FloatArray, normal: FloatArray, sharp: BoolArray
) -> FloatArray:
    """Return the tensors (e, 3) of elements with these corners (e, 3, 2), factors at points of
    equal area (e, s), and directions (e, 2) in which the factor grows.

    A ``sharp`` element (e,) with two conductivities has the edge as a straight line at the place
    that gives both their areas. Every other one is a mixture of thin layers.
    """
    low, high = sigma.min(axis=1), sigma.max(axis=1)
    mean, resistance = sigma.mean(axis=1), (1 / sigma).mean(axis=1)
    kink = resistance[:, None] * normal
    is_low = sigma == low[:, None]
    cut = np.flatnonzero(sharp & (is_low | (sigma == high[:, None])).all(axis=1))
    away = (corners[cut] * normal[cut, None]).sum(axis=2)
    away -= _line(away, is_low[cut].mean(axis=1))[:, None]
    potential = away / np.where(away < 0, low[cut, None], high[cut, None])
    bent = _gradient(corners[cut], potential)
    across = (bent * normal[cut]).sum(axis=1)
    # an obtuse element can leave this range; the formula then has no meaning
    good = (across >= 1 / high[cut]) & (across <= 1 / low[cut])
    kink[cut[good]] = bent[good]
    across = (kink * normal).sum(axis=1)
    # M turns a field into one along the edge, so M'M and n n' are squares of two vectors
    edge = np.column_stack([-normal[:, 1], normal[:, 0]])
    through = normal / across[:, None]
    along = edge - (kink * edge).sum(axis=1)[:, None] * through
    of_along, of_through = (v[:, [0, 1, 0]] * v[:, [0, 1, 1]] for v in (along, through))
    return np.asarray(mean[:, None] * of_along + resistance[:, None] * of_through)


def _gradient(corners: FloatArray, values: FloatArray) -> FloatArray:
    """Return the gradients (e, 2) of the linear functions with ``values`` (e, 3) at the corners (e,
    3, 2) of triangles."""
    (u_x, u_y), (v_x, v_y) = ((corners[:, k] - corners[:, 0]).T for k in (1, 2))
    u, v = values[:, 1] - values[:, 0], values[:, 2] - values[:, 0]
    both = np.column_stack([u * v_y - v * u_y, v * u_x - u * v_x])
    return np.asarray(both / (u_x * v_y - u_y * v_x)[:, None])


def _line(away: FloatArray, share: FloatArray) -> FloatArray:
    """Return the distance (e,) below which ``share`` (e,) of the area of triangles lies whose
    corners have the distances ``away`` (e, 3)."""
    first, second, third = np.sort(away, axis=1).T
    whole = third - first
    rising = first + np.sqrt(share * (second - first) * whole)
    falling = third - np.sqrt((1 - share) * (third - second) * whole)
    return np.asarray(np.where(share * whole <= second - first, rising, falling))


def _unit(vectors: FloatArray) -> FloatArray:
    """Return ``vectors`` (e, 2) with length 1; one without direction becomes (1, 0)."""
    length = np.hypot(vectors[:, 0], vectors[:, 1])[:, None]
    return np.where(length > 0, vectors / np.where(length > 0, length, 1.0), [1.0, 0.0])
