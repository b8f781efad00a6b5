"""Finding effects by name, a user's own by entry point, and the check of their parameters."""

import importlib.metadata
import sys
from dataclasses import dataclass
from types import SimpleNamespace

import pytest
from scene_helpers import effect_module

from eitskin.config import from_table, number, parameter
from eitskin.errors import ConfigError
from eitskin.scene.registry import BUILT_IN, ENTRY_POINT_GROUP, Registry, describe_parameters


@dataclass(frozen=True)
class Every:
    """One field of each kind."""

    gain: float = parameter(1.0, "V", "a number", low=0, high=2, open_low=True)
    bits: int = parameter(12, "bit", "whole", low=1, high=32)
    on: bool = True
    kind: str = parameter("slow", "", "word", choices=("slow", "fast"))
    which: tuple[int, ...] = parameter((0,), "", "list", low=0)
    pair: tuple[float, float] = (0.0, 1.0)
    limit_v: float | None = parameter(None, "V", "or none", low=0)

    def __post_init__(self) -> None:
        if self.bits == 13:
            raise ConfigError("bits = 13: unlucky; take another")


MODULE = SimpleNamespace(Parameters=Every)


def test_tables_become_parameters():
    assert from_table(Every, {}, "w") == Every()
    table = {
        "gain": 2, "bits": 8.0, "on": False, "kind": "fast", "which": [1, 2], "pair": [3, 4],
        "limit_v": 0.5,
    }  # fmt: skip
    found = from_table(Every, table, "w")
    assert found == Every(2.0, 8, False, "fast", (1, 2), (3.0, 4.0), 0.5)
    assert isinstance(found.gain, float) and isinstance(found.bits, int)


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"gian": 1}, r"f \[effects.x\]: unknown key 'gian'; did you mean 'gain'"),
        ({"gain": 0},
         r"f \[effects.x\]: gain = 0 is out of range; it must be above 0 and at most 2 V"),
        ({"gain": float("nan")}, "gain = nan is out of range"),
        ({"gain": "loud"}, "gain must be a number"),
        ({"gain": True}, "gain must be a number"),
        ({"bits": 8.5}, "bits = 8.5 must be a whole number"),
        ({"bits": 13}, r"f \[effects.x\]: bits = 13: unlucky"),
        ({"on": 1}, "on must be true or false"),
        ({"kind": "slwo"}, "kind = 'slwo' is not known; did you mean 'slow'"),
        ({"kind": 3}, "kind must be text"),
        ({"which": 3}, "which must be a list"),
        ({"which": [1, -1]}, r"which entry 1 \(from 0\) = -1 is out of range"),
        ({"pair": [1]}, "pair must be a list of 2"),
        ({"limit_v": -1}, "limit_v = -1 is out of range; it must be at least 0 V"),
    ],
)  # fmt: skip
def test_impossible_parameters_name_file_table_and_key(table, said):
    with pytest.raises(ConfigError, match=said):
        from_table(Every, table, "f [effects.x]")


def test_an_infinite_number_is_refused_where_a_range_has_no_end():
    with pytest.raises(ConfigError, match="x = inf is out of range; it must be finite"):
        number({"x": float("inf")}, "x", None, "f")


def test_parameters_describe_themselves():
    rows = {row["name"]: row for row in describe_parameters(MODULE)}
    assert rows["gain"] == {
        "name": "gain", "type": "float", "default": 1.0, "low": 0, "high": 2, "unit": "V",
        "doc": "a number",
    }  # fmt: skip
    assert rows["kind"]["choices"] == ("slow", "fast")


def test_an_unknown_effect_names_the_nearest():
    said = r"f.toml \[effects.nosie\]: unknown effect 'nosie'; did you mean 'noise'"
    with pytest.raises(ConfigError, match=said):
        Registry().load("nosie", "f.toml")


def test_a_package_adds_an_effect_by_an_entry_point(monkeypatch):
    point = importlib.metadata.EntryPoint("mine", effect_module("mine"), ENTRY_POINT_GROUP)
    taken = importlib.metadata.EntryPoint("noise", effect_module("taken"), ENTRY_POINT_GROUP)
    groups = {ENTRY_POINT_GROUP: [point, taken]}
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: groups[group])
    assert Registry().load("mine", "f").NAME == "mine"
    assert Registry().load("noise", "f").__name__ == BUILT_IN["noise"]
    assert set(Registry().names()) == {*BUILT_IN, "mine"}
    with pytest.raises(ConfigError, match="unknown effect 'mine'"):
        Registry(entry_points=False).load("mine", "f")


def test_modules_that_break_the_contract_are_refused():
    name = effect_module("broken")
    del sys.modules[name].SUMMARY
    for names, said in (
        ({"broken": name}, r"\[effects.broken\]: its module defines no SUMMARY"),
        ({"alias": effect_module("other")}, "NAME must be 'alias'"),
        ({"gone": "no_such_module_at_all"}, "cannot be imported"),
    ):
        with pytest.raises(ConfigError, match=said):
            Registry(names).load(*names, "f")
