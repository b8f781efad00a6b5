"""pyEIT's own solvers in the comparison: each puts a small touch at its place."""

import numpy as np

from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin_studies.compare import pyeit_method
from eitskin_studies.compare.families import setup_for

MIDDLES = {  # a parameter's value, and how far from the touch its image may have its peak
    "pyEIT Gauss-Newton": (1e-4, 20),
    "pyEIT truncated SVD": (50, 20),
    "pyEIT GREIT": (1e-2, 20),
    "pyEIT back projection": (1.0, 50),
}


def test_each_of_pyeits_solvers_finds_a_touch(monkeypatch):
    monkeypatch.setattr(pyeit_method, "ELEMENTS", 800)
    setup = setup_for(paper_skin(), adjacent(16), elements=800, pixels_across=16)
    middles_mm = setup.grid.centres_mm()
    touched = int(np.argmin(np.hypot(*(middles_mm - (50.0, 20.0)).T)))
    frame = 1e-3 * setup.jacobian[None, :, touched]
    found = {}
    for family in pyeit_method.pyeit_methods(setup):
        some = family.make(family.values[0])
        value, _ = MIDDLES[some.name]
        (image,) = family.make(value).reconstruct(frame)
        peak = middles_mm[int(np.argmax(image))]
        found[some.name] = float(np.hypot(*(peak - middles_mm[touched])))
    assert list(found) == list(MIDDLES)
    assert {name: mm for name, mm in found.items() if mm > MIDDLES[name][1]} == {}
