"""Firmware with one bug each, built and run: the check that is meant for it fails. The sources as
they are pass them all."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest
from firmware_checks import CHECKS, run_session, table_after_upload

from cross_build import ROOT, build_cortex_m7
from emulated import IMAGE
from small_models import small_blob

COPIED = (
    "csrc", "firmware", "cmake", "tests/emulated", "tests/soak", "CMakeLists.txt",
    "CMakePresets.json",
)  # fmt: skip
TARGET = "eitskin_nucleo_f767zi"


@dataclass(frozen=True)
class Mutation:
    """Texts to be replaced in a file, each of which must be there exactly once, and the check that
    must notice."""

    file: str
    replaced: tuple[tuple[str, str], ...]
    noticed_by: str


BOARD, DRIVERS, APP = "firmware/boards/nucleo_f767zi", "firmware/drivers", "firmware/app"
MUTATIONS = {
    "SPI mode wrong": Mutation(
        f"{BOARD}/generator.c",
        (("mode = SPI_CR1_CPOL;", "mode = SPI_CR1_CPOL | 1u;"),),
        "generator",
    ),
    "SPI clock missing": Mutation(
        f"{BOARD}/clock.c", (("RCC_APB1ENR |= RCC_APB1ENR_SPI3EN;", ""),), "generator"
    ),
    "ADC clock missing": Mutation(
        f"{BOARD}/clock.c", (("RCC_APB2ENR |= RCC_APB2ENR_ADC1EN;", ""),), "amplitudes"
    ),
    "AD9833 word order": Mutation(
        f"{DRIVERS}/ad9833.c",
        (
            (
                "words[1] = (uint16_t)(ADDRESS_FREQ0 | (tuning & 0x3FFFu));",
                "words[2] = (uint16_t)(ADDRESS_FREQ0 | (tuning & 0x3FFFu));",
            ),
            (
                "words[2] = (uint16_t)(ADDRESS_FREQ0 | (tuning >> 14",
                "words[1] = (uint16_t)(ADDRESS_FREQ0 | (tuning >> 14",
            ),
        ),
        "generator",
    ),
    "DDS left in reset": Mutation(
        f"{DRIVERS}/ad9833.c",
        (
            (
                "words[4] = (uint16_t)(CONTROL_B28 | waveform_bits(waveform));",
                "words[4] = (uint16_t)(FW_AD9833_RESET_WORD | waveform_bits(waveform));",
            ),
        ),
        "generator",
    ),
    "two multiplexers swapped": Mutation(
        f"{DRIVERS}/adg1206.c",
        (
            (
                "addresses |= (uint32_t)electrodes[k] << (4 * k);",
                "addresses |= (uint32_t)electrodes[k] << (4 * (k == 1 ? 2 : k == 2 ? 1 : k));",
            ),
        ),
        "order",
    ),
    "no break before make": Mutation(
        f"{DRIVERS}/adg1206.c",
        (
            (
                "fw_status status = fw_adg1206_all_off(bank);\n    if (status != FW_OK)",
                "fw_status status = FW_OK;\n    if (status != FW_OK)",
            ),
        ),
        "broken_first",
    ),
    "no wait before make": Mutation(
        f"{DRIVERS}/adg1206.c",
        (("bank->lines.ops->wait_ns(bank->lines.ctx, FW_ADG1206_OFF_NS);", ""),),
        "broken_first",
    ),
    "DMA flag not cleared": Mutation(
        f"{BOARD}/capture.c",
        (
            ("        DMA_LIFCR(DMA2_BASE) = STREAM_FLAGS;\n        filling", "        filling"),
            ("} while ((DMA_LISR(DMA2_BASE) & DMA_LISR_TCIF0) != 0);", "} while (false);"),
        ),
        "interrupts",
    ),
    "wrong interrupt": Mutation(
        f"{BOARD}/stm32f767.h",
        (("#define IRQ_DMA2_STREAM0 56u", "#define IRQ_DMA2_STREAM0 57u"),),
        "interrupts",
    ),
    "settling skipped": Mutation(
        f"{APP}/scan.c",
        (
            ("fw_burst_us(s) + s->settle_us + FW_SWITCH_US;", "fw_burst_us(s) + FW_SWITCH_US;"),
            (
                "if ((uint64_t)us * s->excitation_millihz % 1000000000u == 0)",
                "if ((uint64_t)us * s->excitation_millihz > 0)",
            ),
            (
                (
                    "(int32_t)(burst->start_us - scan->switched_us) >"
                    " (int32_t)scan->settings.settle_us;"
                ),
                "true;",
            ),
        ),
        "amplitudes",
    ),
}
STALE_TABLE = Mutation(
    f"{APP}/engine.c",
    (
        (
            "    return (fw_scan_table){engine->model.protocol,",
            (
                "    static const uint8_t *first;\n    if (first == NULL)\n        first ="
                " engine->model.protocol;\n    return (fw_scan_table){first,"
            ),
        ),
    ),
    "table_after_upload",
)


class Workshop:
    """A copy of the sources with a build; mutants are built in it one at a time."""

    def __init__(self, folder: Path) -> None:
        self.source, self.build = folder / "source", folder / "build"
        for name in COPIED:
            (self.source / name).parent.mkdir(parents=True, exist_ok=True)
            copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
            copy(ROOT / name, self.source / name)
        build_cortex_m7(self.source, self.build, TARGET)
        self.unmutated = (self.build / IMAGE).read_bytes()

    def mutant(self, mutation: Mutation) -> bytes:
        """The image of the sources with ``mutation``, which is undone again."""
        path = self.source / mutation.file
        original = text = path.read_text()
        for old, new in mutation.replaced:
            assert text.count(old) == 1, (
                f"{mutation.file}: {old!r} is there {text.count(old)} times: bring the mutation up"
                " to date"
            )
            text = text.replace(old, new)
        try:
            path.write_text(text)
            done = subprocess.run(
                ["cmake", "--build", self.build, "--target", TARGET],
                capture_output=True,
                text=True,
                check=False,
            )
            assert done.returncode == 0, done.stdout
            image = (self.build / IMAGE).read_bytes()
        finally:
            path.write_text(original)
        assert image != self.unmutated, "the mutation is not in the image"
        return image


@pytest.fixture(scope="module")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Workshop:
    return Workshop(tmp_path_factory.mktemp("mutants"))


def test_the_sources_as_they_are_pass(workshop: Workshop) -> None:
    session = run_session(workshop.unmutated)
    assert {check.__name__: check(session) for check in CHECKS} == {
        check.__name__: None for check in CHECKS
    }


@pytest.mark.parametrize("name", MUTATIONS)
def test_a_mutant_is_noticed(workshop: Workshop, name: str) -> None:
    mutation = MUTATIONS[name]
    session = run_session(workshop.mutant(mutation))
    found = {check.__name__: told for check in CHECKS if (told := check(session)) is not None}
    print(f"{name}: {found}")
    assert mutation.noticed_by in found


def test_a_stale_protocol_table_is_noticed(workshop: Workshop) -> None:
    model = small_blob(kind="skip")
    assert table_after_upload(workshop.unmutated, model) is None
    told = table_after_upload(workshop.mutant(STALE_TABLE), model)
    assert told is not None
    assert told.startswith("row 0 is") or "never joined" in told or "is (" in told
