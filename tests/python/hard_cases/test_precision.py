"""Errors of float32 over the condition number, and over the size of the change."""

from dataclasses import replace

import numpy as np
import pytest
from precision import CHANGES, CONDITIONS, by_change, by_condition, condition_steps

from eitskin.model.options import default_options
from eitskin_emulator.core_steps import Choose, Load, Play, TareStep
from small_models import prebuilt


@pytest.mark.parametrize("same_everywhere", ["float32"], indirect=True)
def test_error_over_the_condition_number(same_everywhere, margins):
    """S x is equally exact at any condition number; coefficients lose digits as it grows."""
    _, outcomes = same_everywhere.steps(condition_steps())
    for condition, found in zip(CONDITIONS, by_condition(outcomes), strict=True):
        what = f"S x, float32 from float64, condition {condition:.0e}"
        margins.everywhere("problem/condition", what, found.data, found.allowed, "|y|")
        assert np.isfinite(found.coefficients)


@pytest.mark.parametrize("same_everywhere", ["float32"], indirect=True)
def test_change_down_to_the_last_bit(same_everywhere, margins):
    """The error of the data is that of rounding each voltage. If nothing is left of the change,
    there is no image and no touch. A change of the last bit in every row gives finite numbers."""
    for size, found in zip(CHANGES, by_change(), strict=True):
        what = f"y, float32 from the change itself, change times {size:.1g}"
        margins.everywhere("problem/cancellation", what, found.data, found.allowed, "|y|")
    model, blob = prebuilt()
    reference = model.golden.reference_v
    last_bit = np.nextafter(reference, np.float32(np.inf))
    options = replace(default_options(model), detection_factor=0.0, lambda_noise_factor=0.0)
    steps = [Load(blob), Choose(options), TareStep(reference[None])]
    _, (none, least) = same_everywhere.steps([*steps, Play(np.stack([reference, last_bit]))])
    assert none.status == least.status == 0
    assert not none.image.any() and not none.touches
    assert least.finite()
