"""The GREIT figures of merit of the image of one small target.

A. Adler et al., "GREIT: a unified approach to 2D linear EIT reconstruction of lung images",
Physiol. Meas. 30 (2009) S35-S55, doi 10.1088/0967-3334/30/6/S03, section 2.3. All rest on the
quarter-amplitude set: the pixels with at least a quarter of the image's largest value.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from eitskin.errors import UsageError


@dataclass(frozen=True)
class FiguresOfMerit:
    """Of one image and its target.

    Attributes:
        amplitude_response: AR, integrated change in the image / that of the target; 1 is right.
        position_error_mm: PE, the target's distance from the centre minus that of the image's
            centre of gravity; 0 is right, above 0: drawn to the centre.
        displacement_mm: distance from the target to the image's centre of gravity (not in GREIT,
            which looks along the radius only).
        resolution: RES, sqrt(area of the quarter-amplitude set / area of the medium); small is
            sharp.
        shape_deformation: SD, fraction of the quarter-amplitude set outside a circle of equal area
            about its centre.
        ringing: RNG, size of the change of the opposite sign outside that circle / the change
            inside; 0 is right.
    """

    amplitude_response: float
    position_error_mm: float
    displacement_mm: float
    resolution: float
    shape_deformation: float
    ringing: float


def figures_of_merit(
    values: npt.ArrayLike,
    centres_mm: npt.NDArray[np.float64],
    pixel_mm: float,
    target_mm: tuple[float, float],
    target_radius_mm: float,
    target_change: float,
    medium_centre_mm: tuple[float, float] = (0.0, 0.0),
) -> FiguresOfMerit:
    """The figures of one image.

    Args:
        values: (n,) pixel values, in the unit of ``target_change``. A resistive target
            (``target_change`` below 0) is judged with both signs turned round.
        centres_mm: (n, 2) pixel centres; together the n pixels are the medium.
        pixel_mm: side of a pixel.
        target_mm: centre of the target disc.
        target_radius_mm: its radius.
        target_change: its conductivity minus the medium's.
        medium_centre_mm: the point to which PE refers.

    Raises:
        UsageError: the image has no value of the target's sign, or the target has no change or no
            area.
    """
    if target_change == 0 or not target_radius_mm > 0:
        raise UsageError(
            "figures of merit need a target with a change other than 0 and a radius above 0"
        )
    image = np.asarray(values, dtype=np.float64) * math.copysign(1.0, target_change)
    top = float(image.max())
    if not top > 0:
        raise UsageError(
            "this image has no change of the target's sign, so it has no figures of merit"
        )
    quarter = image >= top / 4
    centre = centres_mm[quarter].mean(axis=0)
    area = float(np.count_nonzero(quarter)) * pixel_mm**2
    circle = ((centres_mm - centre) ** 2).sum(axis=1) <= area / math.pi
    inside = float(image[circle].sum())
    target, medium = np.asarray(target_mm), np.asarray(medium_centre_mm)
    return FiguresOfMerit(
        amplitude_response=float(image.sum())
        * pixel_mm**2
        / (abs(target_change) * math.pi * target_radius_mm**2),
        position_error_mm=float(np.linalg.norm(target - medium) - np.linalg.norm(centre - medium)),
        displacement_mm=float(np.linalg.norm(target - centre)),
        resolution=math.sqrt(np.count_nonzero(quarter) / len(image)),
        shape_deformation=float(np.count_nonzero(quarter & ~circle) / np.count_nonzero(quarter)),
        ringing=float(-image[~circle & (image < 0)].sum() / inside) if inside > 0 else math.inf,
    )
