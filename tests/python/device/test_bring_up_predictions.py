"""The values that the bring-up predicts are those of the circuit's simulation."""

import json
from pathlib import Path

import numpy as np
import pytest

from eitskin.bringup import predicted
from eitskin.bringup.ring import ELECTRODES, decode, explain, levels_ohm, sweep_rows

RESULTS = Path(__file__).resolve().parents[3] / "hardware" / "made" / "results.json"


@pytest.mark.parametrize(
    ("value", "name", "factor"),
    [
        (predicted.SINE_PP_V, "sine_pp_v", 1),
        (predicted.CONVERTER_BIAS_V, "converter_bias_v", 1),
        (predicted.CONVERTER_GAIN, "converter_gain", 1),
        (predicted.SOURCE_1K_V, "source_1k_v", 1),
        (predicted.SOURCE_10K_V, "source_10k_v", 1),
        (predicted.SETTLE_US, "receiver_settle_s", 1e6),
        (predicted.SUPPLY_GOOD_V, "supply_good_v", 1),
    ],
)
def test_a_predicted_value_is_the_simulations(value, name, factor):
    simulated = json.loads(RESULTS.read_text(encoding="utf-8"))
    assert value == pytest.approx(factor * simulated[name], rel=0.01)


def seen(mapping) -> list[int | None]:
    levels = levels_ohm(1.0)
    known = [None if k == 0 else levels[mapping[k]] for k in range(ELECTRODES)]
    return decode(known, 1 / ELECTRODES, levels)


@pytest.mark.parametrize("low", range(4))
@pytest.mark.parametrize("high", range(4))
def test_every_exchange_of_two_address_lines_is_named(low, high):
    mapping = [
        k & ~(1 << low) & ~(1 << high) | (k >> low & 1) << high | (k >> high & 1) << low
        for k in range(ELECTRODES)
    ]
    text = explain("V+", seen(mapping))
    if low == high:
        assert text == ""
    else:
        assert f"A{min(low, high)} and A{max(low, high)} of V+ are exchanged" == text


@pytest.mark.parametrize("line", range(4))
@pytest.mark.parametrize("high", [False, True])
def test_a_stuck_address_line_is_named(line, high):
    mapping = [k | 1 << line if high else k & ~(1 << line) for k in range(ELECTRODES)]
    assert explain("I-", seen(mapping)).startswith(f"A{line} of I- is always")


def test_a_sweep_never_puts_a_pair_on_one_electrode():
    for multiplexer in range(4):
        rows = sweep_rows(multiplexer)
        assert rows[0] is None and all(row is not None for row in rows[1:])
        assert all(row[0] != row[1] and row[2] != row[3] for row in rows[1:] if row)
    assert np.all(np.diff(levels_ohm(1.0)) > 0)
