"""A simulated board: the firmware's commands, checks and replies over the host core and a scene's
frames.

What the firmware does with registers is left out: there is no converter (no saturated rows, and
open electrodes only once there is a reference, by the core) and no processor time; every time that
would tell of one is 0. The clock runs only while the board scans for someone. All else is as
docs/reference/link-protocol.md says, and the packets are the very bytes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin import __version__
from eitskin.core.results import Info
from eitskin.device.simulated.banks import E_MODEL_MAGIC, SimBanks, golden
from eitskin.device.simulated.checks import (
    OK,
    Answer,
    check_scan,
    check_size,
    check_solver,
    outside,
    slot_us,
)
from eitskin.device.simulated.faults import SimFaults
from eitskin.device.simulated.scan import rows_us, scan_frame
from eitskin.device.simulated.skin import SceneSkin
from eitskin.device.simulated.solve import NOTHING, model_facts
from eitskin.device.wire import commands as cmd
from eitskin.device.wire.codec import Decoder, Packet, encode
from eitskin.device.wire.packets import (
    STAGES,
    BoardInfo,
    BoardStats,
    Fault,
    FaultCode,
    PacketType,
    RawFlags,
    RawFrame,
    Reply,
    StageStats,
    Stream,
)
from eitskin.device.wire.packets import ReplyStatus as Status
from eitskin.device.wire.payloads import build_info, build_raw, build_reply, build_stats

BOARD_NAME = "simulated"
DATA_BYTES = 4096
DEFAULT_SCAN = cmd.Scan(50_000_000, 1_000_000, 80, 16, 1, 0, 0)


class _Tare:
    """Quiet frames that are being collected."""

    def __init__(self, request: int, wanted: int) -> None:
        self.request, self.wanted = request, wanted
        self.frames: list[npt.NDArray[np.float32]] = []


class SimBoard:
    """One board before ``skin``, with two ``banks``. ``receive`` takes the host's bytes,
    ``take_output`` gives the board's, and ``scan_one`` lets it scan a frame if anyone wants one."""

    def __init__(self, skin: SceneSkin, banks: list[bytes]) -> None:
        self.skin, self.banks = skin, SimBanks(banks, skin.electrodes)
        self.time_us = 0
        self._restart()

    # ---- start ----

    def _restart(self) -> None:
        self._decoder = Decoder(numbered=False)
        self._output = bytearray()
        self._sequence = self._sent = 0
        self._frame = self._solved = self._glitches = 0
        self._faults = SimFaults(self._send)
        self._stage_counts = dict.fromkeys(STAGES, 0)
        self._scan = DEFAULT_SCAN
        self._tare: _Tare | None = None
        # answers that are given again when their commands are sent again
        self._last_answer: tuple[int, int, bytes] | None = None
        self._last_tare: tuple[int, bytes] | None = None
        self._stats: BoardStats | None = None
        self._reset_wanted = False
        self.banks.restart()
        why = self._open_newest()
        self._send(PacketType.INFO, build_info(self._info(0)))
        self._tell_no_model(why)

    def _open_newest(self) -> int:
        """Take up the newest valid model; returns an eits_status."""
        self._what, self._every, self._left, self._phase = Stream(0), 1, 0, 0
        self._solver, why = self.banks.open_newest()
        if self._solver is not None:
            period = self.skin.period_us
            enough = period >= rows_us(self._solver, self._scan, full=True)
            self._scan = replace(self._scan, frame_period_us=period if enough else 0)
        return why

    def _tell_no_model(self, why: int) -> None:
        self._faults.set(
            Fault(
                FaultCode.NO_MODEL,
                self._solver is None,
                self._frame,
                0,
                why if self._solver is None else 0,
            )
        )

    # ---- bytes ----

    def receive(self, data: bytes) -> None:
        """What the host sent; commands in it are carried out."""
        for packet in self._decoder.feed(data):
            self._command(packet)
            if self._reset_wanted:
                before = bytes(self._output)
                self._restart()
                self._output[:0] = before
                return

    def take_output(self) -> bytes:
        """What the board has sent since the last call."""
        data = bytes(self._output)
        self._output.clear()
        return data

    def _send(self, packet_type: PacketType, payload: bytes) -> None:
        self._output += encode(packet_type, self._sequence, payload)
        self._sequence = (self._sequence + 1) % 2**32
        self._sent += 1

    # ---- frames ----

    @property
    def wanted(self) -> bool:
        """Whether anyone waits for a frame."""
        return (
            self._solver is not None
            and not self.banks.active
            and (self._tare is not None or bool(self._what))
        )

    def scan_one(self) -> bool:
        """Scan one frame and send what is asked of it; False where nobody wants one.

        Raises:
            EitskinError: the scene cannot be simulated.
        """
        if not self.wanted:
            return False
        assert self._solver is not None
        raw, next_us = scan_frame(self.skin, self._solver, self._scan, self._frame, self.time_us)
        self.time_us += next_us
        self._frame = (self._frame + 1) % 2**32
        self._stage_counts["scan"] += 1
        self._process(raw)
        return True

    def _process(self, raw: RawFrame) -> None:
        assert self._solver is not None
        if self._tare is not None:
            self._take_quiet(self._tare, raw)
            return
        if self._phase > 0:
            self._phase -= 1
            self._examine(raw)
            return
        self._phase = self._every - 1
        if self._what & Stream.RAW:
            self._send(PacketType.RAW, build_raw(raw))
        if self._what & (Stream.IMAGE | Stream.TOUCHES) and self._solver.tared:
            status, info, packets = self._solver.solve(raw, self._what)
            self._tell_found(raw, info, solved=status == 0)
            for packet_type, payload in packets:
                self._send(packet_type, payload)
            self._solved += 1
            self._stage_counts["solve"] += 1
        else:
            self._examine(raw)
        if self._left > 0:
            self._left -= 1
            if self._left == 0:
                self._what = Stream(0)

    def _examine(self, raw: RawFrame) -> None:
        """Faults are told whether anything is streamed or not; without a reference nothing is
        found, and none is stale."""
        assert self._solver is not None
        tared = self._solver.tared
        self._tell_found(raw, self._solver.examine(raw) if tared else NOTHING, solved=not tared)

    def _tell_found(self, raw: RawFrame, info: Info, *, solved: bool) -> None:
        self._glitches += info.glitches
        self._faults.found(raw.frame, info, solved=solved)

    def _take_quiet(self, tare: _Tare, raw: RawFrame) -> None:
        assert self._solver is not None
        tare.frames.append(raw.voltage_v)
        if self._what & Stream.RAW:
            self._send(
                PacketType.RAW, build_raw(replace(raw, flags=raw.flags | int(RawFlags.QUIET)))
            )
        if len(tare.frames) < tare.wanted:
            return
        status = self._solver.tare(tare.frames)
        self._tare = None
        if status == 0:
            self._faults.set(Fault(FaultCode.STALE_REFERENCE, False, raw.frame, 0, 0))
        answer = OK if status == 0 else Answer(Status.CORE, (status, 0))
        reply = build_reply(Reply(tare.request, PacketType.TARE, answer.status, answer.detail))
        self._last_tare = tare.request, reply
        self._send(PacketType.REPLY, reply)

    # ---- commands ----

    def _command(self, packet: Packet) -> None:
        if packet.type < PacketType.GET_INFO:
            return
        request = int.from_bytes(packet.payload[:4], "little")
        if len(packet.payload) >= 4 and self._sent_again(packet.type, request):
            return
        answer = self._dispatch(packet)
        if answer is not None:
            reply = build_reply(Reply(request, packet.type, answer.status, answer.detail))
            self._last_answer = packet.type, request, reply
            self._send(PacketType.REPLY, reply)

    def _sent_again(self, packet_type: int, request: int) -> bool:
        if packet_type == PacketType.TARE:
            if self._tare is not None and self._tare.request == request:
                return True
            if self._last_tare is not None and self._last_tare[0] == request:
                self._send(PacketType.REPLY, self._last_tare[1])
                return True
        if self._last_answer is not None and self._last_answer[:2] == (packet_type, request):
            self._send(PacketType.REPLY, self._last_answer[2])
            return True
        return False

    def _dispatch(self, packet: Packet) -> Answer | None:
        kind = cmd.COMMANDS.get(packet.type)
        if kind is None:
            return Answer(Status.UNKNOWN_COMMAND)
        refused = check_size(kind, packet.payload)
        if refused is not None:
            return refused
        if self._tare is not None and kind not in (
            cmd.GetInfo,
            cmd.GetStats,
            cmd.StreamCommand,
            cmd.Reset,
            cmd.ClearFaults,
        ):
            return Answer(Status.BUSY, (PacketType.TARE, 0))
        if self.banks.active and kind in (
            cmd.StreamCommand,
            cmd.Tare,
            cmd.Scan,
            cmd.Solver,
            cmd.MaskRow,
            cmd.SelfTest,
        ):
            return Answer(Status.BUSY, (PacketType.MODEL_BEGIN, 0))
        parsed = cmd.parse_command(kind, packet.payload)
        assert parsed is not None
        request, command = parsed
        handlers: dict[type[cmd.Command], Callable[[int, Any], Answer | None]] = {
            cmd.GetInfo: self._on_get_info,
            cmd.GetStats: self._on_get_stats,
            cmd.StreamCommand: self._on_stream,
            cmd.Tare: self._on_tare,
            cmd.Scan: self._on_scan,
            cmd.Solver: self._on_solver,
            cmd.MaskRow: self._on_mask_row,
            cmd.ModelBegin: self._on_model_begin,
            cmd.ModelData: self._on_model_data,
            cmd.ModelCommit: self._on_model_commit,
            cmd.SelfTest: self._on_self_test,
            cmd.Reset: self._on_reset,
            cmd.ClearFaults: self._on_clear_faults,
        }
        return handlers[kind](request, command)

    def _on_get_info(self, request: int, command: cmd.GetInfo) -> None:
        self._send(PacketType.INFO, build_info(self._info(request)))

    def _on_get_stats(self, request: int, command: cmd.GetStats) -> Answer | None:
        bad = outside(4, command.reset, 0, 1)
        if bad is not None:
            return bad
        if self._stats is None or self._stats.request != request:
            self._stats = self._statistics(request)
            if command.reset:
                self._stage_counts = dict.fromkeys(STAGES, 0)
        self._send(PacketType.STATS, build_stats(self._stats))
        return None

    def _on_stream(self, request: int, command: cmd.StreamCommand) -> Answer:
        bad = outside(4, command.what, 0, 7) or outside(6, command.every, 1, 0xFFFF)
        if bad is not None:
            return bad
        if command.what and self._solver is None:
            return Answer(Status.NO_MODEL)
        if command.what & ~Stream.RAW and self._solver is not None and not self._solver.tared:
            return Answer(Status.NOT_TARED)
        self._what, self._every, self._left, self._phase = (
            Stream(command.what),
            command.every,
            command.frames,
            0,
        )
        return OK

    def _on_tare(self, request: int, command: cmd.Tare) -> Answer | None:
        bad = outside(4, command.frames, 1, 1024) or (
            outside(4, command.frames, 4, 1024) if command.frames > 1 else None
        )
        if bad is not None:
            return bad
        if self._solver is None:
            return Answer(Status.NO_MODEL)
        self.skin.begin_quiet()
        self._tare = _Tare(request, command.frames)
        return None

    def _on_scan(self, request: int, command: cmd.Scan) -> Answer:
        rows = 0
        if self._solver is not None:
            model = self._solver.model
            rows = model.protocol.n_rows if command.check_every else len(model.fold.first)
        bad = check_scan(command, rows)
        if bad is not None:
            return bad
        self._scan = command
        self._what &= Stream.RAW
        if self._solver is not None:
            self._solver.tared = False
        return OK

    def _on_solver(self, request: int, command: cmd.Solver) -> Answer:
        bad = check_solver(command)
        if bad is not None:
            return bad
        if self._solver is None:
            return Answer(Status.NO_MODEL)
        status = self._solver.set_options(command)
        return OK if status == 0 else Answer(Status.CORE, (status, 0))

    def _on_mask_row(self, request: int, command: cmd.MaskRow) -> Answer:
        if self._solver is None:
            return Answer(Status.NO_MODEL)
        bad = outside(4, command.row, 0, self._solver.model.protocol.n_rows - 1) or outside(
            6, command.bad, 0, 1
        )
        if bad is not None:
            return bad
        self._solver.mask(command.row, bool(command.bad))
        return OK

    def _on_self_test(self, request: int, command: cmd.SelfTest) -> Answer:
        return Answer(Status.NO_MODEL) if self._solver is None else golden(self._solver)

    def _on_reset(self, request: int, command: cmd.Reset) -> Answer:
        self._reset_wanted = True
        return OK

    def _on_clear_faults(self, request: int, command: cmd.ClearFaults) -> Answer:
        self._faults.clear(self._frame)
        self._tell_no_model(E_MODEL_MAGIC)
        return OK

    def _on_model_begin(self, request: int, command: cmd.ModelBegin) -> Answer:
        return self.banks.begin(command)

    def _on_model_data(self, request: int, command: cmd.ModelData) -> Answer:
        return self.banks.data(command)

    def _on_model_commit(self, request: int, command: cmd.ModelCommit) -> Answer:
        answer = self.banks.commit()
        if answer.status == Status.OK:
            self._tell_no_model(self._open_newest())
        return answer

    # ---- what it says about itself ----

    def _info(self, request: int) -> BoardInfo:
        solver, scan = self._solver, self._scan
        return BoardInfo(
            **model_facts(solver, self.banks.in_use or 0),
            request=request,
            firmware=tuple(int(word) for word in __version__.split(".")[:3]),  # type: ignore[arg-type]
            board=BOARD_NAME,
            serial=self.skin.serial,
            f_cpu_hz=0,
            electrodes=self.skin.electrodes,
            bank_bytes=self.banks.room,
            data_bytes=DATA_BYTES,
            excitation_millihz=scan.excitation_millihz,
            sample_rate_hz=scan.sample_rate_hz,
            samples=scan.samples,
            settle_us=scan.settle_us,
            slot_us=slot_us(scan),
            check_every=scan.check_every,
            streaming=int(self._what),
            every=self._every,
            tared=int(solver is not None and solver.tared),
            frame_period_us=scan.frame_period_us,
            faults=self._faults.raised,
            volts_per_code_nv=0,
        )

    def _statistics(self, request: int) -> BoardStats:
        counters = self._decoder.counters
        return BoardStats(
            request=request,
            uptime_ms=self.time_us // 1000 % 2**32,
            frames_scanned=self._frame,
            frames_solved=self._solved,
            packets_sent=self._sent,
            packets_dropped=0,
            deadlines_missed=0,
            slots_repeated=0,
            glitches=self._glitches,
            link_packets=counters.packets,
            link_crc_errors=counters.crc_errors,
            link_framing_errors=counters.framing_errors,
            link_overruns=counters.overruns,
            stack_bytes=0,
            stack_used=0,
            workspace_bytes=0,
            workspace_used=self._solver.engine.workspace_bytes if self._solver else 0,
            stages={name: StageStats(count, 0, 0, 0) for name, count in self._stage_counts.items()},
        )
