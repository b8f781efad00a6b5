"""A bench: a design with its supplies and a load as a deck, run by ngspice."""

import re
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from importlib.resources import files
from pathlib import Path

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.errors import EitskinError
from eitskin_hardware.circuit.design import Design
from eitskin_hardware.circuit.instrument import MUX_REF
from eitskin_hardware.circuit.nucleo import MULTIPLEXERS, WIRES
from eitskin_hardware.spice.elements import ON_OHM, Conditions, lines, node
from eitskin_hardware.spice.skins import Load

TIMEOUT_S = 120
BREAK_S = 0.2e-6  # the firmware waits so long between off and on
Row = tuple[int, int, int, int]  # I+, I-, V+, V-
PRINTED = re.compile(r"^(\S+) = (\S+?)(?:,(\S+))?$")
FAILED = re.compile(r"\b[Ee]rror\b|no such vector")
LINE_PIN = {wire.to: wire.pin for wire in WIRES}


class SpiceError(EitskinError):
    """ngspice is missing or did not simulate the deck."""


@dataclass(frozen=True)
class Switching:
    """At ``at_s`` all multiplexers open; ``BREAK_S`` later they select ``row``."""

    row: Row
    at_s: float

    def gates(self) -> list[str]:
        """Return the sources that open and close switches."""
        edge, off, on = 20e-9, self.at_s, self.at_s + BREAK_S
        down = f"{off:g} 1 {off + edge:g} 0"
        up = f"{on:g} 0 {on + edge:g} 1"
        return [
            f"VGB gate_before 0 pwl(0 1 {down})",
            f"VGA gate_after 0 pwl(0 0 {up})",
            f"VGC gate_both 0 pwl(0 1 {down} {up})",
        ]


@dataclass(frozen=True)
class Bench:
    """A circuit to simulate. ``row`` is what the firmware sets on its pins; None disables all.
    ``plus_v`` and ``minus_v`` are the supplies; None leaves one unconnected."""

    design: Design
    load: Load | None = None
    row: Row | None = None
    plus_v: float | None = 15.0
    minus_v: float | None = -15.0
    conditions: Conditions = field(default_factory=Conditions)
    extra: tuple[str, ...] = ()
    then: Switching | None = None

    def deck(self, control: Sequence[str], linear: bool = False) -> str:
        """Return the deck with commands to run. A ``linear`` analysis needs no slew rate, without
        which the operating point is found at once."""
        made = ["* The eitskin instrument. Written from circuit/instrument.py; do not edit."]
        made += [f".func eitlimit(x) {{{'x' if linear else 'tanh(x)'}}}", models()]
        made += [line for part in self.design.fitted() for line in lines(part, self.conditions)]
        made += self.load.lines() if self.load else []
        if self.plus_v is not None:
            made.append(f"VSUP {node('+15V')} 0 {self.plus_v:g}")
        if self.minus_v is not None:
            made.append(f"VSUN {node('-15V')} 0 {self.minus_v:g}")
        made += [f"RSU{k} {node(net)} 0 1meg" for k, net in enumerate(("+15V", "-15V"))]
        self._close_switches(made)
        made += [
            *self.extra,
            ".options noacct rshunt=1e12",
            ".control",
            "set numdgt=9",
            *control,
            "quit",
            ".endc",
            ".end",
        ]
        return "\n".join(made) + "\n"

    def _close_switches(self, made: list[str]) -> None:
        """Close the switch that each multiplexer selects, in the lines ``made``; after ``then`` the
        one of that row."""
        if self.row is None or self.plus_v is None or self.minus_v is None:
            return
        now = _closed(self.design, self.row)
        later = _closed(self.design, self.then.row) if self.then else set()
        for at, line in enumerate(made):
            name, *ends = line.split(" ")
            if not self.then and name in now:
                made[at] = f"{name} {' '.join(ends[:2])} {ON_OHM:g}"
            elif self.then and (name in now or name in later):
                gate = {True: "both", False: "before" if name in now else "after"}[
                    name in now and name in later
                ]
                here = f"v({ends[0]},{ends[1]})"
                made[at] = f"B{name} {ends[0]} {ends[1]} i = {here}*v(gate_{gate})/{ON_OHM:g}"
        if self.then:
            made += self.then.gates()

    def run(self, control: Sequence[str], linear: bool = False) -> str:
        """Run the deck and return what ngspice prints.

        Raises:
            SpiceError: ngspice is missing, fails or does not end.
        """
        return run_ngspice(self.deck(control, linear))

    def phasors(self, *names: str, frequency_hz: float = 50_000.0) -> dict[str, complex]:
        """Return the amplitude (complex) of each expression in a linear analysis."""
        control = [f"ac lin 1 {frequency_hz:g} {frequency_hz:g}", *_print(names)]
        printed = self.run(control, linear=True)
        return _named(printed, names)

    def levels(self, *names: str) -> dict[str, float]:
        """Return the direct voltage of each expression."""
        found = _named(self.run(["op", *_print(names)]), names)
        return {name: value.real for name, value in found.items()}

    def course(
        self, names: Sequence[str], stop_s: float, step_s: float, start_s: float = 0.0
    ) -> FloatArray:
        """Return the course over time (samples, 1 + names): times, then each expression."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "course"
            control = [f"tran {step_s:g} {stop_s:g} {start_s:g} {step_s:g}"]
            control += ["set wr_singlescale", f"wrdata {path} {' '.join(names)}"]
            printed = self.run(control)
            if not path.exists():
                raise SpiceError(f"ngspice wrote no course: {_reason(printed)}")
            return np.loadtxt(path)

    def with_row(self, row: Row | None) -> "Bench":
        """Return the bench with another row selected."""
        return replace(self, row=row)


def pin_levels(row: Row) -> dict[str, bool]:
    """Return the level of each of the processor's pins that select ``row``."""
    levels = {}
    for name, electrode in zip(MULTIPLEXERS, row, strict=True):
        levels[LINE_PIN[f"ADG1206 {name} EN"]] = True
        for bit in range(4):
            levels[LINE_PIN[f"ADG1206 {name} A{bit}"]] = bool(electrode >> bit & 1)
    return levels


