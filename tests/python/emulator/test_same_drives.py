"""A simulated and an emulated board that measure the same volts tell the same touches after each
drive, to the bit."""

from __future__ import annotations

import re
import subprocess
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from unicorn import arm_const as arm
from unicorn.unicorn_const import UC_HOOK_CODE

from eitskin.device.wire.codec import Decoder
from eitskin.device.wire.link_table import Stream
from eitskin.device.wire.packets import DriveTouches, RawFrame, SolvedTouches
from eitskin.device.wire.payloads import parse
from eitskin.session.session import Session
from eitskin.session.settings import SessionSettings
from eitskin.truth import observe_scene

UNTOUCHED, FRAMES = 4, 6
SCENE = f"""[scene]
name = "two presses"
seed = 4
rate_hz = {1 / 20.8e-3!r}
frames = {FRAMES}
quiet_frames = {UNTOUCHED}
elements = 2500
[[touch]]
radius_mm = 8.0
contrast = 5.0
path = [{{t_s = 0.030, x_mm = 10.0, y_mm = 30.0}}, {{t_s = 0.2, x_mm = 30.0, y_mm = 10.0}}]
[[touch]]
radius_mm = 8.0
contrast = 5.0
path = [{{t_s = 0.070, x_mm = -40.0, y_mm = 0.0}}, {{t_s = 0.2, x_mm = -40.0, y_mm = 0.0}}]
[effects.noise]
snr_db = 60.0
"""


@dataclass(frozen=True)
class Recorded:
    """Packets that a board sent during its tare, and from the first followed drive on."""

    untouched: list[RawFrame]
    raw: list[RawFrame]
    drives: list[DriveTouches]
    touches: list[SolvedTouches]

    @classmethod
    def read(cls, run: Path) -> Recorded:
        sent = [parse(one.type, one.payload) for one in Decoder().feed(run.read_bytes())]
        raw = [one for one in sent if isinstance(one, RawFrame)]
        drives = [one for one in sent if isinstance(one, DriveTouches)]
        first = drives[0].head.begun
        return cls(
            [one for one in raw if one.untouched],
            [one for one in raw if first <= one.frame < first + FRAMES],
            [one for one in drives if one.frame < first + FRAMES],
            [
                one
                for one in sent
                if isinstance(one, SolvedTouches) and first <= one.frame < first + FRAMES
            ],
        )

    def facts(self) -> list[Any]:
        """All that is not the processor's time, counted from the first drive: of frames by their
        number, for a slower board leaves more of them out."""
        head = self.drives[0].head
        return [
            {one.frame - head.frame: (one.flags, one.voltage_v.tobytes()) for one in self.raw},
            [
                (one.frame - head.frame, one.head.begun - head.begun, one.head.drive,
                 one.head.time_us - head.time_us, one.touches)
                for one in self.drives
            ],
            {one.frame - head.frame: [replace(t, id=0) for t in one.touches]
             for one in self.touches},
        ]  # fmt: skip


class Given:
    """Frames that replace those that an emulated board demodulates. First come the frames of a
    tare; in its first scan the current settles. Then the first of the other frames is repeated
    until touches are followed, and after that come the rest."""

    def __init__(self, board: Any, elf: Path, given: Recorded) -> None:
        self._engine, self._raw = board.cpu.engine, given.raw
        self._shown, self._left, self._base = (
            given.untouched[0],
            [given.untouched[0], *given.untouched],
            0,
        )
        self._tares = False
        listed = subprocess.run(
            ["arm-none-eabi-nm", elf], capture_output=True, text=True, check=True
        ).stdout
        calls = {
            "fw_tare_begin": self._tare,
            "fw_demodulate": self._demodulate,
            "eits_fast_begin": self._begin,
        }
        for name, call in calls.items():
            found = re.search(rf"^(\w+) T {name}$", listed, re.MULTILINE)
            assert found
            at = int(found[1], 16) & ~1
            self._engine.hook_add(UC_HOOK_CODE, call, begin=at, end=at)

    def _tare(self, *_: object) -> None:
        self._tares = True

    def _begin(self, *_: object) -> None:
        self._left = self._raw[1:]

    def _demodulate(self, *_: object) -> None:
        """z of the row that comes next is its voltage in phase; back to the caller."""
        engine, rows = self._engine, len(self._shown.voltage_v)
        out = engine.reg_read(arm.UC_ARM_REG_R3)
        row = (out - self._base) // 8
        if not 0 <= row < rows:
            self._base, row = out, 0
        if row == 0 and self._tares:
            self._shown = self._left.pop(0) if self._left else self._raw[0]
        volts = np.array([self._shown.voltage_v[row], 0.0], dtype="<f4")
        engine.mem_write(out, volts.tobytes())
        engine.reg_write(arm.UC_ARM_REG_R0, 0)
        engine.reg_write(arm.UC_ARM_REG_PC, engine.reg_read(arm.UC_ARM_REG_LR))


def test_both_boards_tell_the_same_of_the_same_volts(tmp_path, cortex_m7):
    scene, runs = tmp_path / "presses.toml", (tmp_path / "sim.eits", tmp_path / "emu.eits")
    scene.write_text(SCENE, encoding="utf-8")
    image = cortex_m7 / "firmware/eitskin_nucleo_f767zi.bin"
    settings = SessionSettings(
        mode=Stream.RAW | Stream.TOUCHES, report="drive", tare=UNTOUCHED, frames=FRAMES
    )
    for kind, run in zip(("sim", "emu"), runs, strict=True):
        emulated = kind == "emu"
        how = replace(settings, record=run, firmware=image if emulated else None)
        with Session(f"{kind}:{scene}", how, observe=observe_scene) as session:
            if emulated:
                board = session.device.transport.board
                Given(board, image.with_suffix(".elf"), Recorded.read(runs[0]))
            for _ in session.messages():
                pass
    one, other = map(Recorded.read, runs)
    assert [frame.voltage_v.tobytes() for frame in one.untouched] == [
        frame.voltage_v.tobytes() for frame in other.untouched
    ]
    (raw, drives, touches), (slower_raw, same_drives, slower_touches) = one.facts(), other.facts()
    assert drives == same_drives
    assert slower_raw.items() <= raw.items() and len(slower_raw) >= FRAMES - 1
    assert {k: touches[k] for k in slower_touches} == slower_touches and len(slower_touches) > 1
    # both fingers, and frames both solved and left to what drives follow
    assert {len(reported.touches) for reported in one.drives} == {0, 1, 2}
    assert len(one.raw) == len(one.touches) == FRAMES
    assert 1 < sum(not reported.solved.unsolved for reported in one.touches) < FRAMES
