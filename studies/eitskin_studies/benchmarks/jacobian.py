"""Benchmark: the Jacobian's time beside pyEIT's on the same meshes, and the time of a whole model
from its skin.

Both get one mesh of the paper's skin and one conductivity, and return the Jacobian of 208 voltages:
pyEIT's for point electrodes with respect to elements, ours for the complete electrode model with
respect to pixels. Runs are interleaved, and medians compared. The cosine between the two, both on
the pixels, shows that they compute the same thing.
"""

import importlib
import importlib.metadata
import importlib.util
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin import __version__
from eitskin.arrays import FloatArray
from eitskin.errors import UsageError
from eitskin.fem.cem import ForwardModel
from eitskin.fem.grid import Grid, grid_for
from eitskin.fem.mesh import Mesh, mesh_for_elements
from eitskin.fem.sensitivity import element_to_pixel, sensitivity
from eitskin.skin.protocol import Protocol, adjacent
from eitskin.skin.skin import Skin, paper_skin
from eitskin_studies.harness.extras import missing_studies_extra
from eitskin_studies.harness.machine import machine

ELEMENTS = (3000, 10000)
MODEL_ELEMENTS = 3000
OURS_PER_ROUND = 5


def run(
    elements: Sequence[int] = ELEMENTS,
    rounds: int = 3,
    *,
    model_elements: int = MODEL_ELEMENTS,
    progress: bool = False,
) -> dict[str, Any]:
    """Time everything on one BLAS thread where threadpoolctl is installed; returns plain values fit
    for JSON.

    A round is one run of pyEIT and five of ours. ``first`` times start from the mesh; ``again``
    times from what is kept for another conductivity. Times are in s, as [median, least, most].

    Raises:
        UsageError: ``rounds`` is below 1.
        MissingExtraError: pyEIT, scipy or netgen is not installed.
    """
    if rounds < 1:
        raise UsageError(f"bench: {rounds} rounds; use at least 1")
    if importlib.util.find_spec("pyeit") is None:
        raise missing_studies_extra("peers", "pyeit")
    skin, protocol = paper_skin(), adjacent(16)
    grid = grid_for(skin.outline)
    limit, threads = _one_thread()
    with limit:
        cases = [
            _case(mesh_for_elements(skin, count), skin, protocol, grid, rounds, progress)
            for count in elements
        ]
        model = _whole_model(skin, protocol, grid, model_elements, max(3, rounds))
    return {
        "versions": _versions(),
        "machine": f"{machine()}, {threads}",
        "rounds": rounds,
        "pixels": grid.n_pixels,
        "voltages": protocol.n_rows,
        "jacobian": cases,
        "whole_model": model,
    }


def text(result: dict[str, Any]) -> str:
    """The result of ``run`` as a table."""
    versions = ", ".join(f"{name} {version}" for name, version in result["versions"].items())
    lines = [
        (
            f"Jacobian of {result['voltages']} voltages on {result['pixels']} pixels, one mesh for"
            " both"
        ),
        "times in ms: median [least, most]",
        f"{versions}; {result['machine']}; {result['rounds']} interleaved rounds",
        "",
        f"{'elements':>8}  {'from':<10} {'eitskin':>22} {'pyEIT':>28} {'ratio':>7}  cosine",
    ]
    for case in result["jacobian"]:
        for name, label in (("first", "the mesh"), ("again", "kept parts")):
            ours, peer = case["eitskin_s"][name], case["pyeit_s"][name]
            lines.append(
                f"{case['elements']:>8}  {label:<10} {_times(ours):>22} {_times(peer):>28} "
                f"{case['ratio'][name]:>6.0f}x  {case['cosine']:.4f}"
            )
    model = result["whole_model"]
    lines += [
        "",
        (
            f"whole model, {model['elements']} elements: {_times(model['total_s'])} ms, of which"
            f" mesh {1e3 * model['mesh_s'][0]:.0f} ms and Jacobian"
            f" {1e3 * model['jacobian_s'][0]:.0f} ms"
        ),
    ]
    return "\n".join(lines)


def _times(seconds: list[float]) -> str:
    median, least, most = (1e3 * value for value in seconds)
    return f"{median:.1f} [{least:.1f}, {most:.1f}]"


def _case(
    mesh: Mesh, skin: Skin, protocol: Protocol, grid: Grid, rounds: int, progress: bool
) -> dict[str, Any]:
    ours, peer = _ours(mesh, skin, protocol, grid), _pyeit(mesh, skin, protocol)
    jacobians = {}
    for _ in range(2):  # warm up caches and imports; the peer is only run once, it takes seconds
        jacobians["ours"] = ours["first"]()
        ours["again"]()
    times: dict[str, dict[str, list[float]]] = {
        who: {"first": [], "again": []} for who in ("ours", "peer")
    }
    for _ in _rounds(rounds, progress, f"{mesh.n_elements} elements"):
        for name in ("first", "again"):
            for _ in range(OURS_PER_ROUND):
                times["ours"][name].append(_timed(ours[name])[0])
            seconds, jacobians["peer"] = _timed(peer[name])
            times["peer"][name].append(seconds)
    summary = {
        who: {name: _summary(values) for name, values in both.items()}
        for who, both in times.items()
    }
    on_pixels = (element_to_pixel(mesh, grid).T @ jacobians["peer"].T).T
    return {
        "elements": mesh.n_elements,
        "nodes": mesh.n_nodes,
        "eitskin_s": summary["ours"],
        "pyeit_s": summary["peer"],
        "ratio": {
            name: summary["peer"][name][0] / summary["ours"][name][0] for name in ("first", "again")
        },
        "cosine": _cosine(jacobians["ours"], on_pixels),
    }


