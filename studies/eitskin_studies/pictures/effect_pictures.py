"""One picture per effect: its law on the left, and its change of a frame on the right.

The frame is that of a press on the paper's skin, or on a forearm's if the effect is for skins that
cover a surface; on the right stands the frame with the effect minus the frame without it.
Parameters are chosen to be seen, and stand above the picture. docs/reference/effects/README.md
shows all. ``eitskin draw effect NAME -o PNG`` makes one picture.
"""

import io
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.config import nearest
from eitskin.errors import UsageError
from eitskin.fem.cem import ForwardModel
from eitskin.fem.mesh import mesh_for_elements
from eitskin.fileio import write_beside
from eitskin.scene.compiler import compile_scene
from eitskin.scene.description import scene_from_table
from eitskin.scene.effect import EffectSession
from eitskin.scene.runner import simulate_frames
from eitskin.scene.streams import stream
from eitskin.surface.shapes import make_shape, write_obj
from eitskin.view.pictures import STYLE, load_matplotlib
from eitskin_studies.pictures.effect_sketches import LIGHT, SKETCHES, STRONG

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


DPI = 90
COLOURS = 256
ELEMENTS = 2000
FRAMES = 40
RATE_HZ = 20.0

OF_SURFACES = ("flex",)
FOREARM = """
[skin]
surface = "forearm.obj"
[electrodes]
count = 16
width_mm = 5.0
"""
PRESS = {"x_mm": 30.0, "y_mm": 20.0, "radius_mm": 12.0}
SHOWN: dict[str, dict[str, Any]] = {
    "out_of_round": {"spread": 0.05},
    "misplacement": {"spread_mm": 6.0},
    "stretch": {"strain": 0.1, "at_s": 0.5, "rise_s": 1.0},
    "bend": {"radius_mm": 100.0},
    "flex": {"surface": "flexed_forearm.obj"},
    "creep": {"strain": 0.05, "time_constant_s": 0.5, "until_s": 1.0},
    "background": {"spread": 0.2, "length_mm": 25.0},
    "temperature": {"offset_k": 2.0, "drift_k_per_min": 0.5},
    "gel_drying": {"time_constant_h": 0.01, "final_water": 0.5},
    "sheet_change": {"spread": 0.02, "at_s": 0.5, "rise_s": 1.0},
    "contact_impedance": {"mean_ohm_m2": 0.01, "spread": 0.5},
    "detached": {"electrodes": [5]},
    "bridged": {"electrodes": [2, 4], "resistance_ohm": 100.0},
    "phase": {"frequency_hz": 50e3, "capacitance_f_per_m2": 0.1},
    "source_impedance": {"resistance_ohm": 200e3, "capacitance_pf": 50.0},
    "amplitude_drift": {"slope_per_min": 0.5, "walk_per_sqrt_min": 0.05},
    "crosstalk": {"coupling_db": -40.0},
    "mux": {"settling_us": 40.0, "dwell_us": 100.0},
    "charge_injection": {"charge_pc": 5.0},
    "mains": {"amplitude_v": 0.005, "frequency_hz": 49.0},
    "common_mode": {"cmrr_db": 60.0},
    "channel_gain": {"spread": 0.02},
    "offset": {"spread": 0.02},
    "jitter": {"jitter_ns": 100.0, "samples": 16},
    "noise": {"snr_db": 50.0},
    "rectifier": {"drop_v": 0.0},
    "saturation": {"headroom": 0.5},
    "adc": {"bits": 6},
}
"""The parameters in each picture."""


