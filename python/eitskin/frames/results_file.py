"""Results as a file: images, touches and solver info of each frame, with names and units
(docs/reference/frames-format.md)."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.core.results import Reconstruction
from eitskin.fileio import write_beside
from eitskin.frames.frames import Frames
from eitskin.model.model import Model

FORMAT = "eitskin-results"
VERSION = 2


def save_results(
    path: str | Path, model: Model, frames: Frames, results: dict[int, Reconstruction]
) -> None:
    """Write the ``results``, by frame number, to ``path`` (.npz), completely or not at all."""
    numbers = sorted(results)
    touches = [(number, touch) for number in numbers for touch in results[number].touches]
    grid = model.grid
    images = [grid.image(results[number].image) for number in numbers]
    solved = [grid.image(results[number].solver_image) for number in numbers]
    fields: dict[str, Any] = {
        "format": np.array(FORMAT),
        "version": np.array(VERSION, dtype=np.int32),
        "frame": np.array(numbers, dtype=np.int64),
        "frame_name": np.array([frames.frame_name[number] for number in numbers], dtype=np.str_),
        "image_s_per_m": np.array(images).reshape(len(numbers), grid.ny, grid.nx),
        "image_is": np.array([results[number].image_is for number in numbers], dtype=np.str_),
        "solver_image_s_per_m": np.array(solved).reshape(len(numbers), grid.ny, grid.nx),
        "pixel_mm": np.array(grid.pixel_mm),
        "image_origin_mm": np.array(grid.origin_mm),
        "touch_frame": np.array([number for number, _ in touches], dtype=np.int64),
        "touch_id": np.array([touch.id for _, touch in touches], dtype=np.int64),
        "touch_xy_mm": np.array([(touch.x_mm, touch.y_mm) for _, touch in touches]).reshape(-1, 2),
        "touch_radius_mm": np.array([touch.radius_mm for _, touch in touches]),
        "touch_strength_s_per_m_mm2": np.array(
            [touch.strength_s_per_m_mm2 for _, touch in touches]
        ),
        "touch_explained": np.array([touch.explained for _, touch in touches]),
        "touch_force_n": np.array([touch.force_n for _, touch in touches]),
        "touch_confidence": np.array([touch.confidence for _, touch in touches], dtype=float),
        "touch_place_mm2": np.array(
            [
                (touch.x_variance_mm2, touch.xy_covariance_mm2, touch.y_variance_mm2)
                for _, touch in touches
            ],
            dtype=float,
        ).reshape(-1, 3),
        "touch_long_mm": np.array(
            [(touch.long_x_mm or 0.0, touch.long_y_mm or 0.0) for _, touch in touches]
        ).reshape(-1, 2),
        "touch_radius_sd_mm": np.array([touch.radius_sd_mm for _, touch in touches], dtype=float),
        "info": np.array(json.dumps([results[number].info.as_dict() for number in numbers])),
    }
    with write_beside(path) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, **fields)
