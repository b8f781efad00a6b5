"""Which point is chosen: the front, budgets and accuracies on made-up points, and what the shipped
results must show."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("scipy")

from eitskin.errors import ConfigError, FileError, UsageError
from eitskin.tuning.configuration import Configuration
from eitskin.tuning.front import (
    Budget,
    Front,
    Point,
    Where,
    Wish,
    check_wish,
    choose,
    estimated_instructions,
    for_package,
    front_from,
    load_front,
    pareto,
    read_budget,
)
from eitskin_studies.pictures.tradeoff_pictures import PICTURES as DRAWN
from eitskin_studies.tradeoff.default_set import default_set
from eitskin_studies.tradeoff.page import PICTURES, TABLES, fill_page
from eitskin_studies.tradeoff.table import best_points, to_json

HERE = Where()


def point(name: str, accuracy: float, instructions: float, **more: Any) -> Point:
    """A made-up point; its costliest frame takes twice the mean."""
    fields = {
        key: more.pop(key) for key in ("flash_bytes", "ram_bytes", "acquisition_us") if key in more
    }
    macs = instructions / 2
    score = {
        "scenes": 9,
        "image": {
            "mean": accuracy,
            "worst_tenth": accuracy - 0.1,
            "low": accuracy - 0.01,
            "high": accuracy + 0.01,
        },
        "discs": {"mean": 0.9, "worst_tenth": 0.8, "low": 0.88, "high": 0.91},
        "exact_count": 1.0,
        "position_mm": {"median": 0.5, "p95": 1.0},
        "force_error": {"median": 0.1, "p95": 0.2},
        "solve_macs": [macs - 10, macs],
        "touch_macs": [10, 20],
        "most_macs": 2 * macs,
    }
    return Point(
        Configuration(name, **more),
        0.3,
        1.0,
        {
            "flash_bytes": 1000,
            "ram_bytes": 1000,
            "pixels_kept": 812,
            "acquisition_us": 20_800,
            **fields,
        },
        {"kind": "counted", "mean": instructions, "most": 2 * instructions, "macs_mean": macs},
        {"p50": instructions / 1e4, "p99": instructions, "most": instructions / 5e3},
        {"random": {"60": score}},
    )


POINTS = (
    point("a", 0.70, 216e3),
    point("b", 0.80, 432e3),
    point("worse", 0.79, 500e3),
    point("c", 0.85, 2160e3),
    point("barely", 0.8505, 4000e3),
    point("big", 0.90, 5000e3, flash_bytes=600_000),
    point("warm", 0.86, 300e3, warm_start=True),
)
COLD = POINTS[:-1]


def wish(
    budget: str | None = None, accuracy: float | None = None, board: str = "f767", **more: Any
) -> Wish:
    return check_wish(
        Wish(None if budget is None else read_budget(budget), accuracy, board, HERE, **more)
    )


def test_the_front_is_what_nothing_beats() -> None:
    best = pareto(
        POINTS[:4], lambda p: p.cost("instructions", "f767", HERE), lambda p: p.accuracy(HERE)
    )
    assert [one.name for one in best] == ["a", "b", "c"]
    assert [one.name for one in best_points(POINTS, HERE)] == ["a", "b", "c", "big"]


@pytest.mark.parametrize(
    ("asked", "name"),
    [
        ({"budget": "1ms"}, "a"),
        ({"budget": "1.99ms"}, "a"),
        ({"budget": "2ms"}, "b"),
        ({"budget": "2ms", "worst": True}, "a"),
        ({"budget": "4000us", "worst": True}, "b"),
        ({"budget": "10ms"}, "c"),
        ({"budget": "1s"}, "barely"),
        ({"budget": "0.5Minstructions"}, "b"),
        ({"budget": "216kMACs"}, "b"),
        ({"budget": "250us", "board": "host"}, "c"),
        ({"budget": "1s", "board": "host"}, "big"),
        ({"accuracy": 0.75}, "b"),
        ({"accuracy": 0.80}, "b"),
        ({"accuracy": 0.85}, "c"),
        ({"accuracy": 0.86, "board": "host"}, "big"),
        ({"accuracy": 0.6, "budget": "10ms"}, "a"),
    ],
)
def test_the_right_point_is_chosen(asked: dict[str, Any], name: str) -> None:
    wanted = wish(**asked)
    chosen = choose(COLD, wanted)
    assert chosen.name == name
    cost = chosen.cost(wanted.unit, wanted.board, HERE, wanted.worst)
    assert cost is not None and (wanted.budget is None or cost <= wanted.budget.value)
    assert (chosen.accuracy(HERE) or 0) >= (wanted.accuracy or 0)


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"budget": "0.5ms"}, "keeps to 0.5 ms; the cheapest, 'a', takes 1 ms"),
        ({"accuracy": 0.99}, "reaches 0.99; the best, 'barely', has 0.851"),
        ({"accuracy": 0.85, "budget": "3ms"}, "reaches 0.85 within 3 ms; the best, 'b'"),
        ({"budget": "10ms", "period_us": 5000.0}, "within 5 ms; allow more with  --period"),
        ({}, "--budget 10ms"),
        ({"accuracy": 1.5}, "--accuracy 1.5"),
        ({"accuracy": float("nan")}, "--accuracy nan"),
        ({"budget": "1Minstructions", "board": "host"}, "instructions are counted"),
    ],
)
def test_what_cannot_be_is_refused_with_how_near_one_comes(
    asked: dict[str, Any], said: str
) -> None:
    with pytest.raises(UsageError, match=said) as caught:
        choose(COLD, wish(**asked))
    assert "\n" not in str(caught.value)


def test_a_longer_scan_is_chosen_only_where_there_is_time() -> None:
    slow = point("slow", 0.88, 2200e3, samples=320, acquisition_us=70_700)
    assert choose([*COLD, slow], wish("12ms")).name == "c"
    assert choose([*COLD, slow], wish("80ms")).name == "slow"
    assert choose([*COLD, slow], wish("12ms", period_us=71_000.0)).name == "slow"


def test_boards_get_only_what_they_can_be_told() -> None:
    half = point("half", 0.89, 300e3, touch_sweeps=2)
    assert choose([*COLD, half], wish("10ms")).name == "c"
    assert (
        not point("limited", 0.9, 1e5, mac_limit=5).fits_f767
        or "mac_limit"
        in __import__(
            "eitskin.device.settings", fromlist=["SolverSettings"]
        ).SolverSettings.__dataclass_fields__
    )
    assert not point("large", 0.9, 1e5, ram_bytes=300_000).fits_f767


@pytest.mark.parametrize(
    ("text", "budget"),
    [
        ("10ms", Budget(10_000, "us")),
        ("800us", Budget(800, "us")),
        ("0.05 s", Budget(50_000, "us")),
        ("600kMACs", Budget(600_000, "MACs")),
        ("1MMAC", Budget(1e6, "MACs")),
        ("2.5Minstructions", Budget(2.5e6, "instructions")),
        ("70000instructions", Budget(70_000, "instructions")),
    ],
)
def test_budgets_are_read(text: str, budget: Budget) -> None:
    assert read_budget(text) == budget


@pytest.mark.parametrize(
    "text", ["", "10", "ms", "-3ms", "0ms", "1e400ms", "nanms", "3 parsecs", "1ms2"]
)
def test_what_is_no_budget_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match="--budget"):
        read_budget(text)


def test_instructions_are_estimated_from_points_of_the_same_storage_and_solver() -> None:
    packed = Configuration("i8", storage="i8")
    assert estimated_instructions(COLD, packed, (1000.0, 3000.0)) is None
    table = [*COLD, point("i8 too", 0.8, 900e3, storage="i8")]
    estimate = estimated_instructions(table, packed, (1000.0, 3000.0))
    assert estimate == {
        "kind": "estimated",
        "mean": 2000,
        "most": 6000,
        "instructions_per_mac": 2.0,
    }


def test_files_that_are_no_results_are_refused(tmp_path: Path) -> None:
    for text in ("", "[]", "{}", '{"format": "eitskin-tradeoff", "version": 2}', "\x00"):
        path = tmp_path / "front.json"
        path.write_text(text)
        with pytest.raises(ConfigError, match="tradeoff run"):
            load_front(path)
    with pytest.raises(FileError):
        load_front(tmp_path / "absent.json")


def test_the_shipped_results_are_of_the_built_in_set_and_reach_the_targets() -> None:
    front = load_front()
    names = {one.name for one in front.points}
    missing = {one.name for one in default_set()} - names
    assert not missing, (
        f"make the shipped results anew (docs/results/tradeoff.md): {sorted(missing)} are not in"
        " them"
    )
    assert all(
        one.instructions is not None and one.instructions["kind"] == "counted"
        for one in front.points
    )
    assert choose(front.points, wish("2.5Minstructions")).accuracy(HERE) >= 0.84  # type: ignore[operator]
    assert choose(front.points, wish("2.5Minstructions", worst=True)).accuracy(HERE) >= 0.84  # type: ignore[operator]
    assert max(one.accuracy(HERE) or 0 for one in front.points) >= 0.87
    by_name = {one.name: one for one in front.points}
    for base in ("standard", "fine"):
        for storage in ("f16", "i16", "i8"):
            packed, plain = (
                by_name[f"{base} {storage}"].accuracy(HERE),
                by_name[base].accuracy(HERE),
            )
            assert packed == pytest.approx(plain, abs=0.005)
    for budget in ("2ms", "5ms", "10ms", "50ms"):
        assert choose(
            [one for one in front.points if not one.configuration.warm_start], wish(budget)
        ).fits_f767


def test_what_ships_is_smaller_and_reads_the_same() -> None:
    front = Front({"seed": 1}, POINTS)
    again = front_from(json.loads(to_json(for_package(front))), "file")
    assert [one.name for one in again.points] == [one.name for one in POINTS]
    assert choose(again.points[:-1], wish("10ms")).name == "c"


def test_the_page_shows_the_shipped_results(tmp_path: Path) -> None:
    page = Path(__file__).resolve().parents[3] / "docs" / "results" / "tradeoff.md"
    text, front = page.read_text(encoding="utf-8"), load_front()
    for name, make in TABLES.items():
        marked = f"<!-- {name} -->\n{make(front)}\n<!-- end {name} -->"
        assert marked in text, (
            f"the table {name!r} is old: run  eitskin tradeoff run  as the page says"
        )
    assert all((page.parent / PICTURES / name).is_file() for name in DRAWN)
    copy = tmp_path / "page.md"
    copy.write_text(text.replace("| fine |", "| dull |"))
    fill_page(copy, front, tmp_path, ())
    assert copy.read_text() == text
    copy.write_text("no marks")
    with pytest.raises(ConfigError, match="conditions"):
        fill_page(copy, front, tmp_path, ())
