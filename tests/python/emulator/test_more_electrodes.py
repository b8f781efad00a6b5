"""32 electrodes behind two times four multiplexers: the firmware image scans 464 reciprocal rows
and solves them at rank 96 with the bits of this host."""

import numpy as np
import pytest

from eitskin.errors import DeviceError
from eitskin.fem.cem import ForwardModel
from eitskin.fem.grid import grid_for
from eitskin.fem.mesh import mesh_for_elements
from eitskin.fem.sensitivity import sensitivity
from eitskin.model.build import BuildSettings, Linearisation, make_model
from eitskin.model.eitm import encode_model
from eitskin.skin.protocol import in_order, pattern
from eitskin.skin.skin import load_skin
from eitskin_emulator.analog.skin import AnalogSkin
from eitskin_emulator.board import EmulatedBoard
from emulated import board_of, clean, connect, power_up, twin_check

SKIN = """
[skin]
name = "many"
diameter_mm = 194.0
conductivity_s_per_m = 0.02
[electrodes]
count = 32
width_mm = 4.0
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
snr_db = 70.0
"""
RANK, BANK_BYTES = 96, 512 * 1024


@pytest.fixture(scope="module")
def board(image, tmp_path_factory):
    """The board before the skin, and its model. S as f32 would not fit the bank; a model of plain
    differences, with its fields, would not fit the memory."""
    folder = tmp_path_factory.mktemp("many")
    (folder / "skin.toml").write_text(SKIN, encoding="utf-8")
    (folder / "scene.toml").write_text(SCENE, encoding="utf-8")
    skin, _ = load_skin(folder / "skin.toml")
    protocol = in_order(pattern(32, "adjacent"), "by 7")
    grid, mesh = grid_for(skin.outline, 32), mesh_for_elements(skin, 2000)
    jacobian, v0_v = sensitivity(
        ForwardModel(mesh, skin, protocol), skin.conductivity_s_per_m, grid
    )
    linear = Linearisation(grid, jacobian, v0_v, mesh.n_elements)
    settings = BuildSettings(rank=RANK, storage="i16", data_kind="normalised", samples=0)
    blob = encode_model(make_model(skin, protocol, linear, settings))
    device = connect(power_up(image, scene=str(folder / "scene.toml"), model=blob))
    return device, blob


def test_32_electrodes_are_scanned_and_solved_with_the_hosts_bits(board):
    device, blob = board
    info = device.board
    assert (info.electrodes, info.n_electrodes, info.rank) == (32, 32, RANK)
    assert (info.n_rows, info.n_folded) == (928, 464)
    device.scan(check_every=0)
    check, frames, results = twin_check(device, blob, 3)
    assert check.as_dict()["same_bits"] and check.compared == 3
    assert {frame.raw.scan_us for frame in frames} == {464 * 100 - 20}
    (touch,) = results[-1].touches
    assert np.hypot(touch.x_mm - 30, touch.y_mm + 20) < 3
    stats = device.stats()
    print(f"\nmodel {len(blob)} bytes of {BANK_BYTES}, workspace {stats.workspace_used}")
    assert stats.workspace_used <= stats.workspace_bytes
    clean(board_of(device))


def test_electrodes_that_the_board_does_not_have_are_refused():
    protocol = pattern(36, "adjacent")
    volts = np.zeros((1, len(protocol.drive_measure)))
    with pytest.raises(DeviceError, match="36 electrodes; the board's multiplexers reach 32"):
        EmulatedBoard(bytes(64), AnalogSkin(protocol, volts, volts, 20.0))
