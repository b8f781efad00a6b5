"""Sets of configurations: their valid keys and values, and the built-in set."""

from dataclasses import replace

import pytest

from eitskin.core.options_table import SOLVERS
from eitskin.errors import ConfigError
from eitskin.model.storage import STORAGES
from eitskin.tuning.configuration import Configuration, configuration_from
from eitskin_studies.tradeoff.configuration_sets import load_set
from eitskin_studies.tradeoff.default_set import KNOBS, SCALE, default_set


def test_the_built_in_set_turns_every_knob_and_every_solver():
    configurations = default_set()
    assert len({one.name for one in configurations}) == len(configurations)
    assert {one.solver for one in configurations} == set(SOLVERS)
    assert {one.storage for one in configurations} == set(STORAGES)
    assert {one.scan for one in configurations} == {"full", "reciprocal"}
    for knob, turned in KNOBS.items():
        base = Configuration("").as_dict()[knob]
        assert {one.as_dict()[knob] for one in turned} - {base} or knob == "mac_limit", knob
    standard = next(one for one in SCALE if one.name == "standard")
    assert standard == Configuration("standard")
    assert all(configuration_from(one.as_dict(), "set") == one for one in configurations)


def test_own_sets_share_defaults(tmp_path):
    path = tmp_path / "set.toml"
    path.write_text(
        '[defaults]\nrank = 32\nstorage = "i8"\n[[configuration]]\nname = "a"\n'
        '[[configuration]]\nname = "b"\nrank = 48\ngap = 0.01\n'
    )
    a, b = load_set(path)
    assert a == Configuration("a", rank=32, storage="i8")
    assert b == replace(a, name="b", rank=48, gap=0.01)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "holds no"),
        ('[[configuration]]\nname = "a"\n[[configuration]]\nname = "a"\n', "names must differ"),
        ("[[configuration]]\nrank = 3\n", "'name' is required"),
        ('[[configuration]]\nname = "a, b"\n', "without commas"),
        ('[[configuration]]\nname = "a"\nrnak = 3\n', "did you mean 'rank'"),
        ('[[configuration]]\nname = "a"\nstorage = "f8"\n', "storage"),
        ('[[configuration]]\nname = "a"\nsolver = "newton"\n', "solver"),
        ('[[configuration]]\nname = "a"\niterations = 0\n', "iterations"),
        ('[[configuration]]\nname = "a"\nsamples = 50\n', "multiple of 20"),
        ('[[configuration]]\nname = "a"\nwarm_start = 1\n', "true or false"),
        ("[configuration]\n", "tables"),
        ("[[configurations]]\n", "did you mean 'configuration'"),
        ("defaults = 3", "tables"),
    ],
)
def test_bad_sets_are_refused_in_a_line(tmp_path, text, said):
    path = tmp_path / "set.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=said) as caught:
        load_set(path)
    assert "\n" not in str(caught.value) and str(path) in str(caught.value)
