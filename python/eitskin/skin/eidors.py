"""EIDORS' forward models, read from .mat files: a sheet's rim, electrodes and protocol.

The fields are those that EIDORS 3 itself reads (fwd_model_parameters.m, system_mat_fields.m,
stim_meas_list.m): ``nodes`` (N, 2), ``elems`` (E, 3) from 1, ``electrode(k).nodes`` and
``.z_contact``, ``stimulation(d).stim_pattern`` (L, 1) and ``.meas_pattern`` (rows, L). Nodes are
taken for metres. A model of triangles conducts in its plane: its elem_data are conductivity times
thickness, in S, and z_contact is in ohm m.
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

ROUND = 1e-3  # of the radius: as far may a disk's rim nodes be from a circle
UNKNOWN_THICKNESS_MM = 1000.0  # conductivity in S/m is then EIDORS' number


@dataclass(frozen=True, eq=False)
class EidorsModel:
    """A forward model: ``nodes_mm`` (N, 2) as in the file, ``triangles`` (E, 3) from 0, nodes of
    each electrode, contact impedances (L,) in ohm m; rows [I+, I-, V+, V-] (m, 4) from 0, their
    current, and the factor ``gain`` that their voltages carry; the sheet's conductance in S.
    ``jacobian`` (m, E) in V/S where the file holds numbers of that shape."""

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
        """The rim's nodes in order, counterclockwise, (k,)."""
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
        """The rim as an outline, and where its origin lies among ``nodes_mm``, (2,)."""
        rim = self.nodes_mm[self.rim()]
        centre = (rim.min(axis=0) + rim.max(axis=0)) / 2
        radii = np.linalg.norm(rim - centre, axis=1)
        if np.ptp(radii) < ROUND * radii.mean():
            return disk(2 * float(radii.mean())), centre
        return polygon(rim.tolist()), np.zeros(2)

    def contacts(self) -> tuple[FloatArray, float]:
        """The middle of each electrode on the rim of ``nodes_mm``, (L, 2), and their mean width. A
        single node stands for half of the edges beside it, as in EIDORS."""
        rim = self.rim()
        place = {int(node): k for k, node in enumerate(rim)}
        points = self.nodes_mm[rim]
        steps = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
        middles, widths = [], []
        for number, nodes in enumerate(self.electrode_nodes):
            if not len(nodes) or any(int(node) not in place for node in nodes):
                raise GeometryError(
                    f"EIDORS model {self.name!r}: electrode {number + 1} is not on the rim of the"
                    " sheet; eitskin's electrodes are"
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
    """The forward model in a .mat file: the first struct with nodes, elems, electrode and
    stimulation, alone or in an image or inverse model.

    Raises:
        FileError: the file cannot be read, or holds none.
        GeometryError, ProtocolError: what it describes is no sheet, or no scan of pairs.
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
    """The first struct of ``content`` that is a forward model; None where there is none."""
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
    """A struct array as scipy gives it: one struct, or a list or array of them."""
    return [value] if isinstance(value, Mapping) else list(np.asarray(value, object).ravel())


def _dense(value: Any) -> FloatArray:
    return np.asarray(value.toarray() if hasattr(value, "toarray") else value, dtype=np.float64)


def _scan(stimulation: list[Mapping[str, Any]], n_electrodes: int) -> tuple[IntArray, float, float]:
    """Rows (m, 4) from 0, current in A, gain of the patterns."""
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
    """The electrodes (+, -) of a pattern (L,) of two entries, and their size."""
    used = np.flatnonzero(pattern)
    if len(used) != 2 or abs(pattern.sum()) > 1e-9 * np.abs(pattern).max():
        raise ProtocolError(
            f"EIDORS {what} (from 1) uses {len(used)} electrodes; eitskin drives and measures"
            " between two"
        )
    return (int(np.argmax(pattern)), int(np.argmin(pattern))), float(pattern.max())


def _background(content: Mapping[str, Any]) -> float:
    """The sheet's conductance: an inverse model's background, a single image's mean where it is
    above 0, or 1."""
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
