"""From a contact to the report of it: many presses on a simulated board, few on the emulated one.

Presses come at random times and places, while scans follow one another without a pause; each row is
measured at its own instant, so that a press lands and lifts in the middle of scans. The scan's part
is the simulated board's, update, solve and link the emulated one's, host this machine's; a whole is
drawn from the parts at random.
"""

import os
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.arrays import FloatArray
from eitskin.device.ports import BAUD
from eitskin.device.wire.codec import Packet, encode
from eitskin.device.wire.link_table import PacketType, Stream
from eitskin.session.frame import DriveReport, Frame
from eitskin.session.session import Session
from eitskin.session.settings import SessionSettings
from eitskin.truth import observe_scene
from eitskin_studies.benchmarks.outputs import BITS_A_BYTE, host_times_ms
from eitskin_studies.gestures.bench import wilson
from eitskin_studies.harness.machine import machine
from eitskin_studies.harness.sections import Filling

ROWS, ROW_US, DRIVES_A_FRAME = 208, 100.0, 16
RATE_HZ = 1e6 / (ROWS * ROW_US)  # scans without a pause
RISES_MS = (0, 30, 60, 120)
UNTOUCHED_FRAMES = 64
HELD_S = 0.25  # fully pressed; and at least from lift to contact
LINGER_S = 0.1  # after a lift a touch may still be reported for so long
REACH_MM = 60.0  # of contacts from the centre
FALSE_MM = 20.0  # a touch farther off is a false one
IN_SESSION = 50  # presses; each session takes a reference of its own
DRAWS = 20_000
WHOLE, DRIVES = "whole frames", "after each drive"
REPORT = {WHOLE: "frame", DRIVES: "drive"}
QUICK_S = 0.06  # on the emulated board presses of drives are held so long, and as far apart
HEAD = ("method", "rise, ms", "missed", "presses with a false touch", "false touches a press",
    "presses with a false diagnostic", "frames with one",
    "scan, ms", "at the device, ms", "at the host, ms",
    "error then, mm")  # fmt: skip
PARTS_HEAD = ("part", "median ms", "p95 ms", "worst ms", "of")


@dataclass(frozen=True)
class Press:
    """Contact begins, and is whole ``rise_s`` later; it ends at ``lift_s``, as slowly as it
    came."""

    contact_s: float
    rise_s: float
    lift_s: float
    x_mm: float
    y_mm: float

    @property
    def gone_s(self) -> float:
        """From here on nothing touches the skin."""
        return self.lift_s + self.rise_s


@dataclass(frozen=True, eq=False)
class Reported:
    """The report of one frame or drive: measured from ``began_s`` to ``ended_s`` on the scene's
    clock, places of touches (k, 2) in mm, names of diagnostics; how long after it the packet was
    made, and takes on the line. Where drives tell of touches, frames only tell of diagnostics."""

    began_s: float
    ended_s: float
    touches_mm: FloatArray
    diagnostics: tuple[str, ...]
    solve_ms: float
    link_ms: float
    frame: bool


@dataclass(frozen=True)
class Judged:
    """The presses of one rise: what was first reported of each (``scan_ms``: from the contact to
    the end of the scan, or drive, that reported it; ``later_ms``: from there until the packet was
    made); presses with a false touch, how many those were, presses with a diagnostic, and whole
    frames that were solved, and those with one."""

    method: str
    rise_ms: int
    presses: int
    scan_ms: tuple[float, ...]
    error_mm: tuple[float, ...]
    later_ms: tuple[float, ...]
    with_false: int
    false_touches: int
    diagnosed: int
    frames: int
    frames_diagnosed: int

    @property
    def missed(self) -> int:
        """Presses without a report while they lasted."""
        return self.presses - len(self.scan_ms)


