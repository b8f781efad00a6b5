"""The wheel with its plain dependencies: what works, and how a command names missing extras."""

import json
import re

import numpy as np
import pytest
from test_wheel import ROOT

from eitskin.config import load_toml
from eitskin.demo.demo import SEED, SNR_DB, shipped_frames, simulated_frames
from eitskin.errors import EXTRAS
from fresh_python import MAIN, run_python, without

MODULES = sorted({module for packages in EXTRAS.values() for module in packages.values()})
CHECKOUT = ("eitskin_emulator", "eitskin_hardware", "eitskin_studies")
FROM_A_WHEEL = "from eitskin import errors\nerrors.checkout = lambda: None\n"
BARE = without(*MODULES, "unicorn", *CHECKOUT) + FROM_A_WHEEL + MAIN
MISSING = 9
PROJECT = load_toml(ROOT / "pyproject.toml", "project")["project"]


def test_the_demo_needs_only_the_plain_dependencies(tmp_path):
    done = run_python(BARE, "demo", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    assert (facts["hits"], facts["false"], facts["picture"], facts["board"]) == (3, 0, None, None)
    assert max(facts["position_errors_mm"]) < 1
    assert "without the picture: this needs matplotlib" in done.stderr
    assert "the firmware on an emulated board: left out" in done.stderr + done.stdout
    assert "ten to thirty seconds" not in done.stderr + done.stdout
    assert list(tmp_path.iterdir()) == []


def test_the_frames_that_ship_are_those_of_the_command():
    shipped, made = shipped_frames(), simulated_frames(SEED, SNR_DB)
    for name in ("reference_voltage_v", "voltage_v", "touch_xy_mm", "touch_radius_mm"):
        kept, new = getattr(shipped, name), getattr(made, name)
        assert np.abs(kept - new).max() < 1e-4 * np.abs(new).max(), (
            "make them again:  eitskin demo --seed 1 --no-board"
            " --frames python/eitskin/demo/demo_frames.npz"
        )


@pytest.mark.parametrize(
    ("command", "extras"),
    [
        ("demo --seed 2 --picture out.png", "model,plot"),
        ("view --device sim:swipe", "model,view"),
        ("stream --device sim:swipe --to osc://127.0.0.1 --to mcap:out.mcap --picture out.png",
         "mcap,model,osc,plot"),
        ("scene picture demo -o out.png", "model,plot"),
        ("model build --paper -o out.eitm", "model"),
    ],
)  # fmt: skip
def test_a_command_names_all_extras_that_it_lacks(command, extras, tmp_path):
    done = run_python(BARE, *command.split(), cwd=tmp_path)
    assert (done.returncode, done.stdout) == (MISSING, "")
    assert done.stderr.endswith(f"run  pip install 'eitskin[{extras}]'\n")
    for extra in extras.split(","):
        assert all(package in done.stderr for package in EXTRAS[extra])
    assert len(done.stderr.splitlines()) == 1 and list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", ["compare", "study list", "stream --device emu:swipe"])
def test_what_only_the_sources_have_says_where_they_are(command):
    done = run_python(BARE, *command.split())
    assert (done.returncode, done.stdout) == (MISSING, "")
    assert PROJECT["urls"]["Source"] in done.stderr and "pip install ./firmware" in done.stderr


def test_every_extra_is_known_by_its_packages():
    def names(requirements: list[str]) -> set[str]:
        return {re.split(r"[>=<;\[ ]", one)[0] for one in requirements}

    stated = {name: names(given) for name, given in PROJECT["optional-dependencies"].items()}
    groups = {"all", "sinks", "test", "build", "site"}
    assert {name: stated[name] for name in stated.keys() - groups} == {
        name: set(packages) for name, packages in EXTRAS.items()
    }
    everything = set()
    for one in (
        *PROJECT["optional-dependencies"]["all"],
        *PROJECT["optional-dependencies"]["sinks"],
    ):
        everything |= set(one[one.index("[") + 1 : -1].split(","))
    assert everything - {"sinks"} == set(EXTRAS)
