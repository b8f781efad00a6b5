"""The instrument's circuit: the one source of netlist, parts list, wiring, schematic and deck.

Written with SKiDL. Parts come from ``parts.KINDS``, so KiCad's libraries are not needed. Values are
explained where they stand; ``docs/guide/hardware.md`` has their effect from the simulation.
"""

import logging
import os
import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from eitskin_hardware.circuit.design import Design, Part
from eitskin_hardware.circuit.nucleo import (
    ANALOG_GROUND,
    ANALOG_SUPPLY,
    GROUND,
    LOGIC_SUPPLY,
    MULTIPLEXERS,
    WIRES,
    Wire,
)
from eitskin_hardware.circuit.parts import (
    INPUT,
    KINDS,
    OUTPUT,
    PASSIVE,
    POWER_OUT,
    UNUSED,
    Kind,
    Pin,
)

STAGES = ("supply", "generator", "source", "multiplexers", "electrodes", "receiver", "sense")
MUX_REF = dict(zip(MULTIPLEXERS, ("U6", "U7", "U8", "U9"), strict=True))
MUX_NET = dict(zip(MULTIPLEXERS, ("DRIVE", "RETURN", "VPLUS", "VMINUS"), strict=True))


def nucleo() -> Kind:
    """The processor board: each pin that the shield uses, by its place on the connectors."""
    pins = [
        Pin(place(wire), wire.pin, _direction(wire)) for wire in WIRES if wire.zio or wire.morpho
    ]
    pins += [
        Pin(LOGIC_SUPPLY, "3V3", POWER_OUT),
        Pin(ANALOG_SUPPLY, "AVDD", POWER_OUT),
        Pin(ANALOG_GROUND, "AGND", PASSIVE),
        Pin(GROUND, "GND", POWER_OUT),
    ]
    return Kind("NUCLEO-F767ZI", "A", tuple(pins), "eitskin:NUCLEO-144_shield")


def place(wire: Wire) -> str:
    """The place where the shield reaches a pin: on a Zio connector if one has the pin."""
    return wire.zio or wire.morpho


def _direction(wire: Wire) -> str:
    if wire.function.startswith("ADC"):
        return PASSIVE
    return INPUT if wire.function.startswith("input") else OUTPUT


class _Builder:
    """Adds parts to a SKiDL circuit; nets are made when they are first named."""

    def __init__(self, skidl: Any) -> None:
        self.skidl = skidl
        self.circuit = skidl.Circuit()
        self.templates: dict[str, Any] = {}
        self.nets: dict[str, Any] = {}
        self.stage = ""
        self.stages: dict[str, tuple[str, bool, Kind]] = {}

    def net(self, name: str) -> Any:
        if name not in self.nets:
            self.nets[name] = self.skidl.Net(name, circuit=self.circuit)
        return self.nets[name]

    def add(
        self,
        ref: str,
        kind: Kind | str,
        nets: Mapping[str, str],
        value: str = "",
        optional: bool = False,
    ) -> None:
        """Add a part; ``nets`` is keyed by the names of its pins."""
        kind = KINDS[kind] if isinstance(kind, str) else kind
        if kind.name not in self.templates:
            self.templates[kind.name] = self.skidl.Part(
                name=kind.name,
                tool=self.skidl.SKIDL,
                dest=self.skidl.TEMPLATE,
                ref_prefix=kind.prefix,
                pins=[
                    self.skidl.Pin(
                        num=pin.number, name=pin.name, func=self.skidl.Pin.types[pin.function]
                    )
                    for pin in kind.pins
                ],
            )
        part = self.templates[kind.name](
            circuit=self.circuit,
            ref=ref,
            value=value or kind.name,
            footprint=kind.footprint,
            tag=f"eitskin-{ref}",
        )
        if part.ref != ref:
            raise ValueError(f"{ref} stands twice in the circuit")
        for pin in kind.pins:
            net = nets.get(pin.name)
            if net is not None:
                self.net(net).connect(part[_by_number(pin.number)])
            elif pin.function == UNUSED:
                self.circuit.NC.connect(part[_by_number(pin.number)])
        unknown = set(nets) - {pin.name for pin in kind.pins}
        if unknown:
            raise ValueError(f"{ref} has no pin {sorted(unknown)}")
        self.stages[ref] = (self.stage, optional, kind)

    def two(
        self, ref: str, kind: str, value: str, one: str, two: str, optional: bool = False
    ) -> None:
        """Add a part of two pins."""
        self.add(ref, kind, {"1": one, "2": two}, value, optional)

    def resistor(self, ref: str, value: str, one: str, two: str, tight: bool = False) -> None:
        """Add a resistor of 1 %, or 0.1 %."""
        self.two(ref, "R 0.1 %" if tight else "R", value, one, two)

    def bypass(self, ref: str, net: str, ground: str = "AGND") -> None:
        """Add 100 nF at a supply pin."""
        self.two(ref, "C X7R", "100n", net, ground)


