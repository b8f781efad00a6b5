"""Threads that share objects, with the compiled parts under GCC's ThreadSanitizer: it reports no
race with the objects' locks, and many without them."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import eitskin

ROOT = Path(__file__).resolve().parents[3]
PARTS = ("core/_core_f32", "core/_core_f64", "device/_board")
SHARED = """
import sys, threading, time
from contextlib import nullcontext
import numpy as np
import eitskin
from eitskin.core.gestures import Gestures
from eitskin.solve.batch import Batch

model = eitskin.load_model()
rng = np.random.default_rng(1)
v0 = np.zeros(model.protocol.n_rows)
v0[model.fold.first] = model.v_ref_v
v0[model.fold.second] = model.fold.sign * model.v_ref_v
untouched = v0 * (1 + 1e-3 * rng.normal(size=(16, len(v0))))
frames = v0 * (1 + 1e-2 * rng.normal(size=(16, len(v0))))
skin, gestures = eitskin.Reconstructor(model), Gestures()
skin.tare(untouched)
if sys.argv[1] == "unlocked":
    skin.lock = skin.c_engine.lock = nullcontext()

def use(k):
    for i in range(20):
        result = skin.reconstruct(frames[(7 * i + k) % 16])
        if sys.argv[1] == "locked":
            gestures.update(result.touches, 20_000 * i)
            if i % 10 == 5:
                skin.tare(untouched)

threads = [threading.Thread(target=use, args=(k,)) for k in range(2)]
[one.start() for one in threads]
[one.join() for one in threads]
if sys.argv[1] == "locked":
    batch = Batch(model, threads=2)
    batch.tare(untouched)
    list(batch.each(np.vstack([frames] * 4)))
    with eitskin.open_device("sim:swipe?loop=1") as board:
        board.tare(4)
        end = time.monotonic() + 5

        def ask():
            while time.monotonic() < end:
                board.stats()
                board.tare(4)

        thread = threading.Thread(target=ask)
        thread.start()
        for frame in board.stream():
            if time.monotonic() > end:
                break
        thread.join()
print("done")
"""


@pytest.mark.long("the same objects in threads, without a sanitizer")
def test_the_sanitizer_sees_no_race_with_locks_and_many_without(tmp_path):
    library = subprocess.run(
        ["gcc", "-print-file-name=libtsan.so"], capture_output=True, text=True, check=True
    ).stdout.strip()
    assert Path(library).is_absolute(), "GCC has no libtsan: apt-get install libtsan2"
    build = tmp_path / "build"
    options = ["-DEITSKIN_PYTHON=ON", "-DEITSKIN_TESTS=OFF", "-DCMAKE_BUILD_TYPE=RelWithDebInfo"]
    options += [f"-DPython_EXECUTABLE={sys.executable}", "-DCMAKE_C_FLAGS=-fsanitize=thread"]
    for command in (
        [
            "cmake",
            "-S",
            str(ROOT),
            "-B",
            str(build),
            "-G",
            "Ninja",
            "-DCMAKE_C_COMPILER=gcc",
            *options,
        ],
        ["cmake", "--build", str(build), "--target", "python_modules"],
    ):
        subprocess.run(command, check=True, capture_output=True)
    package = tmp_path / "eitskin"
    shutil.copytree(Path(eitskin.__file__).parent, package)
    for part in PARTS:
        for old in (package / part).parent.glob(f"{Path(part).name}*.so"):
            old.unlink()
        (made,) = (build / "python").glob(f"{Path(part).name}*.so")
        shutil.copy(made, (package / part).parent)
    races = {}
    for kind in ("locked", "unlocked"):
        done = subprocess.run(
            [sys.executable, "-c", SHARED, kind],
            env={**os.environ, "LD_PRELOAD": library, "PYTHONPATH": str(tmp_path)},
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.stdout.strip() == "done", done.stderr[-2000:]
        races[kind] = done.stderr.count("WARNING: ThreadSanitizer: data race")
    print(races)
    assert races["locked"] == 0 < races["unlocked"]
