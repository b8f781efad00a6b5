"""The circuit as code: electrical rules, netlist, parts and wiring; and the files in hardware/made
are those that the code makes."""

import csv
import io
import re
from pathlib import Path

import pytest

from eitskin_hardware import make
from eitskin_hardware.circuit import instrument as circuit
from eitskin_hardware.circuit.design import order_of
from eitskin_hardware.circuit.instrument import MUX_REF, instrument
from eitskin_hardware.circuit.lists import parts_csv, parts_list, total_usd
from eitskin_hardware.circuit.netlist import check
from eitskin_hardware.circuit.nucleo import WIRES

MADE = Path(__file__).resolve().parents[3] / "hardware" / "made"


@pytest.fixture(scope="module")
def texts():
    return make.texts()


def test_no_electrical_rule_is_broken():
    assert check().messages == ()


def two_outputs(b):
    b.net("SMOOTH").connect(b.net("DRIVE_V"))


def input_left_open(b):
    b.add("U99", "OPA320", {"OUT": "LOOSE", "V+": "AVDD", "V-": "AGND"})


BROKEN = {
    "two outputs on one net": (two_outputs, "SMOOTH"),
    "an input that leads nowhere": (input_left_open, "U99"),
}


@pytest.mark.parametrize(("breaks", "named"), BROKEN.values(), ids=BROKEN)
def test_the_rules_check_names_what_is_broken(monkeypatch, breaks, named):
    whole = circuit._sense

    def broken(b):
        whole(b)
        breaks(b)

    monkeypatch.setattr(circuit, "_sense", broken)
    checked = check()
    assert any(named in message for message in checked.messages), checked.messages
    with pytest.raises(make.RulesError, match="electrical rules"):
        make.refuse_broken(checked)


@pytest.mark.parametrize(
    "name", ["instrument.net", "parts.csv", "parts.md", "wiring.md", "instrument.cir"]
)
def test_the_kept_file_is_what_the_code_makes(texts, name):
    """After a change of the circuit: eitskin hardware make."""
    assert (MADE / name).read_text(encoding="utf-8") == texts[name]


def test_the_netlist_has_each_pin_of_the_design(texts):
    """KiCad's file, read by pattern, against the design."""
    text = texts["instrument.net"]
    nets = {}
    for block in re.split(r"\(net\s+\(code", text)[1:]:
        name = re.search(r'\(name "([^"]*)"\)', block)[1]
        nodes = re.findall(r'\(node\s+\(ref "([^"]*)"\)\s+\(pin "([^"]*)"\)', block)
        nets[name] = set(nodes)
    design = instrument()
    number = {
        (part.ref, pin.name): pin.number for part in design.parts.values() for pin in part.kind.pins
    }
    expected = {
        net: {(ref, number[ref, pin]) for ref, pin in pins} for net, pins in design.nets().items()
    }
    assert nets == expected
    assert set(re.findall(r'\(ref "([^"]*)"\)\s+\(value', text)) == set(design.parts)


def test_each_part_has_an_order_with_a_price():
    for part in instrument().parts.values():
        if part.kind.name != "star point":
            order = order_of(part)
            assert order.number and order.alternatives and order.price_usd > 0, part.ref


def test_the_csv_counts_every_part_once():
    rows = list(csv.DictReader(io.StringIO(parts_csv(instrument()))))
    refs = [ref for row in rows for ref in row["references"].split()]
    fitted = {ref for ref, part in instrument().parts.items() if part.kind.name != "star point"}
    assert sorted(refs) == sorted(fitted)
    assert all(int(row["pieces"]) == max(len(row["references"].split()), 1) for row in rows)
    total = sum(line.price_usd for line in parts_list(instrument()))
    assert total == pytest.approx(total_usd(instrument()))


@pytest.mark.parametrize("page", ["README.md", "docs/guide/faq.md", "docs/guide/hardware.md"])
def test_pages_name_the_price_of_the_parts(page):
    price = f"about {round(total_usd(instrument()), -1):.0f} US dollars"
    text = (MADE.parents[1] / page).read_text(encoding="utf-8")
    assert price in " ".join(text.split())


def test_the_logic_lines_lead_to_the_firmwares_pins():
    """Each line of a multiplexer is reached from its pin through 1 kohm; see test_hardware_page for
    the pins."""
    design = instrument()
    for wire in WIRES:
        if not wire.to.startswith("ADG1206"):
            continue
        _, name, line = wire.to.split()
        net = design[MUX_REF[name]].net[line]
        between = [p for p in design.of("R") if set(p.net.values()) == {wire.pin, net}]
        assert [p.value for p in between] == ["1k"], wire


def test_electrodes_have_the_same_number_everywhere():
    design = instrument()
    for ref in MUX_REF.values():
        assert [design[ref].net[f"S{k + 1}"] for k in range(16)] == [f"E{k}" for k in range(16)]
    assert [design["J2"].net[f"E{k}"] for k in range(16)] == [f"E{k}" for k in range(16)]


def test_each_supply_pin_of_an_amplifier_has_its_capacitor():
    design = instrument()
    for supply in ("+15V", "-15V"):
        ics = [
            p for p in design.parts.values() if p.kind.prefix == "U" and supply in p.net.values()
        ]
        ics = [p for p in ics if p.kind.name != "optocoupler"]
        caps = [p for p in design.of("C X7R") if p.value == "100n" and supply in p.net.values()]
        assert len(caps) == len(ics), supply
