"""The circuit in ngspice against what the firmware and docs/guide/hardware.md assume.

All is simulated once for this file; the kept results are compared with it."""

import json
from pathlib import Path

import numpy as np
import pytest

from eitskin.frames.front_end import SOURCE_REACH_V, FrontEnd
from eitskin.frames.homogeneous import voltages_of
from eitskin.frames.homogeneous_fem import transfer_by_elements
from eitskin.skin.skin import paper_skin
from eitskin_hardware.circuit.instrument import instrument
from eitskin_hardware.spice import bench, measure, promises
from eitskin_hardware.spice.bench import Bench, SpiceError
from eitskin_hardware.spice.skins import conductances, pair_load

ROOT = Path(__file__).resolve().parents[3]
MADE = ROOT / "hardware" / "made"
PAGE = (ROOT / "docs" / "guide" / "hardware.md").read_text(encoding="utf-8")
BOARD = (ROOT / "firmware" / "boards" / "nucleo_f767zi" / "board.c").read_text(encoding="utf-8")


AS_IT_WAS = pytest.mark.long("the circuit as it is")


@pytest.fixture(scope="module")
def numbers():
    return measure.measure_now()


@pytest.fixture(scope="module")
def numbers_before():
    return measure.measure_before()


def assert_kept(numbers: measure.Numbers, before: bool) -> None:
    """Compare with the kept results. After a change: eitskin hardware make. Versions of ngspice may
    differ in the last digits."""
    kept = json.loads((MADE / "results.json").read_text(encoding="utf-8"))
    kept = {key: value for key, value in kept.items() if key.startswith("before_") == before}
    assert kept.keys() == numbers.keys()
    for key, value in kept.items():
        assert numbers[key] == pytest.approx(value, rel=0.02, abs=1e-5), key


def test_the_kept_results_are_what_the_simulation_says(numbers):
    assert_kept(numbers, before=False)


@AS_IT_WAS
def test_the_kept_results_of_the_circuit_as_it_was(numbers_before):
    assert_kept(numbers_before, before=True)


def test_the_page_has_each_number_of_the_kept_results():
    kept = json.loads((MADE / "results.json").read_text(encoding="utf-8"))
    assert promises.missing(PAGE, kept) == []
    assert (MADE / "promises.md").read_text(encoding="utf-8") == promises.table(kept)


def test_a_number_that_the_page_lacks_is_named():
    kept = json.loads((MADE / "results.json").read_text(encoding="utf-8"))
    page = PAGE.replace("4.93 V", "5.0 V")
    assert promises.missing(page, kept) == ["source into 10 kΩ: 4.93 V"]


# Least and greatest: what the firmware, the model of the front end, and the page need.
BOUNDS = {
    "drive_v": (0.98, 1.02),  # FrontEnd.current_a is 1 V over 2 kohm
    "filter_image_db": (45, 80),
    "source_1k_v": (0.49, 0.51),
    "source_10k_v": (4.8, 5.05),
    "source_skin_v": (9.1, 9.6),
    "source_output_worst_ohm": (100e3, np.inf),
    "source_reach_v": (SOURCE_REACH_V / 2, 14),
    "source_dc_v": (0, 0.01),
    "servo_s": (0, 0.04),  # SETTLE_FRAMES of board.c: 40 ms
    "converter_gain": (2.97, 3.03),  # FrontEnd.gain
    "receiver_corner_hz": (200e3, 500e3),
    "receiver_settle_s": (0, 8e-6),  # half of settle_us
    "converter_bias_v": (1.645, 1.655),  # half of full_scale_code + 1
    "clamped_v": (3.3, 3.7),
    "common_mode_db": (65, np.inf),
    "skin_0pf_error": (0, 0.03),
    "skin_60pf_10khz_error": (0, 0.03),
    "skin_common_mode_v": (0, 1),
    "skin_model_v": (0.7, 0.9),
    "ring_2k2_error": (0, 0.02),
    "settling_error": (0, 1e-4),
    "settling_error_8k5_60pf": (0, 6e-3),
    "demodulation_error": (0, 3e-4),
    "sampling_error": (0, 2e-3),
    "dead_line_a": (0, 5e-3),  # pin and input withstand more than 20 mA
    "supply_good_v": (0.7 * 3.3, 3.3),  # the processor's input levels
    "supply_lost_v": (0, 0.3 * 3.3),
    "supply_lost_minus_v": (0, 0.3 * 3.3),
    "supply_lost_plus_v": (0, 0.3 * 3.3),
    "supply_12v_v": (0, 0.3 * 3.3),
}
BOUNDS_BEFORE = {
    "before_source_10k_v": (3.5, 3.8),
    "before_source_output_ohm": (18e3, 22e3),
    "before_skin_0pf_error": (0.5, np.inf),
    "before_dead_line_a": (30e-3, np.inf),
}


def test_the_numbers_are_what_others_rely_on(numbers):
    wrong = {
        key: numbers[key] for key, (low, high) in BOUNDS.items() if not low <= numbers[key] <= high
    }
    assert wrong == {}


@AS_IT_WAS
def test_the_circuit_as_it_was_had_what_the_page_says(numbers_before):
    for key, (low, high) in BOUNDS_BEFORE.items():
        assert low <= numbers_before[key] <= high, key


def test_cables_make_it_worse_step_by_step(numbers):
    errors = [numbers[f"skin_{pf}pf_error"] for pf in (0, 60, 150)]
    levels = [numbers[f"skin_{pf}pf_scale"] for pf in (0, 60, 150)]
    assert errors == sorted(errors) and levels == sorted(levels, reverse=True)


def test_the_firmwares_numbers_are_these():
    assert f"FRONT_END_GAIN_PPM = {FrontEnd().gain_ppm}," in BOARD
    assert "SOURCE_UA_RMS = 350," in BOARD
    rms_ua = 1e6 * measure.CURRENT_A / 2**0.5
    assert rms_ua == pytest.approx(350, rel=0.02)


def test_the_network_has_the_models_voltages():
    """The sheet in the deck, by direct current through ngspice, against the forward solution."""
    transfer = transfer_by_elements(paper_skin())
    siemens = conductances(transfer)
    assert (siemens >= 0).all()
    from eitskin_hardware.spice.skins import skin_load

    deck = ["* sheet", *skin_load().lines(), "I1 e1 e0 1m", ".options rshunt=1e14", ".control"]
    deck += [
        "set numdgt=9",
        "op",
        *(f"print v(e{k},e{k + 1})" for k in range(2, 15)),
        "quit",
        ".endc",
        ".end",
    ]
    printed = bench.printed_values(bench.run_ngspice("\n".join(deck) + "\n"))
    rows = np.array([(0, 1, k, k + 1) for k in range(2, 15)])
    assert np.real(printed) == pytest.approx(voltages_of(transfer, rows) * 1e-3, rel=1e-4)


def test_a_balanced_return_needs_no_direct_path():
    """Failure of the return's amplifier: no direct current reaches the skin."""
    design = instrument().rewired("U14", OUT="NOWHERE")
    stuck = Bench(design, pair_load(1e3), (0, 1, 0, 1), extra=("VSTUCK mirror 0 13",))
    assert abs(stuck.levels("v(e0,e1)")["v(e0,e1)"]) < 1e-3


def test_a_deck_that_ngspice_refuses_is_an_error_that_says_so():
    with pytest.raises(SpiceError, match="ngspice"):
        Bench(instrument()).levels("v(no_such_node)")


def test_a_missing_ngspice_is_named(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(SpiceError, match="apt-get install ngspice"):
        bench.run_ngspice("* none\n.end\n")
