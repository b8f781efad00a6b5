"""What a configuration costs without running it: flash, RAM, and the time to measure a frame."""

from __future__ import annotations

from typing import Any

from eitskin.core.engine import CoreEngine
from eitskin.device.simulated.checks import slot_us
from eitskin.device.wire.commands import Scan
from eitskin.tuning.configuration import Configuration
from eitskin_studies.tradeoff.engines import Built

EXCITATION_MILLIHZ, SAMPLE_RATE_HZ, SETTLE_US = 50_000_000, 1_000_000, 16


def acquisition_us(one: Configuration, rows: int, unique_rows: int) -> int:
    """From the first measurement of a frame to that of the next: slots times rows, by the
    firmware's rule for slots."""
    scan = Scan(EXCITATION_MILLIHZ, SAMPLE_RATE_HZ, one.samples, SETTLE_US, 1, 0, 0)
    return slot_us(scan) * (rows if one.scan == "full" else unique_rows)


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
