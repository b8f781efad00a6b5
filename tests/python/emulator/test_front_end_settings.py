"""Source and gain are settings: other parts are fitted and named, and the same image tares and
streams other skins. What the parts do not serve is refused with the value to change."""

import numpy as np
import pytest
from test_emulated_patterns import board_before

from eitskin.device.wire.link_table import Setting, Stream
from eitskin.device.wire.packets import RawFrame, SolvedTouches
from eitskin.errors import DeviceError
from eitskin.frames.front_end import Demand, suitable
from emulated import board_of, clean, connect, power_up

# times the greatest row of the paper's skin, 0.8 kohm: dishes by their conductivity, and a foil
SKINS = {
    "the paper's skin": 1.0,
    "dish of .05 S/m": 0.31,
    "dish of .5 S/m": 0.031,
    "dish of 2 S/m": 0.0077,
    "foil of 50 kohm a square": 5.8,
}
EXTREMES = ("the paper's skin", "dish of 2 S/m", "foil of 50 kohm a square")
PAPER_ROW_OHM, PAPER_DRIVE_OHM = 800.0, 19_000.0


class Scaled:
    """A scene's frames on a skin that conducts better or worse."""

    def __init__(self, frames, factor):
        self.frames, self.factor = frames, factor

    def __len__(self):
        return len(self.frames)

    def __getitem__(self, frame):
        return self.factor * self.frames[frame]


@pytest.fixture(scope="module")
def device(image):
    """A board that scans each pair of reciprocal rows once, which is half to emulate."""
    made = connect(power_up(image))
    made.scan(check_every=0)
    return made


def before_skin(device, factor: float, untouched, frames) -> None:
    skin = board_of(device).skin
    skin.untouched_v, skin.frames_v = factor * untouched, Scaled(frames, factor)
    skin._shown, skin._began, skin._frame = skin.untouched_v[0], None, -1


def fit(device, current_a: float, gain: float) -> None:
    front_end = board_of(device).front_end
    front_end.source_a, front_end.gain = current_a, gain


@pytest.fixture(scope="module")
def paper(device):
    skin = board_of(device).skin
    return skin.untouched_v, skin.frames_v


def touches(device) -> list[tuple[float, float]]:
    solved = [
        one for one in device.stream(Stream.TOUCHES, frames=4) if isinstance(one, SolvedTouches)
    ]
    return sorted((touch.x_mm, touch.y_mm) for touch in solved[-1].touches)


@pytest.mark.parametrize(
    "names", [EXTREMES, pytest.param(tuple(SKINS), marks=pytest.mark.long("the extremes"))]
)
def test_other_parts_serve_other_skins_without_a_new_image(device, paper, names):
    places = {}
    for name in names:
        factor = SKINS[name]
        before_skin(device, factor, *paper)
        parts = suitable(Demand(factor * PAPER_ROW_OHM, factor * PAPER_DRIVE_OHM))
        fit(device, parts.current_a, parts.gain)
        before = device.info()
        info = device.settings(Setting(0), source_ua=round(1e6 * parts.current_a), gain=parts.gain)
        changed = info.volts_per_code_nv != before.volts_per_code_nv
        assert info.gain == pytest.approx(parts.gain, abs=1e-6)
        assert not (changed and info.tared), "the reference is of other volts"
        device.tare(4)
        assert device.unserved() is None, name
        device.start_scene()
        places[name] = touches(device)
    assert len(places["the paper's skin"]) == 2
    for name, found in places.items():
        assert np.allclose(found, places["the paper's skin"], atol=1.0), (name, found)
    device.reset()
    assert device.board.gain == pytest.approx(parts.gain, abs=1e-6)  # kept without power
    clean(board_of(device))


def test_a_skin_that_the_parts_do_not_serve_is_refused_with_the_value_to_change(device, paper):
    fit(device, 0.5e-3, 3.0)
    device.settings(Setting(0), source_ua=0, gain=0)
    before_skin(device, SKINS["foil of 50 kohm a square"], *paper)
    with pytest.raises(DeviceError, match=r"exceed .* fit R_G \(R52\) of 19,800 ohm.*--gain 1.5"):
        device.tare(4)
    before_skin(device, SKINS["dish of 2 S/m"], *paper)
    wrong = device.unserved()
    assert wrong is not None and "reaches 9" in wrong and "source resistor (R13)" in wrong
    assert "--gain 100 --source-ua" in wrong


@pytest.mark.parametrize("drive", ["skip-3", "opposite"])
def test_wide_pairs_on_the_papers_skin_need_a_smaller_gain_alone(image, tmp_path, drive):
    device, _ = board_before(tmp_path, image, drive, conductivity=0.01)
    fit(device, 0.15e-3, 1.0)
    device.settings(Setting(0), source_ua=150, gain=1.0)
    device.tare(4)
    assert device.unserved() is None
    device.start_scene()
    (raw,) = (one for one in device.stream(Stream.RAW, frames=1) if isinstance(one, RawFrame))
    assert not any(raw.quality)
    assert touches(device) == [pytest.approx((30.0, -20.0), abs=3)]


def test_the_owner_locks_source_and_gain(device):
    device.settings(Setting.LOCKED)
    with pytest.raises(DeviceError, match="hold the blue button"):
        device.settings(Setting.LOCKED, gain=10.0)
    board_of(device).hold_button(True)
    device.settings(Setting(0))
    board_of(device).hold_button(False)
    with pytest.raises(DeviceError, match=r"70[05]0"):
        device.settings(Setting(0), source_ua=9000)


def test_a_button_that_pulls_low_locks_once_the_board_knows(device):
    board = board_of(device)
    board.button_low = True
    board.hold_button(False)
    assert device.info().button == 1  # as if it were held: a lock would protect nothing
    device.settings(Setting.LOCKED | Setting.BUTTON_LOW)
    with pytest.raises(DeviceError, match="hold the blue button"):
        device.settings(Setting(0))
    board.hold_button(True)
    device.settings(Setting(0))
    board.button_low = False
    board.hold_button(False)
