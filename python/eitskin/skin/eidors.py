"""Read EIDORS' forward models from .mat files: the rim, electrodes and protocol of a
two-dimensional model.

The fields are those that EIDORS 3 itself reads (fwd_model_parameters.m, system_mat_fields.m,
stim_meas_list.m): ``nodes`` (N, 2), ``elems`` (E, 3) from 1, ``electrode(k).nodes`` and
``.z_contact``, ``stimulation(d).stim_pattern`` (L, 1) and ``.meas_pattern`` (rows, L). Nodes are
assumed to be in metres. A model of triangles conducts in its plane: its elem_data are conductivity
times thickness, in S, and z_contact is in ohm m.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.errors import FileError, GeometryError, ProtocolError
from eitskin.fileio import read_mat
from eitskin.skin.outline import Outline, disk, polygon

ROUND = 1e-3  # the radii of rim nodes may differ by this part of the mean if the rim is a circle
UNKNOWN_THICKNESS_MM = 1000.0  # with 1 m, the conductivity in S/m equals EIDORS' number


@dataclass(frozen=True, eq=False)
class EidorsModel:
    """An EIDORS forward model.

    ``nodes_mm`` (N, 2) are as in the file and ``triangles`` (E, 3) count from 0. Each electrode has
    its nodes and a contact impedance (L,) in ohm m. ``rows`` (m, 4) are [I+, I-, V+, V-] from 0,
    driven with ``current_a``; their voltages carry the factor ``gain``. ``sheet_s`` is the
    conductance of the sheet in S. ``jacobian`` is (m, E) in V/S if the file holds an array of that
    shape.
    """

    name: str
    nodes_mm: FloatArray
    triangles: IntArray
    electrode_nodes: tuple[IntArray, ...]
    contact_ohm_m: FloatArray
    rows: IntArray
    current_a: float
    gain: float
    sheet_s: float
    thickness_mm: float
    jacobian: FloatArray | None

    def rim(self) -> IntArray:
        """Return the nodes of the rim, counterclockwise, (k,).

        Raises:
            GeometryError: the triangles have more than one rim.
        """
        edges = self.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        n = len(self.nodes_mm)
        codes = edges @ [n, 1]
        outer = edges[~np.isin(codes, edges @ [1, n])]
        follower = dict(outer.tolist())
        rim = [int(outer[0, 0])]
        while follower[rim[-1]] != rim[0]:
            rim.append(follower[rim[-1]])
            if len(rim) > len(outer):
                break
        if len(rim) != len(outer):
            raise GeometryError(
                f"EIDORS model {self.name!r}: its triangles have more than one rim; a skin has one"
            )
        return np.array(rim)

    def outline(self) -> tuple[Outline, FloatArray]:
        """Return the rim as an outline, and the position of its origin in the coordinates of
        ``nodes_mm``, (2,)."""
        rim = self.nodes_mm[self.rim()]
        centre = (rim.min(axis=0) + rim.max(axis=0)) / 2
        radii = np.linalg.norm(rim - centre, axis=1)
        if np.ptp(radii) < ROUND * radii.mean():
            return disk(2 * float(radii.mean())), centre
        return polygon(rim.tolist()), np.zeros(2)

    def contacts(self) -> tuple[FloatArray, float]:
        """Return the middle of each electrode on the rim, in the coordinates of ``nodes_mm`` (L,
        2), and the mean width. As in EIDORS, a single node covers half of each edge beside it.

        Raises:
            GeometryError: an electrode is not on the rim.
        """
        rim = self.rim()
        place = {int(node): k for k, node in enumerate(rim)}
        points = self.nodes_mm[rim]
        steps = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
        middles, widths = [], []
        for number, nodes in enumerate(self.electrode_nodes):
            if not len(nodes) or any(int(node) not in place for node in nodes):
                raise GeometryError(
                    f"EIDORS model {self.name!r}: electrode {number + 1} is not on the rim of the"
                    " model, where eitskin needs it"
                )
            at = np.sort([place[int(node)] for node in nodes])
            gaps = np.diff(np.append(at, at[0] + len(rim)))
            first = at[(int(np.argmax(gaps)) + 1) % len(at)]
            run = np.arange(first, first + len(rim) - gaps.max()) % len(rim)
            if len(nodes) == 1:
                middles.append(points[at[0]])
                widths.append((steps[at[0]] + steps[at[0] - 1]) / 2)
                continue
            along = np.concatenate([[0.0], np.cumsum(steps[run])])
            k = int(np.searchsorted(along, along[-1] / 2, side="right")) - 1
            share = (along[-1] / 2 - along[k]) / steps[run[k]]
            a, b = points[run[k]], points[(run[k] + 1) % len(rim)]
            middles.append(a + share * (b - a))
            widths.append(along[-1])
        return np.array(middles), float(np.mean(widths))


def read_eidors(path: str | Path) -> EidorsModel:
    """Read the forward model in a .mat file: the first struct with nodes, elems, electrode and
    stimulation, either by itself or within an image or inverse model.

    Raises:
        FileError: the file cannot be read, or holds no such model.
        GeometryError, ProtocolError: it is not a two-dimensional model, or its patterns are not
            pairs.
        MissingExtraError: scipy is not installed.
    """
    content = read_mat(path)
    found = find_model(content)
    if found is None:
        raise FileError(
            f"{path}: no EIDORS model (a struct with nodes, elems, electrode, stimulation); save"
            " one with  save('-v7', 'FILE.mat', 'fmdl')"
        )
    try:
        return _model(content, found)
    except (GeometryError, ProtocolError) as error:
        raise type(error)(f"{path}: {error}") from None
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise FileError(
            f"{path}: a field of its EIDORS model is missing or has another form ({error})"
        ) from None


def find_model(content: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """Return the first struct in ``content`` that is a forward model, or None."""
    if all(name in content for name in ("nodes", "elems", "electrode", "stimulation")):
        return content
    inner = [value for value in content.values() if isinstance(value, Mapping)]
    return next((found for found in map(find_model, inner) if found is not None), None)


def _model(content: Mapping[str, Any], model: Mapping[str, Any]) -> EidorsModel:
    name = str(model.get("name", "")) or "EIDORS"
    nodes, elems = np.asarray(model["nodes"], float), np.asarray(model["elems"], np.int64) - 1
    if nodes.shape[1] != 2 or elems.shape[1] != 3:
        raise GeometryError(
            f"EIDORS model {name!r}: {nodes.shape[1]} coordinates, {elems.shape[1]} nodes an"
            " element; a skin is a sheet of triangles (2 and 3)"
        )
    if elems.min() < 0 or elems.max() >= len(nodes) or not np.isfinite(nodes).all():
        raise ValueError("elems or nodes")
    a, b, c = (nodes[elems[:, k]] for k in range(3))
    turned = (b - a)[:, 0] * (c - a)[:, 1] < (b - a)[:, 1] * (c - a)[:, 0]
    elems[turned] = elems[turned][:, ::-1]
    electrodes = _structs(model["electrode"])
    rows, current_a, gain = _scan(_structs(model["stimulation"]), len(electrodes))
    jacobian = _jacobian(content, model, (len(rows), len(elems)))
    return EidorsModel(
        name=name,
        nodes_mm=1e3 * nodes,
        triangles=elems,
        electrode_nodes=tuple(
            np.atleast_1d(np.asarray(one["nodes"], np.int64)).ravel() - 1 for one in electrodes
        ),
        contact_ohm_m=np.array([float(one.get("z_contact", 0.0)) for one in electrodes]),
        rows=rows,
        current_a=current_a,
        gain=gain,
        sheet_s=_background(content),
        thickness_mm=float(model.get("thickness_mm", UNKNOWN_THICKNESS_MM)),
        jacobian=jacobian,
    )


def _structs(value: Any) -> list[Mapping[str, Any]]:
    """Return the structs of a struct array, for which scipy gives one struct, or a list or array of
    them."""
    return [value] if isinstance(value, Mapping) else list(np.asarray(value, object).ravel())


def _dense(value: Any) -> FloatArray:
    return np.asarray(value.toarray() if hasattr(value, "toarray") else value, dtype=np.float64)


def _scan(stimulation: list[Mapping[str, Any]], n_electrodes: int) -> tuple[IntArray, float, float]:
    """Return the rows (m, 4) from 0, the current in A, and the gain of the patterns."""
    rows, currents, gains = [], [], []
    for k, one in enumerate(stimulation, 1):
        drive, current = _pair(_dense(one["stim_pattern"]).ravel(), f"stim_pattern {k}")
        milli = str(one.get("stimulation", "Amp")).lower() == "ma"
        currents.append(current * (1e-3 if milli else 1.0))
        for pattern in _dense(one["meas_pattern"]).reshape(-1, n_electrodes):
            measure, gain = _pair(pattern, f"meas_pattern {k}")
            rows.append([*drive, *measure])
            gains.append(gain)
    for what, values in (("currents", currents), ("gains", gains)):
        if np.ptp(values) > 1e-9 * max(values):
            raise ProtocolError(
                f"EIDORS stimulation: {what} of {min(values):g} to {max(values):g}; eitskin's rows"
                " have one"
            )
    return np.array(rows, dtype=np.int64), float(currents[0]), float(gains[0])


def _pair(pattern: FloatArray, what: str) -> tuple[tuple[int, int], float]:
    """Return the electrodes (+, -) of a pattern (L,) with two entries, and the size of the
    entries."""
    used = np.flatnonzero(pattern)
    if len(used) != 2 or abs(pattern.sum()) > 1e-9 * np.abs(pattern).max():
        raise ProtocolError(
            f"EIDORS {what} (from 1) uses {len(used)} electrodes; eitskin drives and measures"
            " between two"
        )
    return (int(np.argmax(pattern)), int(np.argmin(pattern))), float(pattern.max())


def _background(content: Mapping[str, Any]) -> float:
    """Return the sheet conductance in S: the background of an inverse model; else the mean of an
    image if all its values are above 0; else 1."""
    for value in content.values():
        if not isinstance(value, Mapping):
            continue
        if value.get("type") == "inv_model" and isinstance(value.get("jacobian_bkgnd"), Mapping):
            return float(np.mean(value["jacobian_bkgnd"]["value"]))
        image = value.get("elem_data") if value.get("type") == "image" else None
        if isinstance(image, np.ndarray) and image.ndim == 1 and image.min() > 0:
            return float(image.mean())
    return 1.0


def _jacobian(
    content: Mapping[str, Any], model: Mapping[str, Any], shape: tuple[int, int]
) -> FloatArray | None:
    for value in (model.get("jacobian"), *content.values()):
        if isinstance(value, np.ndarray) and value.dtype.kind == "f" and value.shape == shape:
            return np.asarray(value, dtype=np.float64)
    return None
