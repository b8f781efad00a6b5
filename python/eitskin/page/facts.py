"""The messages to the page: the session's facts once, and each frame in binary.

A frame is one binary message of the WebSocket, little-endian:

======  ==========================================================
bytes   what
======  ==========================================================
0 - 3   "EVF1"
4 - 7   u32, which frame it is for the page; it answers with it
8 - 11  u32 n, pixels of the image; 0: none
12- 15  u32 m, rows of raw voltages; 0: none
4 n     float32, S/m, on the pixels that ``setup`` names
4 m     float32, V, NaN where a row cannot be used
rest    UTF-8: the frame's message (message.schema.json) without the two above
======  ==========================================================

All else is text, a JSON object with a ``type``: to the page ``setup``, ``surface``, ``state``,
``notice``, ``page``, ``teach`` and ``answer``; from it ``hello``, ``drawn`` and ``do``
(docs/guide/live-view.md).
"""

import json
import struct
from dataclasses import asdict
from typing import Any

import numpy as np

from eitskin import __version__
from eitskin.device.wire.link_table import Stream
from eitskin.kinematics.pose import IDENTITY, Pose
from eitskin.session.frame import Frame
from eitskin.session.message import encoded
from eitskin.session.robot_session import AnySession
from eitskin.session.session import Session
from eitskin.session.settings import KINDS
from eitskin.surface.surface_map import SurfaceMap

MAGIC = b"EVF1"
HEAD = struct.Struct("<4sIII")


def text_of(kind: str, /, **facts: Any) -> str:
    """Return the text of a message that is not a frame."""
    return json.dumps({"type": kind} | facts, separators=(",", ":"), allow_nan=False)


def frame_bytes(number: int, frame: Frame) -> bytes:
    """A frame for the page."""
    image, volts, message = frame.image, frame.voltage_v, frame.message(arrays=False)
    pixels = b"" if image is None else np.ascontiguousarray(image, "<f4").tobytes()
    rows = b"" if volts is None else np.ascontiguousarray(volts, "<f4").tobytes()
    head = HEAD.pack(MAGIC, number, len(pixels) // 4, len(rows) // 4)
    return b"".join((head, pixels, rows, encoded(message).encode()))


def setup_text(whole: AnySession, may_command: bool, length_s: float | None = None) -> str:
    """Return the facts that do not change from frame to frame: those of the first skin, and
    ``skins`` with what differs from skin to skin; ``length_s`` of a recording."""
    session = next(iter(whole.parts.values()))
    board, how, solver = session.device.board, session.settings, session.solver
    mean_v = None if session.reference is None else session.reference.mean_v
    facts: dict[str, Any] = {
        "eitskin": __version__,
        "url": whole.url,
        "board": board.board,
        "serial": board.serial,
        "name": (session.given_name or "") if whole.source else whole.name,
        "replays": whole.replays,
        "timed": whole.timed,
        "length_s": length_s,
        "electrodes": board.n_electrodes,
        "frame_us": board.frame_us,
        "may_command": may_command,
        "mode": [kind for kind in KINDS if session.mode & Stream[kind.upper()]],
        "speed": whole.pacer.speed,
        "paused": whole.pacer.paused,
        "has_truth": session.observer is not None,
        "can_undo_tare": session.device.can_undo_tare,
        "reference_v": None if mean_v is None else mean_v.tolist(),
        "sign": None if solver is None else solver.sign,
        "iterations": None if solver is None else solver.iterations,
        "preset": "" if how.preset is None else how.preset.name,
        "recording": _recording(whole),
        "model_crc": f"{board.model_crc:08x}",
        "zones": [asdict(zone) for zone in how.zones],
        "skin": _skin(session),
        "skins": [_one(name, part, whole.bases.get(name)) for name, part in whole.parts.items()],
    }
    return text_of("setup", **facts)


def _recording(whole: AnySession) -> str | None:
    """The name of the file, or of a robot's folder, that is being recorded to."""
    if isinstance(whole, Session):
        return None if whole.recorder is None else whole.recorder.path.name
    return None if whole.folder is None else whole.folder.name


def _one(name: str, session: Session, base: Pose | None) -> dict[str, Any]:
    """Return the facts that differ from skin to skin. ``pose`` and ``link_pose`` are 4 by 4: the
    poses of the skin's drawing and of its link in the robot's frame."""
    placement, link = session.placement, base or IDENTITY
    pose = link if placement is None else link @ placement.pose
    return {
        "source": name,
        "url": session.url,
        "link": None if placement is None else placement.link,
        "pose": pose.matrix().tolist(),
        "link_pose": link.matrix().tolist(),
        "mode": [kind for kind in KINDS if session.mode & Stream[kind.upper()]],
        "has_truth": session.observer is not None,
        "finger_mm": session.capabilities.finger_mm,
        "skin": _skin(session),
    }


def surface_of(session: Session) -> SurfaceMap | None:
    """The surface that a session's skin covers; None for a flat skin."""
    return None if session.known is None else session.known.model.surface


def surface_text(source: str, surface: SurfaceMap | None) -> str:
    """The surface of a skin, in the frame that ``pose`` maps, with the place of each of its
    vertices in the skin's drawing. It is large, so that a page gets it once and not with each
    ``setup``."""
    facts = None
    if surface is not None:
        facts = {
            "flat_mm": _rounded(surface.flat_mm),
            "points_m": np.round(surface.points_m(), 6).tolist(),
            "triangles": surface.triangles.tolist(),
        }
    return text_of("surface", source=source, surface=facts)


def _skin(session: Session) -> dict[str, Any] | None:
    """Outline, electrodes and pixels; None where the board's model is not known here, or does not
    describe its skin in a way that can be read."""
    if session.known is None:
        return None
    model = session.known.model
    skin, grid = model.known_skin, model.grid
    if skin is None:
        return None
    spans = [
        skin.outline.points_at(np.linspace(start, end, 5))
        for start, end in skin.electrode_spans_mm()
    ]
    cells = grid.index[:, 1] * grid.nx + grid.index[:, 0]
    return {
        "name": skin.name,
        "outline_mm": _rounded(skin.outline.vertices_mm),
        "electrode_spans_mm": [_rounded(span) for span in spans],
        "electrode_centres_mm": _rounded(skin.electrode_centres_mm()),
        "nx": grid.nx,
        "ny": grid.ny,
        "pixel_mm": grid.pixel_mm,
        "origin_mm": list(grid.origin_mm),
        "cells": cells.tolist(),
        "conductivity_s_per_m": skin.conductivity_s_per_m,
    }


def _rounded(points: Any) -> list[Any]:
    rounded: list[Any] = np.round(np.asarray(points, dtype=np.float64), 3).tolist()
    return rounded
