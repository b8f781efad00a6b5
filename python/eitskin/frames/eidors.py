"""Export frames, model and images to EIDORS, and import its frames and images, as .mat files with
EIDORS' own structs (skin.eidors lists the fields and units)."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.arrays import AnyArray, FloatArray
from eitskin.errors import FrameError
from eitskin.fem.grid import Grid
from eitskin.fem.mesh import Mesh
from eitskin.fileio import read_mat, write_beside
from eitskin.frames.frames import Frames
from eitskin.frames.import_options import ImportOptions
from eitskin.skin.eidors import EidorsModel, find_model, read_eidors
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin

UNTOUCHED, TOUCHED = ("vh", "vh.meas"), ("vi", "vi.meas")  # names in EIDORS' tutorials
# The contact impedance of a shunt, in electrode width over sheet conductance; EIDORS divides by the
# impedance, so it must not be 0.
MIN_CONTACT = 1e-4


def save_eidors(
    path: str | Path,
    skin: Skin,
    protocol: Protocol,
    grid: Grid,
    *,
    elements: int = 3000,
    frames: Frames | None = None,
    images_s_per_m: FloatArray | None = None,
) -> tuple[int, int]:
    """Write a .mat file for EIDORS, and return the numbers of nodes and elements.

    It holds ``fmdl`` (the skin on a mesh of about ``elements``), ``img_bkgnd`` (its conductivity),
    ``J`` (m, E) in V/S, and ``c2f`` (E, n), the part of each element that lies in each pixel of
    ``grid``. With ``frames`` it also holds ``vh`` (the mean untouched frame) and ``vi``; with
    ``images_s_per_m`` (frames, n) on the grid it also holds ``img``.

    Raises:
        FileError: the file cannot be written.
        GeometryError, MissingExtraError: as ``mesh_for_elements``.
    """
    from eitskin.fem.cem import ForwardModel
    from eitskin.fem.mesh import mesh_for_elements
    from eitskin.fem.sensitivity import element_sensitivity, element_to_pixel

    mesh, thickness_m = mesh_for_elements(skin, elements), 1e-3 * skin.thickness_mm
    jacobian, _ = element_sensitivity(ForwardModel(mesh, skin, protocol), skin.conductivity_s_per_m)
    shares = element_to_pixel(mesh, grid)
    model = _forward_model(skin, protocol, mesh)
    sheet_s = skin.conductivity_s_per_m * thickness_m
    content: dict[str, Any] = {
        "fmdl": model,
        "img_bkgnd": _image("homogeneous", np.full((mesh.n_elements, 1), sheet_s), model),
        "J": jacobian / thickness_m,
        "c2f": shares.tocsc(),
    }
    if frames is not None:
        content["vh"] = _data("mean untouched frame", frames.reference_v[:, None])
        content["vi"] = _data("frames", frames.voltage_v.T, frames.time_s)
    if images_s_per_m is not None:
        content["img"] = _image("eitskin", shares @ images_s_per_m.T * thickness_m, model)
    _write(path, content)
    return mesh.n_nodes, mesh.n_elements


def with_eidors_defaults(
    path: str | Path, options: ImportOptions, protocol: Protocol | None, n_electrodes: int | None
) -> tuple[ImportOptions, int | None]:
    """Complete ``options`` for a .mat file with an EIDORS model; return them and the number of
    electrodes.

    The table, the current and the gain come from the model, the frames from ``vi`` and the
    reference from ``vh``, unless the user has set them.
    """
    content = read_mat(path)
    if find_model(content) is None:
        return options, n_electrodes
    model, source = read_eidors(path), options.source
    own_table = source.protocol_table is None and options.table_file is None
    if own_table and options.table is None and options.order == "fixed":
        rows = tuple((int(a), int(b), int(c), int(d)) for a, b, c, d in model.rows)
        options = replace(options, table=rows, keep_table=options.keep_table or protocol is None)
    named: dict[str, Any] = {}
    if source.voltage is None:
        named["voltage"] = _named(content, TOUCHED)
    if not (source.reference or source.reference_frames or source.reference_file):
        named["reference"] = _named(content, UNTOUCHED)
    if source.scale is None:
        named["scale"] = 1 / model.gain
    return replace(
        options, source=replace(source, **named), current_a=options.current_a or model.current_a
    ), n_electrodes or len(model.electrode_nodes)


def eidors_images(path: str | Path, name: str, grid: Grid) -> FloatArray:
    """Return the image ``name`` (a struct with elem_data) in a .mat file as conductivities in S/m
    on ``grid``, (images, n). Each element is weighted by the area that it shares with a pixel.

    Raises:
        FileError: the file cannot be read, or holds no forward model.
        FrameError: it holds no such image on the model's elements.
    """
    from eitskin.fem.sensitivity import element_to_pixel

    image, model = read_mat(path).get(name), read_eidors(path)
    values = np.asarray(image.get("elem_data", ()) if isinstance(image, Mapping) else ())
    values = values.reshape(len(values), -1)
    if len(values) != len(model.triangles):
        raise FrameError(
            f"{path}: no image {name!r} with elem_data of the model's {len(model.triangles)}"
            " elements"
        )
    mesh = mesh_of(model)
    shares, area = element_to_pixel(mesh, grid), mesh.areas_mm2
    covered = np.maximum(shares.T @ area, 1e-9)
    return np.asarray(
        (shares.T @ (area[:, None] * values)).T / covered / (1e-3 * model.thickness_mm)
    )


def jacobian_on(model: EidorsModel, grid: Grid) -> FloatArray | None:
    """Return the Jacobian in the file of ``model``, (m, n) in V per S/m on ``grid``, or None if the
    file has none."""
    from eitskin.fem.sensitivity import element_to_pixel

    if model.jacobian is None:
        return None
    shares = element_to_pixel(mesh_of(model), grid)
    return np.asarray(model.jacobian @ shares * (1e-3 * model.thickness_mm / model.gain))


def mesh_of(model: EidorsModel) -> Mesh:
    """Return the triangles of ``model`` in the coordinates of its skin, without electrodes."""
    return Mesh(model.nodes_mm - model.outline()[1], model.triangles, ())


def _named(content: Mapping[str, Any], names: Sequence[str]) -> str | None:
    plain, field = names
    value = content.get(plain)
    if isinstance(value, Mapping):
        return field if "meas" in value else None
    return plain if isinstance(value, np.ndarray) else None


def _forward_model(skin: Skin, protocol: Protocol, mesh: Mesh) -> dict[str, Any]:
    thickness_m, contacts = 1e-3 * skin.thickness_mm, skin.electrodes
    least = MIN_CONTACT * contacts.width_mm * 1e-3 / (skin.conductivity_s_per_m * thickness_m)
    z_ohm_m = max(contacts.contact_impedance_ohm_m2 / thickness_m, least)
    edges = mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    n = mesh.n_nodes
    rim = edges[~np.isin(edges @ [n, 1], edges @ [1, n])]
    return {
        "type": "fwd_model",
        "name": skin.name,
        "nodes": mesh.nodes_mm * 1e-3,
        "elems": mesh.triangles + 1.0,
        "boundary": rim + 1.0,
        "gnd_node": 1.0,
        "electrode": _struct_array(
            [
                {"nodes": np.unique(one)[None] + 1.0, "z_contact": z_ohm_m}
                for one in mesh.electrode_edges
            ]
        ),
        "stimulation": _struct_array(_stimulation(protocol)),
        "solve": "eidors_default",
        "jacobian": "eidors_default",
        "system_mat": "eidors_default",
        "normalize_measurements": 0.0,
        "thickness_mm": skin.thickness_mm,
    }


def _stimulation(protocol: Protocol) -> list[dict[str, Any]]:
    """Return a pattern for each run of rows with the same drive, so that EIDORS orders the data
    like the rows."""
    from scipy.sparse import csc_matrix

    n = protocol.n_electrodes
    listed = []
    for (plus, minus), rows in groupby(
        protocol.drive_measure.astype(int).tolist(), lambda row: (row[0], row[1])
    ):
        drive, pairs = np.zeros((n, 1)), np.array([row[2:] for row in rows])
        drive[[plus, minus], 0] = protocol.current_a, -protocol.current_a
        measure, every = np.zeros((len(pairs), n)), np.arange(len(pairs))
        measure[every, pairs[:, 0]], measure[every, pairs[:, 1]] = 1.0, -1.0
        listed.append(
            {
                "stimulation": "Amp",
                "stim_pattern": csc_matrix(drive),
                "meas_pattern": csc_matrix(measure),
            }
        )
    return listed


def _data(name: str, meas: FloatArray, time_s: FloatArray | None = None) -> dict[str, Any]:
    time = np.array(np.nan) if time_s is None else time_s[None]
    return {"type": "data", "name": name, "meas": meas, "time": time}


def _image(name: str, elem_data: FloatArray, model: dict[str, Any]) -> dict[str, Any]:
    return {"type": "image", "name": name, "elem_data": elem_data, "fwd_model": model}


def _struct_array(values: Sequence[Mapping[str, Any]]) -> AnyArray:
    """Return a 1 x n struct array in the form that scipy writes."""
    array = np.empty((1, len(values)), dtype=[(name, object) for name in values[0]])
    for k, one in enumerate(values):
        array[0, k] = tuple(one.values())
    return array


def _write(path: str | Path, content: dict[str, Any]) -> None:
    from scipy.io import savemat

    with write_beside(path) as temporary:
        savemat(str(temporary), content, appendmat=False, do_compression=True, oned_as="column")