def draw_effect(path: str | Path, name: str) -> None:
    """The picture of the effect ``name`` as a PNG.

    Raises:
        UsageError: there is no such picture.
        MissingExtraError: matplotlib, scipy or netgen is not installed.
        FileError: the file cannot be written.
    """
    if name not in SKETCHES:
        raise UsageError(f"no picture of an effect {name!r}; {nearest(name, SKETCHES)}")
    matplotlib = load_matplotlib()
    with TemporaryDirectory() as made, matplotlib.rc_context(STYLE):
        folder = Path(made)
        skin = write_forearm(folder) if name in OF_SURFACES else ""
        without, _, _ = press_frames({}, skin=skin, folder=folder)
        frames, parameters, skin_session = press_frames(
            {name: SHOWN[name]}, skin=skin, folder=folder
        )
        figure = matplotlib.figure.Figure(figsize=(8.2, 3.3), layout="compressed")
        left, right = figure.subplots(1, 2)
        SKETCHES[name](left, skin_session, parameters[name])
        draw_difference(right, frames[-1] - without[-1], without[-1])
        table = ", ".join(f"{key} = {value}" for key, value in SHOWN[name].items())
        figure.suptitle(
            f"[effects.{name}]  {table}", fontsize=10, fontweight="bold", family="monospace"
        )
        save_small_png(figure, path)


def write_forearm(folder: Path) -> str:
    """Write a skin on a forearm to ``folder``, with the mesh of its pose, and return its name."""
    for name in ("forearm", "flexed_forearm"):
        write_obj(folder / f"{name}.obj", *make_shape(name))
    (folder / "forearm.toml").write_text(FOREARM)
    return "forearm.toml"


def press_frames(
    effects: dict[str, Any],
    touch: dict[str, Any] | None = None,
    skin: str = "",
    folder: Path = Path(),
) -> tuple[FloatArray, dict[str, Any], EffectSession]:
    """All frames (n, m) of the press, the effects' parameters, and a session to make effects in.
    ``touch`` adds keys to the touch's table, or replaces them. The skin is the paper's, or the one
    whose description is the file ``skin`` in ``folder``."""
    table = {
        "scene": {
            "name": "press",
            "frames": FRAMES,
            "quiet_frames": 2,
            "rate_hz": RATE_HZ,
            "elements": ELEMENTS,
            **({"skin": skin} if skin else {}),
        },
        "touch": [{**PRESS, **(touch or {})}],
        "effects": effects,
    }
    compiled = compile_scene(scene_from_table(table, "the picture's scene", folder))
    scene = compiled.scene

    def exact() -> FloatArray:
        mesh = mesh_for_elements(scene.skin, ELEMENTS)
        return ForwardModel(mesh, scene.skin, scene.protocol, 0.0).voltages(
            scene.skin.conductivity_s_per_m
        )

    session = EffectSession(
        skin=scene.skin,
        protocol=scene.protocol,
        n_frames=scene.n_frames,
        quiet_frames=scene.quiet_frames,
        rate_hz=scene.rate_hz,
        seed=scene.seed,
        build_mesh=lambda: mesh_for_elements(scene.skin, ELEMENTS),
        solve_v0=exact,
        make_stream=lambda name, index: stream(scene.seed, name, index),
        folder=folder,
    )
    return simulate_frames(compiled).voltage_v, compiled.parameters, session


def draw_difference(axes: "Axes", change_v: FloatArray, frame_v: FloatArray) -> None:
    rows = np.arange(len(change_v))
    axes.axhline(0, color=LIGHT, linewidth=0.8)
    axes.plot(rows, 1e3 * change_v, color=STRONG, linewidth=0.9)
    rms, whole = (1e3 * float(np.sqrt(np.mean(v**2))) for v in (change_v, frame_v))
    axes.set(xlabel="row of the scan", ylabel="with - without (mV)", xlim=(0, len(rows) - 1))
    axes.set_title(f"in a frame: rms {rms:.3g} mV of {whole:.3g} mV")


def save_small_png(figure: "Figure", path: str | Path) -> None:
    """With a palette, which takes a third of the bytes (Pillow comes with matplotlib)."""
    from PIL import Image

    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=DPI)
    with Image.open(drawn) as image, write_beside(path) as temporary:
        palette = image.convert("RGB").quantize(
            COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE
        )
        palette.save(temporary, format="png", optimize=True)