def selected(design: Design, ref: str, levels: dict[str, bool]) -> int | None:
    """Return the switch (from 0) that a multiplexer closes: its lines are followed through the
    resistors to the processor's pins. A line that leads nowhere is low."""
    part = design.parts.get(ref)
    if part is None:
        return None
    high = [_level(design, part.net.get(line), levels) for line in ("A0", "A1", "A2", "A3", "EN")]
    if not high[4]:
        return None
    return sum(1 << bit for bit in range(4) if high[bit])


def _level(design: Design, net: str | None, levels: dict[str, bool]) -> bool:
    if net is None:
        return False
    if net in levels:
        return levels[net]
    for part in design.of("R"):
        ends = (part.net.get("1"), part.net.get("2"))
        if part.value in ("1k", "0") and net in ends:
            other = ends[1] if ends[0] == net else ends[0]
            if other in levels:
                return levels[other]
    return False


def _closed(design: Design, row: Row) -> set[str]:
    """Return the switches that are closed for ``row``, as the names of their resistors."""
    levels = pin_levels(row)
    found = {ref: selected(design, ref, levels) for ref in MUX_REF.values()}
    return {f"R{ref}_{switch + 1}" for ref, switch in found.items() if switch is not None}


def models() -> str:
    """Return the macro models."""
    return files("eitskin_hardware.spice").joinpath("models.lib").read_text(encoding="utf-8")


@lru_cache(maxsize=512)
def run_ngspice(deck: str) -> str:
    """Run a deck in batch mode and return what ngspice prints. The same deck is run once: stages of
    bring-up share most of theirs."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "deck.cir"
        path.write_text(deck, encoding="utf-8")
        try:
            done = subprocess.run(
                ["ngspice", "-b", str(path)],
                capture_output=True,
                text=True,
                timeout=TIMEOUT_S,
                cwd=folder,
            )
        except FileNotFoundError as error:
            raise SpiceError("ngspice is not installed: sudo apt-get install ngspice") from error
        except subprocess.TimeoutExpired as error:
            raise SpiceError(f"ngspice did not end within {TIMEOUT_S} s") from error
    printed = done.stdout + done.stderr
    if FAILED.search(printed):
        raise SpiceError(f"ngspice: {_reason(printed)}")
    return printed


def printed_values(printed: str) -> list[complex]:
    """Return the values of all ``print`` commands, in their order."""
    found = []
    for line in printed.splitlines():
        match = PRINTED.match(line.strip())
        if match:
            found.append(complex(float(match[2]), float(match[3] or 0)))
    return found


def _named(printed: str, names: Sequence[str]) -> dict[str, complex]:
    found = printed_values(printed)
    if len(found) != len(names):
        raise SpiceError(f"ngspice printed {len(found)} of {len(names)} values: {_reason(printed)}")
    return dict(zip(names, found, strict=True))


def _print(names: Sequence[str]) -> list[str]:
    return [f"print {name}" for name in names]


def _reason(printed: str) -> str:
    bad = [line for line in printed.splitlines() if FAILED.search(line)]
    return "; ".join(bad[:3]) or printed[-300:]
