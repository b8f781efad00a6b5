"""Checks of a firmware image on the emulated board. Each checks one property, and returns what is
wrong, or None.

The session is short, and bounded in the board's own time: a broken image must fail soon and not
hang the test.
"""

import zlib
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from eitskin.device.link import Answer, PumpedLink
from eitskin.device.wire import link_table as commands
from eitskin.device.wire.link_table import Stream
from eitskin.device.wire.packets import BoardInfo, RawFrame, Reply
from eitskin.errors import DeviceError
from eitskin.model.eitm import decode_model
from eitskin.model.prebuilt import load_prebuilt
from eitskin.skin.protocol import Protocol
from eitskin_emulator.analog.converter import STEP_V
from eitskin_emulator.board import EmulatedBoard
from eitskin_emulator.clocktime import TICKS_PER_S, TICKS_PER_US
from eitskin_emulator.transport import EmulatedTransport
from emulated import clean, power_up

BOOT_S, ANSWER_S, SCAN_S = 0.4, 0.15, 0.075  # the board solves the model's golden frames first
SETTLING_S = 0.045  # two frames that the board drops
MAX_INTERRUPTS = 10_000  # of a session; a sound image takes about 3,000
EXCITATION_HZ, SETTLE_US = 50_000.0, 16


@dataclass
class Session:
    """A board that has scanned a few frames of a touched skin without noise, and the packets that
    it sent."""

    board: EmulatedBoard
    protocol: Protocol
    frames: list[RawFrame] = field(default_factory=list)
    info: BoardInfo | None = None
    first_sample_at: list[int] = field(default_factory=list)
    link: PumpedLink | None = None
    stuck: str = ""
    asked: int = 1000

    def ask(
        self, command: commands.Command, timeout_s: float = ANSWER_S
    ) -> Reply | BoardInfo | None:
        """The answer to ``command``, if one comes in time; raw frames that come before it are
        kept."""
        assert self.link is not None
        self.asked += 1
        self.link.send(command.TYPE, command.payload(self.asked))
        answer = self.link.answer(_answers, timeout_s)
        while self.link.keeps:
            self._keep(0.0)
        if isinstance(answer, BoardInfo):
            self.info = answer
        assert answer is None or isinstance(answer, Reply | BoardInfo)
        return answer

    def listen(self, time_s: float) -> None:
        """Keep the raw frames that come within ``time_s``."""
        end = self.board.clock.now + round(time_s * TICKS_PER_S)
        while self.board.clock.now < end:
            self._keep((end - self.board.clock.now) / TICKS_PER_S)

    def _keep(self, timeout_s: float) -> None:
        assert self.link is not None
        content = self.link.next(timeout_s)
        if isinstance(content, RawFrame):
            self.frames.append(content)


def _answers(one: Answer) -> bool:
    """Whether it answers a command, which an INFO after a restart does not."""
    return isinstance(one, Reply | BoardInfo) and one.request != 0


class Impatient(EmulatedTransport):
    """Gives up a board that does little but take interrupts."""

    def read(self, timeout_s: float) -> bytes:
        if self.board.record.interrupts.total() > MAX_INTERRUPTS:
            raise DeviceError("an interrupt that does not end")
        return super().read(min(timeout_s, 0.005))


def run_session(image: bytes) -> Session:
    """Power up, stream raw frames, and watch when the converter samples."""
    board = power_up(image, noisy=False)
    board.strict = False  # broken_first says what the monitor found
    session = Session(board, load_prebuilt()[0].protocol)
    board.skin.begin(0)
    sample = board.adc.sample

    def watched(times: np.ndarray, channel: int) -> np.ndarray:
        session.first_sample_at.append(int(times[0]))
        return sample(times, channel)

    board.adc.sample = watched
    session.link = PumpedLink(Impatient("mutant", board))
    try:
        board.run_until(
            round(BOOT_S * TICKS_PER_S), lambda: board.record.interrupts.total() > MAX_INTERRUPTS
        )
        session.ask(commands.GetInfo())
        session.ask(commands.StreamCommand(int(Stream.RAW)))
        session.listen(SCAN_S + SETTLING_S)
        session.ask(commands.StreamCommand(0))
    except DeviceError as error:
        session.stuck = str(error)
    return session


def speaks(session: Session) -> str | None:
    """The board answers, and has no fault."""
    if session.info is None:
        return "no INFO" + session.stuck
    return f"faults {session.info.fault_codes}" if session.info.faults else None


