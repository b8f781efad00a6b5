"""Rows of a live instrument that cannot be used: the tare and the frames leave them out, name and
count them; the frames are those of a board whose rows were masked."""

import random
from pathlib import Path

import numpy as np
import pytest
from device_helpers import frames, of

from eitskin.core.results import Reconstruction
from eitskin.device.open import open_device
from eitskin.device.transport import LinkEvent
from eitskin.device.wire.link_table import Stream
from eitskin.device.wire.packets import RawFrame, SolvedTouches
from eitskin.errors import DeviceError
from eitskin.session.notices import link_text
from eitskin.skin.protocol import adjacent
from eitskin.solve.reconstructor import Reconstructor
from small_models import prebuilt

ROWS, TARE = 208, 8
LAYOUT = """
[lines]
delimiter = "comma"
cells = 208
[protocol]
electrodes = 16
kind = "adjacent"
[channels]
"""


def volts() -> np.ndarray:
    """Untouched frames, then touched ones, (18, 208)."""
    rows = frames(5000).rows(adjacent(16))
    kept = [rows.around(k) for k in range(18)]
    return np.array([v[k - first] for k, (first, v) in enumerate(kept)])


def shown(folder: Path, cells: list[list[str]], channels: str = "") -> tuple[list, int]:
    """Return the items of a stream of touches and raw frames of these lines, after a tare."""
    (folder / "layout.toml").write_text(LAYOUT + channels)
    (folder / "lines.csv").write_text("\n".join(",".join(line) for line in cells) + "\n")
    with open_device(f"text:{folder}/lines.csv?layout={folder}/layout.toml") as device:
        device.tare(TARE)
        return list(device.stream(Stream.RAW | Stream.TOUCHES)), device.counters.lines_skipped


def written(values: np.ndarray) -> list[list[str]]:
    return [[f"{v:.7g}" for v in frame] for frame in values]


def by_the_host(values: np.ndarray, rows: list[int]) -> list[Reconstruction]:
    skin, mask = Reconstructor(prebuilt()[0]), np.zeros(ROWS, dtype=bool)
    mask[rows] = True
    skin.mask_rows(mask)
    skin.tare(values[:TARE].astype(np.float32))
    return [skin.reconstruct(frame.astype(np.float32)) for frame in values[TARE:]]


@pytest.mark.parametrize("said", ["nan", "NaN", "", "OVERLOAD", "inf", "-"])
@pytest.mark.parametrize("rows", [[5], [0, 17, 207]])
def test_dead_rows_are_left_out_named_and_counted(tmp_path, said, rows):
    values, cells = volts(), written(volts())
    for line in cells:
        for row in rows:
            line[row] = said
    items, skipped = shown(tmp_path, cells)
    (event,) = of(LinkEvent, items)
    which = ", ".join(map(str, rows))
    counted = f"row {which} (from 0) of 208" if len(rows) == 1 else "3 of 208 rows cannot be used"
    assert event.missing == len(rows) and skipped == 0
    assert counted in link_text(event) and which in link_text(event)
    solved = of(SolvedTouches, items)
    here = by_the_host(np.float64(np.float32(values)), rows)
    assert len(solved) == len(here) == 10
    for board, host in zip(solved, here, strict=True):
        assert board.solved.masked == host.info.masked == len(rows)
        places = [[v for t in one.touches for v in (t.x_mm, t.y_mm)] for one in (board, host)]
        assert places[0] == pytest.approx(places[1], abs=0.1)  # mm
    assert max(len(one.touches) for one in solved) == 1


@pytest.mark.parametrize(
    ("channels", "count"), [("drop_channels = [5, 9]", 2), ("drop_electrodes = [3]", 52)]
)
def test_what_the_layout_drops_is_left_out(tmp_path, channels, count):
    items, _ = shown(tmp_path, written(volts()), channels)
    assert of(LinkEvent, items)[0].missing == count
    assert {one.solved.masked for one in of(SolvedTouches, items)} == {count}
    assert max(len(one.touches) for one in of(SolvedTouches, items)) == 1


def test_single_readings_that_are_missing_do_not_stop_a_tare(tmp_path):
    """One random cell of every line is empty."""
    cells, places = written(volts()), random.Random(1)
    for line in cells:
        line[places.randrange(ROWS)] = ""
    items, _ = shown(tmp_path, cells)
    solved = of(SolvedTouches, items)
    assert not of(LinkEvent, items) and {one.solved.masked for one in solved} == {1}
    assert max(len(one.touches) for one in solved) == 1


def test_a_row_that_comes_back_is_used_from_the_next_tare_on(tmp_path):
    values = np.concatenate([volts()[:TARE]] * 3)
    cells = written(values)
    for line in cells[:TARE]:
        line[5] = "nan"
    (tmp_path / "layout.toml").write_text(LAYOUT)
    (tmp_path / "lines.csv").write_text("\n".join(",".join(line) for line in cells) + "\n")
    with open_device(f"text:{tmp_path}/lines.csv?layout={tmp_path}/layout.toml") as device:
        device.mask_row(40)
        device.tare(TARE)
        device.tare(TARE)
        raw = of(RawFrame, device.stream(Stream.RAW))
        assert {tuple(np.flatnonzero(np.isnan(one.voltage_v))) for one in raw} == {(40,)}


def test_too_few_rows_are_refused_in_words(tmp_path):
    dropped = f"drop_channels = {list(range(120))}"
    (tmp_path / "layout.toml").write_text(LAYOUT + dropped)
    (tmp_path / "lines.csv").write_text("\n".join(map(",".join, 3 * written(volts()))) + "\n")
    with open_device(f"text:{tmp_path}/lines.csv?layout={tmp_path}/layout.toml") as device:
        with pytest.raises(DeviceError, match="too many rows of the frame are unusable"):
            device.tare(TARE)
        (event,) = of(LinkEvent, iter(lambda: device.next_item(0.0), None))
        assert event.missing == 120
        assert "120 of 208 rows cannot be used, 0, 1, 2, 3, 4, 5, 6, 7 and 112 others" in event.text
        assert "too few rows are left, repair the instrument or its layout" in event.text
