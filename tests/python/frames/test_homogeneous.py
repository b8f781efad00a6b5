"""The predicted homogeneous frame: its symmetries, the finite-element model, and the touch
response."""

from dataclasses import replace

import numpy as np
import pytest

from eitskin.errors import UsageError
from eitskin.frames.homogeneous import (
    disk_transfer,
    homogeneous,
    shorted,
    shorted_frames,
    touch_transfer,
    voltages_of,
)
from eitskin.frames.orders import electrode_map, relabel
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import polygon
from eitskin.skin.protocol import adjacent, opposite
from eitskin.skin.skin import Skin, paper_skin

ROWS = adjacent(16).drive_measure.astype(np.int64)


def test_point_electrodes_give_the_logarithm_of_the_cross_ratio():
    angles = np.arange(16) * np.pi / 8
    points = np.exp(1j * angles)
    a, b, c, d = points[ROWS].T
    exact = -np.log(np.abs((c - a) * (d - b) / ((d - a) * (c - b)))) / np.pi
    assert np.allclose(voltages_of(disk_transfer(angles, 1e-6), ROWS), exact, atol=1e-9)


def test_symmetric_rows_are_equal_and_reciprocal():
    frame = homogeneous(None, 16).voltages(ROWS)
    assert (frame < 0).all()
    for rotate, mirror in ((1, False), (5, True)):
        assert np.allclose(
            homogeneous(None, 16).voltages(relabel(ROWS, electrode_map(16, rotate, mirror))), frame
        )
    assert np.allclose(homogeneous(None, 16).voltages(ROWS[:, [2, 3, 0, 1]]), frame)
    assert np.allclose(homogeneous(None, 16).voltages(ROWS[:, [1, 0, 2, 3]]), -frame)


def test_closed_form_agrees_with_finite_elements():
    from eitskin.frames.homogeneous_fem import FemPrediction

    skin = paper_skin()
    fem = FemPrediction(skin)
    for protocol in (adjacent(16), opposite(16)):
        rows = protocol.drive_measure.astype(np.int64)
        closed, solved = homogeneous(skin, 16).voltages(rows), voltages_of(fem.transfer_ohm(), rows)
        assert np.abs(closed - solved).max() < 0.01 * np.abs(solved).max()
    xy, radius, sign = (
        np.array([[30.0, 40.0], [-50.0, 10.0]]),
        np.array([8.0, 6.0]),
        np.array([1, -1], dtype=np.int8),
    )
    closed = voltages_of(touch_transfer(skin, xy, radius, sign), ROWS)
    solved = voltages_of(fem.touch_transfer(xy, radius, sign), ROWS)
    assert np.corrcoef(closed, solved)[0, 1] > 0.98


def test_a_touch_beside_the_first_electrodes_changes_their_channels_most():
    skin = paper_skin()
    centre = 0.85 * skin.electrode_centres_mm()[[0]]
    change = voltages_of(
        touch_transfer(skin, centre, np.array([5.0]), np.array([1], dtype=np.int8)), ROWS
    )
    strongest = ROWS[np.argsort(-np.abs(change))[:8]]
    assert (strongest == 0).any(axis=1).all()
    frame = homogeneous(skin, 16).voltages(ROWS)
    lateral = np.argmax(np.abs(change))
    assert np.sign(change[lateral]) != np.sign(frame[lateral])


def test_joined_electrodes_have_one_potential():
    transfer = shorted(homogeneous(None, 16).transfer_ohm, 3, 9)
    between = np.array([[0, 1, 3, 9], [5, 12, 3, 9], [3, 9, 0, 1]])
    assert np.allclose(voltages_of(transfer, between), 0, atol=1e-12)


def test_frames_of_several_joined_pairs_are_those_of_each():
    transfer, pairs = homogeneous(None, 16).transfer_ohm, np.array([[3, 9], [0, 1]])
    each = [voltages_of(shorted(transfer, i, j), ROWS) for i, j in pairs]
    assert np.allclose(shorted_frames(transfer, pairs, ROWS), each, atol=1e-12)


def test_other_outlines_use_finite_elements_and_scale_with_the_sheet():
    corners = [(-60.0, -40.0), (70.0, -40.0), (70.0, 30.0), (10.0, 60.0), (-60.0, 40.0)]
    skin = Skin("odd", polygon(corners), Electrodes(count=8))
    rows = adjacent(8).drive_measure.astype(np.int64)
    predicted = homogeneous(skin, 8)
    assert predicted.source == "finite elements"
    thicker = homogeneous(replace(skin, thickness_mm=2 * skin.thickness_mm), 8)
    assert np.allclose(2 * thicker.voltages(rows), predicted.voltages(rows), rtol=1e-6)
    turned = predicted.voltages(relabel(rows, electrode_map(8, 1)))
    assert np.corrcoef(turned, predicted.voltages(rows))[0, 1] < 0.99


def test_another_number_of_electrodes_is_refused():
    with pytest.raises(UsageError, match="has 16 electrodes, the frames have 8"):
        homogeneous(paper_skin(), 8)
