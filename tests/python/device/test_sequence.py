"""Sequence numbers: gaps are counted, what is no news is refused, a board that begins again is
recognised."""

import random

import pytest

from eitskin.device.wire.codec import Decoder, LinkCounters, encode
from eitskin.device.wire.link_table import PacketType
from eitskin.device.wire.payloads import pack
from eitskin.device.wire.sequence import LATE_IN_A_ROW, REMEMBERED, SequenceCheck

TOP = 2**32


def judged(
    numbers: list[int], *, prints: list[int] | None = None
) -> tuple[list[int | None], LinkCounters]:
    """Verdicts on packets of these numbers; the same number has the same content unless ``prints``
    says otherwise."""
    counters = LinkCounters()
    check = SequenceCheck(counters)
    return [check.admit(n % TOP, (prints or numbers)[k]) for k, n in enumerate(numbers)], counters


@pytest.mark.parametrize("start", [0, 5, TOP - 3, TOP - 1])
def test_one_after_another(start):
    verdicts, counters = judged([start + k for k in range(10)])
    assert verdicts == [0] * 10
    assert counters == LinkCounters()


@pytest.mark.parametrize("start", [0, 17, TOP - 4])
def test_gaps_are_counted_across_the_wrap(start):
    verdicts, counters = judged([start, start + 3, start + 4, start + 10])
    assert verdicts == [0, 2, 0, 5]
    assert (counters.gaps, counters.missing) == (2, 7)


def test_duplicates_and_late_packets_are_refused():
    verdicts, counters = judged([1, 2, 2, 5, 3, 6, 5, 1])
    assert verdicts == [0, 0, None, 2, None, 0, None, None]
    assert (counters.duplicates, counters.stale, counters.gaps, counters.missing) == (3, 1, 1, 2)


def test_duplicates_across_the_wrap():
    verdicts, counters = judged([TOP - 1, TOP, TOP - 1, TOP, TOP + 1])
    assert verdicts == [0, 0, None, None, 0]
    assert (counters.duplicates, counters.stale) == (2, 0)


def test_a_restart_that_says_so():
    counters = LinkCounters()
    check = SequenceCheck(counters)
    assert [check.admit(n, n) for n in range(100, 110)] == [0] * 10
    assert check.admit(0, 9000, restart=True) == 0
    assert [check.admit(n, 9000 + n) for n in range(1, 5)] == [0] * 4
    assert (counters.restarts, counters.gaps, counters.duplicates, counters.stale) == (1, 0, 0, 0)


def test_a_loss_right_after_a_restart_is_a_gap():
    counters = LinkCounters()
    check = SequenceCheck(counters)
    for n in range(100, 110):
        check.admit(n, n)
    check.admit(0, 9000, restart=True)
    assert check.admit(4, 9004) == 3
    assert (counters.restarts, counters.gaps, counters.missing) == (1, 1, 3)


def test_the_first_info_may_be_repeated():
    """A board says once that it began; the line gives it twice, and more after it. Nothing is taken
    twice."""
    counters = LinkCounters()
    check = SequenceCheck(counters)
    assert check.admit(0, 7, restart=True) == 0
    assert [check.admit(n, 10 + n) for n in range(1, 6)] == [0] * 5
    assert check.admit(0, 7, restart=True) == 0  # it cannot be told yet
    assert check.admit(1, 11) is None
    assert check.admit(2, 12) is None
    assert [check.admit(n, 10 + n) for n in range(6, 9)] == [0] * 3
    assert (counters.restarts, counters.duplicates, counters.gaps, counters.missing) == (0, 3, 0, 0)


def test_a_restart_whose_info_was_lost_is_found_out():
    """Late numbers one after another are a new life, not a hundred late packets."""
    verdicts, counters = judged([*range(1000, 1010), *range(1, 40)], prints=list(range(49)))
    assert verdicts[:10] == [0] * 10
    assert verdicts[10 : 10 + LATE_IN_A_ROW - 1] == [None] * (LATE_IN_A_ROW - 1)
    assert verdicts[10 + LATE_IN_A_ROW - 1 :] == [0] * (40 - LATE_IN_A_ROW)
    assert (counters.restarts, counters.gaps, counters.stale) == (1, 0, 0)


def test_a_restart_within_the_remembered_numbers_is_found_out_too():
    numbers = [*range(30), *range(1, 30)]
    verdicts, counters = judged(numbers, prints=list(range(len(numbers))))
    assert counters.restarts == 1
    assert counters.duplicates == 0
    assert verdicts[-1] == 0


def test_a_long_stretch_that_comes_again_is_not_taken_for_a_restart():
    numbers = [*range(REMEMBERED), *range(REMEMBERED - 100, REMEMBERED), REMEMBERED]
    verdicts, counters = judged(numbers)
    assert (counters.duplicates, counters.restarts, counters.gaps) == (100, 0, 0)
    assert verdicts[-1] == 0


def test_a_cut_line_counts_one_gap():
    counters = LinkCounters()
    check = SequenceCheck(counters)
    check.admit(5, 5)
    check.link_lost()
    assert check.admit(6, 6) == 0
    assert counters.gaps == 0
    check.link_lost()
    assert check.admit(20, 20) == 13
    assert (counters.gaps, counters.missing) == (1, 13)
    check.link_lost()
    assert check.admit(3, 33) == 1  # begun again: how many, nobody knows
    assert (counters.gaps, counters.missing, counters.restarts) == (2, 13, 1)
    assert check.admit(4, 34) == 0


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
    from device_helpers import board_info

    if restart:
        return encode(PacketType.INFO, number, pack(board_info(request=0)))
    return encode(PacketType.FAULT, number, number.to_bytes(8, "little") * 4)


def test_whole_packets_shuffled_dropped_and_doubled():
    """Against a plain account of the same packets: in order, each once, and what is missing is what
    is not there."""
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
