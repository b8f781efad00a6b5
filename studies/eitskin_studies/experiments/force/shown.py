"""The content of the force study's pictures, as plain values."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.skin.skin import Skin
from eitskin_studies.experiments.force.anywhere import Anywhere
from eitskin_studies.experiments.force.curves import ForceCurves
from eitskin_studies.experiments.force.detection import Detection
from eitskin_studies.experiments.force.law import WEIGHTS_G
from eitskin_studies.experiments.force.readouts import INTEGRAL, PEAK, TOUCH
from eitskin_studies.experiments.force.scenes import RADIUS_SHARES

PLACES = ("centre", *(f"{share:g} R" for share in RADIUS_SHARES[1:]))
READINGS = ((PEAK, "peak (S/m)"), (INTEGRAL, "integral (S mm²/m)"), (TOUCH, "strength (S mm²/m)"))
MOST = {PEAK: 100.0, TOUCH: 5.0}  # ends of the colours of errors, in %


def curves_shown(curves: Mapping[str, ForceCurves]) -> dict[str, Any]:
    """Readings over weight at the four radii, with 90 % bands over the laws."""
    readings = []
    for name, unit in READINGS:
        low, high = np.nanquantile(curves[name].bands, [0.05, 0.95], axis=0)
        of = {"mean": np.asarray(curves[name].mean), "low": low, "high": high}
        shown = {key: values.tolist() for key, values in of.items()}
        readings.append({"name": name, "unit": unit, **shown})
    return {"weights_g": list(WEIGHTS_G), "places": list(PLACES), "readings": readings}


def skin_shown(
    skin: Skin, places_mm: FloatArray, judged: Mapping[tuple[str, float], Anywhere], snr_db: float
) -> dict[str, Any]:
    """Each place's error, the mean over the weights, before and after calibration."""
    panels = []
    for name in (PEAK, TOUCH):
        for kind in ("raw", "calibrated"):
            errors = 100 * np.nanmean(getattr(judged[name, snr_db], kind), axis=1)
            spread = float(np.nanstd(errors, ddof=1))
            title = f"{name}\n{kind}, mean of {len(WEIGHTS_G)} weights: {spread:.1f} %"
            panels.append({"title": title, "errors": errors.tolist(), "most": MOST[name]})
    rim = np.vstack([np.array(skin.outline.vertices_mm), skin.outline.vertices_mm[:1]])
    places = np.asarray(places_mm).tolist()
    return {"rim_mm": rim.round(1).tolist(), "places_mm": places, "panels": panels}


def detection_shown(found: Sequence[Detection]) -> dict[str, Any]:
    """The smallest weight over the SNR by place, where one of the ladder is detected: SNR in dB,
    grams, and its 95 % interval, at most to the ladder's end."""
    by_place = []
    for radius in range(len(PLACES)):
        of = [(one.snr_db, *one.threshold(radius)) for one in found]
        ends = [one.loads_g[-1] for one in found]
        by_place.append(
            [
                [float(snr_db), float(grams), float(low), float(min(high, end))]
                for (snr_db, grams, low, high), end in zip(of, ends, strict=True)
                if np.isfinite(grams)
            ]
        )
    return {"places": list(PLACES), "found": by_place}
