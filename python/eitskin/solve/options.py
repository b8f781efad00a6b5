"""A model's own defaults as options."""

from __future__ import annotations

from eitskin.core.results import MAX_TOUCHES, Options
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
        gate_factor=d.gate_factor,
        touch_threshold=d.touch_threshold,
        touch_share=d.touch_share,
        touch_min_radius_mm=d.touch_min_radius_mm,
        touch_max_radius_mm=d.touch_max_radius_mm,
        touch_seed_radius_mm=d.touch_seed_radius_mm,
        touch_change_s_per_m=d.touch_change_s_per_m,
        touch_radius_weight=d.touch_radius_weight,
        follow_mm=d.follow_mm,
        solver=d.solver,
    )
