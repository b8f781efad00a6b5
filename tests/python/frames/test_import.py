"""Import: every option that says how a source differs gives back the frames that the source was
made from."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from injected import healthy_frames

from eitskin.errors import EitskinError, FrameError, ProtocolError, UsageError
from eitskin.frames.frames import Frames, load_frames, save_frames
from eitskin.frames.import_options import ImportOptions
from eitskin.frames.importer import import_frames
from eitskin.frames.orders import ORDERS, electrode_map, match_rows, relabel, source_table, swap_map
from eitskin.frames.source import SourceOptions, electrode_table
from eitskin.frames.truth import TruthOptions
from eitskin.skin.protocol import adjacent, opposite, table
from eitskin.skin.skin import paper_skin

ADJACENT = adjacent(16)
TABLE = ADJACENT.drive_measure.astype(np.int64)
KEYS = SourceOptions(voltage="v", reference="r", scale=1.0)


def source(
    tmp_path: Path, frames: Frames, index: Any = slice(None), sign: Any = 1.0, **more: Any
) -> Path:
    """An NPZ with the frames' channels under ``index`` and ``sign``."""
    path = tmp_path / "source.npz"
    np.savez(
        path,
        v=frames.voltage_v[:, index] * sign,
        r=frames.reference_voltage_v[:, index] * sign,
        **more,
    )
    return path


def taken(
    path: Path, protocol: Any = ADJACENT, skin: Any = None, source: Any = KEYS, **options: Any
) -> Frames:
    """Import ``path``. The source's arrays are v and r, unless ``source`` names others."""
    return import_frames(path, ImportOptions(source=source, **options), protocol, skin)


def assert_same(frames: Frames, wanted: Frames) -> None:
    assert frames.protocol.hash == wanted.protocol.hash
    assert np.allclose(frames.voltage_v, wanted.voltage_v, rtol=1e-12)
    assert np.allclose(frames.reference_voltage_v, wanted.reference_voltage_v, rtol=1e-12)


@pytest.mark.parametrize("protocol", (adjacent(16), opposite(16)), ids=("adjacent", "opposite"))
@pytest.mark.parametrize("order", ORDERS)
def test_every_order_comes_back_in_ours(tmp_path, protocol, order):
    frames = healthy_frames(1, protocol)
    rows = source_table(order, protocol)
    measured = ~(rows[:, :2, None] == rows[:, None, 2:]).any(axis=(1, 2))
    index = np.zeros(len(rows), dtype=np.int64)
    index[measured] = match_rows(protocol.drive_measure, rows[measured]).index
    path = source(tmp_path, frames, index, np.where(measured, 1.0, 77.0))
    assert_same(taken(path, protocol, order=order), frames)


def test_a_table_of_the_source_or_of_a_file_is_followed(tmp_path):
    frames, rng = healthy_frames(2), np.random.default_rng(2)
    index = rng.permutation(208)
    rows = TABLE[index].copy()
    rows[:50] = rows[:50, [0, 1, 3, 2]]
    sign = np.where(np.arange(208) < 50, -1.0, 1.0)
    path = source(tmp_path, frames, index, sign, rows=rows + 1)
    inside = replace(KEYS, protocol_table="rows", table_base=1)
    assert_same(taken(path, source=inside), frames)
    text = tmp_path / "rows.csv"
    np.savetxt(text, rows, fmt="%d", delimiter=",", header="I+,I-,V+,V-")
    options = ImportOptions(source=KEYS, order="table", table_file=str(text))
    assert_same(import_frames(path, options, adjacent(16), None), frames)
    kept = import_frames(path, replace(options, keep_table=True), adjacent(16), None)
    assert np.array_equal(kept.protocol.drive_measure, rows)
    assert np.allclose(kept.voltage_v, frames.voltage_v[:, index] * sign)
    assert_same(import_frames(path, options, None, None, 16), kept)
    with pytest.raises(
        FrameError, match="1 to 16, but they are 0 to 15; if it counts from 1 say --table-base 1"
    ):
        taken(path, source=replace(inside, table_base=0))


@pytest.mark.parametrize("sign", ("reversed", "magnitude"))
@pytest.mark.parametrize("protocol", (adjacent(16), opposite(16)), ids=("adjacent", "opposite"))
def test_signs_come_back(tmp_path, protocol, sign):
    frames = healthy_frames(3, protocol)
    change = np.abs if sign == "magnitude" else np.negative
    volts, untouched = change(frames.voltage_v), change(frames.reference_voltage_v)
    path = source(tmp_path, replace(frames, voltage_v=volts, reference_voltage_v=untouched))
    assert_same(taken(path, protocol, sign=sign), frames)


