"""A board's reference is not taken under a finger; a tare can be undone; a finger that lifts after
a tare under it is named."""

from collections.abc import Iterator

import pytest
from device_helpers import UNTOUCHED, sim_board, sim_device

from eitskin.cli.main import main
from eitskin.device.client import Device
from eitskin.device.wire.link_table import Stream
from eitskin.device.wire.packets import SolvedTouches
from eitskin.errors import DeviceError, SkinTouchedError
from eitskin.session import set_up
from eitskin.session.set_up import take_reference, wait_untouched


@pytest.fixture
def touched() -> Iterator[Device]:
    """A board with a reference, and a finger near (-40, 10) mm that stays (its mesh is
    coarse)."""
    with sim_device(sim_board()) as device:
        device.tare(UNTOUCHED)
        device.start_scene()
        next(iter(device.stream(Stream.TOUCHES, frames=1)))
        yield device


def places(device: Device) -> list[tuple[float, float]]:
    """Return the places of the touches in the second of the next two frames."""
    frames = [one for one in device.stream(frames=2) if isinstance(one, SolvedTouches)]
    return [(touch.x_mm, touch.y_mm) for touch in frames[-1].touches]


@pytest.mark.parametrize("streamed", [False, True])
def test_a_tare_under_a_finger_is_refused(touched, streamed):
    with pytest.raises(SkinTouchedError, match=r"touches the skin at \(-3\d, \d+\) mm; lift it"):
        take_reference(touched, UNTOUCHED, streamed=streamed)
    assert places(touched)[0] == pytest.approx((-40, 10), abs=4)
    assert not touched.can_undo_tare


def test_a_tare_is_undone(touched):
    touched.tare(4, anyway=True)
    assert places(touched) == [] and touched.can_undo_tare
    touched.undo_tare()
    assert places(touched)[0] == pytest.approx((-40, 10), abs=4)
    with pytest.raises(DeviceError, match="does not keep the reference before the last tare"):
        touched.undo_tare()


def test_the_first_tare_cannot_be_undone():
    with sim_device() as device:
        device.tare(UNTOUCHED)
        assert not device.can_undo_tare
        with pytest.raises(DeviceError, match="leave the skin untouched and take it again"):
            device.undo_tare()


def test_a_tare_waits_until_the_finger_lifts(monkeypatch):
    said: list[str] = []
    left = [3]

    def take() -> None:
        left[0] -= 1
        if left[0]:
            raise SkinTouchedError("something touches the skin at (1, 2) mm")

    wait_untouched(take, said.append)
    assert left == [0] and said == ["the reference waits: something touches the skin at (1, 2) mm"]
    left[0] = 5
    with pytest.raises(SkinTouchedError, match="run  eitskin tare --anyway"):
        wait_untouched(take, said.append, 0.0)
    assert set_up.UNTOUCHED_S > 5


def test_tare_has_words_for_both(capsys):
    assert main(["tare", "--device", "sim:hold", "--undo"]) == 12
    assert "does not keep the reference" in capsys.readouterr().err
    assert main(["tare", "--device", "sim:hold", "--undo", "--anyway"]) == 2
    assert main(["tare", "--device", "sim:hold", "--anyway"]) == 0
