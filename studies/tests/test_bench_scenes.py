"""The benchmarks of scenes: what they count and print; times are not judged."""

import json

import pytest

from eitskin.scene.registry import BUILT_IN
from eitskin_studies.benchmarks import scenes as bench_scenes


@pytest.mark.long("test_the_scenes_table_has_both_ways_and_what_bounds_a_dataset")
def test_the_effects_table_has_none_each_and_all():
    result = bench_scenes.effects_table(frames=3, rounds=1)
    cases = result["cases"]
    names = [name for name in BUILT_IN if name != "flex"]  # which is for surfaces
    assert list(cases) == ["none", *names, "all"]
    assert all(cases[name]["steps"] == cases["none"]["steps"] + 1 for name in names)
    assert cases["all"]["steps"] == cases["none"]["steps"] + len(names)
    assert cases["none"]["random_numbers"] == 0 and cases["noise"]["random_numbers"] == 7 * 208
    assert "gel_drying" in bench_scenes.effects_text(result) and json.dumps(result)


def test_the_scenes_table_has_both_ways_and_what_bounds_a_dataset():
    result = bench_scenes.scenes_table(frames=6, scenes=4, elements=600, rounds=1)
    ways = result["moving"]["ways"]
    assert (ways["update"]["factorisations"], ways["factorise"]["factorisations"]) == (1, 6)
    assert result["moving"]["largest_difference_relative"] < 1e-9
    assert set(result["dataset"]["shares"]) == {"factorisation", "triangular solves", "the rest"}
    text = bench_scenes.scenes_text(result)
    assert "what bounds it" in text and "10000 would take" in text and json.dumps(result)
