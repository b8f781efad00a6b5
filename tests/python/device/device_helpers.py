"""Small scenes, boards before them, and transports that damage what goes through."""

import random
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from itertools import count
from typing import TypeVar

from eitskin.device.bank import BANK_BYTES, ERASED, bank_bytes
from eitskin.device.client import Device
from eitskin.device.ports import Port
from eitskin.device.simulated import SimBoard, SimTransport
from eitskin.device.transport import Capabilities, Transport
from eitskin.device.wire.codec import Decoder, encode
from eitskin.device.wire.link_table import GetStats, PacketType, Stream
from eitskin.device.wire.packets import BoardInfo, BoardStats, RawFrame
from eitskin.device.wire.payloads import parse
from eitskin.scene.board_frames import BoardFrames
from eitskin.scene.description import Scene
from eitskin.scene.touch_path import Keyframe, TouchTrack
from small_models import prebuilt

_REQUESTS = count(2**31)  # above those of any Device
Kind = TypeVar("Kind")
UNTOUCHED = 8
FRAMES = 10


@cache
def scene(elements: int = 2500) -> Scene:
    """Ten frames of one touch at (-40, 10) on the paper's skin, with noise at 60 dB. On a mesh as
    coarse as the default one the touch does not look like a disc, and some frames show two touches;
    with 5,000 elements they show one."""
    touch = TouchTrack((Keyframe(-1e9, -40.0, 10.0, 9.0, 9.0),), hold=True)
    return Scene(
        "one",
        touches=(touch,),
        frames=FRAMES,
        quiet_frames=UNTOUCHED,
        elements=elements,
        effects={"noise": {"snr_db": 60.0}},
    )


@cache
def frames(elements: int = 2500) -> BoardFrames:
    """Return the frames of ``scene``. They are shared, so that the scene is simulated once."""
    return BoardFrames(scene(elements))


def empty_bank() -> bytes:
    return bytes([ERASED]) * BANK_BYTES


def sim_board(
    model: bytes | None = None, *, no_model: bool = False, elements: int = 2500
) -> SimBoard:
    """A board with ``model`` (the prebuilt one) in bank 0."""
    first = empty_bank() if no_model else bank_bytes(model or prebuilt()[1], 1)
    return SimBoard(frames(elements), [first, empty_bank()])


def stats_of(board: SimBoard) -> BoardStats:
    """Return the counters of ``board``, read directly and not over a line, at each call."""
    board.receive(encode(PacketType.GET_STATS, 0, GetStats(0).payload(next(_REQUESTS))))
    (stats,) = (
        parse(packet.type, packet.payload) for packet in Decoder().feed(board.take_output())
    )
    assert isinstance(stats, BoardStats)
    return stats


@contextmanager
def sim_device(board: SimBoard | None = None) -> Iterator[Device]:
    with Device(SimTransport("test", board or sim_board())) as device:
        yield device


def st_link(path: str, serial: str = "SERIAL1") -> Port:
    """An ST-LINK's port, as pyserial lists it."""
    return Port(path, "STM32 STLink", 0x0483, 0x374B, serial)


class Damaging(Transport):
    """A transport that puts every piece of bytes through ``there`` (to the board) or ``back`` (from
    it)."""

    def __init__(
        self, inner: SimTransport, there: Callable[[bytes], bytes], back: Callable[[bytes], bytes]
    ) -> None:
        self._inner, self._there, self._back = inner, there, back
        self.url = self.name = inner.name

    @property
    def capabilities(self) -> Capabilities:
        return Capabilities(own_clock=True)

    @property
    def ended(self) -> bool:  # type: ignore[override]
        return self._inner.ended

    def read(self, timeout_s: float) -> bytes:
        return self._back(self._inner.read(timeout_s))

    def write(self, data: bytes) -> None:
        self._inner.write(self._there(data))

    def reopen(self) -> bool:
        return True

    def begin_scene(self) -> int | None:
        return self._inner.begin_scene()

    def close(self) -> None:
        self._inner.close()


def dropping(generator: random.Random, share: float) -> Callable[[bytes], bytes]:
    """Whole pieces lost, or one byte of them changed, each with probability ``share`` / 2."""

    def damage(data: bytes) -> bytes:
        chance = generator.random()
        if not data or chance >= share:
            return data
        if chance < share / 2:
            return b""
        place = generator.randrange(len(data))
        changed = bytes([data[place] ^ (1 + generator.randrange(255))])
        return data[:place] + changed + data[place + 1 :]

    return damage


def same(data: bytes) -> bytes:
    return data


def board_info(**changes: object) -> BoardInfo:
    """Return the properties of a board, some of them changed."""
    values: dict[str, object] = {
        "request": 1, "firmware": (0, 1, 0), "board": "nucleo_f767zi",
        "serial": "0123456789ABCDEF01234567",
        "f_cpu_hz": 216_000_000, "electrodes": 16, "bank_bytes": 524256, "data_bytes": 4096,
        "model_bytes": 1000,
        "model_crc": 0xDEADBEEF, "protocol_hash": 2**63 + 5, "n_electrodes": 16, "n_rows": 208,
        "n_folded": 104, "rank": 64,
        "n_pixels": 812, "nx": 32, "ny": 32, "storage": 0, "bank": 1,
        "excitation_millihz": 50_000_012,
        "sample_rate_hz": 1_000_000, "samples": 80, "settle_us": 16, "slot_us": 100,
        "check_every": 1, "streaming": 0, "every": 1,
        "tared": 0, "frame_period_us": 0, "faults": 0, "volts_per_code_nv": 805664,
        "drive": 0, "settings": 0, "source_ua_rms": 350, "current_ua_rms": 0,
        "current_limit_ua_rms": 437, "name": "left", "source_ua": 500, "gain_ppm": 3_000_000,
        "button": 0, "reserved": 0,
    }  # fmt: skip
    return BoardInfo(**(values | changes))


def of(kind: type[Kind], items: Iterable[object]) -> list[Kind]:
    return [item for item in items if isinstance(item, kind)]


def raw_frames(device: Device, frames: int = 0) -> list[RawFrame]:
    """Return the raw frames of a stream, without events."""
    return of(RawFrame, device.stream(Stream.RAW, frames=frames))
