"""Reconstruction needs neither scipy nor netgen nor matplotlib: they are made unimportable, or looked for afterwards."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import eitskin

BLOCKED = ("scipy", "netgen", "matplotlib", "sklearn")
BLOCK = f"import sys\nfor name in {BLOCKED!r}:\n    sys.modules[name] = None\n"
RECONSTRUCT = """
import json, sys
import numpy as np
from eitskin.model.prebuilt import load_prebuilt
from eitskin.solve.reconstructor import Reconstructor
model, blob = load_prebuilt()
facts = {}
for engine in ("c", "c64", "numpy"):
    reconstructor = Reconstructor(model, engine=engine, blob=blob)
    noise = 1e-4 * np.random.default_rng(1).normal(size=(16, 208))
    baseline = reconstructor.tare(model.golden.reference_v + noise)
    result = reconstructor.reconstruct(model.golden.frame_v)
    facts[engine] = [baseline.correlation, float(result.image.max()), len(result.touches)]
facts["loaded"] = sorted(name for name in sys.modules if name.split(".")[0] in ("scipy", "netgen", "matplotlib", "sklearn")
                         and sys.modules[name] is not None)
print(json.dumps(facts))
"""


def run(code: str, *arguments: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """A fresh Python on ``code``."""
    root = str(Path(eitskin.__file__).parents[1])
    path = os.pathsep.join(filter(None, [root, os.environ.get("PYTHONPATH")]))
    return subprocess.run(
        [sys.executable, "-c", code, *arguments],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1"},
        cwd=cwd,
        timeout=60,
        check=False,
    )


def test_reconstruction_where_they_cannot_be_imported() -> None:
    done = run(BLOCK + RECONSTRUCT)
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    for engine in ("c", "c64", "numpy"):
        correlation, peak, touches = facts[engine]
        assert correlation > 0.9999 and peak > 0.005 and touches == 2
    assert facts["loaded"] == []


def test_reconstruction_does_not_import_them_where_it_could() -> None:
    done = run(RECONSTRUCT)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["loaded"] == []


MAIN = "\nfrom eitskin.cli.main import main\nsys.exit(main(sys.argv[1:]))\n"


def test_info_and_verify_of_the_prebuilt_model() -> None:
    for action in ("info", "verify"):
        done = run(BLOCK + MAIN, "model", action, "--json")
        assert (done.returncode, done.stderr) == (0, "")
        assert json.loads(done.stdout)["model"] == "prebuilt paper skin"


def test_the_parser_is_light() -> None:
    """Help and refusals need nothing but the standard library: imports come when a command runs."""
    done = run("import sys\nfrom eitskin.cli.main import build_parser\nbuild_parser()\nprint('numpy' in sys.modules)")
    assert (done.returncode, done.stdout.strip()) == (0, "False")
