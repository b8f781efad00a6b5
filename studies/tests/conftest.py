"""Fixtures for every test of the studies."""

import hashlib
import json
import os
from collections.abc import Iterator
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from filelock import FileLock

from eitskin.fem import mesh, mesh_worker
from eitskin_emulator.core_on_qemu import build_cortex_m7

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
BUILD = ROOT / "build"
NEEDED = ("dask", "pyeit", "sklearn", "celer", "daqp", "unicorn", "netgen", "matplotlib")


def pytest_sessionstart() -> None:
    """Nothing is left out for want of a package."""
    missing = [name for name in NEEDED if find_spec(name) is None]
    if missing:
        raise pytest.UsageError(f"no {', '.join(missing)} here: run  studies/test")


@pytest.fixture(scope="session", autouse=True)
def meshes_are_kept() -> Iterator[None]:
    """In build/meshes, for every process and every run: Netgen is a process of its own, about half
    a second a mesh. It only runs for a request, a mesh_worker.py or a netgen that is new."""
    real, kept = mesh.run_mesher, BUILD / "meshes"
    made_by = Path(mesh_worker.__file__).read_bytes() + version("netgen-mesher").encode()
    kept.mkdir(parents=True, exist_ok=True)

    def run(request: dict[str, Any], timeout_s: float, name: str) -> list[Any]:
        asked = hashlib.sha256(made_by + json.dumps(request).encode()).hexdigest()
        path = kept / f"{asked}.npz"
        if not path.exists():
            partial = kept / f"{asked}.{os.getpid()}.npz"
            np.savez(partial, *real(request, timeout_s, name))
            partial.replace(path)
        with np.load(path) as arrays:
            return [arrays[key] for key in arrays.files]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mesh, "run_mesher", run)
        yield


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of measured frames, ``../shared/data`` beside the project's root; without it the
    test is skipped."""
    folder = ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(
            "the measured frames are not part of the project: no ../shared/data beside its root"
        )
    return folder


@pytest.fixture(scope="session")
def cortex_m7() -> Path:
    """A build of everything for the Cortex-M7, brought up to date by whichever process asks first:
    ``firmware/eitskin_BOARD.elf``, ``.bin`` and ``.map``, ``tests/emulated``."""
    BUILD.mkdir(exist_ok=True)
    with FileLock(BUILD / "cortex-m7.lock"):
        return build_cortex_m7(ROOT, BUILD / "cortex-m7")
