"""The table [uncertainty] of a skin's file: defaults, no uncertainty, and refusals."""

from dataclasses import fields, replace
from typing import Any

import pytest

from eitskin.errors import ConfigError, UsageError
from eitskin.skin.skin import load_skin, paper_skin, skin_from_table, skin_to_table
from eitskin.skin.uncertainty import LIMITS, Uncertainty

SKIN: dict[str, Any] = {"skin": {"diameter_mm": 100.0}}


def test_without_it_the_defaults():
    assert skin_from_table(SKIN, "x").uncertainty == Uncertainty()
    assert skin_from_table({**SKIN, "uncertainty": {}}, "x").uncertainty == Uncertainty()
    assert "uncertainty" not in skin_to_table(paper_skin())


def test_a_file_says_it(tmp_path):
    path = tmp_path / "skin.toml"
    path.write_text('uncertainty = "none"\n[skin]\ndiameter_mm = 100\n')
    assert load_skin(path)[0].uncertainty is None
    path.write_text(
        "[skin]\ndiameter_mm = 100\n[uncertainty]\nsamples = 20\nbackground_length = [0.5, 2]\n"
        "row_gains = false\ndrift_log_sd = 0\n"
    )
    read = load_skin(path)[0].uncertainty
    assert read == Uncertainty(
        samples=20, background_length=(0.5, 2.0), row_gains=False, drift_log_sd=0.0
    )


@pytest.mark.parametrize("uncertainty", [None, Uncertainty(seed=7, touch_contrast=(0.2, 0.9))])
def test_a_table_gives_it_again(uncertainty):
    skin = replace(paper_skin(), uncertainty=uncertainty)
    assert skin_from_table(skin_to_table(skin), "x") == skin


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("all", "x: uncertainty must be a table [uncertainty], or \"none\", not 'all'"),
        ({"sample": 3}, "x [uncertainty]: unknown key 'sample'; did you mean 'samples'?"),
        ({"samples": 1}, "samples = 1 is out of range; it must be at least 2 and at most 100000"),
        ({"samples": 2.5}, "samples = 2.5 must be a whole number"),
        ({"row_gains": 1}, "row_gains must be true or false, not 1"),
        ({"contact_log_sd": -0.1}, "contact_log_sd = -0.1 is out of range"),
        ({"out_of_round": "much"}, "out_of_round must be a number, not 'much'"),
        ({"touch_radius": 0.1}, "touch_radius must be [least, greatest], not 0.1"),
        ({"touch_radius": [0.1]}, "touch_radius must be [least, greatest], not [0.1]"),
        ({"touch_radius": [0.2, 0.1]}, "touch_radius = [0.2, 0.1] must have the least first"),
        ({"touch_contrast": [0, 2]}, "touch_contrast = 0 is out of range"),
    ],
)
def test_refused(value, said):
    with pytest.raises(ConfigError) as refused:
        skin_from_table({**SKIN, "uncertainty": value}, "x")
    assert said in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize("name", LIMITS)
def test_python_is_refused_the_same(name):
    high: Any = LIMITS[name][1] * 1.5
    if isinstance(getattr(Uncertainty(), name), tuple):
        high = (LIMITS[name][0], high)
    with pytest.raises(UsageError, match=f"{name} = .* is out of range"):
        replace(Uncertainty(), **{name: high})


def test_every_number_has_its_limits():
    assert set(LIMITS) == {field.name for field in fields(Uncertainty)} - {"row_gains"}
