"""The numpy reference of the search for touches in csrc/src/touch/touch.c and track.c: the same
steps, written for reading."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.diagnostics_table import Touch
from eitskin.core.options_table import SPLIT_MERGE
from eitskin.core.results import Options
from eitskin.fem.grid import Grid
from eitskin.model.model import Model
from eitskin_reference.confidence import miscounted, places_by_fit, rated
from eitskin_reference.constants_table import (
    CENTRE_SURE,
    EARLY_RADIUS,
    FINAL_RADIUS,
    INTERACTION_MAX,
    LATER_SWEEPS,
    ROUNDS,
)
from eitskin_reference.disc_fit import Disc, Fit, Reduced
from eitskin_reference.evidence import DataErrors, keep_likely
from eitskin_reference.seek import centre, seek
from eitskin_reference.split_merge import join, part

Interplay = Callable[[Sequence[Disc]], FloatArray]


def search(fit: Fit, frame: Reduced, image: FloatArray, interplay: Interplay | None) -> FloatArray:
    """Discs for the ``image`` (n,), fitted to ``frame``; returns what each explains. ``interplay``
    gives what discs add to y (r,) by what they do to each other; None where the model cannot tell.
    """
    o = fit.options
    later, straight = (
        min(o.touch_sweeps, LATER_SWEEPS),
        frame.straight is not None or fit.model.data_kind == "log-ratio",
    )
    regroups = bool(o.touch_fit & SPLIT_MERGE) and (straight or interplay is not None)

    def couple() -> None:
        added = (
            interplay(fit.discs)
            if interplay is not None and len(fit.discs) > 1
            else np.zeros_like(frame.y)
        )
        fit.data = frame.y - added if added @ added <= INTERACTION_MAX * fit.whole else frame.y

    fit.radius_weight = o.touch_radius_weight * (EARLY_RADIUS if interplay is not None else 1.0)
    fit.data = frame.straight if frame.straight is not None and o.touch_sweeps > 0 else frame.y
    if o.touch_seek and o.touch_sweeps > 0:
        seek(fit)
    else:
        fit.seed(image)
        fit.fit_strengths()
        if o.touch_change_s_per_m > 0:
            fit.discs = [replace(disc, radius_mm=fit.expected_radius(disc)) for disc in fit.discs]
            fit.fit_strengths()
        fit.move_all(o.touch_sweeps - later)
    explained = fit.keep_real()
    if o.touch_sweeps == 0:
        return explained
    if regroups:
        join(fit)
    for _ in range(ROUNDS):
        if interplay is not None and len(fit.discs) > 1:
            couple()
            fit.move_all(later)
    for _ in range(ROUNDS if regroups else 0):
        joined, parted = join(fit), part(fit)
        if not joined and not parted:
            break
        couple()
        fit.move_all(later)
        fit.keep_real()
    fit.radius_weight = o.touch_radius_weight * (FINAL_RADIUS if interplay is not None else 1.0)
    couple()
    fit.move_all(later)
    return fit.keep_real()


def brought_onto_skin(grid: Grid, touch: Touch) -> Touch:
    """``touch``, its place the nearest one on a kept pixel if it is next to it."""
    place = np.array([touch.x_mm, touch.y_mm])
    low = grid.origin_mm + grid.pixel_mm * grid.index
    there = np.clip(place, low, low + grid.pixel_mm)
    apart = np.hypot(*(there - place).T)
    nearest = int(apart.argmin())
    if apart[nearest] == 0:
        return touch
    return replace(touch, x_mm=float(there[nearest, 0]), y_mm=float(there[nearest, 1]))


def find_touches(
    model: Model,
    frame: Reduced,
    image: FloatArray,
    options: Options,
    interplay: Interplay | None,
    errors: DataErrors | None = None,
) -> tuple[tuple[Touch, ...], float, FloatArray, bool]:
    """The touches of an ``image`` (n,) of ``frame``, strongest first and without ids or loads, the
    share of |y|^2 that they leave (0 where the image is zero), and the data (r,) that they were
    fitted to in the end. With ``errors`` those are left out that such errors could have made, and
    the last says whether their count may be wrong."""
    fit = Fit(model, frame, options)
    explained, tested = np.zeros(0), None
    sure, places = np.zeros(0), np.zeros((0, 3))
    if np.abs(image).max() > 0:
        explained = search(fit, frame, image, interplay)
        if errors is not None:
            tested = keep_likely(fit, errors)
        if tested is not None and errors is not None:
            sure, places = rated(tested, errors.distance, errors.places, model.grid.pixel_mm)
            if errors.kept and len(sure) == 1 and sure[0] < CENTRE_SURE:
                moved = centre(fit, frame.y)
                if moved is not None:
                    disc, places = fit.discs[0], moved[None]
                    at = np.array([[disc.x_mm, disc.y_mm, disc.radius_mm]])
                    tested = replace(tested, long_mm=np.zeros((1, 2)), reported_mm=at)
            explained = fit.explained()
    found = [
        Touch(0, d.x_mm, d.y_mm, d.radius_mm, d.change * fit.area_mm2(d), min(1.0, float(e)))
        for d, e in zip(fit.discs, explained, strict=True)
    ]
    if tested is None:
        found = [
            replace(touch, x_variance_mm2=float(xx), xy_covariance_mm2=float(xy),
                    y_variance_mm2=float(yy)) if xx > 0 else touch
            for touch, (xx, xy, yy) in zip(found, places_by_fit(fit), strict=True)
        ]  # fmt: skip
    if tested is not None:
        tared = errors.places if errors is not None else None
        on_skin = [
            (float(x), float(y)) if tared is None else tared.on_skin(float(x), float(y))
            for x, y, _ in tested.reported_mm
        ]
        found = [
            replace(
                touch,
                x_mm=where[0],
                y_mm=where[1],
                radius_mm=float(at[2]),
                confidence=float(one),
                x_variance_mm2=float(xx),
                xy_covariance_mm2=float(xy),
                y_variance_mm2=float(yy),
                long_x_mm=float(x) if x or y else None,
                long_y_mm=float(y) if x or y else None,
            )
            for touch, one, (xx, xy, yy), (x, y), at, where in zip(
                found, sure, places, tested.long_mm, tested.reported_mm, on_skin, strict=True
            )
        ]
    found.sort(key=lambda touch: -abs(touch.strength_s_per_m_mm2))
    unexplained = fit.left() / fit.whole if fit.whole > 0 and np.abs(image).max() > 0 else 0.0
    doubtful = tested is not None and miscounted(tested)
    return tuple(found), unexplained, fit.data, doubtful
