"""Power that goes at any write to the flash during an upload: the firmware image itself starts on
what the flash then holds. It has the old model, and the new one only once its last word is in."""

import zlib

import numpy as np
import pytest

from eitskin.device.bank import bank_bytes
from eitskin.skin.protocol import adjacent
from eitskin_emulator.analog.skin import AnalogSkin
from eitskin_emulator.board import EmulatedBoard
from eitskin_emulator.memory import BANK_BYTES, BANKS, FLASH
from eitskin_emulator.peripherals.flash import LARGE
from emulated import clean, connect
from small_models import tiny_blob

SPARE = slice(BANKS[1] - FLASH, BANKS[1] - FLASH + BANK_BYTES)


def old() -> bytes:
    return tiny_blob("f32")


def new() -> bytes:
    return tiny_blob("i8")


def words() -> int:
    """The words that an upload writes; the record is the last 8."""
    return -(-len(new()) // 4) + 8


def powered(image: bytes) -> EmulatedBoard:
    """A board that uses the old model; an older model lies in the other bank."""
    rows = np.full((1, adjacent(8).n_rows), 0.01)
    skin = AnalogSkin(adjacent(8), rows, rows, 10.0)
    return EmulatedBoard(image, skin, (bank_bytes(old(), 1), bank_bytes(new(), 0)))


def spare_at_each_write(image: bytes) -> list[bytes]:
    """The other bank before each word of an upload and after the last."""
    board = powered(image)
    device, states = connect(board), []
    board.flash.word_programmed = lambda: states.append(board.bank(1))
    device.upload_model(new())
    clean(board)
    assert len(states) == words()
    return [b"\xff" * BANK_BYTES, *states]


def half_written(before: bytes, after: bytes, rng: np.random.Generator) -> bytes:
    """A word in which some cells have gone to 0 and some not yet."""
    was, will = (np.frombuffer(state, np.uint8) for state in (before, after))
    changed = np.flatnonzero(was != will)
    made = will.copy()
    made[changed] |= was[changed] & rng.integers(0, 256, changed.size, np.uint8)
    return made.tobytes()


def half_erased(rng: np.random.Generator) -> list[bytes]:
    """A sector that is being erased reads as anything; the one behind it is as it was."""
    bank = bank_bytes(new(), 0)
    bank += b"\xff" * (BANK_BYTES - len(bank))
    noise = rng.integers(0, 256, LARGE, np.uint8)
    first = (np.frombuffer(bank[:LARGE], np.uint8) | noise).tobytes()
    last = (np.frombuffer(bank[LARGE:], np.uint8) | noise).tobytes()
    return [first + bank[LARGE:], b"\xff" * LARGE + bank[LARGE:], b"\xff" * LARGE + last]


@pytest.mark.parametrize(
    "cuts", ["sample", pytest.param("every word", marks=pytest.mark.long("a sample of the words"))]
)
def test_a_model_is_open_after_every_cut(image, cuts):
    rng = np.random.default_rng(5)
    states = spare_at_each_write(image)
    chosen = range(words())
    if cuts == "sample":
        chosen = sorted(
            {0, *rng.integers(1, words() - 8, 8).tolist(), *range(words() - 8, words())}
        )
    board = powered(image)
    spoiled = half_erased(rng)
    spoiled += [half_written(states[k], states[k + 1], rng) for k in chosen]
    for state in [*spoiled, states[-1]]:
        board.memories.flash[SPARE] = state
        board.lose_power()
        device = connect(board)
        expected = new() if state == states[-1] else old()
        assert device.board.model_crc == zlib.crc32(expected)
    # and an upload that was cut may be sent again
    board.memories.flash[SPARE] = states[words() // 2]
    board.lose_power()
    assert connect(board).upload_model(new()).model_crc == zlib.crc32(new())
    clean(board)
