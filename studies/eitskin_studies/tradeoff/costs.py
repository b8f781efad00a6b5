"""The costs of a configuration that need no run: flash, RAM, and the time to measure a frame."""

from typing import Any

from eitskin.core.engine import CoreEngine
from eitskin.tuning.configuration import Configuration
from eitskin_studies.tradeoff.engines import Built

EXCITATION_PERIOD_US, SAMPLE_US, SETTLE_US, SWITCH_US = 20, 1, 16, 3


def acquisition_us(one: Configuration, rows: int, unique_rows: int) -> int:
    """From the first measurement of a frame to that of the next: slots times rows, by the
    firmware's rule for slots."""
    return slot_us(one.samples) * (rows if one.scan == "full" else unique_rows)


def slot_us(samples: int) -> int:
    """From one measurement to the next: burst, settling, switching; a whole number of excitation
    periods where that costs at most a quarter more (fw_slot_us in firmware/app/acquire/scan.c)."""
    least = samples * SAMPLE_US + SETTLE_US + SWITCH_US
    whole = -(-least // EXCITATION_PERIOD_US) * EXCITATION_PERIOD_US
    return whole if whole <= least + least // 4 else least


def static_costs(one: Configuration, built: Built) -> dict[str, Any]:
    """Bytes of the .eitm file and of the core's workspace without panels, as a board has it;
    pixels; us of a scan."""
    model = built.model
    core = CoreEngine(built.blob, prepared=False)
    return {
        "flash_bytes": len(built.blob),
        "ram_bytes": core.workspace_bytes,
        "pixels_kept": model.grid.n_pixels,
        "acquisition_us": acquisition_us(one, model.protocol.n_rows, len(model.fold.first)),
    }