def _by_number(number: str) -> Any:
    """SKiDL takes a string as a pattern of names and numbers; a number of digits is exact."""
    return int(number) if number.isdigit() else number


def _supply(b: _Builder) -> None:
    b.stage = "supply"
    b.add("J1", "supply inlet", {"+15V": "+15V", "AGND": "AGND", "-15V": "-15V"})
    b.two("C1", "C bulk", "47u", "+15V", "AGND")
    b.two("C2", "C bulk", "47u", "AGND", "-15V")
    b.two("NT1", "star point", "", "AGND", "GND")
    # Supply good: light in U12 needs +15 V and -15 V together above about 26 V. The internal
    # pull-up of PC11 makes a board without these parts read "good".
    b.resistor("R1", "2.2k", "+15V", "LIGHT")
    b.add("D1", "Zener", {"K": "LIGHT", "A": "ZENER"}, "24V")
    nets = {"A": "ZENER", "K": "-15V", "C": "+3V3", "E": "SUPPLY_GOOD"}
    b.add("U12", "optocoupler", nets)
    b.resistor("R2", "10k", "SUPPLY_GOOD", "GND")


def _board(b: _Builder) -> None:
    nets = {"3V3": "+3V3", "AVDD": "AVDD", "AGND": "AGND", "GND": "GND"}
    for wire in WIRES:
        if wire.zio or wire.morpho:
            nets[wire.pin] = wire.pin
    nets |= {"PA3": "CONVERTER", "PC0": "SENSE", "PC11": "SUPPLY_GOOD"}
    b.add("A1", nucleo(), nets)


def _generator(b: _Builder) -> None:
    b.stage = "generator"
    b.add(
        "U1", "AD9833",
        {"COMP": "COMP", "VDD": "+3V3", "CAP": "CAP", "DGND": "GND", "AGND": "AGND",
         "MCLK": "PA8", "SDATA": "PC12", "SCLK": "PC10", "FSYNC": "PD2", "VOUT": "SINE"},
    )  # fmt: skip
    b.two("C3", "C X7R", "10n", "COMP", "+3V3")
    b.bypass("C4", "CAP", "GND")
    b.bypass("C5", "+3V3", "GND")
    # Sallen-Key, 198 kHz and Q 0.73 with the 200 ohm inside the AD9833
    b.resistor("R3", "1k", "SINE", "FILTER")
    b.resistor("R4", "1.15k", "FILTER", "FILTERED")
    b.two("C6", "C C0G", "1n", "FILTER", "SMOOTH")
    b.two("C7", "C C0G", "470p", "FILTERED", "AGND")
    _op_amp(b, "U2", "FILTERED", "SMOOTH", "SMOOTH")
    # Without the generator's bias: 159 Hz. The servo of the source sets the mean.
    b.two("C8", "C film", "100n", "SMOOTH", "BLOCKED")
    b.resistor("R5", "10k", "BLOCKED", "SERVO")
    # Gain 3.26 for the sine, 1 for its mean
    b.resistor("R6", "2.26k", "GAIN_IN", "DRIVE_V")
    b.resistor("R7", "1k", "GAIN_IN", "GAIN_LEG")
    b.two("C9", "C X7R", "1u", "GAIN_LEG", "AGND")
    _op_amp(b, "U3", "BLOCKED", "GAIN_IN", "DRIVE_V")
    for k, net in enumerate(2 * ("+15V", "-15V")):
        b.bypass(f"C{10 + k}", net)


