"""The settings of a board's scan and solver that a user names; only these are changed."""

from dataclasses import asdict, dataclass, replace
from typing import Any

from eitskin.core.results import Options
from eitskin.device.client import Device
from eitskin.device.known_model import board_options
from eitskin.device.wire.packets import BoardInfo
from eitskin.model.model import Model


@dataclass(frozen=True)
class _Settings:
    @property
    def named(self) -> dict[str, Any]:
        """The settings that are to be changed."""
        return {name: value for name, value in asdict(self).items() if value is not None}


@dataclass(frozen=True)
class ScanSettings(_Settings):
    """Settings of the scan; None leaves a setting as it is. ``check_every`` is that of
    ``commands.Scan``: with 1 every row is scanned; with n > 1 one row of each reciprocal pair, and
    all rows in every n-th frame; with 0 never all rows."""

    excitation_hz: float | None = None
    sample_rate_hz: int | None = None
    samples: int | None = None
    settle_us: int | None = None
    check_every: int | None = None
    frame_period_us: int | None = None


@dataclass(frozen=True)
class SolverSettings(_Settings):
    """The board's solver; None stays at the model's own, ``warm_start`` at off, ``mac_limit`` at
    none, ``diagnostics`` at all."""

    iterations: int | None = None
    gap_rel: float | None = None
    warm_start: bool | None = None
    sign: str | None = None
    lambda_rel: float | None = None
    max_touches: int | None = None
    solver: str | None = None
    mac_limit: int | None = None
    diagnostics: int | None = None

    def applied(self, model: Model, board: BoardInfo) -> Options:
        """The options that ``board`` with ``model`` starts with, with these changes."""
        return replace(board_options(model, board), **self.named)


def apply_scan(device: Device, scan: ScanSettings) -> None:
    """Change the scan if a setting is given; the board then discards its reference."""
    if scan.named:
        device.scan(**scan.named)
