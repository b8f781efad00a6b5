"""What a processor fault leaves in memory that survives the reset, and what the next start makes of
it."""

import struct

import numpy as np
import pytest
from bare_image import SCRATCH, BareImage

SCB = 0xE000ED00
ICSR, AIRCR, CFSR, HFSR, MMFAR, BFAR = (
    SCB + offset for offset in (0x04, 0x0C, 0x28, 0x2C, 0x34, 0x38)
)
RCC_CSR = 0x40023874
STKERR = 1 << 12
R0_TO_R12, LR, PC, XPSR = (1, 2, 3, 4, 12), 0x08001235, 0x08004568, 0x01000000
FRAME = struct.pack("<8I", *R0_TO_R12, LR, PC, XPSR)


@pytest.fixture
def image(elf) -> BareImage:
    return BareImage(elf)


def crash(image: BareImage, frame: int, cfsr: int, hfsr: int = 0) -> None:
    image.write(CFSR, cfsr)
    image.write(HFSR, hfsr)
    image.write(MMFAR, 0x111)
    image.write(BFAR, 0x222)
    image.write(ICSR, 0x0040_0000 | (16 + 28))
    image.run_into_a_loop("nucleo_crash", frame)
    assert image.read(AIRCR) == 0x05FA0004, "no reset is asked for"


def last_reset(image: BareImage) -> tuple[int, ...]:
    """crash, watchdog and the five words."""
    image.call("nucleo_last_reset", SCRATCH)
    return struct.unpack("<7I", image.read_bytes(SCRATCH, 28))


@pytest.mark.parametrize(("cfsr", "address"), [(0x82, 0x111), (0x8200, 0x222), (0x10000, 0)])
def test_a_fault_is_told_once_after_the_reset(image, cfsr, address):
    frame = image.symbols["stack_top"] - 64
    image.write_bytes(frame, FRAME)
    crash(image, frame, cfsr, 1 << 30)
    assert last_reset(image) == (1, 0, PC, LR, cfsr, 1 << 30, address)
    assert last_reset(image) == (0, 0, 0, 0, 0, 0, 0)


def test_an_unexpected_interrupt_is_told_by_its_number(image):
    frame = image.symbols["stack_top"] - 64
    image.write_bytes(frame, FRAME)
    crash(image, frame, 0)
    assert last_reset(image)[2:] == (PC, LR, 0, 0, 16 + 28)


@pytest.mark.parametrize("frame", ["below the guard", "above the stack", "stacking failed"])
def test_no_frame_is_read_where_none_is(image, frame):
    """A stack that overflowed: reading there would be a second fault."""
    bottom, top = image.symbols["stack_bottom"], image.symbols["stack_top"]
    at = {
        "below the guard": bottom + 128,
        "above the stack": top - 16,
        "stacking failed": top - 64,
    }[frame]
    cfsr = STKERR if frame == "stacking failed" else 0x82
    image.write_bytes(at, FRAME)
    crash(image, at, cfsr)
    assert last_reset(image)[:5] == (1, 0, 0, 0, cfsr)


def test_random_memory_after_power_up_is_no_crash(image):
    rng = np.random.default_rng(1)
    for _ in range(20):
        image.write_bytes(image.symbols["crash"], rng.bytes(28))
        assert last_reset(image)[0] == 0
    image.write_bytes(image.symbols["crash"], struct.pack("<7I", 0xC0A57ED5, *([5] * 6)))
    assert last_reset(image)[0] == 0


def test_the_watchdog_is_told_and_its_flag_cleared(image):
    image.write(RCC_CSR, 1 << 29)
    assert last_reset(image)[:2] == (0, 1)
    assert image.read(RCC_CSR) & 1 << 24, "RMVF"
