"""An effect that is not named is not imported: seen from outside, in a process of its own."""

import json

import pytest

from fresh_python import run_python

HEAVY = {"matplotlib", "dask", "distributed", "tqdm"}

PROBE = """
import json, sys
from dataclasses import replace
from eitskin.scene.description import Scene
from eitskin.scene.runner import run_scene
from eitskin.scene.touch_path import always
effects = json.loads(sys.argv[1])
scene = Scene("probe", touches=(always(0, 0, 10),), frames=2, quiet_frames=1, elements=400,
              effects=effects)
run_scene(scene)
prefix = "eitskin.scene.effects."
loaded = sorted(m[len(prefix):] for m in sys.modules if m.startswith(prefix))
print(json.dumps([loaded, sorted(sys.modules)]))
"""


def fresh(code: str, *arguments: str) -> str:
    done = run_python(code, *arguments)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize(
    "effects",
    [{}, pytest.param({"mains": {}, "gel_drying": {}}, marks=pytest.mark.long("no effects"))],
)
def test_only_named_effects_are_imported(effects):
    own, every = json.loads(fresh(PROBE, json.dumps(effects)))
    assert own == sorted(effects)
    assert "eitskin.scene.touch_shape" not in every
    assert not {name.split(".")[0] for name in every} & HEAVY


def test_listing_effects_imports_none():
    code = """
import sys
from eitskin.scene.registry import Registry, summary_of
rows = {name: summary_of(target) for name, target in Registry().names().items()}
assert rows["noise"], rows
print([m for m in sys.modules if m.startswith("eitskin.scene.effects.")])
"""
    assert fresh(code).strip() == "[]"


def test_the_command_line_starts_without_scipy():
    code = "import sys, eitskin.cli.cmd_scene\nprint({'scipy', 'matplotlib'} & {*sys.modules})"
    assert fresh(code).strip() == "set()"
