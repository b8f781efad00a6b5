"""The board's serial link: every byte out once and in order, all of a write or nothing, and what a
full receiver does."""

from pathlib import Path

import numpy as np
import pytest
from bare_image import DMA1, SCRATCH, BareImage

TX, RX = DMA1 + 0x10 + 0x18 * 3, DMA1 + 0x10 + 0x18 * 1
CR, NDTR, M0AR = 0, 4, 12
EN, TCIF1, TCIF3, TEIF3 = 1, 1 << 11, 1 << 27, 1 << 25
TX_BYTES, RX_BYTES = 32768, 16384
READ_AT = SCRATCH + 0x8000


class Serial:
    """The link of a fresh image; DMA is played by the test."""

    def __init__(self, elf: Path) -> None:
        self.image = BareImage(elf)
        self.image.call("nucleo_link_start")
        self.received = 0

    def write(self, data: bytes) -> bool:
        self.image.write_bytes(SCRATCH, data)
        write = self.image.operation("nucleo_link_ops", 0)
        return bool(self.image.call(write, 0, SCRATCH, len(data)) & 0xFF)

    def send(self, flag: int = TCIF3) -> bytes:
        """DMA sends the bytes that it was given, and raises its flag."""
        image = self.image
        if not image.read(TX + CR) & EN:
            return b""
        data = image.read_bytes(image.read(TX + M0AR), image.read(TX + NDTR))
        image.write(TX + CR, image.read(TX + CR) & ~EN)
        image.write(DMA1, image.read(DMA1) | flag)
        image.call("nucleo_dma1_stream3_irq")
        assert image.read(DMA1) & flag == 0
        return data

    def receive(self, data: bytes, *, interrupts: bool = True) -> None:
        """DMA stores ``data`` in its ring."""
        image, ring = self.image, self.image.symbols["rx_ring"]
        for value in data:
            image.write_bytes(ring + self.received % RX_BYTES, bytes([value]))
            self.received += 1
            if self.received % RX_BYTES == 0:
                image.write(DMA1, image.read(DMA1) | TCIF1)
                if interrupts:
                    image.write(RX + NDTR, RX_BYTES)
                    image.call("nucleo_dma1_stream1_irq")
        image.write(RX + NDTR, RX_BYTES - self.received % RX_BYTES)

    def read(self, room: int) -> bytes:
        size = self.image.call(self.image.operation("nucleo_link_ops", 1), 0, READ_AT, room)
        return self.image.read_bytes(READ_AT, size)


def test_baud_rate_and_directions(elf):
    image = Serial(elf).image
    assert 54_000_000 / image.read(0x4000480C) == 1_000_000
    assert image.read(RX + CR) & EN and not image.read(TX + CR) & EN
    assert image.read(RX + 8) == 0x40004824 and image.read(TX + 8) == 0x40004828  # RDR, TDR


@pytest.mark.parametrize("seed", range(3))
def test_every_byte_is_sent_once_and_in_order(elf, seed):
    serial, rng = Serial(elf), np.random.default_rng(seed)
    accepted, sent, refused = b"", b"", 0
    for _ in range(60):
        data = rng.bytes(int(rng.integers(1, 12_000)))
        if serial.write(data):
            accepted += data
        else:
            refused += 1
            room = TX_BYTES - (len(accepted) - len(sent))
            assert len(data) > room, "refused though there was room"
        assert len(accepted) - len(sent) <= TX_BYTES
        if rng.random() < 0.5:
            sent += serial.send()
    while piece := serial.send():
        sent += piece
    assert sent == accepted and refused > 0


def test_a_write_fits_wholly_or_not_at_all(elf):
    serial = Serial(elf)
    assert serial.write(bytes(TX_BYTES)) and not serial.write(b"x")
    assert len(serial.send()) == TX_BYTES
    assert serial.write(b"x") and serial.send() == b"x"


def test_the_link_goes_on_after_a_failed_transfer(elf):
    serial = Serial(elf)
    assert serial.write(b"lost") and serial.write(b"kept")
    assert serial.send(TEIF3) == b"lost"
    assert serial.send() == b"kept" and serial.send() == b""


@pytest.mark.parametrize("seed", range(3))
def test_every_byte_is_received_once_and_in_order(elf, seed):
    serial, rng = Serial(elf), np.random.default_rng(seed)
    came, taken = b"", b""
    for _ in range(60):
        data = rng.bytes(int(rng.integers(0, 3000)))
        if len(came) + len(data) - len(taken) <= RX_BYTES:
            serial.receive(data)
            came += data
        taken += serial.read(int(rng.integers(1, 4096)))
    while piece := serial.read(4096):
        taken += piece
    assert taken == came and len(came) > 2 * RX_BYTES


def test_a_wrap_before_its_interrupt_is_waited_for(elf):
    serial = Serial(elf)
    serial.receive(bytes(RX_BYTES - 2))
    assert len(serial.read(RX_BYTES)) == RX_BYTES - 2
    serial.receive(b"abcd", interrupts=False)
    assert serial.read(100) == b""
    serial.image.call("nucleo_dma1_stream1_irq")
    assert serial.read(100) == b"abcd"


def test_after_an_overrun_only_what_comes_later_is_read(elf):
    serial = Serial(elf)
    serial.receive(bytes(RX_BYTES + 100))
    assert serial.read(100) == b""
    serial.receive(b"after")
    assert serial.read(100) == b"after"
