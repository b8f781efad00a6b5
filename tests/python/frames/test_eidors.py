"""Models, frames and images to EIDORS and back; Octave reads, solves and writes them."""

import shutil
import subprocess
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import loadmat, savemat
from scipy.sparse import csc_matrix

from eitskin.cli.main import main
from eitskin.errors import EitskinError
from eitskin.fem.cem import ForwardModel
from eitskin.fem.mesh import mesh_for_elements
from eitskin.frames.eidors import eidors_images, jacobian_on
from eitskin.frames.frames import Frames, load_frames, save_frames
from eitskin.model.build import Linearisation, _golden_frame
from eitskin.model.eitm import load_model
from eitskin.model.prebuilt import load_prebuilt
from eitskin.skin.eidors import read_eidors
from eitskin.skin.skin import load_skin

MODEL = load_prebuilt()[0]
STEPS = 12


@pytest.fixture(scope="module")
def exported(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("eidors")
    golden = MODEL.golden
    still, pressed = (np.array([v], dtype=float) for v in (golden.reference_v, golden.frame_v))
    frames = Frames(MODEL.protocol, np.repeat(pressed, 2, axis=0), np.repeat(still, 8, axis=0))
    save_frames(folder / "frames.npz", frames)
    assert main(["export", str(folder / "frames.npz"), "-o", str(folder / "ours.mat")]) == 0
    return folder / "ours.mat"


def imported(path: Path, *words: str) -> Frames:
    out = path.with_suffix(".npz")
    assert main(["import", str(path), "-o", str(out), *words]) == 0
    return load_frames(out)


def test_the_fields_are_eidors_own(exported):
    content = loadmat(exported, simplify_cells=True)
    fmdl, rows = content["fmdl"], MODEL.protocol.drive_measure.astype(int)
    assert fmdl["type"] == "fwd_model" and content["vi"]["type"] == "data"
    assert fmdl["elems"].min() == 1 and fmdl["elems"].max() == len(fmdl["nodes"])
    assert np.abs(np.linalg.norm(fmdl["nodes"], axis=1).max() - 0.097) < 1e-6
    drives = [one["stim_pattern"].toarray().ravel() for one in fmdl["stimulation"]]
    assert all(d[k] == 1e-3 and d[(k + 1) % 16] == -1e-3 for k, d in enumerate(drives))
    patterns = np.vstack([one["meas_pattern"].toarray() for one in fmdl["stimulation"]])
    assert (patterns[np.arange(208), rows[:, 2]] == 1).all()
    assert (patterns[np.arange(208), rows[:, 3]] == -1).all()
    assert np.allclose([e["z_contact"] for e in fmdl["electrode"]], 0.01 / 0.012)
    assert content["vi"]["meas"].shape == (208, 2) and content["vh"]["meas"].shape == (208,)
    assert content["J"].shape == (208, len(fmdl["elems"]))
    assert content["img"]["elem_data"].shape == (len(fmdl["elems"]), 2)


def test_what_was_exported_comes_back(exported):
    ours, (skin, protocol) = MODEL.skin, load_skin(exported)
    assert protocol.hash == MODEL.protocol.hash and protocol.current_a == 1e-3
    assert np.isclose(skin.outline.diameter_mm or 0, 194, rtol=1e-6)
    assert np.abs(skin.electrode_centres_mm() - ours.electrode_centres_mm()).max() < 0.01
    assert np.isclose(skin.electrodes.width_mm, 4, rtol=1e-3)
    assert np.isclose(skin.conductivity_s_per_m, 0.01) and skin.thickness_mm == 12
    assert np.isclose(skin.electrodes.contact_impedance_ohm_m2, 0.01)
    frames = imported(exported)
    assert frames.protocol.hash == MODEL.protocol.hash and frames.meta["unit"] == "V"
    assert np.array_equal(frames.voltage_v[1], MODEL.golden.frame_v.astype(float))
    image = eidors_images(exported, "img", MODEL.grid)[1]
    assert np.corrcoef(image, MODEL.golden.image)[0, 1] > 0.8  # the mesh blurs by an element
    assert np.isclose(image.sum(), MODEL.golden.image.sum(), rtol=0.05)
    jacobian = jacobian_on(read_eidors(exported), MODEL.grid)
    assert jacobian is not None
    change = MODEL.golden.frame_v.astype(float) - MODEL.golden.reference_v
    predicted = jacobian @ np.asarray(MODEL.golden.image, dtype=float)
    assert np.corrcoef(predicted, change)[0, 1] > 0.99


@cache
def square() -> dict[str, Any]:
    """A sheet of .1 m, contacts clockwise from the top, patterns as stim_meas_list makes them."""
    line = np.linspace(0, 0.1, STEPS + 1)
    nodes = np.array([(x, y) for y in line for x in line])
    low = np.array([k + j * (STEPS + 1) for j in range(STEPS) for k in range(STEPS)])
    up = low + STEPS + 1
    elems = np.vstack([np.column_stack([low, up, low + 1]), np.column_stack([low + 1, up, up + 1])])
    elems[::3] = elems[::3, ::-1]  # either way round
    top, right = STEPS * (STEPS + 1), STEPS
    pairs = [top + 3, top + 8, top - 1 - 3 * 13, top - 1 - 8 * 13, right - 3, right - 8, 39, 104]
    steps = [1, 1, -13, -13, -1, -1, 13, 13]
    electrode = np.array(
        [(np.array([[a, a + s]]) + 1.0, 0.01) for a, s in zip(pairs, steps, strict=True)],
        dtype=[("nodes", object), ("z_contact", object)],
    )[None]
    stimulation = np.empty(
        (1, 8), dtype=[(n, object) for n in ("stimulation", "stim_pattern", "meas_pattern")]
    )
    for d in range(8):
        drive, measure = np.zeros((8, 1)), np.zeros((5, 8))
        drive[[d, (d + 1) % 8], 0] = -0.01, 0.01
        for row, k in enumerate(range(d + 2, d + 7)):
            measure[row, [k % 8, (k + 1) % 8]] = -2.0, 2.0
        unit, factor = ("mA", 1e3) if d == 3 else ("Amp", 1)  # older versions count in mA
        stimulation[0, d] = (unit, csc_matrix(factor * drive), measure)
    return {
        "type": "fwd_model",
        "name": "square",
        "nodes": nodes,
        "elems": elems + 1.0,
        "electrode": electrode,
        "stimulation": stimulation,
    }


def foreign(path: Path, model: dict[str, Any], **more: Any) -> Path:
    savemat(
        path,
        {"imdl": {"type": "inv_model", "jacobian_bkgnd": {"value": 0.5}, "fwd_model": model}}
        | more,
    )
    return path


def test_a_model_that_eidors_made(tmp_path):
    data = np.arange(80.0).reshape(40, 2)
    path = foreign(tmp_path / "a.mat", square(), vh=data[:, :1], vi={"type": "data", "meas": data})
    skin, protocol = load_skin(path)
    assert skin.electrodes.clockwise and skin.outline.diameter_mm is None
    assert np.isclose(skin.outline.area_mm2, 1e4) and np.isclose(skin.electrodes.width_mm, 100 / 12)
    assert np.allclose(skin.electrode_centres_mm()[0], [3.5 * 100 / 12, 100])
    assert skin.conductivity_s_per_m == 0.5 and protocol.current_a == 0.01
    assert protocol.drive_measure[0].tolist() == [1, 0, 3, 2]
    frames = imported(path)
    assert np.allclose(frames.voltage_v, data.T / 2)  # the patterns' gain is 2
    assert frames.protocol.hash == protocol.hash and frames.protocol.current_a == 0.01


def test_a_model_of_their_jacobian(tmp_path):
    theirs = np.random.default_rng(1).normal(size=(40, 2 * STEPS**2))
    path, out = foreign(tmp_path / "a.mat", square(), J=theirs), tmp_path / "m.eitm"
    assert main(["model", "build", str(path), "-o", str(out), "--samples", "0"]) == 0
    assert main(["model", "verify", str(out)]) == 0
    model, _ = load_model(out)
    jacobian, v0 = (
        jacobian_on(read_eidors(path), model.grid),
        model.golden.reference_v.astype(float),
    )
    assert jacobian is not None and np.ptp(jacobian) > 0
    golden = _golden_frame(model.skin, Linearisation(model.grid, jacobian, v0, 0))
    assert np.allclose(model.golden.frame_v, golden, rtol=1e-4)


def tetrahedra(model: dict[str, Any]) -> None:
    model["nodes"] = np.column_stack([model["nodes"], np.zeros(len(model["nodes"]))])


def inner(model: dict[str, Any]) -> None:
    model["electrode"] = model["electrode"].copy()
    model["electrode"][0, 2] = (np.array([[30.0, 31.0]]), 0.01)


def trigonometric(model: dict[str, Any]) -> None:
    model["stimulation"] = model["stimulation"].copy()
    model["stimulation"][0, 1] = ("Amp", np.cos(np.arange(8.0))[:, None], np.zeros((1, 8)))


def stronger(model: dict[str, Any]) -> None:
    model["stimulation"] = model["stimulation"].copy()
    name, drive, measure = model["stimulation"][0, 0]
    model["stimulation"][0, 0] = (name, 3 * drive, measure)


def torn(model: dict[str, Any]) -> None:
    model["elems"] = np.delete(model["elems"], [66, 67, 210], axis=0)


REFUSED: list[tuple[Callable[[dict[str, Any]], Any], str]] = [
    (tetrahedra, "a skin is a sheet of triangles"),
    (inner, "electrode 3 is not on the rim"),
    (trigonometric, "stim_pattern 2 (from 1) uses 8 electrodes"),
    (stronger, "currents of 0.01 to 0.03"),
    (torn, "more than one rim"),
    (lambda model: model.update(elems=model["elems"] + 99), "missing or has another form"),
    (lambda model: model.pop("stimulation"), "no EIDORS model"),
]


@pytest.mark.parametrize(("spoil", "said"), REFUSED, ids=[said for _, said in REFUSED])
def test_what_is_no_skin_is_refused(spoil, said, tmp_path):
    model = dict(square())
    spoil(model)
    with pytest.raises(EitskinError) as refused:
        load_skin(foreign(tmp_path / "a.mat", model))
    assert said in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.long("the other tests of the file, by scipy; Octave takes a minute to install")
def test_octave_solves_what_we_export_and_we_import_what_it_saves(exported, tmp_path):
    octave, theirs = shutil.which("octave-cli"), tmp_path / "theirs.mat"
    assert octave, "octave-cli is not installed: apt-get install octave"
    script = Path(__file__).with_name("eidors_forward.m")
    words = [octave, "--norc", str(script), str(exported), str(theirs)]
    subprocess.run(words, check=True, timeout=300, capture_output=True)
    content, ours = loadmat(theirs), loadmat(exported)
    frames = imported(theirs)
    forward = ForwardModel(mesh_for_elements(MODEL.skin), MODEL.skin, MODEL.protocol)
    voltages = forward.voltages(MODEL.skin.conductivity_s_per_m)
    assert np.allclose(frames.reference_v, voltages, rtol=1e-9, atol=0)
    column = ours["J"][:, 699]
    assert np.abs(content["slope"].ravel() - column).max() < 1e-3 * np.abs(column).max()
    answer = (frames.voltage_v[0] - frames.reference_v, content["linear"].ravel())
    assert np.corrcoef(*answer)[0, 1] > 0.99  # the image is too strong for more
    even = eidors_images(theirs, "theirs", MODEL.grid) * 0.012
    assert np.isclose(np.median(even), 1, atol=1e-6) and even.max() < 1 + 1e-6
