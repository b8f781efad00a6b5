"""From a chosen point to what a user does with it: a model with the settings inside, and the
options for the rest."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eitskin.model.build import build_model
from eitskin.model.eitm import save_model
from eitskin.progress import Progress, silent
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin
from eitskin.tuning.configuration import build_settings
from eitskin.tuning.front import REPORT_US, Point, Target


@dataclass(frozen=True, eq=False)
class Recommendation:
    """A point and why: ``target`` is what was asked for."""

    point: Point
    target: Target

    @property
    def frame_us(self) -> float | None:
        """From frame to frame: the longer of measuring and solving, which go on at the same
        time."""
        solve = self.point.cost("us", self.target.board, self.target.where)
        return None if solve is None else max(solve, self.point.costs["acquisition_us"])

    @property
    def report_us(self) -> float | None:
        """From contact to report, the mean."""
        return self.point.cost(REPORT_US, self.target.board, self.target.where)

    @property
    def options(self) -> list[str]:
        """Command-line options of ``eitskin stream`` and ``record`` for what a model does not
        hold."""
        one = self.point.configuration
        options = [f"--samples {one.samples}", "--full" if one.scan == "full" else "--reciprocal 0"]
        if one.warm_start:
            options.append("--warm")
        if one.gap:
            options.append(f"--gap {one.gap:g}")
        if one.second_pass:
            options.append("--second-pass (of reconstruct)")
        return options

    def as_dict(self) -> dict[str, Any]:
        point, target = self.point, self.target
        return {
            "name": point.name,
            "configuration": point.configuration.as_dict(),
            "threshold": point.threshold,
            "force_scale": point.force_scale,
            "judged": str(target.where),
            "accuracy": point.accuracy(target.where),
            "score": point.score(target.where),
            "board": target.board,
            "budget": (
                None
                if target.budget is None
                else {"value": target.budget.value, "unit": target.budget.unit}
            ),
            "cost": point.cost(target.unit, target.board, target.where, target.worst),
            "worst": target.worst,
            "unit": target.unit,
            "solve_us": point.cost("us", target.board, target.where),
            "solve_most_us": point.cost("us", target.board, target.where, True),
            "acquisition_us": point.costs["acquisition_us"],
            "frame_us": self.frame_us,
            "report_us": self.report_us,
            "instructions": point.instructions,
            "flash_bytes": point.costs["flash_bytes"],
            "ram_bytes": point.costs["ram_bytes"],
            "options": self.options,
        }

    def text(self) -> str:
        point, target, one = self.point, self.target, self.point.configuration
        score = point.score(target.where)
        assert score is not None
        image, discs = score["image"], score["discs"]
        solve, most = (
            point.cost("us", target.board, target.where, worst) for worst in (False, True)
        )
        acquisition = point.costs["acquisition_us"]
        lines = [
            (
                f"{point.name}: image MIoU {image['mean']:.3f} ({image['low']:.3f} to"
                f" {image['high']:.3f}; worst tenth {image['worst_tenth']:.3f}), discs"
                f" {discs['mean']:.3f}, exact count {100 * score['exact_count']:.0f} %;"
                f" {target.where.scenes}, {target.where.snr_db:g} dB"
            ),
            (
                f"model: rank {one.rank}, {one.pixels} pixels across, {one.storage}, mu"
                f" {one.regularisation:g}; {point.costs['flash_bytes'] / 1e3:.0f} kB of flash,"
                f" {point.costs['ram_bytes'] / 1e3:.0f} kB of RAM"
            ),
            f"solver: {one.solver}, {one.iterations} iterations at most, lambda_rel"
            f" {one.lambda_rel:g}"
            + (f", gap {one.gap:g}" if one.gap else "")
            + (f", at most {one.mac_limit} MACs" if one.mac_limit else "")
            + f", {'warm' if one.warm_start else 'cold'}, {one.touch_sweeps} sweeps; mask t"
            f" {point.threshold:g}",
        ]
        if solve is not None and most is not None and self.frame_us is not None:
            lines.append(_time_line(target.board, solve, most, point))
            bound = "measuring" if acquisition >= solve else "solving"
            lines.append(
                f"scan: {one.scan}, {one.samples} samples: {acquisition / 1000:.1f} ms a frame;"
                f" {bound} bounds the rate: {1e6 / self.frame_us:.1f} frames a second"
            )
            lines.append(
                f"from contact to report: {(self.report_us or 0) / 1000:.0f} ms, half a period,"
                " scan, solve and link at 1 Mbaud, an estimate"
            )
        lines.append("options: " + " ".join(self.options))
        return "\n".join(lines)


def _time_line(board: str, solve_us: float, most_us: float, point: Point) -> str:
    if board == "host":
        return (
            f"host: solve and touches median {solve_us / 1000:.3f} ms, of the costliest scene"
            f" {most_us / 1000:.3f} ms"
        )
    assert point.instructions is not None
    kind = point.instructions["kind"]
    return (
        f"F767: solve and touches about {solve_us / 1000:.1f} ms a frame, {most_us / 1000:.1f} ms"
        f" at most: {kind} instructions ({point.instructions['mean'] / 1e6:.2f} million, most"
        f" {point.instructions['most'] / 1e6:.2f}) at one a cycle and 216 MHz, an estimate"
    )


def write_model(
    path: Path, point: Point, skin: Skin, protocol: Protocol, progress: Progress = silent
) -> int:
    """Build and write the model of a point for ``skin``, the solver's settings and t as its
    defaults; returns its bytes. ``progress`` as ``build_model``."""
    settings = build_settings(point.configuration, skin, point.threshold)
    return save_model(path, build_model(skin, protocol, settings, progress=progress))
