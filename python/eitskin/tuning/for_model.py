"""Choose an operating point for a given model: measured settings of the solver that this model can
use."""

from typing import Any

from eitskin.core.results import Options
from eitskin.errors import UsageError
from eitskin.model.model import Model
from eitskin.tuning.configuration import Configuration
from eitskin.tuning.front import OperatingPoint, Preset, choose, load_front


def operating_point_for(
    preset: Preset,
    model: Model,
    now: Options,
    settable: set[str] | None = None,
    any_scan: bool = False,
) -> OperatingPoint:
    """Return the operating point that fulfils ``preset`` with ``model``.

    It must have been measured with the same rank, grid, storage and reduction. Its settings may
    differ from ``now`` only in ``settable`` (None: any), and it must use the full scan with 80
    samples unless ``any_scan`` is set. The point with the settings ``now`` and that scan is the
    default that "balanced" and "accurate" are compared with.

    Raises:
        UsageError: no operating point of this model exists, or none fulfils the preset.
        FileError, ConfigError: the results are missing or damaged.
    """
    usual = Configuration("")
    points, default = [], None
    for point in load_front().points:
        one = point.configuration
        wanted = one.solver_settings.items()
        other = {name for name, value in wanted if not _same(value, getattr(now, name, None))}
        usual_scan = (one.samples, one.scan) == (usual.samples, usual.scan)
        if (
            _is_of(one, point, model)
            and (any_scan or usual_scan)
            and one.warm_start == now.warm_start
            and (settable is None or other <= settable)
        ):
            points.append(point)
            if usual_scan and not other:
                default = point
    if not points:
        raise UsageError(
            f"preset: no operating point was measured with a model of rank {model.rank},"
            f" {model.grid.n_pixels} pixels and {model.stored.storage} like this one"
            f"{', started warm' if now.warm_start else ''}; make a model with measured settings by"
            "  eitskin recommend -o MODEL.eitm"
        )
    return choose(points, preset, "operating point of this model", default)


def _same(value: Any, other: Any) -> bool:
    """Return whether both are equal; numbers are compared to the precision of float32."""
    if isinstance(value, float) and isinstance(other, float):
        return abs(value - other) <= 1e-6 * abs(value)
    return bool(value == other)


def _is_of(one: Configuration, point: OperatingPoint, model: Model) -> bool:
    """Return whether the point was measured with such a model."""
    build = model.meta.get("build", {})
    if build.get("pixels_across", one.pixels) != one.pixels:
        return False
    if "pixels_across" not in build and model.grid.n_pixels != point.costs["pixels_kept"]:
        return False
    reduction = (("regularisation", one.regularisation), ("column_power", one.column_power))
    if not all(_same(build.get(name, value), value) for name, value in reduction):
        return False
    return (one.rank, one.storage, one.model_errors, "difference") == (
        model.rank,
        model.stored.storage,
        model.model_errors is not None,
        model.data_kind,
    )


def settings_text(point: OperatingPoint, preset: Preset) -> str:
    """Return a line that states what ``preset`` has chosen."""
    one, board = point.configuration, preset.board
    where, score = preset.where, point.accuracy(preset.where)
    typical, most = (point.cost("us", board, where, worst) for worst in (False, True))
    text = (
        f"settings of {point.name!r}: {one.solver}, at most {one.iterations} iterations, lambda_rel"
        f" {one.lambda_rel:g}"
    )
    if one.lambda_noise_factor != Configuration("").lambda_noise_factor:
        text += f" or {one.lambda_noise_factor:g} lambda_noise"
    text += f", gap {one.gap:g}" if one.gap else ""
    text += f", at most {one.mac_limit} MACs" if one.mac_limit else ""
    if (one.samples, one.scan) != (Configuration("").samples, Configuration("").scan):
        text += f", {one.samples} samples, {one.scan} scan"
    if score is not None:
        text += f"; measured at {where.snr_db:g} dB: image MIoU {score:.3f}"
    if typical is not None and most is not None:
        machine = "on the F767 (an estimate)" if board == "f767" else "on the host that measured"
        text += f", {typical / 1000:.3g} ms per frame, at most {most / 1000:.3g}, {machine}"
    return text
