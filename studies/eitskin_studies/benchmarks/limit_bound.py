"""The Cramer-Rao bound of touches on a round skin: the least covariance that an estimate without
bias can have.

The data are one frame and the tare, with independent normal noise in all rows. The unknowns are,
for each touch, the centre, the logarithm of the radius and the amplitude q = 2 (c - 1) / (c + 1) of
its contrast c; for a touch of another shape also e1 and e2, (a - b) / (a + b) times the cosine and
sine of twice the angle, of its half axes a and b; and the logarithm of each contact's impedance.
Radius, amplitude, shape and contacts have priors, whose precision adds to the information of the
data (H. L. van Trees, Detection, Estimation and Modulation Theory, part I, 1968, section 2.4).
Centres have no prior.

Frames and slopes are exact (``eitskin.oracle.round_skin``): a mesh of 12,000 elements makes the
bound 20 % too small.
"""

import typing
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.oracle.round_skin import RoundSkin
from eitskin.scene.random_touches import TrueTouch
from eitskin.scene.touch_shape import TouchShape
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin
from eitskin_studies.experiments.electrodes.patterns import from_transfer, transfer

STEPS = (0.05, 0.05, 0.003, 0.005, 0.01, 0.01)  # x and y in mm, log radius, q, e1, e2
CONTACT_STEP = 0.05
# The deviations that the core's joint fit assumes (tables/constants.toml, module "joint").
LOG_RADIUS_SD, AMPLITUDE_SD, SHAPE_SD = 0.3, 0.17, 0.15
NORMALS = np.random.default_rng(0).standard_normal((4000, 2))


@dataclass(frozen=True, eq=False)
class ExactScene:
    """A scene with its exact voltages in V, and how they change. All rows are those of
    ``transfer``, t = L^2 of them.

    Attributes:
        touches: the true touches.
        untouched_v, touched_v: (t,) without and with the touches.
        slopes_v: (p, t) the derivatives of ``touched_v``, all parameters of one touch after the
            other.
        contact_slopes_v: (2, L, t) the derivatives of ``untouched_v`` and of ``touched_v`` by the
            logarithm of each contact's impedance.
    """

    touches: tuple[TrueTouch, ...]
    untouched_v: FloatArray
    touched_v: FloatArray
    slopes_v: FloatArray
    contact_slopes_v: FloatArray


@dataclass(frozen=True, eq=False)
class Bound:
    """The bound of one touch: the covariance (2, 2) of its centre in mm^2, and the deviation of the
    logarithm of its radius."""

    covariance_mm2: FloatArray
    log_radius_sd: float

    @cached_property
    def distances_mm(self) -> FloatArray:
        """Distances (d,) from the true centre of normal errors with this covariance."""
        errors = NORMALS @ np.linalg.cholesky(self.covariance_mm2).T
        return np.asarray(np.hypot(*errors.T))

    @cached_property
    def median_mm(self) -> float:
        """The median of ``distances_mm``."""
        return float(np.median(self.distances_mm))


def exact_scene(
    skin: Skin, touches: tuple[TrueTouch, ...], contact_ohm_m2: FloatArray
) -> ExactScene:
    """Solve a scene and its slopes, by central differences for touches and forward differences for
    contacts.

    Raises:
        GeometryError: the skin is not round.
        UsageError: a touch reaches the rim.
    """
    protocol = transfer(skin.electrodes.count)
    model = RoundSkin(skin, protocol, contact_ohm_m2)
    both = np.array([model.voltages(()), model.voltages(touches)])
    contacts = []
    for k in range(len(contact_ohm_m2)):
        changed = contact_ohm_m2.copy()
        changed[k] *= np.exp(CONTACT_STEP)
        other = RoundSkin(skin, protocol, changed)
        contacts.append(np.array([other.voltages(()), other.voltages(touches)]) - both)
    return ExactScene(
        touches,
        both[0],
        both[1],
        touch_slopes_v(model, touches),
        np.array(contacts).transpose(1, 0, 2) / CONTACT_STEP,
    )


class SolvedSkin(typing.Protocol):
    """A skin whose voltages (m,) with touches can be calculated."""

    def voltages(self, touches: Sequence[TrueTouch]) -> FloatArray: ...


