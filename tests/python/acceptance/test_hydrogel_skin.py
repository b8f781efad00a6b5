"""A measured hydrogel skin whose front end is far from any model: what default options make of its
presses before it is taught. The data are not part of the project; without them this is skipped."""

import pytest

from eitskin.teaching.presses import load_presses
from eitskin_studies.experiments.teaching import FILE, SIZE_MM, SKIN
from eitskin_studies.experiments.teaching.untaught import untaught


def test_an_untaught_press_is_one_touch_a_tenth_of_the_diameter_off_at_most(shared_data):
    if not (shared_data / FILE).is_file():
        pytest.skip(f"the measured presses are not part of the project: no ../shared/data/{FILE}")
    presses = load_presses(shared_data / FILE)
    found = untaught(presses.take(range(0, len(presses), 4)), SKIN, samples=60)
    assert max(found["medians"]) <= 0.1 * SIZE_MM
    assert found["touches"] <= 1.5
    assert 0.8 <= found["covered"] <= 0.97
