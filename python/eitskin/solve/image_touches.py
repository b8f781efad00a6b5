"""Find touches in an image by one simple rule that is the same for every method.

Pixels with x > t max(x) are grouped into connected components (pixels that share an edge or a
corner). Each component is a touch at the centroid of its pixels, weighted by their values.
"""

import numpy as np
import numpy.typing as npt

from eitskin.arrays import FloatArray, IntArray
from eitskin.errors import missing_extra


def touches_in_image(
    values: npt.ArrayLike,
    index: IntArray,
    centres_mm: FloatArray,
    threshold: float,
    sign: int = 1,
) -> FloatArray:
    """Return the positions (k, 2) in mm of the touches in an image (n,), the strongest (summed
    value) first.

    ``index`` (n, 2) holds the column and row of each pixel, ``centres_mm`` (n, 2) its centre.
    ``threshold`` is the fraction t, and ``sign`` is -1 for touches that decrease the conductivity.

    Raises:
        MissingExtraError: scipy is not installed.
    """
    try:
        from scipy.ndimage import label
    except ImportError:
        raise missing_extra("model", "scipy") from None
    wanted = sign * np.asarray(values, dtype=np.float64)
    top = wanted.max()
    mask = (wanted > threshold * top) & (top > 0)
    square = np.zeros(index.max(axis=0) + 1, dtype=np.bool_)
    square[tuple(index.T)] = mask
    labels, count = label(square, structure=np.ones((3, 3)))
    of_pixel = np.asarray(labels)[tuple(index.T)]
    weight = np.bincount(of_pixel, weights=wanted, minlength=count + 1)[1:]
    moments = [
        np.bincount(of_pixel, weights=wanted * along, minlength=count + 1)[1:]
        for along in centres_mm.T
    ]
    xy = np.stack(moments, axis=1)
    return np.asarray(
        (xy / weight[:, None])[np.argsort(-weight, kind="stable")], dtype=np.float64
    ).reshape(-1, 2)
