"""The benchmark of a frame: every engine and other program runs on the same frames, and the numbers
in its report are consistent."""

import numpy as np
import pytest

from eitskin.model.prebuilt import load_prebuilt
from eitskin_studies.benchmarks.frame import pyeit_frames, run, to_text

pytestmark = pytest.mark.long("the other tests of bench, with fewer peers")


def test_all_are_timed_and_said():
    times = run(3)
    assert set(times.p50_us) == {
        "C: solve", "C: touches", "Python: frame to touches", "Python: frame to touches, warm",
        "numpy: image only",
        "C, portable kernels: frame to touches",
        "pyEIT: Gauss-Newton, image only", "pyEIT: back projection, image only",
    }  # fmt: skip
    assert all(0 < times.p50_us[name] <= times.p99_us[name] for name in times.p50_us)
    lines = to_text(times).splitlines()
    assert all(any(line.startswith(name) for line in lines) for name in times.p50_us)


def test_the_peer_sees_the_touch():
    """pyEIT's image of the golden frame is not that of no touch: its rows are in its own order."""
    golden = load_prebuilt()[0].golden
    reference, frame = golden.reference_v.astype(np.float64), golden.frame_v.astype(np.float64)
    for solve in pyeit_frames(reference).values():
        assert np.abs(solve(reference)).max() < 1e-9 * np.abs(solve(frame)).max()
