"""``eitskin bench diagnostics``: its counts agree with the frames, and its page has the text that
the command wrote."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eitskin.cli.main import main
from eitskin.model.prebuilt import load_prebuilt
from eitskin.solve.reconstructor import Reconstructor
from eitskin_studies.benchmarks import diagnostics as bench_diagnostics
from eitskin_studies.benchmarks.diagnostics_faults import DETACHED, FAULTS, NONE, OUTLIER
from eitskin_studies.benchmarks.diagnostics_scenes import (
    IMPERFECT,
    ROWS,
    UNTOUCHED_FRAMES,
    CaseMaker,
    drawn,
    swapped,
)
from study_pages import PAGES, page_copy

SCENES, SEED = 4, 6
FIRST_CELL = re.compile(r"^\| ([^|]+) \|", re.MULTILINE)


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Path:
    return page_copy(tmp_path_factory.mktemp("diagnostics"), "diagnostics")


@pytest.fixture(scope="module")
def result(page) -> dict[str, Any]:
    """A small run, by the command line."""
    sizes = f"--scenes {SCENES} --crowds 2 --imperfect 1 --seed {SEED}"
    with pytest.MonkeyPatch.context() as patch:
        shown: list[str] = []
        patch.setattr("builtins.print", lambda text: shown.append(text))
        assert main(["bench", "diagnostics", *sizes.split(), "--json", "--page", str(page)]) == 0
    return dict(json.loads("".join(shown)))


def rate(result: dict[str, Any], fault: str, snr_db: float = 60.0) -> dict[str, Any]:
    return next(one for one in result["rates"] if one["fault"] == fault and one["snr_db"] == snr_db)


def lost(rate: dict[str, Any], which: str = "lost") -> float:
    return float(rate[which]["mean"])


@pytest.mark.long("tests/python/oracle and hard_cases check diagnostics by their rules")
def test_what_is_certain_is_counted(result):
    assert len(result["rates"]) == 3 * len(FAULTS) + 2
    assert all(one["scenes"] == SCENES for one in result["rates"])
    lifted = "touch during the tare, then lifted"
    outlier, bridged = OUTLIER.format(0.3), "neighbours bridged by 10 ohm"
    for fault in (DETACHED, bridged, "neighbours swapped", outlier, lifted):
        assert rate(result, fault)["named"] == 1.0 and rate(result, fault)["refused"] == 0
    for snr in (40.0, 50.0, 60.0, 80.0):
        clean = rate(result, NONE, snr)
        assert clean["named"] is None and clean["other"] == 0.0 and lost(clean) == 0.0
    assert lost(rate(result, DETACHED)) < 0.2 < lost(rate(result, DETACHED), "lost_blind")
    strong = rate(result, OUTLIER.format(5.0))
    assert lost(strong) < 0.02 < 0.2 < lost(strong, "lost_blind")
    assert abs(lost(rate(result, "gain off by +20 %", 80.0), "peak_lost")) < 0.02
    crowds = [one["touches"] for one in result["crowds"]]
    assert crowds == [n for n in range(1, 13) for _ in range(3)]
    assert all(one["frames"] == 2 for one in result["crowds"])
    assert {one["effect"] for one in result["imperfect"]} == set(IMPERFECT)


@pytest.mark.long("tests/python/oracle and hard_cases check diagnostics by their rules")
def test_counts_are_those_of_the_frames(result):
    """A detached electrode once more, by hand."""
    model, blob = load_prebuilt()
    solver, named = Reconstructor(model, blob=blob), 0
    for case in CaseMaker(SEED).cases(range(SCENES), drawn(SEED, SCENES)):
        off = np.isin(ROWS, case.electrode).any(axis=1)
        assert (case.volts["detached"][off] == 0).all()
        assert (case.volts["detached"][~off] != 0).all()
        solver.tare(
            case.measured(np.tile(case.volts["quiet"], (UNTOUCHED_FRAMES, 1)), 60.0, "quiet")
        )
        noisy = case.measured(case.volts["detached"][None], 60.0, "frame")[0]
        named += solver.reconstruct(noisy).info.open_electrodes == (case.electrode,)
    assert named / SCENES == rate(result, DETACHED)["named"]


def test_wires_exchanged_twice_are_right_again():
    rows = swapped(3, 8).drive_measure
    assert (np.isin(rows, 3) == np.isin(ROWS, 8)).all() and not (rows == ROWS).all()


def test_intervals():
    mean = bench_diagnostics.mean_of([*[0.0] * 10, *[1.0] * 10])
    assert mean is not None and bench_diagnostics.mean_of([]) is None
    assert mean.mean == 0.5 and mean.worst_tenth == 1.0
    assert mean.half_95 == pytest.approx(1.96 * np.sqrt(0.25 * 20 / 19 / 20))


@pytest.mark.long("tests/python/oracle and hard_cases check diagnostics by their rules")
def test_the_page_is_filled_and_has_its_rows(result, page):
    """The fixture's page is a copy of ours; what no command writes stays."""
    written, ours = page.read_text(), (PAGES / page.name).read_text()
    assert "`eitskin bench diagnostics --scenes 4 " in written
    assert "--scenes 320 --crowds 24 --imperfect 40 --seed 4001" in ours  # nothing was chosen on it
    assert written.split("<!-- run -->")[0] == ours.split("<!-- run -->")[0]
    assert written.rsplit("<!-- end", 1)[1] == ours.rsplit("<!-- end", 1)[1]
    names, shown = [fault.name for fault in FAULTS], FIRST_CELL.findall(ours)
    assert [name for name in shown if name in names] == [name for name in names if name in shown]
    assert FIRST_CELL.findall(written) == shown and DETACHED in shown


def test_sizes_out_of_range_are_refused():
    for arguments in ("--scenes 1", "--crowds 0", "--imperfect 0", "--seed -1"):
        assert main(["bench", "diagnostics", *arguments.split()]) == 2
