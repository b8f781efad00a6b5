"""A budget or an accuracy where a model is given already: the solver's settings of a measured point
that it can take."""

from typing import Any

from eitskin.core.results import Options
from eitskin.errors import UsageError
from eitskin.model.model import Model
from eitskin.tuning.configuration import Configuration
from eitskin.tuning.front import Conditions, Point, Target, choose, load_front


def chosen_point(
    target: Target,
    model: Model,
    now: Options,
    settable: set[str] | None = None,
    any_scan: bool = False,
) -> Point:
    """The measured point that fulfils ``target`` with ``model``: of its rank, grid, storage and
    reduction, with no other settings than ``now`` but those in ``settable`` (None: any), and
    scanned fully with 80 samples unless ``any_scan``.

    Raises:
        UsageError: there is none, or none that does what is asked for.
        FileError, ConfigError: there are no results.
    """
    usual = Configuration("")
    points = []
    for point in load_front().points:
        one = point.configuration
        wanted = one.solver_settings.items()
        other = {name for name, value in wanted if not _same(value, getattr(now, name, None))}
        if (
            _is_of(one, point, model)
            and (any_scan or (one.samples, one.scan) == (usual.samples, usual.scan))
            and one.warm_start == now.warm_start
            and (settable is None or other <= settable)
        ):
            points.append(point)
    if not points:
        raise UsageError(
            "--preset, --budget and --accuracy: no measured point has this model's rank"
            f" {model.rank}, {model.grid.n_pixels} pixels in"
            f" {model.stored.storage}{' and starts warm' if now.warm_start else ''}; make a model"
            " of one by  eitskin recommend -o MODEL.eitm"
        )
    return choose(points, target, "measured point of this model")


def _same(value: Any, other: Any) -> bool:
    """Equal, a number to what a float32 keeps of it."""
    if isinstance(value, float) and isinstance(other, float):
        return abs(value - other) <= 1e-6 * abs(value)
    return bool(value == other)


def _is_of(one: Configuration, point: Point, model: Model) -> bool:
    """Whether a point was measured with such a model."""
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


def settings_text(point: Point, board: str) -> str:
    """What was chosen, in a line."""
    one = point.configuration
    usual, score = Conditions(), point.accuracy(Conditions())
    typical, most = (point.cost("us", board, usual, worst) for worst in (False, True))
    text = (
        f"settings of {point.name!r}: {one.solver}, {one.iterations} iterations at most, lambda_rel"
        f" {one.lambda_rel:g}"
    )
    text += f", gap {one.gap:g}" if one.gap else ""
    text += f", at most {one.mac_limit} MACs" if one.mac_limit else ""
    if (one.samples, one.scan) != (Configuration("").samples, Configuration("").scan):
        text += f", {one.samples} samples, {one.scan} scan"
    if score is not None:
        text += f"; measured: image MIoU {score:.3f}"
    if typical is not None and most is not None:
        where = "on the F767 (an estimate)" if board == "f767" else "on the host that measured"
        text += f", {typical / 1000:.3g} ms a frame, at most {most / 1000:.3g}, {where}"
    return text
