"""Reconstruction needs neither scipy nor netgen nor matplotlib: they are made unimportable, or
looked for afterwards."""

import json

from fresh_python import MAIN, run_python, without

BLOCK = without("scipy", "netgen", "matplotlib", "sklearn")
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
    facts[engine] = [baseline.correlation, float(result.solver_image.max()), len(result.touches)]
extras = ("scipy", "netgen", "matplotlib", "sklearn")
facts["loaded"] = sorted(name for name, module in sys.modules.items()
                         if name.split(".")[0] in extras and module is not None)
print(json.dumps(facts))
"""


def test_reconstruction_where_they_cannot_be_imported():
    done = run_python(BLOCK + RECONSTRUCT)
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    for engine in ("c", "c64", "numpy"):
        correlation, peak, touches = facts[engine]
        assert correlation > 0.9999 and peak > 0.005 and touches == 2
    assert facts["loaded"] == []


def test_info_and_verify_of_the_prebuilt_model():
    for action in ("info", "verify"):
        done = run_python(BLOCK + MAIN, "model", action, "--json")
        assert (done.returncode, done.stderr) == (0, "")
        assert json.loads(done.stdout)["model"] == "prebuilt paper skin"
