"""A model's own defaults as options, and what suits a stream."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from eitskin.core.results import ALL_TOUCH_FIT, MAX_TOUCHES, Options
from eitskin.model.model import Model


def default_options(model: Model) -> Options:
    """The model's own defaults."""
    d = model.defaults
    return Options(
        iterations=d.iterations,
        max_touches=min(d.max_touches, MAX_TOUCHES),
        max_masked=model.protocol.n_rows // 2,
        lambda_rel=d.lambda_rel,
        lambda_noise_factor=d.lambda_noise_factor,
        detection_factor=d.detection_factor,
        touch_threshold=d.touch_threshold,
        touch_min_fraction=d.touch_min_fraction,
        touch_min_radius_mm=d.touch_min_radius_mm,
        touch_max_radius_mm=d.touch_max_radius_mm,
        touch_seed_radius_mm=d.touch_seed_radius_mm,
        touch_change_s_per_m=d.touch_change_s_per_m,
        touch_radius_weight=d.touch_radius_weight,
        follow_mm=d.follow_mm,
        solver=d.solver,
        touch_fit=ALL_TOUCH_FIT & ~d.touch_fit_left_out,
    )


def tracking(options: Options) -> Options:
    """``options``, of :func:`default_options`, for frames that follow one another: as
    eits_options_track in the C core sets them, to the bit in float32. docs/guide/tracking.md says
    what that is worth."""
    detection_factor = float(np.float32(options.detection_factor) * np.float32(0.75))
    return replace(
        options,
        detection_factor=detection_factor,
        track_confirm=2,
        track_hold=2,
        track_smooth=float(np.float32(0.66)),
    )
