"""The truth of a scene: the touches of each frame, their mask, and the conductivity that was
solved."""

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.arrays import FloatArray, IntArray
from eitskin.errors import UsageError
from eitskin.fem.grid import grid_for
from eitskin.fem.sensitivity import element_to_pixel
from eitskin.frames.paths import Paths
from eitskin.scene.compiler import Compiled, State, background_of
from eitskin.scene.description import Scene
from eitskin.scene.laws import ShortCircuit
from eitskin.scene.random_touches import TrueTouch
from eitskin.scene.touch_path import sample, touches_at
from eitskin.surface.surface_map import SurfaceMap

MAX_CELLS = 500_000_000
LAW_PIECES = 16  # straight lines between two keyframes, for a nonlinear law


def truth_of(compiled: Compiled, pixels: int = 64) -> dict[str, Any]:
    """Return the truth fields of ``Frames`` for the recorded frames, rastered with ``pixels`` along
    the longer side (0: no rasters).

    Raises:
        UsageError: the rasters would be too large.
    """
    numbers, states = _states_at_truth(compiled)
    flat = [(frame, t) for frame, k in enumerate(numbers) for t in states[k].touches]
    contrast = np.array([t.contrast for _, t in flat], dtype=np.float64)
    masks = conductivity = extent = None
    if pixels:
        masks, conductivity, extent = _rasters(compiled, numbers, states, pixels)
    places = np.array([(t.x_mm, t.y_mm) for _, t in flat], dtype=np.float64)
    return {
        "touch_frame": np.array([frame for frame, _ in flat], dtype=np.int64),
        "touch_xy_mm": places.reshape(-1, 2),
        "touch_radius_mm": np.array([t.radius_mm for _, t in flat], dtype=np.float64),
        "touch_strength": contrast - 1.0,
        "touch_sign": np.sign(contrast - 1.0).astype(np.int8),
        "truth_mask": masks,
        "truth_mask_extent_mm": extent,
        "truth_conductivity_s_per_m": conductivity,
        "paths": _paths(compiled.scene) if compiled.mixes else None,
    }


def _paths(scene: Scene) -> Paths | None:
    """Return the paths of all touches from the beginning of the first frame to the end of the
    last."""
    end_s, points = scene.frames / scene.rate_hz, []
    for number, track in enumerate(scene.touches):
        keys = track.keyframes
        times = [np.clip(key.t_s, 0, end_s) for key in keys]
        times += [end_s] if track.hold else []
        if len(set(times)) < 2:
            continue
        pieces = 1 if isinstance(track.law, ShortCircuit) else LAW_PIECES
        bounds = np.unique(times)
        fine = np.arange(pieces * (len(bounds) - 1) + 1) / pieces
        at = np.interp(fine, np.arange(len(bounds)), bounds)
        ways = sample(track, at)
        own = [np.full(len(at), number), at, ways.x_mm, ways.y_mm]
        points.append(np.column_stack([*own, ways.radius_mm, ways.contrast - 1.0]))
    if not points:
        return None
    flat = np.concatenate(points)
    return Paths(flat[:, 0].astype(np.int64), flat[:, 1], flat[:, 2:4], flat[:, 4], flat[:, 5])


def _states_at_truth(compiled: Compiled) -> tuple[IntArray, list[State]]:
    """Return the state of each recorded frame at the instant of its truth (n,), and the states.
    States of frames in which touches move are not solved."""
    scene, states = compiled.scene, list(compiled.states)
    numbers, samples = compiled.state_of_frame.copy(), scene.samples()
    for place in np.flatnonzero(numbers < 0):
        frame = int(place) + compiled.frames.start
        touches = touches_at(samples, frame - scene.quiet_frames)
        numbers[place] = len(states)
        states.append(
            replace(states[0], touches=touches, change=compiled.table.change(touches), frame=frame)
        )
    return numbers[scene.quiet_frames :], states


def mask_of(
    touches: tuple[TrueTouch, ...],
    x_mm: FloatArray,
    y_mm: FloatArray,
    surface: SurfaceMap | None = None,
) -> npt.NDArray[np.int8]:
    """Return +1 where the centres (h, w) lie in a conductive touch, -1 in a resistive one,
    otherwise 0. On a ``surface`` the centres are those of its flattened copy, and a touch has there
    its true size over the scale at its middle."""
    mask = np.zeros(x_mm.shape, dtype=np.int8)
    for touch in touches:
        scale = 1.0 if surface is None else float(surface.at([[touch.x_mm, touch.y_mm]]).scale[0])
        inside = touch.covers(scale * (x_mm - touch.x_mm), scale * (y_mm - touch.y_mm))
        mask[inside] = 1 if touch.contrast > 1 else -1
    return mask


def _rasters(
    compiled: Compiled, numbers: IntArray, states: list[State], pixels: int
) -> tuple[npt.NDArray[np.int8], npt.NDArray[np.float32], tuple[float, float, float, float]]:
    grid, mesh = grid_for(compiled.skin.outline, pixels), compiled.model.mesh
    if len(numbers) * grid.nx * grid.ny > MAX_CELLS:
        raise UsageError(
            f"truth of {len(numbers)} frames with {grid.nx} x {grid.ny} cells each is over"
            f" {MAX_CELLS} cells; use fewer --truth-pixels, or 0 for none"
        )
    x0, y0 = grid.origin_mm
    x_mm, y_mm = np.meshgrid(
        x0 + (np.arange(grid.nx) + 0.5) * grid.pixel_mm,
        y0 + (np.arange(grid.ny) + 0.5) * grid.pixel_mm,
    )
    share: Any = element_to_pixel(mesh, grid).multiply(mesh.areas_mm2[:, None]).T
    total = np.asarray(share.sum(axis=1)).ravel()
    used, which = np.unique(numbers, return_inverse=True)
    background = background_of(compiled)
    masks = np.zeros((len(used), grid.ny, grid.nx), dtype=np.int8)
    images = np.zeros((len(used), grid.ny, grid.nx), dtype=np.float32)
    for k, state in enumerate(states[number] for number in used):
        masks[k] = mask_of(state.touches, x_mm, y_mm, compiled.skin.surface)
        conductivity = background(state).copy()
        conductivity[state.change.elements] *= state.change.mean
        values = share @ conductivity / np.where(total > 0, total, np.nan)
        images[k] = grid.image(values)
    extent = (x0, y0, x0 + grid.nx * grid.pixel_mm, y0 + grid.ny * grid.pixel_mm)
    return masks[which], images[which], extent
