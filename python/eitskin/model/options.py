"""The options of the core that a model's own defaults give, and those for a stream."""

from dataclasses import replace

import numpy as np

from eitskin.core.constants_table import (
    REFERENCE_TRACKING_FRAMES,
    TRACK_DETECTION,
)
from eitskin.core.options_table import ALL_TOUCH_FIT, MAX_TOUCHES, OF_MODEL
from eitskin.core.results import Options
from eitskin.model.model import GAIN_DRIFT_KEPT, TRACKS_REFERENCE, Model


def default_options(model: Model) -> Options:
    """Return the options that the model's own defaults give."""
    d = model.defaults
    return Options(
        **{name: getattr(d, name) for name in OF_MODEL},
        max_touches=min(d.max_touches, MAX_TOUCHES),
        max_masked=model.protocol.n_rows // 2,
        touch_fit=ALL_TOUCH_FIT & ~d.touch_fit_left_out,
        project_reference=not d.touch_fit_left_out & GAIN_DRIFT_KEPT,
        reference_frames=REFERENCE_TRACKING_FRAMES
        if d.touch_fit_left_out & TRACKS_REFERENCE
        else 0,
        touch_seek=bool(d.touch_fit_left_out & GAIN_DRIFT_KEPT),
    )


def tracking(options: Options) -> Options:
    """Return ``options``, from :func:`default_options`, for consecutive frames: the detection
    threshold is lower, since touches from noise are not found in a second frame. The result equals
    that of eits_options_track in the C core, bit by bit in float32."""
    detection_factor = float(np.float32(options.detection_factor) * np.float32(TRACK_DETECTION))
    return replace(options, detection_factor=detection_factor)