def _op_amp(b: _Builder, ref: str, plus: str, minus: str, out: str, kind: str = "OPA828") -> None:
    b.add(ref, kind, {"+IN": plus, "-IN": minus, "OUT": out, "V+": "+15V", "V-": "-15V"})


def _source(b: _Builder) -> None:
    b.stage = "source"
    # Improved Howland source, 0.5 mA per volt of DRIVE_V. U13 buffers its output, so that the
    # resistors of the positive side draw nothing from the load.
    b.resistor("R8", "10k", "DRIVE_V", "POS", tight=True)
    b.resistor("R9", "10k", "NEG", "AGND", tight=True)
    b.resistor("R10", "10k", "NEG", "SOURCE_OUT", tight=True)
    b.resistor("R11", "10k", "POS", "FOLLOW", tight=True)
    b.resistor("R13", "2k", "SOURCE_OUT", "SOURCE", tight=True)
    _op_amp(b, "U4", "POS", "NEG", "SOURCE_OUT")
    _op_amp(b, "U13", "SOURCE", "FOLLOW", "FOLLOW")
    # The return is driven to minus the source's voltage: the middle of the skin stays at 0 V, and
    # the capacitance of wires and multiplexers takes little current from it.
    b.resistor("R16", "10k", "FOLLOW", "MIRROR_IN", tight=True)
    b.resistor("R17", "10k", "MIRROR_IN", "MIRROR", tight=True)
    _op_amp(b, "U14", "AGND", "MIRROR_IN", "MIRROR")
    # Direct current: C14 and C41 keep it out of the skin, also when an amplifier fails; the servo
    # takes the mean of SOURCE to 0 V.
    b.two("C14", "C C0G", "10n", "SOURCE", "DRIVE")
    b.two("C41", "C C0G", "10n", "MIRROR", "MIRRORED")
    b.resistor("R14", "1M", "SOURCE", "AGND")
    b.resistor("R18", "1M", "RETURN", "AGND")
    b.resistor("R15", "10M", "SOURCE", "SERVO_IN")
    b.two("C15", "C X7R", "1u", "SERVO_IN", "SERVO")
    _op_amp(b, "U5", "AGND", "SERVO_IN", "SERVO", "TL071H")
    numbers = (16, 17, 18, 19, 42, 43, 44, 45)
    for number, net in zip(numbers, 4 * ("+15V", "-15V"), strict=True):
        b.bypass(f"C{number}", net)


def _multiplexers(b: _Builder) -> None:
    """R20 to R39: 1 kohm in each logic line, so that dead rails take at most 3 mA of a pin."""
    b.stage = "multiplexers"
    lines = {wire.to: wire.pin for wire in WIRES if wire.to.startswith("ADG1206")}
    number = 20
    for index, name in enumerate(MULTIPLEXERS):
        short = f"{'I' if index < 2 else 'V'}{'P' if index % 2 == 0 else 'N'}"
        nets = {"VDD": "+15V", "VSS": "-15V", "GND": "GND", "D": MUX_NET[name]}
        nets |= {f"S{k + 1}": f"E{k}" for k in range(16)}
        for line in ("A0", "A1", "A2", "A3", "EN"):
            nets[line] = f"{short}_{line}"
            b.resistor(f"R{number}", "1k", lines[f"ADG1206 {name} {line}"], nets[line])
            number += 1
        b.add(MUX_REF[name], "ADG1206", nets)
        b.resistor(f"R{40 + index}", "100k", nets["EN"], "GND")
        b.bypass(f"C{20 + 2 * index}", "+15V")
        b.bypass(f"C{21 + 2 * index}", "-15V")


