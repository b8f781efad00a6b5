"""The GREIT figures on images whose figures are known beforehand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eitskin.errors import UsageError
from eitskin.fem.grid import grid_for
from eitskin.scoring.figures_of_merit import figures_of_merit
from eitskin.skin.outline import disk

GRID = grid_for(disk(194.0), 194)
XY = GRID.centres_mm()


def disc(x: float, y: float, radius: float) -> np.ndarray:
    return ((XY - (x, y)) ** 2).sum(axis=1) <= radius**2


def test_ideal_disc_scores_ideally() -> None:
    figures = figures_of_merit(0.05 * disc(30, 20, 12), XY, GRID.pixel_mm, (30, 20), 12.0, 0.05)
    assert figures.amplitude_response == pytest.approx(1.0, abs=0.02)
    assert figures.position_error_mm == pytest.approx(0.0, abs=0.05)
    assert figures.displacement_mm == pytest.approx(0.0, abs=0.05)
    assert figures.resolution == pytest.approx(12 / 97, rel=0.01)
    assert figures.shape_deformation == pytest.approx(0.0, abs=0.02)
    assert figures.ringing == 0.0


def test_resistive_target_is_the_same_turned_round() -> None:
    image = 0.05 * disc(30, 20, 12) - 0.01 * disc(-40, 0, 6)
    one = figures_of_merit(image, XY, GRID.pixel_mm, (30, 20), 12.0, 0.05)
    assert figures_of_merit(-image, XY, GRID.pixel_mm, (30, 20), 12.0, -0.05) == one


def test_image_drawn_to_the_centre_has_positive_position_error() -> None:
    figures = figures_of_merit(1.0 * disc(36, 0, 10), XY, GRID.pixel_mm, (40, 0), 10.0, 1.0)
    assert figures.position_error_mm == pytest.approx(4.0, abs=0.05)
    turned = figures_of_merit(1.0 * disc(0, 40, 10), XY, GRID.pixel_mm, (40, 0), 10.0, 1.0)
    assert turned.position_error_mm == pytest.approx(0.0, abs=0.05)
    assert turned.displacement_mm == pytest.approx(40 * math.sqrt(2), abs=0.1)


def test_only_a_quarter_of_the_peak_counts_as_target() -> None:
    image = 1.0 * disc(0, 0, 10) + 0.24 * disc(0, 50, 10)
    assert figures_of_merit(
        image, XY, GRID.pixel_mm, (0, 0), 10.0, 1.0
    ).resolution == pytest.approx(10 / 97, rel=0.02)
    image = 1.0 * disc(0, 0, 10) + 0.26 * disc(0, 50, 10)
    figures = figures_of_merit(image, XY, GRID.pixel_mm, (0, 0), 10.0, 1.0)
    assert figures.resolution == pytest.approx(math.sqrt(2) * 10 / 97, rel=0.02)
    assert figures.displacement_mm == pytest.approx(25.0, abs=0.1)


def test_shape_deformation_of_a_square_is_its_corners() -> None:
    """A square of side a and its circle of equal area: the part of the square outside, over a^2, is
    0.0905."""
    radius = 1 / math.sqrt(math.pi)
    corner = 4 * (radius**2 * math.acos(0.5 / radius) - 0.5 * math.sqrt(radius**2 - 0.25))
    image = (np.abs(XY) <= 30).all(axis=1) * 1.0
    figures = figures_of_merit(image, XY, GRID.pixel_mm, (0, 0), 30.0, 1.0)
    assert corner == pytest.approx(0.0905, abs=1e-3)
    assert figures.shape_deformation == pytest.approx(corner, abs=0.01)


def test_ringing_is_negative_outside_over_sum_inside() -> None:
    image = 1.0 * disc(0, 0, 10) - 0.5 * disc(50, 0, 10)
    figures = figures_of_merit(image, XY, GRID.pixel_mm, (0, 0), 10.0, 1.0)
    assert figures.ringing == pytest.approx(0.5, abs=0.01)
    assert figures.amplitude_response == pytest.approx(0.5, abs=0.02)


def test_no_target_no_figures() -> None:
    with pytest.raises(UsageError, match="no change of the target's sign"):
        figures_of_merit(-np.ones(len(XY)), XY, GRID.pixel_mm, (0, 0), 10.0, 1.0)
    with pytest.raises(UsageError, match="change other than 0"):
        figures_of_merit(np.ones(len(XY)), XY, GRID.pixel_mm, (0, 0), 10.0, 0.0)
