"""A model bank's bytes, against the layout written out by hand, and which bank a board starts
from."""

from __future__ import annotations

import struct
import zlib

import pytest

from eitskin.device.bank import (
    BANK_BYTES,
    BankRecord,
    bank_bytes,
    newest_bank,
    read_record,
    record_offset,
)
from eitskin.errors import DeviceError

MODEL = bytes(range(256)) * 40


def test_a_bank_is_the_model_and_its_record_at_the_end() -> None:
    bank = bank_bytes(MODEL, 7)
    assert len(bank) == BANK_BYTES == 512 * 1024
    assert bank[: len(MODEL)] == MODEL
    assert set(bank[len(MODEL) : record_offset()]) == {0xFF}
    assert bank[-32:-28] == b"EBNK"
    words = struct.unpack("<8I", bank[-32:])
    assert words[1:7] == (7, len(MODEL), zlib.crc32(MODEL), 0, 0, 0)
    assert words[7] == zlib.crc32(bank[-32:-4])
    assert read_record(bank) == BankRecord(7, len(MODEL), zlib.crc32(MODEL))


def test_a_model_that_does_not_fit_is_refused() -> None:
    assert len(bank_bytes(bytes(992), 1, 1024)) == 1024
    with pytest.raises(DeviceError, match="993 bytes and a bank of the board holds 992"):
        bank_bytes(bytes(993), 1, 1024)


def test_any_damage_to_the_record_makes_it_none() -> None:
    bank = bytearray(bank_bytes(MODEL, 1, 16384))
    for place in range(record_offset(16384), 16384):
        for bit in (0, 3, 7):
            bank[place] ^= 1 << bit
            assert read_record(bytes(bank)) is None
            bank[place] ^= 1 << bit
    assert read_record(bytes(bank)) is not None
    assert read_record(b"") is None
    assert read_record(bytes([0xFF]) * 1024) is None


@pytest.mark.parametrize(
    ("generations", "newest"),
    [
        ((1, 2), 1),
        ((2, 1), 0),
        ((2**32 - 1, 0), 1),
        ((0, 2**32 - 1), 0),
        ((None, 5), 1),
        ((5, None), 0),
        ((None, None), None),
    ],
)
def test_the_latest_valid_bank_wins(
    generations: tuple[int | None, int | None], newest: int | None
) -> None:
    banks = [
        bytes([0xFF]) * 16384 if g is None else bank_bytes(MODEL, g, 16384) for g in generations
    ]
    assert newest_bank(banks) == newest


def test_a_damaged_model_leaves_the_other_bank() -> None:
    damaged = bytearray(bank_bytes(MODEL, 9, 16384))
    damaged[100] ^= 1
    assert newest_bank([bank_bytes(MODEL, 8, 16384), bytes(damaged)]) == 0
    assert newest_bank([bytes(damaged)]) is None
