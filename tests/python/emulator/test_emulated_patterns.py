"""The firmware image on the emulated board scans skip-3 and opposite pairs: its own front end,
full and half scans, and the bits of this host."""

import pytest

from eitskin.device.wire.link_table import Quality
from eitskin.errors import DeviceError
from eitskin.model.build import BuildSettings, build_model
from eitskin.model.eitm import encode_model
from eitskin.skin.protocol import in_order, pattern
from eitskin.skin.skin import load_skin
from emulated import board_of, clean, connect, power_up, raw_frames, twin_check

# ten times the paper's conductivity: with .5 mA and a gain of 3 the converter holds wide pairs
SKIN = """
[skin]
name = "conductive"
diameter_mm = 194.0
conductivity_s_per_m = {conductivity}
"""
SCENE = """
[scene]
name = "one finger"
frames = 400
elements = 2000
skin = "skin.toml"
[[touch]]
radius_mm = 9.0
x_mm = 30.0
y_mm = -20.0
[effects.noise]
snr_db = 60.0
"""


def board_before(folder, image, drive, conductivity=0.1):
    (folder / "skin.toml").write_text(SKIN.format(conductivity=conductivity), encoding="utf-8")
    (folder / "scene.toml").write_text(SCENE, encoding="utf-8")
    skin, _ = load_skin(folder / "skin.toml")
    protocol = in_order(pattern(16, drive), "by 7")
    settings = BuildSettings(pixels_across=20, elements=2000, samples=0)
    blob = encode_model(build_model(skin, protocol, settings))
    return connect(power_up(image, scene=str(folder / "scene.toml"), model=blob)), blob


@pytest.mark.parametrize(
    ("drive", "check_every"),
    [
        ("skip-3", 2),
        pytest.param("opposite", 2, marks=pytest.mark.long("skip-3, full and half scans in turns")),
        pytest.param("skip-3", 0, marks=pytest.mark.long("skip-3, full and half scans in turns")),
    ],
)
def test_a_pattern_is_scanned_and_solved_with_the_hosts_bits(image, tmp_path, drive, check_every):
    device, blob = board_before(tmp_path, image, drive)
    device.scan(check_every=check_every)
    check, _, results = twin_check(device, blob, 4)
    assert check.as_dict()["same_bits"] and check.compared == 4
    assert results[-1] is not None
    assert [(one.x_mm, one.y_mm) for one in results[-1].touches] == [
        pytest.approx((30.0, -20.0), abs=3)
    ]
    clean(board_of(device))


def test_rows_of_wide_pairs_saturate_on_the_papers_skin(image, tmp_path):
    """The front end as described does not bear skip-3 there: rows are marked, the tare refused."""
    device, _ = board_before(tmp_path, image, "skip-3", conductivity=0.01)
    (raw,) = raw_frames(device, 1)
    saturated = [bool(one & Quality.SATURATED) for one in raw.quality]
    assert sum(saturated) > len(saturated) / 2
    with pytest.raises(DeviceError, match="too many rows"):
        device.tare(4)
