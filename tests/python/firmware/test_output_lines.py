"""The multiplexers' lines on their ports: one store a port, nothing but what was asked for."""

import numpy as np
import pytest
from bare_image import BareImage

PORT_E_BSRR, PORT_F_BSRR = 0x40021018, 0x40021418
ENABLE_PIN = 12
ADDRESSES, ENABLES = 0x0000FFFF, 0x000F0000


@pytest.fixture(scope="module")
def image(elf) -> BareImage:
    return BareImage(elf)


def write(image: BareImage, mask: int, levels: int) -> tuple[int, int, int]:
    """Status, and what was stored to the ports' BSRR."""
    image.write(PORT_E_BSRR, 0)
    image.write(PORT_F_BSRR, 0)
    status = image.call(image.operation("nucleo_multiplexers_ops", 0), 0, mask, levels)
    return status, image.read(PORT_E_BSRR), image.read(PORT_F_BSRR)


def test_lines_take_their_levels(image):
    rng = np.random.default_rng(2)
    for mask in (ADDRESSES, ENABLES, ADDRESSES | ENABLES, 0x00010, 0x80000, 0):
        for levels in map(int, rng.integers(0, 2**20, 8)):
            status, port_e, port_f = write(image, mask, levels)
            assert status == 0
            high, low = mask & levels, mask & ~levels
            assert port_e == (high & ADDRESSES) | (low & ADDRESSES) << 16
            assert port_f == (high >> 16) << ENABLE_PIN | (low >> 16) << (ENABLE_PIN + 16)


def test_lines_that_are_not_there_are_refused(image):
    assert write(image, 1 << 20, 0) == (-1, 0, 0)


def test_nothing_is_connected_before_the_pins_are_outputs(image):
    image.call("nucleo_multiplexers_start")
    assert image.read(PORT_F_BSRR) == 0xF000 << 16
    assert image.read(0x40021400) >> 24 == 0x55 and image.read(0x40021000) == 0x55555555
