"""Energy per frame: the sum of the parts, and the sentences of the page."""

import json

import pytest

from eitskin.cli.main import main
from eitskin.tuning.front import Conditions, load_front
from eitskin_studies.benchmarks import energy
from study_pages import page_copy


def test_a_point_takes_the_processor_while_it_solves_and_all_else_for_the_frame():
    point = next(one for one in load_front().points if one.name == "standard")
    one = energy.energy_of(point, Conditions())
    assert one is not None and one.scan_ms == 20.8
    processor = 363 * one.solve_ms + 82.5 * (20.8 - one.solve_ms)
    assert 1e3 * one.processor_mj == pytest.approx(processor)
    rest = 1e3 * (one.frame_mj - one.processor_mj) / 20.8
    assert rest == pytest.approx(energy.measuring_mw()) == pytest.approx(792, abs=1)


def test_the_cheapest_keeps_its_accuracy_and_sleep_saves():
    result = energy.run()
    cheaper = [one for one in result.points if one.frame_mj < result.cheapest.frame_mj]
    assert all(one.miou < energy.KEPT_MIOU <= result.cheapest.miou for one in cheaper)
    wfi, stopped, off = energy.waiting_mw().values()
    assert wfi > stopped > 10 * off
    for rate in energy.RATES_HZ:
        means = [energy.mean_mw(result.cheapest, rate, one) for one in (wfi, stopped, off)]
        assert means == sorted(means, reverse=True) and means[-1] < 0.2 * means[0]


def test_the_command_fills_its_marks_alone(tmp_path, capsys):
    page = page_copy(tmp_path, "board-cost")
    before = page.read_text(encoding="utf-8")
    assert main(["bench", "energy", "--json", "--page", str(page)]) == 0
    assert json.loads(capsys.readouterr().out)["cheapest"] == energy.run().cheapest.name
    assert page.read_text(encoding="utf-8") == before