def touch_slopes_v(
    model: SolvedSkin, touches: Sequence[TrueTouch], steps: Sequence[float] = STEPS
) -> FloatArray:
    """Return the derivatives (p, m) of the voltages by all parameters of one touch after the other,
    by central differences with ``steps``."""
    slopes = [
        (model.voltages(ahead) - model.voltages(back)) / (2 * step)
        for ahead, back, step in _neighbours(touches, steps)
    ]
    return np.array(slopes)


def bounds(
    scene: ExactScene,
    protocol: Protocol,
    sigma_v: float,
    tare_frames: int,
    contact_sd: float,
    amplitude_sd: float = AMPLITUDE_SD,
) -> list[Bound]:
    """Return the bound of each touch of ``scene`` for one frame of ``protocol`` with noise
    ``sigma_v``, after a tare of ``tare_frames`` such frames."""
    touch_rows = from_transfer(scene.slopes_v, protocol) / sigma_v
    tare, frame = from_transfer(scene.contact_slopes_v, protocol) / sigma_v
    tare = tare * np.sqrt(tare_frames)
    slopes = np.block([[touch_rows, np.zeros_like(touch_rows)], [frame, tare]])
    return bounds_of(slopes, scene.touches, amplitude_sd, [contact_sd] * len(tare))


def bounds_of(
    slopes: FloatArray,
    touches: Sequence[TrueTouch],
    amplitude_sd: float = AMPLITUDE_SD,
    nuisance_sd: Sequence[float] = (),
) -> list[Bound]:
    """Return the bound of each touch from data whose noise has the deviation 1: ``slopes`` (p, m)
    are theirs by the parameters of the touches, then by nuisances whose priors have the deviations
    ``nuisance_sd``."""
    sizes = [_parameter_count(touch) for touch in touches]
    own = (np.inf, np.inf, LOG_RADIUS_SD, amplitude_sd, SHAPE_SD, SHAPE_SD)
    prior_sd = [*(sd for size in sizes for sd in own[:size]), *nuisance_sd]
    information = slopes @ slopes.T + np.diag(np.array(prior_sd) ** -2.0)
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    starts = np.cumsum([0, *sizes[:-1]])
    return [
        Bound(covariance[k : k + 2, k : k + 2], float(np.sqrt(covariance[k + 2, k + 2])))
        for k in starts
    ]


def _neighbours(
    touches: Sequence[TrueTouch], steps: Sequence[float]
) -> Iterator[tuple[tuple[TrueTouch, ...], tuple[TrueTouch, ...], float]]:
    """Yield, for each parameter of each touch, the scene one step ahead, one step back, and the
    step."""
    for k, touch in enumerate(touches):
        for parameter in range(_parameter_count(touch)):
            step = steps[parameter]
            ahead, back = (
                (*touches[:k], _moved(touch, parameter, by), *touches[k + 1 :])
                for by in (step, -step)
            )
            yield ahead, back, step


def _parameter_count(touch: TrueTouch) -> int:
    return 4 if touch.shape is None else 6


def _moved(touch: TrueTouch, parameter: int, by: float) -> TrueTouch:
    """Return ``touch`` with one parameter changed."""
    if parameter < 2:
        name = ("x_mm", "y_mm")[parameter]
        return replace(touch, **{name: getattr(touch, name) + by})
    if parameter == 2:
        return replace(touch, radius_mm=touch.radius_mm * float(np.exp(by)))
    if parameter == 3:
        q = 2 * (touch.contrast - 1) / (touch.contrast + 1) + by
        return replace(touch, contrast=(2 + q) / (2 - q))
    shape = touch.shape or TouchShape()
    eta = (shape.aspect - 1) / (shape.aspect + 1) * np.exp(2j * np.radians(shape.angle_deg))
    eta += by if parameter == 4 else 1j * by
    aspect = (1 + abs(eta)) / (1 - abs(eta))
    angle_deg = float(np.degrees(np.angle(eta))) / 2
    return replace(touch, shape=replace(shape, aspect=float(aspect), angle_deg=angle_deg))
