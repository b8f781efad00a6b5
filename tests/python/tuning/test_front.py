"""Which point is chosen for a budget or an accuracy, on made-up points."""

import pytest

from eitskin.device.settings import SolverSettings
from eitskin.errors import ConfigError, FileError, UsageError
from eitskin.tuning.front import Limit, choose, load_front, read_limit
from made_points import COLD, HERE, point, target


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
def test_the_right_point_is_chosen(asked, name):
    wanted = target(**asked)
    chosen = choose(COLD, wanted)
    assert chosen.name == name
    cost = chosen.cost(wanted.unit, wanted.board, HERE, wanted.worst)
    assert cost is not None and (wanted.limit is None or cost <= wanted.limit.value)
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
def test_what_cannot_be_is_refused_with_how_near_one_comes(asked, said):
    with pytest.raises(UsageError, match=said) as caught:
        choose(COLD, target(**asked))
    assert "\n" not in str(caught.value)


def test_a_longer_scan_is_chosen_only_where_there_is_time():
    slow = point("slow", 0.88, 2200e3, samples=320, acquisition_us=70_700)
    assert choose([*COLD, slow], target("12ms")).name == "c"
    assert choose([*COLD, slow], target("80ms")).name == "slow"
    assert choose([*COLD, slow], target("12ms", period_us=71_000.0)).name == "slow"


def test_boards_get_only_what_they_can_be_told():
    half = point("half", 0.89, 300e3, touch_sweeps=2)
    assert choose([*COLD, half], target("10ms")).name == "c"
    limited = point("limited", 0.9, 1e5, mac_limit=5)
    assert not limited.fits_f767 or "mac_limit" in SolverSettings.__dataclass_fields__
    assert not point("large", 0.9, 1e5, ram_bytes=300_000).fits_f767


@pytest.mark.parametrize(
    ("text", "budget"),
    [
        ("10ms", Limit(10_000, "us")),
        ("800us", Limit(800, "us")),
        ("0.05 s", Limit(50_000, "us")),
        ("600kMACs", Limit(600_000, "MACs")),
        ("1MMAC", Limit(1e6, "MACs")),
        ("2.5Minstructions", Limit(2.5e6, "instructions")),
        ("70000instructions", Limit(70_000, "instructions")),
    ],
)
def test_budgets_are_read(text, budget):
    assert read_limit(text) == budget


@pytest.mark.parametrize(
    "text", ["", "10", "ms", "-3ms", "0ms", "1e400ms", "nanms", "3 parsecs", "1ms2"]
)
def test_what_is_no_budget_is_refused(text):
    with pytest.raises(UsageError, match="--budget"):
        read_limit(text)


def test_files_that_are_no_results_are_refused(tmp_path):
    for text in ("", "[]", "{}", '{"format": "eitskin-tradeoff", "version": 2}', "\x00"):
        path = tmp_path / "front.json"
        path.write_text(text)
        with pytest.raises(ConfigError, match="tradeoff run"):
            load_front(path)
    with pytest.raises(FileError):
        load_front(tmp_path / "absent.json")