@dataclass(frozen=True)
class Latency:
    """All of it: (median, p95, worst) of times in ms; of parts also their number."""

    judged: tuple[Judged, ...]
    parts_ms: dict[str, tuple[float, float, float, int]]
    whole_ms: tuple[dict[str, tuple[float, float, float]], ...]
    machine: str

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def run(presses: int, emulated: int, seed: int, order: str = "") -> Latency:
    """``presses`` of each rise on the simulated board, drives as they stand, and again in
    ``order``; ``emulated`` of 30 ms on the emulated board.

    Raises:
        ProtocolError: the order cannot be.
    """
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        judged = []
        orders = ("", order) if order else ("",)
        for method, one in ((m, o) for m in (DRIVES, WHOLE) for o in reversed(orders)):
            model = _model(place, one)
            name = f"{method}, drives {one}" if one else method
            for rise_ms in RISES_MS:
                sessions = []
                for first in range(0, presses, IN_SESSION):
                    own_seed = seed + 10_000 * rise_ms + first
                    count = min(IN_SESSION, presses - first)
                    drawn = draw(count, 1e-3 * rise_ms, own_seed)
                    reported = follow("sim", place, drawn, own_seed, model, REPORT[method])
                    sessions.append((drawn, list(reported)))
                judged.append(judge(name, rise_ms, sessions))
        parts = _parts(place, emulated, seed, order)
    rng = np.random.default_rng(seed)
    whole = tuple(_whole(one, parts, rng) for one in judged)
    shown = {name: (*_spread(values), len(values)) for name, values in parts.items()}
    return Latency(tuple(judged), shown, whole, machine())


def _named(
    method: str, judged: Judged, reported: Sequence[Reported], what: str
) -> dict[str, FloatArray]:
    found = [one for one in reported if len(one.touches_mm)]
    return {
        f"scan, {method}": np.array(judged.scan_ms),
        f"{what}, {method}": np.array([one.solve_ms for one in found]),
        f"link, {method}": np.array([one.link_ms for one in found]),
    }


def _parts(place: Path, emulated: int, seed: int, order: str) -> dict[str, FloatArray]:
    """Return the times that the emulated board and this host take, in ms."""
    parts: dict[str, FloatArray] = {}
    if emulated:
        drawn = draw(emulated, 0.03, seed + 1)
        reported = list(follow("emu", place, drawn, seed, None))
        parts = _named(WHOLE, judge(WHOLE, 30, [(drawn, reported)]), reported, "solve")
        quick = draw(emulated, 0.03, seed + 2, QUICK_S)
        reported = list(follow("emu", place, quick, seed, _model(place, order), REPORT[DRIVES]))
        judged = judge(DRIVES, 30, [(quick, reported)])
        parts |= _named(DRIVES, judged, reported, "update")
        parts[f"first update, {DRIVES}"] = np.array(judged.later_ms)
    steady = _written(place, "steady", draw(2, 0.0, seed), seed)
    return parts | {"host": host_times_ms(steady)}


def _model(place: Path, order: str) -> Path | None:
    """The prebuilt model with another order of drives; None: as it is."""
    if not order:
        return None
    from dataclasses import replace

    from eitskin.model.eitm import save_model
    from eitskin.model.prebuilt import load_prebuilt
    from eitskin.skin.protocol import in_order

    made = load_prebuilt()[0]
    path = place / "ordered.eitm"
    save_model(path, replace(made, protocol=in_order(made.protocol, order)))
    return path


def draw(count: int, rise_s: float, seed: int, held_s: float = HELD_S) -> list[Press]:
    """Presses one after another, at random times and places, as far apart as they are held."""
    rng, presses, now = np.random.default_rng(seed), [], 0.0
    for _ in range(count):
        now += held_s + float(rng.uniform(0, 2 / RATE_HZ))
        reach, angle = REACH_MM * np.sqrt(rng.random()), 2 * np.pi * rng.random()
        x_mm, y_mm = float(reach * np.cos(angle)), float(reach * np.sin(angle))
        presses.append(Press(now, rise_s, now + rise_s + held_s, x_mm, y_mm))
        now = presses[-1].gone_s
    return presses


