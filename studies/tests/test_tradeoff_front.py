"""The Pareto front of made-up points; requirements on the recorded results, and the part of them in
the package."""

import json
from pathlib import Path

import pytest

from eitskin.errors import ConfigError
from eitskin.tuning.configuration import Configuration
from eitskin.tuning.front import Conditions, Front, choose, front_from, load_front
from eitskin_studies.pictures.tradeoff_pictures import DRAWN
from eitskin_studies.tradeoff.default_set import default_set
from eitskin_studies.tradeoff.equal import COUNTED, equal_table, reached
from eitskin_studies.tradeoff.fronts import (
    estimated_instructions,
    in_short,
    pareto,
    recorded_front,
    to_json,
)
from eitskin_studies.tradeoff.page import PICTURES, fill_page
from eitskin_studies.tradeoff.table import best_points
from made_points import COLD, HERE, POINTS, point, target


def test_the_front_is_what_nothing_beats():
    best = pareto(
        POINTS[:4], lambda p: p.cost("instructions", "f767", HERE), lambda p: p.accuracy(HERE)
    )
    assert [one.name for one in best] == ["a", "b", "c"]
    assert [one.name for one in best_points(POINTS, HERE)] == ["a", "b", "c", "big"]


def test_instructions_are_estimated_from_points_of_the_same_storage_and_solver():
    packed = Configuration("i8", storage="i8")
    assert estimated_instructions(COLD, packed, (1000.0, 3000.0)) is None
    table = [*COLD, point("i8 too", 0.8, 900e3, storage="i8")]
    assert estimated_instructions(table, packed, (1000.0, 3000.0)) == {
        "kind": "estimated", "mean": 2000, "most": 6000, "instructions_per_mac": 2.0,
    }  # fmt: skip


def test_the_recorded_results_are_of_the_built_in_set_and_reach_the_targets():
    front = recorded_front()
    names = {one.name for one in front.points}
    missing = {one.name for one in default_set()} - names
    assert not missing, f"make the recorded results again (studies/results/tradeoff.md): {missing}"
    kinds = {(one.instructions or {}).get("kind") for one in front.points}
    assert kinds <= {"counted", "estimated"}
    assert choose(front.points, target("2.5Minstructions")).accuracy(HERE) >= 0.84
    assert choose(front.points, target("3Minstructions", worst=True)).accuracy(HERE) >= 0.84
    assert max(one.accuracy(HERE) or 0 for one in front.points) >= 0.87
    accuracy = {one.name: one.accuracy(HERE) for one in front.points}
    for storage in ("f16", "i16", "i8"):
        assert accuracy[f"standard {storage}"] == pytest.approx(accuracy["standard"], abs=0.005)
    cold = [one for one in front.points if not one.configuration.warm_start]
    for budget in ("2ms", "5ms", "10ms", "50ms"):
        assert choose(cold, target(budget)).fits_f767


def test_what_ships_is_short_and_chooses_the_same():
    made = front_from(json.loads(to_json(in_short(Front({"seed": 1}, POINTS)))), "file")
    assert [one.name for one in made.points] == [one.name for one in POINTS]
    assert choose(made.points[:-1], target("10ms")).name == "c"
    recorded, shipped = recorded_front(), load_front()
    assert in_short(shipped) == in_short(recorded), "write the shipped front again (--front)"
    for whole, short in zip(recorded.points, shipped.points, strict=True):
        assert (whole.configuration, whole.costs) == (short.configuration, short.costs)
        for judged in ("image", "discs"):
            where = Conditions("six close", 60.0, judged)
            assert whole.accuracy(where) == short.accuracy(where)
        for worst in (False, True):
            for unit, board in (("MACs", "f767"), ("us", "f767"), ("us", "host")):
                assert whole.cost(unit, board, HERE, worst) == short.cost(unit, board, HERE, worst)


def test_the_page_shows_the_recorded_results(tmp_path):
    page = Path(__file__).resolve().parents[1] / "results" / "tradeoff.md"
    text, front = page.read_text(encoding="utf-8"), recorded_front()
    assert all((page.parent / PICTURES / name).is_file() for name in DRAWN)
    copy = tmp_path / "page.md"
    copy.write_text(text.replace("| fine |", "| dull |"))
    fill_page(copy, front, tmp_path, ())
    assert copy.read_text() == text, "the page is old: run  eitskin tradeoff run  as it says"
    copy.write_text("no marks")
    with pytest.raises(ConfigError, match="conditions"):
        fill_page(copy, front, tmp_path, ())


def test_other_methods_get_their_fastest_time_and_the_worst_scenes_at_each_snr():
    front = recorded_front()
    head, rows = equal_table(front)
    assert head[-1] == "worst 10 %, full scan, 80 samples: 40 / 60 / 80 dB"
    assert all(len(row[-1].split(" / ")) == 3 for row in rows)
    peers = front.settings["peers"]
    counted = {one["value"] for one in peers if one["name"] == COUNTED}
    for name, works in (("plain FISTA 3000, non-negative", 1), (COUNTED, len(counted))):
        times_us = {one.frame_us for one in reached(front) if one.name == name}
        assert len(times_us) == works
        assert min(times_us) == min(one["host_us"] for one in peers if one["name"] == name)
