"""The choice of a point for a budget or an accuracy, on made-up points."""

from dataclasses import replace
from typing import Any

import pytest

from eitskin import load_model
from eitskin.device.settings import SolverSettings
from eitskin.errors import ConfigError, FileError, UsageError
from eitskin.model.options import default_options
from eitskin.tuning.for_model import operating_point_for
from eitskin.tuning.front import (
    MEASURED_DB,
    PRESETS,
    Conditions,
    Limit,
    OperatingPoint,
    board_takes,
    choose,
    default_point,
    load_front,
    named_preset,
    read_limit,
)
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


@pytest.mark.parametrize("noise", [(1.0, 1.04), (1.04, 1.0)])
def test_host_times_within_their_noise_do_not_choose_but_macs_do(noise):
    """Two runs that time the same points a little differently make the same presets."""
    made = point("more sweeps", 0.85, 2.2e6, touch_sweeps=12), point("few", 0.85, 2.1e6)
    points = [
        replace(one, host_us={"p50": 200.0 * part, "most": 900.0 * part})
        for one, part in zip(made, noise, strict=True)
    ]
    for asked in (
        *(named_preset(name, "host") for name in PRESETS),
        target(accuracy=0.84, board="host"),
        target("1ms", board="host"),
    ):
        assert choose(points, asked).name == "few"
    faster = replace(made[0], host_us={"p50": 180.0, "most": 800.0})
    assert choose([faster, points[1]], target(accuracy=0.84, board="host")).name == "more sweeps"


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
    assert not point("large", 0.9, 1e5, ram_bytes=380_000).fits_f767


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


def scored(name: str, by_snr: dict[float, tuple[float, float]], **more: Any) -> OperatingPoint:
    """A made-up point with the MIoU of the solver's and of the shown image at each SNR."""
    made = point(name, 0.5, 216e3, **more)
    cell = made.scores["random"]["60"]
    cells = {
        f"{snr:g}": cell | {"image": {"mean": image}, "drawn": {"mean": drawn}}
        for snr, (image, drawn) in by_snr.items()
    }
    return replace(made, scores={"random": cells})


USUAL = scored("usual", {40.0: (0.82, 0.87), 60.0: (0.86, 0.94), 80.0: (0.86, 0.95)})
FINE_AT_60 = scored("fine at 60", {40.0: (0.75, 0.85), 60.0: (0.89, 0.95), 80.0: (0.87, 0.96)})
WORSE_SHOWN = scored("worse shown", {40.0: (0.82, 0.87), 60.0: (0.90, 0.93), 80.0: (0.90, 0.94)})
ALWAYS = scored("always", {40.0: (0.83, 0.87), 60.0: (0.87, 0.94), 80.0: (0.86, 0.95)})


@pytest.mark.parametrize(
    ("snr_db", "name"),
    [(None, "always"), (38.0, "always"), (57.0, "fine at 60"), (99.0, "fine at 60")],
)
def test_accurate_is_chosen_by_the_noise_and_never_below_the_default(snr_db, name):
    points = [USUAL, FINE_AT_60, WORSE_SHOWN, ALWAYS]
    for preset in ("balanced", "accurate"):
        asked = named_preset(preset, "host", snr_db=snr_db)
        assert choose(points, asked, default=USUAL).name == name
        assert choose([USUAL], asked, default=USUAL) is USUAL


@pytest.mark.parametrize("board", ["f767", "host"])
@pytest.mark.parametrize("snr_db", [None, *MEASURED_DB])
@pytest.mark.parametrize("prebuilt_model", [False, True])
def test_measured_presets_are_at_least_as_accurate_as_the_default(board, snr_db, prebuilt_model):
    points = [one for one in load_front().points if not one.configuration.warm_start]
    default = default_point(points)
    assert default is not None
    for name in ("balanced", "accurate"):
        asked = named_preset(name, board, snr_db=snr_db)
        if prebuilt_model:
            model = load_model()
            settable = board_takes() if board == "f767" else None
            chosen = operating_point_for(asked, model, default_options(model), settable)
        else:
            chosen = choose(points, asked, default=default)
        for snr in MEASURED_DB if snr_db is None else (snr_db,):
            for judged in ("image", "drawn"):
                place = Conditions(snr_db=snr, judged=judged)
                assert (chosen.accuracy(place) or 0) >= (default.accuracy(place) or 1)