def _written(place: Path, name: str, presses: Sequence[Press], seed: int) -> Path:
    """The scene of ``presses``: radius 8 mm, contrast 5, 60 dB, contacts that differ."""
    touches = []
    for press in presses:
        times = [(press.contact_s, 0.0), (press.contact_s + press.rise_s, 1.0)]
        times += [(press.lift_s, 1.0), (press.gone_s, 0.0)]
        path = ", ".join(
            f"{{t_s = {t_s:.6f}, x_mm = {press.x_mm:.3f}, y_mm = {press.y_mm:.3f}, press = {part}}}"
            for t_s, part in (times if press.rise_s else times[1:3])
        )
        touches.append(f"[[touch]]\nradius_mm = 8.0\ncontrast = 5.0\npath = [{path}]\n")
    frames = int((presses[-1].gone_s + LINGER_S) * RATE_HZ) + 2
    written = place / f"{name}.toml"
    written.write_text(
        f'[scene]\nname = "{name}"\nskin = "paper"\nseed = {seed}\nrate_hz = {RATE_HZ!r}\n'
        f"frames = {frames}\nquiet_frames = {UNTOUCHED_FRAMES}\n{''.join(touches)}"
        "[effects.noise]\nsnr_db = 60.0\n[effects.contact_impedance]\nspread = 0.2\n",
        encoding="utf-8",
    )
    return written


