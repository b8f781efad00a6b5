"""The settings of a session with a board."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias

from eitskin.config import nearest
from eitskin.core.gestures import Zone
from eitskin.device.known_model import KnownModel, need_model
from eitskin.device.settings import ScanSettings, SolverSettings
from eitskin.device.wire.link_table import Stream
from eitskin.device.wire.packets import BoardInfo
from eitskin.errors import UsageError
from eitskin.kinematics.pose import Pose
from eitskin.tuning.for_model import operating_point_for, settings_text
from eitskin.tuning.front import REPORT_US, Preset, board_takes

KINDS = ("raw", "image", "touches", "events")
Say: TypeAlias = Callable[[str], None]


def kinds_of(text: str, name: str) -> Stream:
    """The kinds in "raw,touches"; ``name`` is the option that gave them."""
    what = Stream(0)
    for kind in (one.strip() for one in text.split(",")):
        if kind not in KINDS:
            raise UsageError(f"{name} {text}: {nearest(kind, KINDS)}")
        what |= Stream[kind.upper()]
    return what


@dataclass(frozen=True)
class SessionSettings:
    """The settings of a session; those that are not given stay as they are on the board.

    Attributes:
        mode: what is streamed; None: all that a simulated or recorded board can send, and image
            and touches of a real one, whose line carries fewer frames with raw voltages.
        report: "frame", or also touches after each "drive", with their velocity.
        confirmed: only touches that a whole frame has confirmed, in frames and reports.
        every: every n-th frame; 0: as many as the line carries.
        frames: stop after so many; 0: go on until the scene or the recording ends.
        model: a file, where the board's model is not the prebuilt one.
        firmware: of an emulated board.
        model_for: what cannot do without the board's model, such as "a picture"; "": nothing.
        tare: take the reference from so many frames; None: from 16 where that is needed.
        zones: named places that fingers press (``eitskin.session.zones``).
        preset: a preset that chooses the solver's settings.
        record: a new recording of every packet; an existing file is written over.
        name: of the board, skin or source, in every message; None: the URL's, else the one
            in the board's settings, else the board's serial number.
        quiet_frames: the untouched frames of the reference are sent too, and their mean is kept.
        pose: where the skin is on a link of a robot; None: no robot file says it, and only the
            model of a surface does.
        link: the link's frame of reference; None: the one that the model of a surface names, else
            the name.
    """

    mode: Stream | None = Stream.TOUCHES
    report: str = "frame"
    confirmed: bool = False
    every: int = 0
    frames: int = 0
    model: Path | None = None
    firmware: Path | None = None
    model_for: str = ""
    scan: ScanSettings = field(default_factory=ScanSettings)
    solver: SolverSettings = field(default_factory=SolverSettings)
    zones: tuple[Zone, ...] = ()
    preset: "Preset | None" = None
    tare: int | None = None
    record: Path | None = None
    name: str | None = None
    quiet_frames: bool = False
    pose: Pose | None = None
    link: str | None = None

    def scan_and_solver(
        self, board: BoardInfo, known: KnownModel | None, name: str, say: Say
    ) -> tuple[ScanSettings, SolverSettings]:
        """Return the named settings. With a preset, return those of the operating point that it
        chooses for the board's ``known`` model; ``name`` is the board's name."""
        scan, named, preset = self.scan, self.solver, self.preset
        if preset is None:
            return scan, named

        known = known or need_model(board, self.model, name, "a preset")
        any_scan = preset.unit == REPORT_US
        now = named.applied(known.model, board)
        point = operating_point_for(preset, known.model, now, board_takes(), any_scan)
        say(settings_text(point, preset))
        one = point.configuration
        kept = {k: value for k, value in one.solver_settings.items() if k in board_takes()}
        own = {key: getattr(named, key) for key in ("sign", "warm_start", "diagnostics")}
        if any_scan:
            check_every = 1 if one.scan == "full" else 0
            scan = replace(scan, samples=one.samples, check_every=check_every)
        return scan, replace(SolverSettings(**kept), **own)

    def refuse_of_recording(self, name: str) -> None:
        """Reject settings for a recording, which takes none."""
        named: dict[str, Any] = {**self.scan.named, **self.solver.named}
        if self.preset is not None:
            named["preset"] = True
        if named or self.tare is not None:
            what = next(iter(named), "tare").replace("_", "-")
            raise UsageError(
                f"{name} is a recording, {what} cannot be set any more; leave the options of"
                " scan, solver and tare out"
            )
        if self.record is not None:
            raise UsageError(f"{name} is a recording already; copy the file")
