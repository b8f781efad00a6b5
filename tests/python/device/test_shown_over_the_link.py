"""The image that shows a board's frame, drawn on the host from the touches that the board sent."""

from dataclasses import replace

import numpy as np
import pytest
from device_helpers import UNTOUCHED, sim_board, sim_device

from eitskin.device.known_model import KnownModel
from eitskin.device.wire.link_table import Stream
from eitskin.page.facts import HEAD, frame_bytes
from eitskin.session.assemble import read_frames
from eitskin.session.frame import Frame
from small_models import prebuilt


def streamed(what: Stream) -> list[Frame]:
    """Frames of one touch, with the board's model, but the first, within which the touch comes."""
    known = KnownModel(*prebuilt())
    with sim_device(sim_board(elements=5000)) as device:
        device.tare(UNTOUCHED)
        device.start_scene()
        read = [one for one in read_frames(device, what) if isinstance(one, Frame)]
    assert len(read) > 1
    return [replace(frame, known=known) for frame in read[1:]]


def test_the_head_of_touches_says_which_image_and_the_host_draws_it():
    shown = streamed(Stream.IMAGE | Stream.TOUCHES)
    for frame in shown:
        assert frame.info is not None and frame.info.shown == "touches"
        assert frame.image_is == "touches" and frame.touch_image is not None
        assert frame.image is frame.touch_image and frame.image.dtype == np.float32
        assert frame.solver_image is not None and (frame.image != frame.solver_image).any()
        message = frame.message()
        assert message["image_is"] == "touches"
        assert message["image_s_per_m"] == frame.image.tolist()
        top = np.argmax(np.abs(frame.solver_image))
        assert message["peak_s_per_m"] == pytest.approx(float(frame.solver_image[top]))


def test_touches_alone_are_enough_for_the_image():
    """No pixel crosses the link. The page shows them; a line of JSON stays short."""
    shown = streamed(Stream.TOUCHES)
    for frame in shown:
        assert frame.solver_image is None and frame.image is frame.touch_image
        assert HEAD.unpack_from(frame_bytes(0, frame))[2] == 812
        assert "image_s_per_m" not in frame.message()


def test_without_touches_or_the_model_the_image_is_the_solvers():
    for frame in streamed(Stream.IMAGE):
        assert frame.image is frame.solver_image and frame.image_is == "solver"
    for frame in streamed(Stream.IMAGE | Stream.TOUCHES):
        stranger = replace(frame, known=None)
        assert stranger.image is stranger.solver_image
        assert frame.info is not None
        unexplained = replace(frame, info=replace(frame.info, shown="solver"))
        assert unexplained.image is unexplained.solver_image and unexplained.touch_image is None
    for frame in streamed(Stream.RAW):
        assert frame.image is None and frame.image_is is None
