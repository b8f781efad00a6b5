"""A ring of resistors in place of the skin: its voltages, the doctor before it, and which current
and gain suit."""

import json

import numpy as np
import pytest

from eitskin.cli.main import main
from eitskin.frames.front_end import (
    Demand,
    FrontEnd,
    advice,
    demand_of,
    resistor_from,
    suitable,
)
from eitskin.frames.homogeneous import resistor_ring, voltages_of
from eitskin.skin.protocol import Protocol, adjacent, opposite

OHM = 1000.0


def by_node_voltages(protocol: Protocol) -> np.ndarray:
    """Kirchhoff's current law at every node of the ring, at the protocol's current."""
    n = protocol.n_electrodes
    laplacian = 2 * np.eye(n) - np.roll(np.eye(n), 1, axis=0) - np.roll(np.eye(n), -1, axis=0)
    potentials = np.linalg.pinv(laplacian / OHM)
    return voltages_of(potentials, protocol.drive_measure.astype(int)) * protocol.current_a


@pytest.mark.parametrize("protocol", [adjacent(16), opposite(16), adjacent(9)])
def test_voltages_are_those_of_the_network(protocol):
    rows = protocol.drive_measure.astype(int)
    volts = resistor_ring(protocol.n_electrodes, OHM).voltages(rows, protocol.current_a)
    assert np.allclose(volts, by_node_voltages(protocol), rtol=1e-9)


@pytest.mark.parametrize(
    ("spoil", "named", "code"),
    [
        (lambda frames: frames, set(), 0),
        (lambda frames: 0.7 * frames, {"level"}, 11),
        (lambda frames: frames * np.where(np.arange(208) == 17, 1.5, 1.0), {"channel-gain"}, 11),
    ],
    ids=["healthy", "30 % too low", "one channel 50 % too high"],
)
def test_the_doctor_compares_with_the_ring(
    spoil,
    named,
    code,
    tmp_path,
    capsys,
):
    volts = by_node_voltages(adjacent(16))
    frames = volts * np.random.default_rng(1).normal(1, 1e-3, (12, 208))
    np.savetxt(tmp_path / "ring.csv", spoil(frames), delimiter=",")
    given = [
        "doctor", str(tmp_path / "ring.csv"), "--protocol", "adjacent", "--electrodes", "16",
        "--reference-frames", "0:12", "--scale", "1", "--resistor-ring", "1000", "--json",
    ]  # fmt: skip
    found = main(given)
    report = json.loads(capsys.readouterr().out)
    faults = {one["name"] for one in report["findings"] if one["severity"] == "fault"}
    assert (faults, found) == (named, code)


@pytest.mark.parametrize("conductivity", [0.001, 0.01, 0.1, 1.0, 10.0])
def test_what_is_proposed_suits(conductivity):
    """A ring as conductive as skins from dry gel to saline."""
    for protocol in (adjacent(16), opposite(16)):
        transfer = resistor_ring(16, 100.0 / conductivity).transfer_ohm
        demand = demand_of(transfer, protocol)
        proposed = suitable(demand)
        assert demand.suits(proposed), (demand, proposed)
        assert demand.suits(FrontEnd()) == (proposed == FrontEnd())


def test_resistors_are_of_the_series():
    wanted = {1.0: 1.0, 1.05: 1.1, 99.0: 100.0, 1000.0: 1000.0, 1001.0: 1100.0, 8300.0: 9100.0}
    assert {ohm: resistor_from(ohm) for ohm in wanted} == wanted
    assert resistor_from(47e3) == 47e3


ADVICE = {
    "it suits": (
        Demand(row_ohm=500.0, drive_ohm=2000.0),
        ["0.5 mA, gain 3: source 1 of 24 V, converter 0.75 of 1.65 V: suits"],
    ),
    "too much for source and converter": (
        Demand(row_ohm=10_000.0, drive_ohm=200_000.0),
        [
            "0.5 mA, gain 3: source 100 of 24 V, converter 15 of 1.65 V: unsuited",
            # 24 V / 200 kohm = 0.12 mA, so 1 V / 9.1 kohm; 1.2375 V / (0.11 mA 10 kohm) = 1.13
            "0.11 mA, gain 1.13: source 22 of 24 V, converter 1.24 of 1.65 V",
            "source resistor 9,100 ohm, R_G 71,403 ohm;  eitskin board --gain 1.126"
            " --source-ua 110",
        ],
    ),
    "less than the receiver's gain of 1": (
        Demand(row_ohm=60_000.0, drive_ohm=200_000.0),
        [
            "0.5 mA, gain 3: source 100 of 24 V, converter 90 of 1.65 V: unsuited",
            "0.0196 mA, gain 1: source 3.92 of 24 V, converter 1.18 of 1.65 V",
            "source resistor 51,000 ohm, no R_G;  eitskin board --gain 1 --source-ua 20",
        ],
    ),
    "hardly anything at the greatest current and gain": (
        Demand(row_ohm=0.1, drive_ohm=250.0),
        [
            "0.5 mA, gain 3: source 0.125 of 24 V, converter 0.00015 of 1.65 V: unsuited",
            "6.67 mA, gain 100: source 1.67 of 24 V, converter 0.0667 of 1.65 V",
            "source resistor 150 ohm, R_G 99 ohm;  eitskin board --gain 100 --source-ua 6667",
            "even so the converter is hardly used or clips: change the skin's conductivity or"
            " thickness, or the protocol",
        ],
    ),
}


@pytest.mark.parametrize(("demand", "lines"), ADVICE.values(), ids=ADVICE)
def test_the_advice_names_the_resistors(demand, lines):
    assert [line[17:] for line in advice(demand)] == lines


def test_a_resistance_below_zero_is_a_mistake(refused):
    said = refused(2, "model voltages --paper --resistor-ring -5")
    assert "--resistor-ring -5 is out of range" in said
