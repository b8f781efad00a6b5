"""The board's own register header agrees with SVD files that others made: bases, offsets and bits
of everything they share.

There is no SVD file of the STM32F7 in a package; the F429's has its older peripherals, the L4's
those that came between (USART, SPI with a FIFO) and the core's. ``f767_facts.toml`` has what
neither has, and what differs between the families, each with its section of RM0410 or PM0253.
"""

import re
from functools import cache
from pathlib import Path

import pytest
from svd_files import Device, Register, load_svd

from eitskin.config import load_toml

BOARD = Path(__file__).resolve().parents[3] / "firmware" / "boards" / "nucleo_f767zi"
HEADER = BOARD / "stm32f767.h"
F4, L4 = "STM32F429x.svd", "STM32L4x2.svd"

# Prefix in the header: file, peripheral there, and other instances whose bases the header names.
PERIPHERALS = {
    "RCC": (F4, "RCC"), "PWR": (F4, "PWR"), "FLASH": (F4, "FLASH"), "GPIO": (F4, "GPIOA"),
    "ADC": (F4, "ADC1"), "EXTI": (F4, "EXTI"),
    "DMA": (F4, "DMA2"), "TIM": (F4, "TIM2"), "IWDG": (F4, "IWDG"), "SPI": (L4, "SPI3"),
    "USART": (L4, "USART3"),
    "STK": (L4, "STK"), "NVIC": (L4, "NVIC"), "SCB": (L4, "SCB"), "MPU": (L4, "MPU"),
}  # fmt: skip
# Registers and fields that have another name there; CTRL and the like of the MPU bear their unit's
# name.
RENAMED = {
    "PWR_CR1": "CR", "PWR_CSR1": "CSR", "SCB_CFSR": "CFSR_UFSR_BFSR_MMFSR",
    "TIM_CCMR1": "CCMR1_Output",
    "MPU_CTRL": "MPU_CTRL", "MPU_RNR": "MPU_RNR", "MPU_RBAR": "MPU_RBAR", "MPU_RASR": "MPU_RASR",
    "NVIC_ISER": "ISER0", "NVIC_ICER": "ICER0", "NVIC_ICPR": "ICPR0", "NVIC_IPR": "IPR0",
    "DMA_CR": "S0CR", "DMA_NDTR": "S0NDTR", "DMA_PAR": "S0PAR", "DMA_M0AR": "S0M0AR",
    "DMA_M1AR": "S0M1AR", "DMA_FCR": "S0FCR",
    "RCC_CFGR_SW": "SW0", "RCC_CFGR_SWS": "SWS0", "RCC_PLLCFGR_PLLM": "PLLM0",
    "RCC_PLLCFGR_PLLN": "PLLN0",
    "RCC_PLLCFGR_PLLP": "PLLP0", "RCC_PLLCFGR_PLLQ": "PLLQ0",
    "RCC_AHB1ENR_DTCMRAMEN": "CCMDATARAMEN",
    "FLASH_OPTCR_BOR": "BOR_LEV", "FLASH_ACR_ARTEN": "ICEN", "FLASH_SR_ERSERR": "PGSERR",
}  # fmt: skip
FACTS = load_toml(Path(__file__).with_name("f767_facts.toml"), "facts about the F767")
# Not of a peripheral with an SVD: the trace unit, the debugger's, and the identifier (RM0410 45.1).
ADDRESSES = {"UID": 0x1FF0F420}
ONLY_HERE = ("DWT_", "DCB_", "DBGMCU_")  # in no SVD file
NOT_IN_SVD = (
    *("RCC_PLLCFGR_PLLR", "FLASH_OPTCR_NDBANK", "ADC_SMPR2_SMP3", "SCB_CCR_DC", "SCB_CCR_IC"),
    *("SCB_CSSELR", "SCB_CPACR", "SCB_ICIALLU", "SCB_DCIMVAC", "SCB_DCISW"),
)
INTERRUPTS = {
    "DMA1_STREAM1": "DMA1_Stream1", "DMA1_STREAM3": "DMA1_Stream3", "DMA2_STREAM0": "DMA2_Stream0",
    "ADC": "ADC", "PVD": "PVD",
    "USART3": "USART3",
}  # fmt: skip

TEXT = re.sub(" +", " ", HEADER.read_text(encoding="utf-8"))  # macros are aligned
BASES = {
    name: int(value, 16)
    for name, value in re.findall(r"^#define (\w+)_BASE (0x[0-9A-F]+)u", TEXT, re.M)
}
ACCESS = r"(?:REG32|REG16|\(\*\(volatile uint8_t \*\))"
REGISTER = re.compile(
    rf"^#define (\w+?)(?:\([\w, ]+\))? {ACCESS}\(\(?(\w+)\)? \+ 0x([0-9A-F]+)u", re.M
)
REGISTERS = {name: (owner, int(offset, 16)) for name, owner, offset in REGISTER.findall(TEXT)}
BITS = {name: int(bit) for name, bit in re.findall(r"^#define (\w+) \(1u << (\d+)\)", TEXT, re.M)}
POSITIONS = {name: int(bit) for name, bit in re.findall(r"^#define (\w+)_POS (\d+)u", TEXT, re.M)}


@cache
def device(name: str) -> Device:
    return load_svd(name)


def peripheral_of(name: str) -> tuple[Device, str]:
    file, key = PERIPHERALS[name.split("_")[0]]
    if name.startswith("ADC_CCR"):
        key = "C_ADC"
    return device(file), key