@pytest.mark.parametrize(("rotate", "mirror"), [(3, False), (0, True), (5, True)])
def test_renumbering_comes_back(tmp_path, rotate, mirror):
    frames = healthy_frames(4)
    match = match_rows(TABLE, relabel(TABLE, electrode_map(16, rotate, mirror)))
    path = source(tmp_path, frames, match.index, match.sign)
    assert_same(taken(path, rotate=rotate, mirror=mirror), frames)


def test_clockwise_mirrors_unless_the_skin_is_clockwise(tmp_path):
    frames, skin = healthy_frames(5), paper_skin()
    match = match_rows(TABLE, relabel(TABLE, electrode_map(16, 0, True)))
    path = source(tmp_path, frames, match.index, match.sign)
    assert_same(taken(path, skin=skin, clockwise=True), frames)
    clockwise = replace(skin, electrodes=replace(skin.electrodes, clockwise=True))
    unchanged = taken(path, skin=clockwise, clockwise=True)
    assert np.allclose(unchanged.voltage_v, frames.voltage_v[:, match.index] * match.sign)


def test_swapped_wires_give_the_table_that_was_really_measured(tmp_path):
    path = source(tmp_path, healthy_frames(6))
    frames = taken(path, swaps=((3, 9), (1, 2)))
    assert np.array_equal(frames.protocol.drive_measure, swap_map(16, [(3, 9), (1, 2)])[TABLE])


def test_channels_are_flipped_filled_and_left_out(tmp_path):
    frames = healthy_frames(7)
    path = source(tmp_path, frames)
    repaired = taken(
        path, flip_channels=(5,), impute_channels=(0,), drop_channels=(207,), drop_electrodes=(9,)
    )
    kept = [row for row in range(207) if 9 not in TABLE[row]]
    assert np.array_equal(repaired.protocol.drive_measure, TABLE[kept])
    assert np.allclose(repaired.voltage_v[:, 5], -frames.voltage_v[:, 5])
    assert TABLE[0].tolist() == [0, 1, 2, 3] and TABLE[26].tolist() == [2, 3, 0, 1]
    assert np.allclose(repaired.voltage_v[:, 0], frames.voltage_v[:, 26])
    for bad, said in (
        ({"impute_channels": (0, 26)}, "no good reciprocal"),
        ({"impute_channels": (208,)}, "--impute-channels 208: out of range; there are 0 to 207"),
        ({"drop_electrodes": (16,)}, "--drop-electrodes 16"),
        ({"drop_electrodes": tuple(range(14))}, "nothing is left"),
        ({"flip_channels": (-1,)}, "--flip-channels -1"),
    ):
        with pytest.raises(UsageError, match=said):
            taken(path, **bad)


def test_bad_values_pass_only_where_they_are_mended(tmp_path):
    frames = healthy_frames(8)
    voltage = frames.voltage_v.copy()
    voltage[0, 0] = np.nan
    path = tmp_path / "nan.npz"
    np.savez(path, v=voltage, r=frames.reference_voltage_v)
    with pytest.raises(FrameError, match=r"frame 0, row 0 \(from 0\) is nan"):
        taken(path)
    with pytest.raises(FrameError, match="frame 0, row 0 is nan"):
        taken(path, impute_channels=(3,))
    repaired = taken(path, impute_channels=(0,))
    assert repaired.voltage_v[0, 0] == voltage[0, 26]


def test_equalised_gains_follow_the_prediction(tmp_path):
    frames = healthy_frames(9, gain=0.15)
    repaired = taken(source(tmp_path, frames), equalise=True)
    gains = repaired.reference_v / frames.reference_v
    assert np.allclose(repaired.voltage_v, frames.voltage_v * gains)
    pairs = repaired.protocol.reciprocal_pairs()
    assert np.allclose(
        repaired.reference_v[pairs.first], repaired.reference_v[pairs.second], rtol=1e-9
    )
    weak = frames.reference_voltage_v.copy()
    weak[:, 40] *= 0.01
    np.savez(tmp_path / "weak.npz", v=frames.voltage_v, r=weak)
    with pytest.raises(
        FrameError, match=r"row 40 has 0\.0\d+ of its predicted reference \(1 such\)"
    ):
        taken(tmp_path / "weak.npz", equalise=True)


