"""A model bank's bytes, against the layout written out by hand."""

import struct
import zlib

import pytest

from eitskin.device.bank import BANK_BYTES, bank_bytes, record_offset
from eitskin.errors import DeviceError

MODEL = bytes(range(256)) * 40


def test_a_bank_is_the_model_and_its_record_at_the_end():
    bank = bank_bytes(MODEL, 7)
    assert len(bank) == BANK_BYTES == 512 * 1024
    assert bank[: len(MODEL)] == MODEL
    assert set(bank[len(MODEL) : record_offset()]) == {0xFF}
    assert bank[-32:-28] == b"EBNK"
    words = struct.unpack("<8I", bank[-32:])
    assert words[1:7] == (7, len(MODEL), zlib.crc32(MODEL), 0, 0, 0)
    assert words[7] == zlib.crc32(bank[-32:-4])


def test_a_model_that_does_not_fit_is_refused():
    assert len(bank_bytes(bytes(992), 1, 1024)) == 1024
    with pytest.raises(DeviceError, match="993 bytes and a bank of the board holds 992"):
        bank_bytes(bytes(993), 1, 1024)