def register_of(name: str) -> tuple[str, Register] | None:
    """The header's register that ``name`` is or is a field of, and the SVD file's."""
    parts = name.split("_")
    ours = "_".join(parts[:2])
    if parts[0] not in PERIPHERALS:
        return None
    source, key = peripheral_of(name)
    return ours, source.peripherals[key].registers[RENAMED.get(ours, parts[1])]


def test_everything_in_the_header_was_read():
    defined = set(re.findall(r"^#define (\w+)", TEXT, re.M)) - {"STM32F767_H", "REG32", "REG16"}
    read = (
        {f"{name}_BASE" for name in BASES}
        | set(REGISTERS)
        | set(BITS)
        | {f"{name}_POS" for name in POSITIONS}
    )
    constants = {f"FLASH_{kind}{k}" for kind in ("KEY", "OPTKEY") for k in (1, 2)}
    constants |= {"SCB_AIRCR_SYSRESETREQ", "UID", "DCB_DEMCR"}
    assert {name for name in defined - read - constants if not name.startswith("IRQ_")} == set()
    assert len(REGISTERS) > 80 and len(BITS) > 80 and len(POSITIONS) > 20


def test_everything_in_the_header_is_used():
    program = "".join(path.read_text(encoding="utf-8") for path in sorted(BOARD.glob("*.c")))
    program += (BOARD / "nucleo.h").read_text(encoding="utf-8")
    lines = TEXT.splitlines()
    for name in re.findall(r"^#define (\w+)", TEXT, re.M):
        elsewhere = "\n".join(line for line in lines if not line.startswith(f"#define {name}"))
        assert re.search(rf"\b{name}\b", program + elsewhere) or name == "STM32F767_H", (
            f"{name} is not used"
        )


def test_bases():
    for name in sorted(BASES):
        assert_base(name)


def assert_base(name: str) -> None:
    known = {**FACTS["bases"], **ADDRESSES}
    assert BASES[name] == known.get(name, BASES[name]), name
    prefix = next((key for key in PERIPHERALS if name.startswith(key)), None)
    if prefix is None or name == "ADC_COMMON":
        assert name in known, f"{name} is checked against nothing"
        return
    assert BASES[name] == device(PERIPHERALS[prefix][0]).peripherals[name].base, name


def test_registers():
    for name in sorted(REGISTERS):
        assert_register(name)


def assert_register(name: str) -> None:
    owner, offset = REGISTERS[name]
    fact = FACTS["offsets"].get(name)
    assert offset == (offset if fact is None else fact), name
    if name.startswith(ONLY_HERE):
        assert fact is not None and owner == f"{name.split('_')[0]}_BASE", name
    elif name not in NOT_IN_SVD:
        found = register_of(name)
        assert found is not None, f"{name} is checked against nothing"
        assert offset == found[1].offset, name
        if owner.endswith("_BASE"):  # of the peripheral whose name it bears
            assert owner == (
                "ADC_COMMON_BASE" if name == "ADC_CCR" else f"{name.split('_')[0]}_BASE"
            ), name


def test_fields():
    for name in sorted(BITS | POSITIONS):
        assert_field(name)


def assert_field(name: str) -> None:
    bit = (BITS | POSITIONS)[name]
    fact = FACTS["bits"].get(name)
    assert bit == (bit if fact is None else fact), name
    if name.startswith(ONLY_HERE) or name in NOT_IN_SVD:
        assert fact is not None, f"{name} is checked against nothing"
        return
    found = register_of(name)
    assert found is not None, f"{name} is checked against nothing"
    field = RENAMED.get(name, name.removeprefix(found[0] + "_"))
    lowest, width = found[1].fields[field]
    assert bit == lowest, name
    assert name in RENAMED or (width == 1) == (name in BITS), f"{field} has {width} bits"


@pytest.mark.parametrize(
    ("kind", "defined"),
    [
        ("bases", BASES),
        ("offsets", {name: offset for name, (_, offset) in REGISTERS.items()}),
        ("bits", BITS | POSITIONS),
    ],
)
def test_every_fact_is_in_the_header(kind, defined):
    assert {name: defined.get(name) for name in FACTS[kind]} == FACTS[kind]


def test_registers_of_one_stream_are_0x18_apart():
    registers = device(F4).peripherals["DMA2"].registers
    for stream in range(4):
        assert registers[f"S{stream}CR"].offset == 0x10 + 0x18 * stream
    assert TEXT.count("+ 0x18u * (stream)") == 6


def test_access_control_of_the_fpu():
    assert BASES["SCB"] + REGISTERS["SCB_CPACR"][1] == device(L4).peripherals["FPU_CPACR"].base


def test_reset_request():
    """The key 0x05FA in the upper half, and SYSRESETREQ (PM0253 4.3.5)."""
    bit = device(L4).peripherals["SCB"].registers["AIRCR"].fields["SYSRESETREQ"][0]
    assert f"0x05FA0000u | (1u << {bit})" in TEXT


def test_interrupts():
    numbers = {
        name: int(value) for name, value in re.findall(r"^#define IRQ_(\w+) (\d+)u", TEXT, re.M)
    }
    assert numbers == FACTS["interrupts"]
    del numbers["COUNT"]
    assert numbers == {name: device(F4).interrupts[theirs] for name, theirs in INTERRUPTS.items()}