def test_text_with_channels_in_rows_or_frames_in_rows(tmp_path):
    frames = healthy_frames(10)
    untouched, voltage = frames.reference_voltage_v, frames.voltage_v
    rows = tmp_path / "rows.csv"
    three = np.vstack([untouched[0], untouched[1], voltage]).T
    np.savetxt(rows, three, delimiter=";", header="q0;q1;one", comments="", fmt="%.17g")
    options = SourceOptions(columns="one", reference_columns="q0,q1", scale=1.0)
    got = taken(rows, source=options)
    assert got.frame_name == ("one",) and len(got.reference_voltage_v) == 2
    assert np.array_equal(got.voltage_v, voltage)
    assert np.array_equal(got.reference_voltage_v, untouched[:2])
    wide = tmp_path / "wide.csv"
    times = np.arange(len(untouched) + 1) * 0.25
    np.savetxt(
        wide,
        np.column_stack([times, 1000 * np.vstack([untouched, voltage])]),
        delimiter=",",
        fmt="%.17g",
    )
    options = SourceOptions(columns="1:209", time="0", reference_frames="0:12", scale=1e-3)
    got = taken(wide, source=options)
    assert np.allclose(got.voltage_v, voltage, rtol=1e-12)
    assert np.allclose(got.reference_voltage_v, untouched, rtol=1e-12)
    assert got.time_s is not None and got.time_s.tolist() == [3.0]
    assert got.meta["unit"] == "V" and got.meta["options"]["scale"] == 1e-3
    with pytest.raises(
        FrameError, match=r"209 chosen columns: a frame should have 208 channels \(16 electrodes, "
    ):
        taken(wide, source=SourceOptions(reference_frames="0:12"))


@pytest.mark.parametrize("part", ("real", "imag", "abs", "in-phase"))
def test_complex_parts_of_arrays_and_column_pairs(tmp_path, part):
    frames = healthy_frames(11)
    phase = np.exp(0.4j)
    voltage, untouched = frames.voltage_v * phase, frames.reference_voltage_v * phase
    wanted = {
        "real": np.real,
        "imag": np.imag,
        "abs": np.abs,
        "in-phase": lambda z: np.real(z / phase),
    }[part]
    np.savez(tmp_path / "z.npz", v=voltage, r=untouched)
    source_of = replace(KEYS, complex_part=part)
    got = taken(tmp_path / "z.npz", source=source_of)
    assert np.allclose(got.voltage_v, wanted(voltage), rtol=1e-9)
    pairs = np.column_stack(
        [untouched[0].real, untouched[0].imag, voltage[0].real, voltage[0].imag]
    )
    np.savetxt(tmp_path / "z.csv", pairs, delimiter=",", fmt="%.17g")
    columns = SourceOptions(
        columns="2,3", reference_columns="0,1", complex_part=part, pairs="real-imag"
    )
    got = taken(tmp_path / "z.csv", source=columns)
    assert np.allclose(got.voltage_v, wanted(voltage), rtol=1e-9)
    assert got.meta["unit"] == "unknown, taken as V"
    with pytest.raises(UsageError, match="numbers are complex; say with --complex-part"):
        taken(tmp_path / "z.npz")
    with pytest.raises(UsageError, match="columns come in pairs; 1 are named"):
        taken(tmp_path / "z.csv", source=replace(columns, columns="2"))


def test_mat_files_with_structs(tmp_path):
    from scipy.io import savemat

    frames = healthy_frames(12)
    path = tmp_path / "m.mat"
    savemat(
        path,
        {"data": {"v": frames.voltage_v.T, "quiet": frames.reference_voltage_v.T}, "note": "x"},
    )
    options = SourceOptions(voltage="data.v", reference="data.quiet", scale=1.0)
    assert_same(taken(path, source=options), frames)
    with pytest.raises(
        FrameError, match=r"no array 'v' for --voltage; it holds data.quiet \(208, 12\), data.v"
    ):
        taken(path)
    path.write_bytes(path.read_bytes()[:700])
    with pytest.raises(EitskinError, match=r"not a readable MAT file|cannot read"):
        taken(path, source=options)


def test_truth_comes_along_in_millimetres(tmp_path):
    frames, rng = healthy_frames(13), np.random.default_rng(13)
    mask = rng.integers(-1, 2, size=(1, 5, 6)).astype(np.int8)
    known = {"of": ["two", "two"], "xy": [[0.1, 0.2], [0.3, -0.4]], "rad": [0.1, 0.2]}
    path = source(tmp_path, frames, names=["two"], more=[True, False], mask=mask, **known)
    truth = TruthOptions(
        touch_frame="of", touch_xy="xy", touch_radius="rad", touch_sign="more", touch_unit_mm=97.0,
        mask="mask",
    )  # fmt: skip
    named, skin = replace(KEYS, names="names"), paper_skin()
    got = taken(path, skin=skin, source=named, truth=truth)
    assert got.touch_frame is not None
    assert got.touch_xy_mm is not None
    assert got.touch_sign is not None
    assert got.touch_frame.tolist() == [0, 0] and got.touch_sign.tolist() == [1, -1]
    assert np.allclose(got.touch_xy_mm, [[9.7, 19.4], [29.1, -38.8]])
    assert got.touch_strength is not None and np.isnan(got.touch_strength).all()
    assert np.array_equal(got.truth_mask, mask)
    assert got.truth_mask_extent_mm == (-97.0, -97.0, 97.0, 97.0)
    flipped = taken(path, skin=skin, source=named, truth=replace(truth, mask_top_first=True))
    assert np.array_equal(flipped.truth_mask, mask[:, ::-1])
    with pytest.raises(UsageError, match="--truth-mask-extent"):
        taken(path, source=named, truth=truth)
    with pytest.raises(UsageError, match="need --truth-xy too"):
        taken(path, source=named, truth=TruthOptions(touch_frame="of"))
    with pytest.raises(FrameError, match="names frame 'two'; frames are 0"):
        taken(path, skin=skin, truth=truth)


