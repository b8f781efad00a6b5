"""Numbers and words of the rooms that speak with boards, on fixed inputs."""

import random
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from device_helpers import board_info

from eitskin.device import bandwidth, check, known_model
from eitskin.device.client import check_tare_frames
from eitskin.device.settings import ScanSettings, SolverSettings
from eitskin.device.transport import LinkEvent
from eitskin.device.wire import explain, link_table
from eitskin.device.wire import packets as pk
from eitskin.device.wire.payloads import MalformedPacket, parse
from eitskin.session.frame import Frame
from eitskin.session.notices import Novelty, notice_of
from eitskin.session.sample import Sample
from eitskin.session.summary import Summary
from eitskin.skin.protocol import adjacent, opposite, skip
from same_results import check_same
from small_models import prebuilt

STORE = Path(__file__).with_suffix(".json")
STREAM = link_table.Stream
BOARDS = {
    "usual": board_info(),
    "no model": board_info(model_bytes=0, model_crc=0, n_rows=0, n_pixels=0, slot_us=0),
    "another firmware": board_info(firmware=(9, 4, 1), source_ua_rms=0, current_ua_rms=3),
    "all its bits": board_info(
        faults=0xFFFFFF, streaming=31, drive=2, settings=7, check_every=0, frame_period_us=31_000
    ),
    "few samples": board_info(samples=4, settle_us=2, slot_us=17, every=3, tared=1, storage=3),
}


def properties(of: object) -> dict[str, Any]:
    """Every property of an object, and what it gives as a dict."""
    names = [n for n in dir(type(of)) if isinstance(getattr(type(of), n), property)]
    found = {name: getattr(of, name) for name in names}
    return found | ({"as_dict": of.as_dict()} if hasattr(of, "as_dict") else {})


def payload(kind: int, size: int, seed: int) -> bytes:
    draw = random.Random(f"{kind} {size} {seed}")
    return bytes(draw.choice((0, 0, 0, 1, 2, 63, 128, 255)) for _ in range(size))


def read(kind: int) -> list[Any]:
    """What payloads with few whole numbers say, and why others are refused."""
    read: list[Any] = []
    refused: dict[str, int] = {}
    for size in range(0, 400, 4):
        for seed in range(3):
            try:
                packet = parse(kind, payload(kind, size, seed))
            except MalformedPacket as error:
                refused[str(error)] = refused.get(str(error), 0) + 1
            else:
                read.append([packet, properties(packet)])
    return [read[:: 1 + len(read) // 4], dict(list(refused.items())[:4])]


def faults() -> list[pk.Fault]:
    """One of each code, up and over, of some electrodes."""
    return [
        pk.Fault(
            **dict.fromkeys((f.name for f in fields(pk.Fault)), 0)
            | {"code": code, "raised": raised, "frame": 70 + code, "index": index, "value": value}
            | {"words": (1, 2, 3, 4, 5)}
        )
        for code in range(len(link_table.FaultCode) + 3)
        for raised, index, value in ((1, 5, 9), (1, 6, 0), (0, 5, 9), (1, 3, -1))
    ]


def replies() -> list[str]:
    return [
        explain.reply_text(pk.Reply(request=1, command=command, status=status, detail=detail))
        for status in range(len(link_table.ReplyStatus) + 2)
        for command, detail in ((0x83, (4, 7)), (0x84, (16, 2)), (0x99, (0x82, 0)), (0x81, (6, 3)))
    ]


def events() -> list[list[str]]:
    told = Novelty()
    link = [
        LinkEvent(kind, missing, text)
        for kind in ("gap", "dropped", "unplugged", "reconnected", "restarted", "skipped")
        for missing, text in ((0, ""), (1, ""), (4, "said"))
    ]
    return [told.lines(notice_of(item)) for item in (*faults(), *link, *faults()[::-1])]


def sampled() -> list[Any]:
    sample = Sample(50)
    for k in range(400):
        sample.add(float(k * k % 977))
    return [sample.count, sample.largest, np.array(sample.values), sample.quantile(0.5)]


def summed() -> list[Any]:
    """A summary as it grows."""
    summary, found = Summary(link={"gaps": 2, "missing": 5, "dropped": 1}), []
    for number in range(4):
        summary.add(Frame(number, 20_000 * number, 7))
        summary.drives += number
        summary.faults += number % 2
        summary.refused += number // 3
        found.append([summary.as_dict(), summary.lines()])
    summary.link["lines_skipped"] = 3
    return [*found, summary.lines()]


MODEL, BLOB = prebuilt()
CALLS: dict[str, Callable[[], Any]] = {
    **{f"packet {kind.name}": lambda kind=kind: read(kind) for kind in link_table.PacketType},
    **{f"board, {name}": lambda info=info: properties(info) for name, info in BOARDS.items()},
    **{
        f"line, {name}": lambda info=info: [
            [bandwidth.frame_bytes(info, what), bandwidth.least_every(info, what, baud)]
            for what in (STREAM(k) for k in range(32))
            for baud in (115_200, 2_000_000)
        ]
        for name, info in BOARDS.items()
    },
    **{
        f"check, {name}": lambda info=info: check.check_board(info, "port")
        for name, info in BOARDS.items()
    },
    **{
        f"model, {name}": lambda info=info: check.check_model(info, MODEL, BLOB, "port")
        for name, info in {
            **BOARDS,
            "another": board_info(protocol_hash=MODEL.protocol.hash),
        }.items()
    },
    "usual protocols": lambda: [
        known_model.scanned_protocol(
            board_info(protocol_hash=p.hash, n_electrodes=p.n_electrodes), None, "port"
        )
        for p in (adjacent(8), opposite(16), skip(16, 4))
    ],
    "an unknown protocol": lambda: known_model.scanned_protocol(board_info(), None, "port"),
    "options of a board": lambda: [
        known_model.board_options(MODEL, board_info(), track=track) for track in (True, False)
    ],
    "settings": lambda: [
        ScanSettings(samples=4, settle_us=0).named,
        SolverSettings(track=False, iterations=3).named,
        SolverSettings(track=False, iterations=3).applied(MODEL, board_info()),
    ],
    **{f"a tare of {n}": lambda n=n: check_tare_frames(n) for n in (0, 3, 4, 1024, 1025)},
    "replies": replies,
    "faults": lambda: [explain.fault_text(fault) for fault in faults()],
    "qualities": lambda: [explain.quality_text(bits) for bits in range(70)],
    "fields": lambda: [
        [explain.field_at(command, at) for at in range(0, 48, 2)] for command in range(0x80, 0x91)
    ],
    "events": events,
    "sample": sampled,
    "summary": summed,
}  # fmt: skip


@pytest.mark.parametrize("name", CALLS)
def test_same_results_of_devices(name):
    check_same(STORE, name, CALLS[name])
