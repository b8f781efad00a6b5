"""The multiplexers' lines on their ports: one store a port, nothing but what was asked for."""

import numpy as np
import pytest
from bare_image import BareImage

PORT_E_BSRR, PORT_F_BSRR = 0x40021018, 0x40021418
ADDRESSES, ENABLES = 0x0000FFFF, 0x00FF0000


@pytest.fixture(scope="module")
def image(elf) -> BareImage:
    return BareImage(elf)


def pins_of(lines: int) -> int:
    """Lines 16 to 19 are PF12 to PF15, lines 20 to 23 are PF8 to PF11."""
    return (lines >> 16 & 0xF) << 12 | (lines >> 20 & 0xF) << 8


def write(image: BareImage, mask: int, levels: int) -> tuple[int, int, int]:
    """Status, and what was stored to the ports' BSRR."""
    image.write(PORT_E_BSRR, 0)
    image.write(PORT_F_BSRR, 0)
    status = image.call(image.operation("nucleo_multiplexers_ops", 0), 0, mask, levels)
    return status, image.read(PORT_E_BSRR), image.read(PORT_F_BSRR)


def test_lines_take_their_levels(image):
    rng = np.random.default_rng(2)
    for mask in (ADDRESSES, ENABLES, ADDRESSES | ENABLES, 0x00010, 0x480000, 0):
        for levels in map(int, rng.integers(0, 2**24, 8)):
            status, port_e, port_f = write(image, mask, levels)
            assert status == 0
            high, low = mask & levels, mask & ~levels
            assert port_e == (high & ADDRESSES) | (low & ADDRESSES) << 16
            assert port_f == pins_of(high) | pins_of(low) << 16


def test_lines_that_are_not_there_are_refused(image):
    assert write(image, 1 << 24, 0) == (-1, 0, 0)


def test_nothing_is_connected_before_the_pins_are_outputs(image):
    image.call("nucleo_multiplexers_start")
    assert image.read(PORT_F_BSRR) == 0xFF00 << 16
    assert image.read(0x40021400) >> 16 == 0x5555 and image.read(0x40021000) == 0x55555555
    assert image.read(0x40021400) >> 14 & 3 == 0  # PF7, which says how many there are
