"""Any bytes as the measured operating points, as a firmware image: read or refused."""

import json
from importlib import resources

from bytes_damage import ODD_BYTES, ODD_WORDS, any_bytes, bounded, read_or_refuse, written
from hypothesis import given

from eitskin.device.flash import check_image
from eitskin.firmware.prebuilt import load_image
from eitskin.tuning.front import load_front


def small_front() -> bytes:
    """The file of operating points that comes with eitskin, cut to two points."""
    whole = json.loads(resources.files("eitskin.tuning").joinpath("front.json").read_bytes())
    return json.dumps({**whole, "points": whole["points"][:2]}).encode()


FRONT = small_front()
IMAGE = load_image()[0][:4096]


@given(content=any_bytes([FRONT], ODD_BYTES + ODD_WORDS))
@bounded(200)
def test_any_operating_points_are_read_or_refused(tmp_path, content):
    read_or_refuse(load_front, written(tmp_path, "front.json", content))


@given(content=any_bytes([IMAGE]))
@bounded(60)
def test_any_firmware_image_is_checked_or_refused(tmp_path, content):
    read_or_refuse(check_image, tmp_path / "x.bin", content)