def _electrodes(b: _Builder) -> None:
    b.stage = "electrodes"
    nets = {f"E{k}": f"E{k}" for k in range(16)} | {f"AGND{k}": "AGND" for k in range(16)}
    b.add("J2", "electrode connector", nets)
    for k in range(8):
        b.add(
            f"D{10 + k}", "ESD2CAN24", {"IO1": f"E{2 * k}", "IO2": f"E{2 * k + 1}", "GND": "AGND"}
        )


def _receiver(b: _Builder) -> None:
    b.stage = "receiver"
    b.resistor("R50", "1M", "VPLUS", "AGND")
    b.resistor("R51", "1M", "VMINUS", "AGND")
    b.resistor("R52", "4.87k", "RG1", "RG2", tight=True)
    b.add(
        "U10", "AD8421",
        {"+IN": "VPLUS", "-IN": "VMINUS", "RG1": "RG1", "RG2": "RG2", "REF": "REF",
           "OUT": "RECEIVED", "+VS": "+15V", "-VS": "-15V"},
    )  # fmt: skip
    b.resistor("R53", "10k", "AVDD", "HALF")
    b.resistor("R54", "10k", "HALF", "AGND")
    b.two("C30", "C X7R", "1u", "HALF", "AGND")
    b.add("U11", "OPA320", {"+IN": "HALF", "-IN": "REF", "OUT": "REF", "V+": "AVDD", "V-": "AGND"})
    b.resistor("R55", "1k", "RECEIVED", "LIMITED")
    b.two("C31", "C C0G", "470p", "LIMITED", "AGND")
    b.add("D2", "BAT54S", {"A": "AGND", "K": "AVDD", "AK": "LIMITED"})
    b.resistor("R56", "100", "LIMITED", "CONVERTER")
    for k, net in enumerate(("+15V", "-15V", "AVDD")):
        b.bypass(f"C{32 + k}", net)


def _sense(b: _Builder) -> None:
    """R60 joins the driven return. With the sense resistor R63 in place of R60 the return is
    grounded, and the other optional parts are fitted."""
    b.stage = "sense"
    b.resistor("R60", "0", "MIRRORED", "RETURN")
    b.two("R63", "R 0.1 %", "1k", "RETURN", "AGND", optional=True)
    b.two("C40", "C film", "100n", "RETURN", "SENSE", optional=True)
    b.two("R61", "R", "100k", "AVDD", "SENSE", optional=True)
    b.two("R62", "R", "100k", "SENSE", "AGND", optional=True)
    b.add("D3", "BAT54S", {"A": "AGND", "K": "AVDD", "AK": "SENSE"}, optional=True)


def build_circuit() -> tuple[Any, Any, dict[str, tuple[str, bool, Kind]]]:
    """Return SKiDL's module, the circuit, and for each reference its stage, whether it is optional,
    and its kind."""
    skidl = _quiet_skidl()
    b = _Builder(skidl)
    b.stage = "supply"
    _board(b)
    for stage in (_supply, _generator, _source, _multiplexers, _electrodes, _receiver, _sense):
        stage(b)
    for name in ("+15V", "-15V", "+3V3", "AVDD", "GND", "AGND"):
        b.net(name).drive = skidl.POWER
    return skidl, b.circuit, b.stages


@cache
def instrument() -> Design:
    """Return the instrument's design."""
    _, circuit, stages = build_circuit()
    parts = {}
    for part in circuit.parts:
        stage, optional, kind = stages[part.ref]
        net = {pin.name: pin.net.name for pin in part.pins if pin.is_connected() is True}
        value = part.value if part.value != kind.name else ""
        parts[part.ref] = Part(part.ref, kind, value, stage, net, optional)
    order = {stage: k for k, stage in enumerate(STAGES)}
    return Design(dict(sorted(parts.items(), key=lambda item: order[item[1].stage])))


@cache
def _quiet_skidl() -> Any:
    """Import SKiDL, which writes logs into the working folder and warns of KiCad's libraries, that
    are not used."""
    here = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            logging.disable(logging.WARNING)
            import skidl

            skidl.logger.stop_log_file_output()
        finally:
            logging.disable(logging.NOTSET)
            os.chdir(here)
    return skidl
