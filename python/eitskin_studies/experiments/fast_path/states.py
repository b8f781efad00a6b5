"""Skins whose contacts were drawn, with drawn places on them, and what a scan measures there while
touches land, move and lift: scenes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.model.model import Model
from eitskin.scene.compiler import compile_scene
from eitskin.scene.description import Scene, scene_from_table
from eitskin.scene.runner import simulate_frames
from eitskin.scene.session import MeshCache
from eitskin.skin.protocol import in_order
from eitskin_studies.experiments.fast_path.scans import ROW_S, STEP

FloatArray = npt.NDArray[np.float64]
Keyframes = Sequence[tuple[float, float, float, float]]

ELEMENTS = 7000
RADIUS_MM, CONTRAST = 8.0, 5.0
REACH = 0.83  # of the skin's radius: where touches are
CONTACT_SPREAD = 0.3
SKINS = 4  # contacts are drawn again for each part of the touches
_MESHES = MeshCache()


class States:
    """``places`` (n, k, 2) of n presses, swipes (from, to) or pairs; ``v0`` (n, m) of their
    skins."""

    def __init__(
        self, places: FloatArray, seeds: Sequence[int], n_rows: int, elements: int
    ) -> None:
        self.places, self._seeds, self._elements = places, seeds, elements
        self._rate_hz = 1 / (ROW_S * n_rows)
        untouched = {seed: self._simulated(seed, (), 1)[0] for seed in set(seeds)}
        self.v0 = np.array([untouched[seed] for seed in seeds])

    def volts(self, k: int, paths: Sequence[Keyframes], frames: int) -> FloatArray:
        """Rows (t,) in V of ``frames`` scans of skin ``k`` in the order of their times; of each
        touch ``paths`` has keyframes (s, mm, mm, press), the last held where it is at infinity."""
        return self._simulated(self._seeds[k], paths, frames)[1:].ravel()

    def _simulated(self, seed: int, paths: Sequence[Keyframes], frames: int) -> FloatArray:
        """An untouched frame as the protocol stands, then ``frames`` scans in their order."""
        scene = self._scene(seed, paths, frames)
        volts = simulate_frames(compile_scene(scene, mesh_cache=_MESHES)).voltage_v
        volts[1:] = volts[1:, scene.protocol.scan_rows]
        return volts

    def _scene(self, seed: int, paths: Sequence[Keyframes], frames: int) -> Scene:
        head = {"seed": seed, "elements": self._elements, "quiet_frames": 1, "frames": frames,
                "rate_hz": self._rate_hz}  # fmt: skip
        touches = [_touch(path) for path in paths]
        effects = {"contact_impedance": {"spread": CONTACT_SPREAD}}
        table = {"scene": head, "touch": touches, "effects": effects}
        scene = scene_from_table(table, "fast path", Path())
        return replace(scene, protocol=in_order(scene.protocol, f"by {STEP}"))


def _touch(path: Keyframes) -> dict[str, Any]:
    keys = [
        {"t_s": t_s, "x_mm": x_mm, "y_mm": y_mm, "press": press}
        for t_s, x_mm, y_mm, press in path
        if np.isfinite(t_s)
    ]
    held = len(keys) < len(path)
    return {"radius_mm": RADIUS_MM, "contrast": CONTRAST, "hold": held, "path": keys}


def _place(model: Model, rng: np.random.Generator) -> FloatArray:
    x0, _, x1, _ = model.skin.outline.bounding_box_mm
    radius, angle = REACH * (x1 - x0) / 2 * np.sqrt(rng.uniform()), rng.uniform(0, 2 * np.pi)
    return np.array([radius * np.cos(angle), radius * np.sin(angle)])


def _places(model: Model, rng: np.random.Generator, kind: str) -> FloatArray:
    least_mm = {"presses": 0.0, "pairs": 35.0, "swipes": 70.0}[kind]
    while True:
        places = np.array([_place(model, rng) for _ in range(1 if kind == "presses" else 2)])
        if np.hypot(*(places[0] - places[-1])) >= least_mm:
            return places


def draw_states(model: Model, kind: str, count: int, seed: int, elements: int) -> States:
    """``count`` "presses", "swipes" (at least 70 mm long) or "pairs" (at least 35 mm apart)."""
    rng = np.random.default_rng([seed, ("presses", "swipes", "pairs").index(kind)])
    places = np.array([_places(model, rng, kind) for _ in range(count)])
    skins = rng.integers(2**32, size=min(SKINS, count)).tolist()
    seeds = [skins[k * len(skins) // count] for k in range(count)]
    return States(places, seeds, model.protocol.n_rows, elements)
