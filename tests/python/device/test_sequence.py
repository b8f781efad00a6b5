"""Sequence numbers: gaps are counted, old and repeated packets are rejected, and a board that
restarts is recognised."""

import random
from collections.abc import Iterable

import pytest
from device_helpers import board_info

from eitskin.device.wire.codec import Decoder, LinkCounters, encode
from eitskin.device.wire.link_table import PacketType
from eitskin.device.wire.payloads import pack
from eitskin.device.wire.sequence import LATE_IN_A_ROW, REMEMBERED, SequenceCheck

TOP = 2**32


CUT = "the line is cut"
Event = str | int | tuple[int, int, bool]  # (number, content, an INFO with request 0)


def judged(events: list[Event]) -> tuple[list[int | None], dict[str, int]]:
    """Return the verdicts on packets, and the counters. An event that is only a number is a packet
    with this number and this content."""
    counters = LinkCounters()
    check, verdicts = SequenceCheck(counters), []
    for event in events:
        if isinstance(event, str):
            check.link_lost()
            continue
        number, content, restart = event if isinstance(event, tuple) else (event, event, False)
        verdicts.append(check.admit(number % TOP, content, restart=restart))
    return verdicts, {name: count for name, count in vars(counters).items() if count}


def new(numbers: Iterable[int], past: int) -> list[Event]:
    """Packets of a new life: their content tells them from those of the old one."""
    return [(n, past + n, False) for n in numbers]


LATE, FOUND_OUT = [None] * (LATE_IN_A_ROW - 1), {"restarts": 1}
TOLD = [*range(100, 110), (0, 9000, True)]  # a restart that says so
CASES: dict[str, tuple[list[Event], list[int | None], dict[str, int]]] = {
    **{
        f"one after another from {start}": ([start + k for k in range(10)], [0] * 10, {})
        for start in (0, 5, TOP - 3, TOP - 1)
    },
    **{
        f"gaps are counted from {start}": (
            [start, start + 3, start + 4, start + 10], [0, 2, 0, 5], {"gaps": 2, "missing": 7}
        )
        for start in (0, 17, TOP - 4)
    },
    "duplicates and late packets are refused": (
        [1, 2, 2, 5, 3, 6, 5, 1], [0, 0, None, 2, None, 0, None, None],
        {"duplicates": 3, "stale": 1, "gaps": 1, "missing": 2},
    ),
    "duplicates across the wrap": (
        [TOP - 1, TOP, TOP - 1, TOP, TOP + 1], [0, 0, None, None, 0], {"duplicates": 2}
    ),
    "a restart that says so": ([*TOLD, *new(range(1, 5), 9000)], [0] * 15, {"restarts": 1}),
    "a loss right after a restart is a gap": (
        [*TOLD, *new([4], 9000)], [0] * 11 + [3], {"restarts": 1, "gaps": 1, "missing": 3}
    ),
    # the line repeats the board's first INFO, and more follows; at first this may be a restart
    "the first INFO may be repeated": (
        [(0, 7, True), *new(range(1, 6), 10), (0, 7, True), *new((1, 2, 6, 7, 8), 10)],
        [0] * 7 + [None, None, 0, 0, 0], {"duplicates": 3},
    ),
    "late numbers one after another are a new life": (
        [*range(1000, 1010), *new(range(1, 40), 9000)], [0] * 10 + LATE + [0] * (39 - len(LATE)),
        FOUND_OUT,
    ),
    "a new life within the remembered numbers": (
        [*range(30), *new(range(1, 30), 9000)], [0] * 30 + LATE + [0] * (29 - len(LATE)), FOUND_OUT
    ),
    "a long stretch that comes again is no restart": (
        [*range(REMEMBERED), *range(REMEMBERED - 100, REMEMBERED), REMEMBERED],
        [0] * REMEMBERED + [None] * 100 + [0], {"duplicates": 100},
    ),
    # the last gap is of a new life: how many are missing nobody knows
    "a cut line counts one gap": (
        [5, CUT, 6, CUT, 20, CUT, *new((3, 4), 30)], [0, 0, 13, 1, 0],
        {"gaps": 2, "missing": 13, "restarts": 1},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_packets_are_judged_by_their_numbers(name):
    events, verdicts, counted = CASES[name]
    assert judged(events) == (verdicts, counted)


def test_nothing_of_a_new_life_is_lost_although_its_first_packets_seem_late():
    """Faults of the start may come before the INFO that reports it, or that INFO be lost: they are
    all there in the end."""
    for said in (True, False):
        decoder = Decoder()
        old = b"".join(packet(n) for n in range(500, 520))
        new = [encode(PacketType.FAULT, n, b"new life" + bytes([n])) for n in range(30)]
        if said:
            new[2] = packet(2, restart=True)
        found = decoder.feed(old + b"".join(new))
        assert [p.sequence for p in found] == [*range(500, 520), *range(30)]
        assert [p.payload[:8] for p in found[20:22]] == [b"new life"] * 2
        counters = decoder.counters
        assert (counters.restarts, counters.gaps, counters.stale, counters.packets) == (1, 0, 0, 50)


def packet(number: int, *, restart: bool = False) -> bytes:
    if restart:
        return encode(PacketType.INFO, number, pack(board_info(request=0)))
    return encode(PacketType.FAULT, number, number.to_bytes(8, "little") * 4)


def test_whole_packets_shuffled_dropped_and_doubled():
    """The verdicts agree with a simple count of the same packets: in order, each once, and the
    numbers that never came are missing."""
    for seed in range(60):
        generator = random.Random(seed)
        numbers, n = [], generator.randrange(TOP)
        start = n
        for _ in range(300):
            chance = generator.random()
            if chance < 0.05:
                n += generator.randrange(1, 6)  # lost
            numbers.append(n)
            if chance > 0.95:
                numbers.append(generator.choice(numbers[-5:]))  # came again
            n += 1
        for place in generator.sample(range(1, len(numbers) - 1), 10):  # neighbours swapped
            numbers[place], numbers[place + 1] = numbers[place + 1], numbers[place]
        decoder = Decoder()
        wire = b"".join(packet(k % TOP) for k in numbers)
        found = []
        while wire:
            cut = generator.randrange(1, 500)
            found += decoder.feed(wire[:cut])
            wire = wire[cut:]
        taken = [(p.sequence - start) % TOP for p in found]
        assert taken == sorted(set(taken))
        missing = sum(p.lost for p in found)
        assert missing == taken[-1] - taken[0] + 1 - len(taken) == decoder.counters.missing
        refused = decoder.counters.duplicates + decoder.counters.stale
        assert len(found) + refused == len(numbers)
        assert decoder.counters.gaps == sum(p.lost > 0 for p in found)
        assert decoder.counters.restarts == 0