def follow(
    board: str,
    place: Path,
    presses: Sequence[Press],
    seed: int,
    model: Path | None,
    report: str = "frame",
) -> Iterator[Reported]:
    """Return what a board, "sim" or "emu", reports of ``presses``, frame by frame or drive by
    drive."""
    scene = _written(place, f"{board}-{len(presses)}", presses, seed)
    settings = SessionSettings(
        mode=Stream.TOUCHES, tare=UNTOUCHED_FRAMES, model=model, every=1, report=report
    )
    with Session(f"{board}:{scene}", settings, observe=observe_scene) as session:
        session.start()
        sizes = [0]  # of the last packet with touches
        teller = PacketType.TOUCHES if report == "frame" else PacketType.DRIVE_TOUCHES

        def tap(packet: Packet) -> None:
            if packet.type == teller:
                sizes[0] = len(encode(packet.type, packet.sequence, packet.payload))

        session.device.record(tap)
        began_us, scan_s = session.began_us, 1e-6 * ROWS * session.device.board.slot_us
        half_s = scan_s * (ROWS // DRIVES_A_FRAME) / ROWS / 2
        for item in session.messages():
            if not isinstance(item, Frame | DriveReport):
                continue
            told_us = item.board_us
            if isinstance(item, DriveReport):
                told_us -= round(1e6 * half_s)
            if began_us is None:  # a simulated board's scene begins with a scan
                began_us = told_us
            began_s = 1e-6 * (told_us - began_us)
            link_ms = 1e3 * sizes[0] * BITS_A_BYTE / BAUD
            if isinstance(item, DriveReport):
                age_us = item.packet.head.age_us
                yield Reported(
                    began_s, began_s + 2 * half_s, _places(item), (), age_us / 1e3, link_ms, False
                )
            elif item.info is not None:
                shown = _places(item) if report == "frame" else np.zeros((0, 2))
                age_ms = item.info.age_us / 1e3
                ended_s = began_s + scan_s
                yield Reported(began_s, ended_s, shown, item.diagnostics, age_ms, link_ms, True)


def _places(item: Frame | DriveReport) -> FloatArray:
    return np.array([(t.x_mm, t.y_mm) for t in item.touches]).reshape(-1, 2)


def judge(
    method: str, rise_ms: int, sessions: Sequence[tuple[Sequence[Press], Sequence[Reported]]]
) -> Judged:
    """Return the reports of each press, session by session. A report is false if it is a touch over
    ``FALSE_MM`` from the press, a second one, one before the contact or over ``LINGER_S`` after the
    press has gone."""
    scans, errors, later, counts, diagnosed = [], [], [], [], 0
    solved = [one for _, reported in sessions for one in reported if one.frame]
    for presses, reported in sessions:
        ends_s = [press.contact_s for press in presses[1:]] + [np.inf]
        at = 0
        for press, end_s in zip(presses, ends_s, strict=True):
            wrong, named, first = 0, False, None
            while at < len(reported) and reported[at].ended_s < end_s:
                one = reported[at]
                at += 1
                away_mm = np.hypot(*(one.touches_mm - (press.x_mm, press.y_mm)).T)
                begun = press.contact_s <= one.ended_s
                there = begun and one.began_s < press.gone_s + LINGER_S
                wrong += len(away_mm) - int(there and bool((away_mm <= FALSE_MM).any()))
                named |= bool(one.diagnostics)
                if first is None and begun and one.began_s < press.gone_s and len(away_mm):
                    first = one.ended_s - press.contact_s, float(away_mm.min()), one.solve_ms
            counts.append(wrong)
            diagnosed += named
            if first is not None:
                scans.append(1e3 * first[0])
                errors.append(first[1])
                later.append(first[2])
    return Judged(
        method,
        rise_ms,
        len(counts),
        tuple(scans),
        tuple(errors),
        tuple(later),
        sum(count > 0 for count in counts),
        sum(counts),
        diagnosed,
        len(solved),
        sum(bool(one.diagnostics) for one in solved),
    )


def _spread(values: npt.ArrayLike) -> tuple[float, float, float]:
    """Median, 95th percentile, worst."""
    if not np.size(values):
        return float("nan"), float("nan"), float("nan")
    median, high, worst = np.percentile(np.asarray(values), [50, 95, 100])
    return float(median), float(high), float(worst)


def _whole(
    one: Judged, parts: dict[str, FloatArray], rng: np.random.Generator
) -> dict[str, tuple[float, float, float]]:
    """From contact to report: when the device has it, and when the host has."""
    if not one.scan_ms:
        return {}
    method = DRIVES if one.method.startswith(DRIVES) else WHOLE
    names = (f"first update, {DRIVES}" if method == DRIVES else f"solve, {WHOLE}",
             f"link, {method}", "host")  # fmt: skip
    solve, link, host = (
        rng.choice(parts[name], DRAWS) if len(parts.get(name, ())) else np.zeros(DRAWS)
        for name in names
    )
    device = rng.choice(one.scan_ms, DRAWS) + solve
    return {"device": _spread(device), "host": _spread(device + link + host)}


def _percent(count: int, of: int) -> str:
    low, high = wilson(count, of)
    return f"{100 * count / of:.0f} % ({100 * max(low, 0.0):.0f} to {100 * high:.0f})"


def _times(values: tuple[float, float, float] | None) -> str:
    return "-" if values is None else ", ".join(f"{value:.1f}" for value in values)


def rows(result: Latency) -> list[list[str]]:
    """A row a method and rise; times as median, p95, worst."""
    return [
        [
            one.method,
            str(one.rise_ms),
            str(one.missed),
            _percent(one.with_false, one.presses),
            f"{one.false_touches / one.presses:.2f}",
            _percent(one.diagnosed, one.presses),
            f"{100 * one.frames_diagnosed / max(1, one.frames):.2f} %",
            _times(_spread(one.scan_ms)),
            _times(whole.get("device")),
            _times(whole.get("host")),
            _times(_spread(one.error_mm)),
        ]
        for one, whole in zip(result.judged, result.whole_ms, strict=True)
    ]


def part_rows(result: Latency) -> list[list[str]]:
    """A row a part."""
    return [
        [name, *(f"{value:.2f}" for value in values[:3]), str(values[3])]
        for name, values in result.parts_ms.items()
    ]


def as_text(result: Latency) -> str:
    """For a terminal."""
    lines = [result.machine]
    for head, table in ((HEAD, rows(result)), (PARTS_HEAD, part_rows(result))):
        wide = [max(len(cell) for cell in column) for column in zip(head, *table, strict=True)]
        for line in (head, *table):
            lines.append("  ".join(cell.ljust(w) for cell, w in zip(line, wide, strict=True)))
    return "\n".join(lines)


def for_page(result: Latency, command: str) -> Filling:
    """The marks ``latency-run``, ``latency`` and ``latency-parts``."""
    emulated = result.parts_ms.get(f"scan, {WHOLE}")
    run_text = (
        f"By `{command}`: {result.judged[0].presses} presses a rise on `sim:`,"
        f" {0 if emulated is None else emulated[3]} found on the emulated board;"
        f" {result.machine}, {os.cpu_count()} processors."
    )
    return {"latency-run": run_text}, {
        "latency": (HEAD, rows(result)),
        "latency-parts": (PARTS_HEAD, part_rows(result)),
    }