def generator(session: Session) -> str | None:
    """The AD9833, as decoded from the wires, gives the frequency."""
    hz = session.board.generator.frequency_hz
    return (
        None
        if abs(hz - EXCITATION_HZ) < 0.02
        else f"{hz} Hz, words {[hex(word) for word in session.board.generator.words]}"
    )


def order(session: Session) -> str | None:
    """Electrodes are joined as the protocol's table says, row after row."""
    return _order(session.board, session.protocol)


def _order(board: EmulatedBoard, protocol: Protocol) -> str | None:
    table = [tuple(int(k) for k in row) for row in protocol.drive_measure]
    joined = [one.joined for one in board.multiplexers.log if None not in one.joined]
    if table[0] not in joined:
        return "the first row is never joined"
    start = joined.index(table[0])
    if len(joined) - start < len(table):
        return f"only {len(joined) - start} rows are joined"
    wrong = [k for k, row in enumerate(joined[start : start + len(table)]) if row != table[k]]
    return f"row {wrong[0]} is {joined[start + wrong[0]]}, not {table[wrong[0]]}" if wrong else None


def broken_first(session: Session) -> str | None:
    """The monitor of the drive finds nothing: no multiplexer changes its address while it may still
    be closed, no current flows before a host asks."""
    found = session.board.drive.violations
    return f"{len(found)}, first {found[0]}" if found else None


def amplitudes(session: Session) -> str | None:
    """Every row of every raw frame lies within half a step of the scene's exact voltage."""
    if len(session.frames) < 2:
        return f"{len(session.frames)} raw frames"
    exact = session.board.skin.frames_v[0]
    errors = (
        np.array([np.abs(frame.voltage_v - exact).max() for frame in session.frames[1:]]) / STEP_V
    )
    return None if np.all(errors < 0.5) else f"{errors.max():.2f} LSB"


def settled(session: Session) -> str | None:
    """Every burst begins at least the settling time after the switch before it."""
    made = np.array([one.at for one in session.board.multiplexers.log if None not in one.joined])
    starts = np.array(session.first_sample_at)
    if not len(made) or not len(starts):
        return "nothing is sampled"
    starts = starts[starts > made[0]]
    least = ((starts - made[np.searchsorted(made, starts) - 1]) / TICKS_PER_US).min()
    return None if least >= SETTLE_US else f"{least:.2f} us"


def interrupts(session: Session) -> str | None:
    """There is one interrupt per burst: none is lost, and none comes twice."""
    board = session.board
    taken, bursts = board.record.interrupts[16 + 56], board.adc.conversions / 80
    return (
        None
        if bursts > 100 and abs(taken - bursts) <= 1
        else f"{taken} interrupts for {bursts:.1f} bursts"
    )


def orderly(session: Session) -> str | None:
    """Nothing unknown, unclocked, forbidden or crashed."""
    record = session.board.record
    if record.resets != ["power"]:
        return f"resets {record.resets}"
    try:
        clean(session.board)
    except AssertionError:
        return (
            f"{record.unmodelled} {record.clock_off} {record.hazards} {record.faults}"
            f" {session.board.generator.ignored_bits}"
        )
    return None


CHECKS: tuple[Callable[[Session], str | None], ...] = (
    *(speaks, generator, order, broken_first, amplitudes),
    *(settled, interrupts, orderly),
)


def table_after_upload(image: bytes, model: bytes) -> str | None:
    """A model with another protocol is uploaded: its table is the one that is scanned from then
    on."""
    board = power_up(image, noisy=False)
    session = Session(board, decode_model(model, "the model").protocol)
    session.link = PumpedLink(EmulatedTransport("mutant", board))
    board.run_until(round(BOOT_S * TICKS_PER_S))
    steps: list[tuple[commands.Command, float]] = [
        (commands.ModelBegin(len(model), zlib.crc32(model)), 5.0)
    ]
    steps += [
        (commands.ModelData(at, model[at : at + 4096]), 1.0) for at in range(0, len(model), 4096)
    ]
    steps += [(commands.ModelCommit(), 5.0), (commands.GetInfo(), ANSWER_S)]
    for step, timeout_s in steps:
        answer = session.ask(step, timeout_s)
        if answer is None or (isinstance(answer, Reply) and not answer.ok):
            return f"the upload is refused: {answer}"
    if session.info is None or session.info.protocol_hash != session.protocol.hash:
        return "INFO reports another protocol"
    board.multiplexers.log.clear()
    session.ask(commands.StreamCommand(int(Stream.RAW)))
    session.listen(2 * SCAN_S)
    return _order(board, session.protocol)
