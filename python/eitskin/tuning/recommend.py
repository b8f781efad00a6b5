"""Prepare a chosen operating point for use: a model that holds its settings, and command-line
options for the rest."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from eitskin.model.build import build_model
from eitskin.model.eitm import save_model
from eitskin.progress import Progress, silent
from eitskin.skin.protocol import Protocol, independent_rows
from eitskin.skin.skin import Skin
from eitskin.tuning.configuration import build_settings
from eitskin.tuning.front import REPORT_US, OperatingPoint, Preset


@dataclass(frozen=True, eq=False)
class Recommendation:
    """An operating point, and the ``preset`` that it was chosen by."""

    point: OperatingPoint
    preset: Preset

    @property
    def frame_us(self) -> float | None:
        """The time from frame to frame: the longer of measuring and solving, which run at the same
        time."""
        solve = self.point.cost("us", self.preset.board, self.preset.where)
        return None if solve is None else max(solve, self.point.costs["acquisition_us"])

    @property
    def report_us(self) -> float | None:
        """The mean time from contact to report."""
        return self.point.cost(REPORT_US, self.preset.board, self.preset.where)

    @property
    def options(self) -> list[str]:
        """Command-line options of ``eitskin stream`` and ``record`` for settings that a model does
        not hold."""
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
        """Return the recommendation as JSON values."""
        point, preset = self.point, self.preset
        return {
            "name": point.name,
            "configuration": point.configuration.as_dict(),
            "threshold": point.threshold,
            "force_scale": point.force_scale,
            "judged": str(preset.where),
            "accuracy": point.accuracy(preset.where),
            "score": point.score(preset.where),
            "board": preset.board,
            "budget": (
                None
                if preset.limit is None
                else {"value": preset.limit.value, "unit": preset.limit.unit}
            ),
            "cost": point.cost(preset.unit, preset.board, preset.where, preset.worst),
            "worst": preset.worst,
            "unit": preset.unit,
            "solve_us": point.cost("us", preset.board, preset.where),
            "solve_most_us": point.cost("us", preset.board, preset.where, True),
            "acquisition_us": point.costs["acquisition_us"],
            "frame_us": self.frame_us,
            "report_us": self.report_us,
            "instructions": point.instructions,
            "flash_bytes": point.costs["flash_bytes"],
            "ram_bytes": point.costs["ram_bytes"],
            "options": self.options,
        }

    def text(self) -> str:
        """Return the recommendation as lines of text."""
        point, preset, one = self.point, self.preset, self.point.configuration
        score = point.score(preset.where)
        assert score is not None
        image, discs = score["image"], score["discs"]
        solve, most = (
            point.cost("us", preset.board, preset.where, worst) for worst in (False, True)
        )
        acquisition = point.costs["acquisition_us"]
        lines = [
            (
                f"{point.name}: image MIoU {image['mean']:.3f} ({image['low']:.3f} to"
                f" {image['high']:.3f}; mean of the worst 10 % {image['worst_tenth']:.3f}), discs"
                f" {discs['mean']:.3f}, exact count {100 * score['exact_count']:.0f} %;"
                f" {preset.where.scenes}, {preset.where.snr_db:g} dB"
            ),
            (
                f"model: rank {one.rank}, {one.pixels} pixels across, {one.storage}, mu"
                f" {one.regularisation:g}; {point.costs['flash_bytes'] / 1e3:.0f} kB of flash,"
                f" {point.costs['ram_bytes'] / 1e3:.0f} kB of RAM"
            ),
            f"solver: {one.solver}, at most {one.iterations} iterations, lambda_rel"
            f" {one.lambda_rel:g}"
            + (f", gap {one.gap:g}" if one.gap else "")
            + (f", at most {one.mac_limit} MACs" if one.mac_limit else "")
            + f", {'warm' if one.warm_start else 'cold'}, {one.touch_sweeps} sweeps; mask t"
            f" {point.threshold:g}",
        ]
        if solve is not None and most is not None and self.frame_us is not None:
            lines.append(_time_line(preset.board, solve, most, point))
            bound = "measuring" if acquisition >= solve else "solving"
            lines.append(
                f"scan: {one.scan}, {one.samples} samples: {acquisition / 1000:.1f} ms per frame;"
                f" {bound} limits the rate: {1e6 / self.frame_us:.1f} frames per second"
            )
            lines.append(
                f"from contact to report: {(self.report_us or 0) / 1000:.0f} ms (an estimate: half"
                " a period, scan, solve, and link at 1 Mbaud)"
            )
        lines.append("options: " + " ".join(self.options))
        return "\n".join(lines)


def _time_line(board: str, solve_us: float, most_us: float, point: OperatingPoint) -> str:
    if board == "host":
        return (
            f"host: solve and touches take {solve_us / 1000:.3f} ms (median),"
            f" {most_us / 1000:.3f} ms for the slowest scene"
        )
    assert point.instructions is not None
    kind = point.instructions["kind"]
    return (
        f"F767: solve and touches take about {solve_us / 1000:.1f} ms per frame, at most"
        f" {most_us / 1000:.1f} ms (an estimate: {kind} instructions, mean"
        f" {point.instructions['mean'] / 1e6:.2f} million, at most"
        f" {point.instructions['most'] / 1e6:.2f} million, one per cycle at 216 MHz)"
    )


def write_model(
    path: Path, point: OperatingPoint, skin: Skin, protocol: Protocol, progress: Progress = silent
) -> int:
    """Build and write the model of a point for ``skin``, with the solver's settings and the mask
    threshold as its defaults; return its size in bytes. The rank is at most the number of
    independent rows of ``protocol``. ``progress`` is as in ``build_model``."""
    settings = build_settings(point.configuration, skin, point.threshold)
    settings = replace(settings, rank=min(settings.rank, independent_rows(protocol)))
    return save_model(path, build_model(skin, protocol, settings, progress=progress))