def test_a_frames_file_is_mended_and_keeps_its_truth(tmp_path):
    frames = healthy_frames(14)
    save_frames(tmp_path / "a.npz", frames)
    repaired = import_frames(tmp_path / "a.npz", ImportOptions(sign="reversed"), None, None)
    save_frames(tmp_path / "b.npz", repaired)
    back = load_frames(tmp_path / "b.npz")
    assert np.array_equal(back.voltage_v, -frames.voltage_v)
    assert np.array_equal(back.touch_xy_mm, frames.touch_xy_mm)
    assert back.meta["before"] == {} and back.meta["options"] == {"sign": "reversed"}
    with pytest.raises(UsageError, match="already a frames file"):
        taken(tmp_path / "a.npz", None)
    with pytest.raises(ProtocolError, match="another protocol"):
        import_frames(tmp_path / "a.npz", ImportOptions(), opposite(16), None)


NPZ = r"no array 'x' .*r \(12, 208\), v \(1, 208\)"
UNTOUCHED = "which frames are untouched: --reference KEY"


@pytest.mark.parametrize(
    ("of_source", "options", "protocol", "said"),
    [
        (SourceOptions(voltage="x"), {}, ADJACENT, NPZ),
        (SourceOptions(), {}, ADJACENT, "--voltage KEY"),
        (SourceOptions(voltage="v"), {}, ADJACENT, UNTOUCHED),
        (replace(KEYS, columns="1"), {}, ADJACENT, "--columns does not go with a NPZ"),
        (KEYS, {}, adjacent(8), r"v \(1, 208\): a frame should have 40 channels"),
        (KEYS, {"order": "fixed-all"}, ADJACENT, "should have 256 channels"),
        (KEYS, {}, None, "say which protocol"),
        (KEYS, {"order": "table"}, ADJACENT, "--order table needs"),
        (KEYS, {"sign": "maybe"}, ADJACENT, "--sign maybe"),
        (replace(KEYS, scale=0.0), {}, ADJACENT, "--scale 0"),
        (replace(KEYS, frames_in="columns"), {}, ADJACENT, "--frames-in columns a"),
        (replace(KEYS, reference_frames="0"), {}, ADJACENT, "another reference"),
        (replace(KEYS, protocol_table="v"), {}, ADJACENT, "table is .rows, 4"),
    ],
)
def test_bad_options_say_what_to_do(tmp_path, of_source, options, protocol, said):
    path = source(tmp_path, healthy_frames(15))
    with pytest.raises(EitskinError, match=said) as caught:
        taken(path, protocol, source=of_source, **options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("cell", [np.inf, np.nan, 0.5])
def test_electrodes_are_whole_numbers(cell):
    table = np.array([[0.0, 1, 2, cell]])
    with pytest.raises(FrameError, match="whole numbers"):
        electrode_table(table, 0, "there")


def test_foreign_and_square_sources(tmp_path):
    (tmp_path / "a.xyz").write_text("1")
    with pytest.raises(UsageError, match=r"suffix '.xyz' is not known; use .csv"):
        import_frames(tmp_path / "a.xyz", ImportOptions(), adjacent(16), None)
    with pytest.raises(EitskinError, match="no such table"):
        import_frames(tmp_path / "absent.csv", ImportOptions(), adjacent(16), None)
    np.savez(tmp_path / "square.npz", v=np.ones((40, 40)), r=np.ones(40), words=np.array(["a"]))
    with pytest.raises(UsageError, match="both sides fit; say --frames-in rows or columns"):
        taken(tmp_path / "square.npz", adjacent(8))
    with pytest.raises(FrameError, match="holds <U1, not numbers"):
        words = ImportOptions(source=replace(KEYS, voltage="words"))
        import_frames(tmp_path / "square.npz", words, adjacent(8), None)


def test_kept_tables_need_the_number_of_electrodes(tmp_path):
    frames = healthy_frames(16)
    path = source(tmp_path, frames, rows=TABLE)
    options = ImportOptions(source=replace(KEYS, protocol_table="rows"))
    with pytest.raises(UsageError, match="--electrodes N"):
        import_frames(path, options, None, None)
    assert import_frames(path, options, None, None, 16).protocol.hash == table(16, TABLE).hash
