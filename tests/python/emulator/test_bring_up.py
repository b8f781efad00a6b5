"""Bring-up on the emulated board: nothing is wrong with a right instrument, and each of the
mistakes that a maker makes is named by its stage."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from eitskin.bringup.findings import STAGES, StageReport
from eitskin.bringup.run import bring_up
from eitskin.device.wire.link_table import Setting
from eitskin_emulator.analog.fixture import ring
from emulated import board_of, connect, power_up

EXCHANGED_A0_A1 = [k & 12 | (k & 1) << 1 | k >> 1 & 1 for k in range(16)]
A2_LOW = [k & ~4 for k in range(16)]


@dataclass(frozen=True)
class Mistake:
    """A mistake of the maker of a board, which ``make`` puts into the emulated one, and the stage
    that must name it."""

    name: str
    make: Callable
    stage: str
    words: str


def front(**values) -> Callable:
    def make(board) -> None:
        for name, value in values.items():
            setattr(board.front_end, name, value)

    return make


def wired(multiplexer: int, electrodes) -> Callable:
    def make(board) -> None:
        board.front_end.wired[multiplexer] = list(electrodes)

    return make


def own_oscillator(board) -> None:
    board.generator.oscillator_hz = 24_000_000
    board.generator.set_mclk(board.clock.now, 8_000_000)


def no_generator(board) -> None:
    front_end = board.front_end
    front_end.source_a = 1e-9


def open_electrode(board) -> None:
    electrodes = list(range(16))
    electrodes[5] = None
    for multiplexer in range(4):
        board.front_end.wired[multiplexer] = list(electrodes)


MISTAKES = (
    Mistake("no +-15 V", lambda board: board.lose_analog(True), "supplies", "-15 V is missing"),
    Mistake("no half reference", front(bias_codes=-700.0), "supplies", "REF is not half"),
    Mistake("digital ground", front(noise_codes=25.0), "converter", "analogue ground"),
    Mistake("the module's oscillator left on", own_oscillator, "generator", "clock is 24 MHz"),
    Mistake("no generator", no_generator, "generator", "no signal"),
    Mistake("gain of 30", front(gain=30.0), "generator", "clips"),
    Mistake("Howland resistor missing", front(source_ohm=20e3), "source", "R8 to R11"),
    Mistake("source resistor of 20 kohm", front(source_a=0.05e-3), "amplifier", "R13"),
    Mistake("gain of 2", front(gain=2.0), "amplifier", "R52"),
    Mistake("capacitor of 47 nF", front(tau_ticks=47e-6 * 432e6), "amplifier", "settles slowly"),
    Mistake("A0 and A1 of V+ exchanged", wired(2, EXCHANGED_A0_A1), "multiplexers",
            "A0 and A1 of V+ are exchanged"),
    Mistake("A2 of I- open", wired(1, A2_LOW), "multiplexers", "A2 of I- is always low"),
    Mistake("EN of V- open", wired(3, [None] * 16), "generator", "no signal"),
    Mistake("wire of electrode 5 open", open_electrode, "multiplexers", "5 shows nothing"),
)  # fmt: skip


@pytest.fixture(scope="module")
def device(image):
    return connect(power_up(image))


def reports_of(device, *, make=None, ring_of=None, across_v=None, first=STAGES[0], last="ring"):
    """All reports, with a mistake made before, and taken back after."""
    board = board_of(device)
    fresh = board.front_end.__class__(board.generator, board.multiplexers, board.skin)
    board.multiplexers.switched = board.front_end._switched
    names = ("source_a", "gain", "source_ohm", "bias_codes", "noise_codes", "tau_ticks", "wired")
    if make is not None:
        make(board)

    def fixture(what: str) -> None:
        device.transport.connect(what)
        if what == "ring" and ring_of is not None:
            board.front_end.fixture = ring_of

    try:
        return list(
            bring_up(
                device, fixture, lambda question: across_v, lambda what: False, first=first,
                last=last,
            )
        )  # fmt: skip
    finally:
        for name in names:
            setattr(board.front_end, name, getattr(fresh, name))
        board.generator.oscillator_hz = 0
        board.generator.set_mclk(board.clock.now, 8_000_000)
        board.lose_analog(False)
        board.front_end.fixture = None


def texts(report: StageReport) -> str:
    return "; ".join(one.wrong for one in report.findings if one.wrong)


def test_a_right_instrument_passes_every_stage(device):
    reports = reports_of(device, last="gel")
    assert [(one.stage, one.good) for one in reports] == [(stage, True) for stage in STAGES]


IN_TURN = [  # a short run has every third
    one if k % 3 == 0 else pytest.param(one, marks=pytest.mark.long("every third mistake"))
    for k, one in enumerate(MISTAKES)
]


@pytest.mark.parametrize("mistake", IN_TURN, ids=lambda one: one.name)
def test_a_mistake_is_named_by_its_stage(device, mistake):
    last = reports_of(device, make=mistake.make)[-1]
    assert (last.stage, last.good) == (mistake.stage, False), texts(last)
    assert mistake.words in texts(last)


def test_a_wrong_or_open_resistor_of_the_ring_is_named(device):
    last = reports_of(device, ring_of=ring({6: 680.0}), first="ring")[-1]
    assert "electrodes 6 and 7" in texts(last)
    (wrong,) = (one for one in last.findings if one.wrong)
    assert float(wrong.seen.removesuffix(" ohm")) == pytest.approx(680, rel=0.02)
    last = reports_of(device, ring_of=ring({9: 1e9}), first="ring")[-1]
    (wrong,) = (one for one in last.findings if "9 to 10" in one.what)
    assert wrong.seen.startswith("more than")


def test_with_the_voltage_over_the_resistor_source_and_gain_are_told_apart(device):
    last = reports_of(
        device, make=front(source_a=0.05e-3), across_v=0.05, first="source", last="amplifier"
    )[-1]
    assert last.stage == "source" and "--source-ua" in texts(last)
    last = reports_of(device, make=front(gain=2.0), across_v=0.5, first="source", last="amplifier")[
        -1
    ]
    assert last.stage == "amplifier"


def test_bring_up_learns_the_buttons_polarity(device):
    board = board_of(device)
    board.button_low = True
    board.hold_button(False)

    def done(what: str) -> bool:
        board.hold_button(what.startswith("hold"))
        return True

    (report,) = bring_up(device, lambda what: None, lambda question: None, done, last="supplies")
    assert report.good and device.info().settings & Setting.BUTTON_LOW
    assert any("pulls its pin low" in one.seen for one in report.findings)
    board.button_low = False
    board.hold_button(False)
    list(bring_up(device, lambda what: None, lambda question: None, done, last="supplies"))
    assert not device.info().settings & Setting.BUTTON_LOW


def test_a_probe_shows_a_row_while_it_settles(device):
    device.transport.connect("ring")
    burst = device.probe((1, 0, 1, 0), before=(0, 1, 1, 0), settle_us=1, samples=200)
    assert 1 <= burst.start_us - burst.switched_us <= 6 and len(burst.codes) == 200
    assert not burst.lost and np.ptp(burst.codes) > 3000
    device.transport.connect("skin")


def test_the_command_prints_each_stage_and_ends_at_the_first_wrong_one(device, monkeypatch, capsys):
    from eitskin.cli import bring_up as command
    from eitskin.cli.main import main

    class Kept:
        def __enter__(self):
            return device

        def __exit__(self, *_):
            return None

    monkeypatch.setattr(command, "open_named", lambda options: Kept())
    asked = ["board", "bring-up", "--device", "emu:two_touch", "--last-stage", "converter"]
    assert main(asked) == 0
    out = capsys.readouterr().out
    assert "supplies: ok" in out and "converter: ok" in out and "generator" not in out
    board_of(device).lose_analog(True)
    assert main(asked) == 1
    out = capsys.readouterr().out
    assert "supplies: wrong" in out and "-15 V is missing" in out and "converter" not in out
    board_of(device).lose_analog(False)