def _ours(
    mesh: Mesh, skin: Skin, protocol: Protocol, grid: Grid
) -> dict[str, Callable[[], FloatArray]]:
    kept = ForwardModel(mesh, skin, protocol)
    weights = element_to_pixel(mesh, grid)
    sigma = skin.conductivity_s_per_m
    return {
        "first": lambda: sensitivity(ForwardModel(mesh, skin, protocol), sigma, grid)[0],
        "again": lambda: sensitivity(kept, sigma, grid, weights=weights)[0],
    }


def pyeit_case(mesh: Mesh, skin: Skin, protocol: Protocol) -> tuple[Any, Any, npt.NDArray[np.intp]]:
    """pyEIT's mesh and protocol for the same mesh, and the order in which it measures the rows. Its
    electrodes are points, here the rim nodes nearest to the electrodes' middles."""
    wrapper, scan = (
        importlib.import_module("pyeit.mesh"),
        importlib.import_module("pyeit.eit.protocol"),
    )
    middles = skin.electrode_centres_mm()
    contacts = [
        int(edges[np.argmin(np.hypot(*(mesh.nodes_mm[edges[:, 0]] - middle).T)), 0])
        for edges, middle in zip(mesh.electrode_edges, middles, strict=True)
    ]
    drives = np.unique(protocol.drive_measure[:, :2], axis=0).astype(int)
    measures = np.stack(
        [
            protocol.drive_measure[(protocol.drive_measure[:, :2] == drive).all(axis=1), 2:]
            for drive in drives
        ]
    ).astype(int)
    reference = int(np.argmin(np.hypot(*mesh.nodes_mm.T)))
    theirs = wrapper.PyEITMesh(
        node=np.array(mesh.nodes_mm),
        element=np.array(mesh.triangles),
        el_pos=np.array(contacts),
        ref_node=reference,
    )
    pattern = scan.PyEITProtocol(
        ex_mat=drives, meas_mat=measures, keep_ba=np.ones(protocol.n_rows, dtype=bool)
    )
    return theirs, pattern, np.lexsort((protocol.drive_measure[:, 1], protocol.drive_measure[:, 0]))


def _pyeit(mesh: Mesh, skin: Skin, protocol: Protocol) -> dict[str, Callable[[], FloatArray]]:
    fem = importlib.import_module("pyeit.eit.fem")
    theirs, pattern, order = pyeit_case(mesh, skin, protocol)
    kept, back = fem.EITForward(theirs, pattern), np.argsort(order, kind="stable")
    return {
        "first": lambda: fem.EITForward(theirs, pattern).compute_jac()[0][back],
        "again": lambda: kept.compute_jac()[0][back],
    }


def _whole_model(
    skin: Skin, protocol: Protocol, grid: Grid, elements: int, runs: int
) -> dict[str, Any]:
    meshing, linearising = [], []
    count = 0
    for _ in range(runs):
        seconds, mesh = _timed(lambda: mesh_for_elements(skin, elements))
        meshing.append(seconds)
        linearising.append(_timed(_ours_first(mesh, skin, protocol, grid))[0])
        count = mesh.n_elements
    total = [a + b for a, b in zip(meshing, linearising, strict=True)]
    return {
        "elements": count,
        "total_s": _summary(total),
        "mesh_s": _summary(meshing),
        "jacobian_s": _summary(linearising),
    }


def _ours_first(mesh: Mesh, skin: Skin, protocol: Protocol, grid: Grid) -> Callable[[], object]:
    return lambda: sensitivity(ForwardModel(mesh, skin, protocol), skin.conductivity_s_per_m, grid)


def _timed(work: Callable[[], Any]) -> tuple[float, Any]:
    begin = time.perf_counter()
    result = work()
    return time.perf_counter() - begin, result


def _summary(seconds: list[float]) -> list[float]:
    return [statistics.median(seconds), min(seconds), max(seconds)]


def _cosine(one: FloatArray, other: FloatArray) -> float:
    return float(abs((one * other).sum()) / (np.linalg.norm(one) * np.linalg.norm(other)))


def _rounds(count: int, progress: bool, what: str) -> Any:
    if not progress:
        return range(count)
    from tqdm import tqdm

    return tqdm(range(count), desc=what, unit="round", file=sys.stderr, disable=None)


def _one_thread() -> tuple[AbstractContextManager[Any], str]:
    if importlib.util.find_spec("threadpoolctl") is None:
        return nullcontext(), "BLAS threads as configured"
    return importlib.import_module("threadpoolctl").threadpool_limits(1), "one BLAS thread"


def _versions() -> dict[str, str]:
    names = ("pyeit", "numpy", "scipy", "netgen-mesher")
    return {"eitskin": __version__, **{name: importlib.metadata.version(name) for name in names}}


if __name__ == "__main__":
    print(text(run(progress=True)))
