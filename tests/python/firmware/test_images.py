"""Contents of the built images: vectors, places in memory and sizes; and no heap, stdio or double
arithmetic."""

import re
import shutil
import struct
import subprocess

import pytest

from cross_build import ROOT, build_cortex_m7

FLASH, FLASH_BYTES = 0x08000000, 256 * 1024  # of the program: models begin at 0x08040000
DTCM, DTCM_BYTES = 0x20000000, 128 * 1024
SRAM, SRAM_BYTES = 0x20020000, 384 * 1024
ITCM, ITCM_GUARD, ITCM_BYTES = 0x00000000, 0x800, 16 * 1024
MEMORIES = (
    (ITCM + ITCM_GUARD, ITCM_BYTES - ITCM_GUARD),
    (FLASH, FLASH_BYTES),
    (DTCM, DTCM_BYTES),
    (SRAM, SRAM_BYTES),
)
IMAGE = "eitskin_nucleo_f767zi"
HANDLERS = {
    2: "nucleo_clock_irq",
    14: "nucleo_later_irq",
    15: "nucleo_tick_irq",
    16 + 1: "nucleo_supply_irq",
    16 + 12: "nucleo_dma1_stream1_irq",
    16 + 14: "nucleo_dma1_stream3_irq",
    16 + 18: "nucleo_adc_irq",
    16 + 39: "nucleo_usart3_irq",
    16 + 56: "nucleo_dma2_stream0_irq",
}
ON_TIME = (
    *("nucleo_dma2_stream0_irq", "on_burst", "fw_adg1206_join", "fw_adg1206_all_off"),
    *("write_lines", "wait_ns", "nucleo_multiplexers_ops", "nucleo_time_us", "nucleo_wake"),
    *("fw_demodulate", "fw_sincos"),
)
RESERVED = (7, 8, 9, 10, 13)  # Armv7-M B1.5.2


def arm(tool: str, *arguments: object) -> str:
    command = [f"arm-none-eabi-{tool}", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


@pytest.fixture(scope="session")
def symbols(elf) -> dict[str, int]:
    return {
        name: int(value, 16)
        for value, name in re.findall(r"^([0-9a-f]{8}) \w (\S+)$", arm("nm", elf), re.M)
    }


@pytest.fixture(scope="session")
def sections(elf) -> dict[str, tuple[int, int]]:
    """Size and address of each section that is loaded or set up."""
    found = re.findall(r"^(\.\S+)\s+(\d+)\s+(\d+)$", arm("size", "-A", elf), re.M)
    return {name: (int(size), int(address)) for name, size, address in found if int(address)}


def test_vectors(elf, symbols):
    # 16 of the core, 110 of the F767 (RM0410 table 46)
    vectors = struct.unpack("<126I", elf.with_suffix(".bin").read_bytes()[: 4 * 126])
    assert vectors[0] == symbols["stack_top"] and vectors[0] % 8 == 0
    assert vectors[1] == symbols["nucleo_reset"] | 1
    for number, vector in enumerate(vectors[2:], 2):
        handler = symbols[HANDLERS.get(number, "nucleo_fault_irq")] | 1
        assert vector == (0 if number in RESERVED else handler), f"vector {number}"
    # VTOR: aligned to the table's size, a power of two
    assert symbols["vectors"] == FLASH and symbols["vectors"] % 512 == 0


def test_places_in_memory(sections, symbols):
    for name, (size, address) in sections.items():
        ends = [start + room for start, room in MEMORIES if start <= address < start + room]
        assert ends and address + size <= ends[0], name
    # The stack is at the bottom of DTCM, so that what overflows it meets the MPU's guard, aligned
    # to its 256 bytes.
    assert symbols["stack_bottom"] == DTCM
    assert symbols["stack_top"] - symbols["stack_bottom"] >= 8 * 1024
    # The path from a burst's end to the next row meets no cache: code in ITCM, data in DTCM.
    for name in ON_TIME:
        assert ITCM + ITCM_GUARD <= symbols[name] < ITCM + ITCM_BYTES, name
    assert symbols["itcm_vectors"] % 512 == 0
    assert DTCM <= symbols["instrument"] < DTCM + DTCM_BYTES
    # DMA works on memory that no cache covers.
    for name in ("buffers", "tx_ring", "rx_ring"):
        assert DTCM <= symbols[name] < DTCM + DTCM_BYTES, name
    # Memory that survives a reset is neither cleared nor painted.
    assert symbols["dtcm_start"] >= symbols["crash"] + 28
    assert symbols["crash"] >= symbols["stack_top"]
    assert symbols["workspace_start"] % 16 == 0 and symbols["workspace_start"] >= symbols["bss_end"]


def test_what_the_image_does_without(symbols):
    for name in symbols:
        assert not re.search(r"alloc|printf|sbrk|^free$|^exit$|fwrite|fopen", name), name
        assert not re.search(r"__aeabi_d(?!iv0)|df[23]$|df$|f2d", name), (
            f"{name}: double arithmetic"
        )


def test_sizes(elf, sections, symbols):
    image = elf.with_suffix(".bin").stat().st_size
    stack = symbols["stack_top"] - symbols["stack_bottom"]
    workspace = symbols["workspace_end"] - symbols["workspace_start"]
    print(f"\nflash {image} of {FLASH_BYTES} bytes, stack {stack}, DMA {sections['.dtcm'][0]}")
    print(f"code in ITCM {sections['.itcm'][0]} of {ITCM_BYTES - ITCM_GUARD}")
    print(f"statics {sections['.bss'][0]}, workspace {workspace} of {SRAM_BYTES} bytes")
    parts = (".vectors", ".itcm", ".text", ".ARM.exidx", ".data")
    assert image == sum(sections.get(name, (0, 0))[0] for name in parts)
    assert image <= FLASH_BYTES - 60_000, "60 kB of flash are kept for what is to come"
    assert workspace >= 256 * 1024
    assert f"0x{symbols['stack_top']:08x}" in elf.with_suffix(".map").read_text(encoding="utf-8")


@pytest.mark.long("test_prebuilt.py builds the image once")
def test_the_same_bytes_wherever_it_is_built(elf, tmp_path):
    """In a copy of the checkout with another path, in a folder of another name."""
    copy = tmp_path / "a checkout elsewhere"
    for name in ("csrc", "firmware", "cmake", "tests/emulated", "tests/soak"):
        shutil.copytree(ROOT / name, copy / name)
    shutil.copy(ROOT / "CMakeLists.txt", copy)
    again = build_cortex_m7(copy, tmp_path / "other", IMAGE) / "firmware" / f"{IMAGE}.bin"
    assert again.read_bytes() == elf.with_suffix(".bin").read_bytes()
    assert str(copy).encode() not in again.read_bytes()
