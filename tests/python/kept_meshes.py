"""Meshes for tests: made in the test's process and kept in ``build/meshes``, for every process and
every run."""

import hashlib
import json
import os
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cross_build import ROOT
from eitskin.fem import mesh, mesh_worker

PATIENCE_S = 60.0  # what build_mesh allows by default
Mesher = Callable[[dict[str, Any], float, str], list[npt.NDArray[Any]]]
FOLDER = ROOT / "build" / "meshes"


def mesher_that_keeps() -> Mesher:
    """``run_mesher`` without a process for each mesh, whose start takes a quarter of a second.

    It only meshes if the request, mesh_worker.py or netgen is new. A request with less time than
    usual expects the mesher to hang, and goes to the real one. So does one that fails here, for its
    message.
    """
    real = mesh.run_mesher
    try:
        made_by = Path(mesh_worker.__file__).read_bytes() + version("netgen-mesher").encode()
    except PackageNotFoundError:
        return real
    FOLDER.mkdir(parents=True, exist_ok=True)

    def run(request: dict[str, Any], timeout_s: float, name: str) -> list[npt.NDArray[Any]]:
        asked = hashlib.sha256(made_by + json.dumps(request).encode()).hexdigest()
        path = FOLDER / f"{asked}.npz"
        if not path.exists():
            arrays = made_here(request) if timeout_s >= PATIENCE_S else None
            arrays = arrays or real(request, timeout_s, name)
            partial = FOLDER / f"{asked}.{os.getpid()}.npz"
            np.savez(partial, *arrays)
            partial.replace(path)
        with np.load(path) as kept:
            return [kept[key] for key in kept.files]

    return run


def made_here(request: dict[str, Any]) -> list[npt.NDArray[Any]] | None:
    """The mesh by netgen in this process, or None if netgen fails."""
    try:
        return mesh_worker.mesh_arrays(request)
    except Exception:
        return None
