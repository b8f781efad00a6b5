"""A scene in which a finger presses the places of a plan, one after another, at the pace of a quick
person, to try teaching without a skin."""

from pathlib import Path

import numpy as np

from eitskin.config import load_toml
from eitskin.fileio import read_bytes
from eitskin.scene.description import load_scene
from eitskin.scene.library_scenes import scene_path
from eitskin.skin.skin import Skin
from eitskin.teaching.plan import PressPlan

REST_S, PRESS_S = 0.45, 0.6
RATE_HZ = 40.0
RADIUS_PER_SIZE = 0.04


def practice_scene(skin: Skin, path: Path, plan: PressPlan) -> str:
    """Return the TOML of the scene for ``skin``, whose description is the file ``path``."""
    low_x, low_y, high_x, high_y = skin.outline.bounding_box_mm
    radius = RADIUS_PER_SIZE * max(high_x - low_x, high_y - low_y)
    period = REST_S + PRESS_S
    lines = [
        "[scene]",
        'name = "practice"',
        f'description = "A finger presses {len(plan)} places of a plan."',
        f'skin = "{path.as_posix()}"',
        f"frames = {round((period * len(plan) + REST_S) * RATE_HZ)}",
        f"rate_hz = {RATE_HZ:g}",
        "elements = 3000",
        "",
        "[effects.noise]",
        "snr_db = 60.0",
    ]
    for number, (x, y) in enumerate(plan.place_mm):
        start = REST_S + period * number
        lines += [
            "",
            "[[touch]]",
            f"radius_mm = {radius:.2f}",
            f"x_mm = {x:.2f}",
            f"y_mm = {y:.2f}",
            f"from_s = {start:.3f}",
            f"to_s = {start + PRESS_S:.3f}",
        ]
    return "\n".join(lines) + "\n"


def plan_of_scene(name: str) -> tuple[PressPlan, str]:
    """Return the places that the touches of a scene (a file, or one of the library) press, and the
    text of its skin's description, empty for the paper's skin."""
    path = scene_path(name)
    scene = load_scene(path)
    first = sorted((track.keyframes[0] for track in scene.touches), key=lambda one: one.t_s)
    unknown = np.full(len(first), np.nan)
    plan = PressPlan(
        np.array([(one.x_mm, one.y_mm) for one in first]).reshape(-1, 2), unknown, unknown
    )
    skin = str(load_toml(path, "scene")["scene"].get("skin", "paper"))
    if skin == "paper":
        return plan, ""
    return plan, read_bytes(path.parent / skin, "skin description", 1_000_000).decode("utf-8")
