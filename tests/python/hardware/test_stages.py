"""Bring-up on the simulated instrument: all stages pass without a mistake, and each of twenty
mistakes of a maker is named by the stage that the guide says."""

import re
from pathlib import Path

import pytest

from eitskin_hardware.spice.stages import MISTAKES, STAGES, first_wrong, right

ROOT = Path(__file__).resolve().parents[3]
PAGE = re.sub(r"\s+", " ", (ROOT / "docs" / "guide" / "bring-up.md").read_text(encoding="utf-8"))
KEPT = (ROOT / "hardware" / "made" / "bring-up.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("stage", STAGES)
def test_a_stage_passes_without_a_mistake(stage):
    readings = list(STAGES[stage](right()))
    assert readings and [reading for reading in readings if not reading.passes] == []
    for reading in readings:
        kept = [
            line for line in KEPT.splitlines() if line.startswith(f"| {stage} | {reading.what} |")
        ]
        assert kept, f"eitskin hardware make: {reading.what} is missing"
        assert reading.value == pytest.approx(
            float(kept[0].split("|")[3].split()[0]), rel=0.02, abs=1e-3
        )


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda mistake: mistake.what)
def test_a_mistake_is_named_by_its_stage(mistake):
    named = first_wrong(mistake.make(right()))
    assert named is not None and named.stage == mistake.stage, named
    assert f"| {mistake.what} | {mistake.stage} | {named.reading.what} |" in KEPT
    assert mistake.what in PAGE


SHOWN = {
    "PC11": ("supplies", 3, "{:.1f} V"),
    "VOUT": ("generator", 0, "{:.2f} V"),
    "gain": ("generator", 2, "{:.2f} V"),
    "1 kohm": ("source", 0, "{:.2f} V"),
    "10 kohm": ("source", 1, "{:.2f} V"),
    "pair": ("multiplexers", 0, "{:.2f} V"),
    "receiver": ("amplifier", 0, "{:.2f}"),
    "codes": ("converter", 0, "{:.0f}"),
    "bias": ("converter", 1, "{:.0f}"),
    "ring": ("ring", 0, "{:.3f} V"),
    "dish": ("dish", 2, "{:.1f} V"),
    "gel": ("gel", 2, "{:.1f} V"),
}


@pytest.mark.parametrize(("stage", "index", "shown"), SHOWN.values(), ids=SHOWN)
def test_the_page_says_what_the_stage_shows(stage, index, shown):
    reading = list(STAGES[stage](right()))[index]
    assert shown.format(reading.value) in PAGE
