"""The solver of a simulated board: the host's core with the firmware's options, results as
packets."""

from __future__ import annotations

import re
import zlib
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.core.engine import CoreEngine
from eitskin.core.results import SIGNS, SOLVERS, Info
from eitskin.device.known_model import board_options
from eitskin.device.wire.commands import Solver
from eitskin.device.wire.packets import (
    PacketType,
    RawFrame,
    Solved,
    SolvedImage,
    SolvedTouches,
    Stream,
)
from eitskin.device.wire.payloads import build_image, build_touches
from eitskin.errors import EitskinError, FrameError, UsageError
from eitskin.model.eitm import decode_model
from eitskin.model.storage import STORAGES
from eitskin.solve.options import TRACKING

E_ARGUMENT = -1
NOTHING = Info(0, "iterations", 0, 0, 0, 0, 0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def core_status(error: EitskinError) -> int:
    """The eits_status behind an error of ``CoreEngine``."""
    match = re.search(r"status (-\d+)\)", str(error))
    return int(match.group(1)) if match else E_ARGUMENT


def model_facts(solver: SimSolver | None, bank: int) -> dict[str, Any]:
    """What ``BoardInfo`` says of the model, zeros where there is none."""
    names = (
        "model_bytes", "model_crc", "protocol_hash", "n_electrodes", "n_rows", "n_folded", "rank",
        "n_pixels", "nx", "ny",
        "storage", "bank",
    )  # fmt: skip
    if solver is None:
        return dict.fromkeys(names, 0)
    blob, model, protocol, grid = (
        solver.blob,
        solver.model,
        solver.model.protocol,
        solver.model.grid,
    )
    head = len(blob), zlib.crc32(blob), protocol.hash, protocol.n_electrodes, protocol.n_rows
    rest = (
        len(model.fold.first),
        model.rank,
        grid.n_pixels,
        grid.nx,
        grid.ny,
        STORAGES.index(model.stored.storage),
        bank,
    )
    return dict(zip(names, (*head, *rest), strict=True))


class SimSolver:
    """A model taken up by the core, as the firmware does; not tared.

    Raises:
        ModelError: the core refuses the model.
    """

    def __init__(self, blob: bytes) -> None:
        self.blob = blob
        self.engine = CoreEngine(blob)
        self.model = decode_model(blob, "the model")
        self.options = board_options(self.model)
        self.engine.set_options(self.options)
        self.masked = np.zeros(self.model.protocol.n_rows, dtype=np.bool_)
        self.tared = False

    def set_options(self, command: Solver) -> int:
        """Change the options that SOLVER names; an eits_status."""
        usual = board_options(self.model, track=bool(command.track))
        options = replace(
            self.options,
            iterations=command.iterations,
            max_touches=command.max_touches,
            warm_start=bool(command.warm_start),
            sign=SIGNS[command.sign],
            lambda_rel=command.lambda_rel,
            gap_rel=command.gap_rel,
            solver=SOLVERS[command.solver],
            mac_limit=command.mac_limit,
            findings=command.findings,
            **{name: getattr(usual, name) for name in TRACKING},
        )
        try:
            self.engine.set_options(options)
        except UsageError as error:
            return core_status(error)
        self.options = options
        return 0

    def mask(self, row: int, bad: bool) -> None:
        """Leave a row out, or not."""
        self.masked[row] = bad
        self.engine.mask_rows(self.masked)

    def tare(self, frames: list[npt.NDArray[np.float32]]) -> int:
        """Take the reference; an eits_status."""
        try:
            self.engine.set_baseline(np.array(frames, dtype=np.float64))
        except FrameError as error:
            self.tared = False
            return core_status(error)
        self.engine.forget()
        self.tared = True
        return 0

    def self_test(self) -> float:
        """The golden frame's difference in a core of its own, so that nothing here changes.

        Raises:
            FrameError: it does not even run.
        """
        return CoreEngine(self.blob).self_test()

    def examine(self, raw: RawFrame) -> Info:
        """What the core finds in a frame that is not solved."""
        self.engine.follow(raw.voltage_v[None])
        return self.engine.last_info()

    def solve(
        self, raw: RawFrame, what: Stream
    ) -> tuple[int, Info, list[tuple[PacketType, bytes]]]:
        """An eits_status, what the core says of a frame, and its IMAGE and TOUCHES, as asked for;
        times are 0."""
        status, info = 0, NOTHING
        image = np.zeros(self.model.grid.n_pixels, dtype=np.float32)
        touches = ()
        try:
            result = self.engine.reconstruct(raw.voltage_v, touches=bool(what & Stream.TOUCHES))
            info, image, touches = result.info, result.image, result.touches  # type: ignore[assignment]
        except FrameError as error:
            status, info = core_status(error), self.engine.last_info()
        solved = Solved(
            frame=raw.frame, time_us=raw.time_us, solve_us=0, touch_us=0, age_us=0,
            count=len(image), status=status,
            stop=info.stop, masked=info.masked, iterations=info.iterations, nonzeros=info.nonzeros,
            macs=min(info.macs, 2**32 - 1), touch_macs=min(info.touch_macs, 2**32 - 1),
            lambda_=info.lambda_,
            lambda_max=info.lambda_max, lambda_noise=info.lambda_noise, gap_rel=info.gap_rel,
            residual=info.residual,
            data_norm=info.data_norm, findings=info.findings, saturated=info.saturated,
            glitches=info.glitches,
            misfit=info.misfit, open_electrodes=info.open_electrodes,
            bridged_electrodes=info.bridged_electrodes,
            noisy_electrodes=info.noisy_electrodes,
        )  # fmt: skip
        packets = []
        if what & Stream.IMAGE:
            packets.append((PacketType.IMAGE, build_image(SolvedImage(solved, image))))
        if what & Stream.TOUCHES:
            found = SolvedTouches(replace(solved, count=len(touches)), touches)
            packets.append((PacketType.TOUCHES, build_touches(found)))
        return status, info, packets
