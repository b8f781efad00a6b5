"""Helpers for the tests of scenes: small scenes, effects that a test makes, and the command line
with the commands for scenes only."""

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from eitskin.cli import cmd_scene
from eitskin.scene.description import Scene
from eitskin.scene.effect import EffectCost, EffectSession, Stage, VoltageStep
from eitskin.scene.touch_path import Keyframe, TouchTrack, always

ELEMENTS = 600


def still_scene(frames: int = 3, **changes: Any) -> Scene:
    """A touch that stays; a coarse mesh."""
    given = {
        "touches": (always(-30, 20, 10),),
        "frames": frames,
        "quiet_frames": 2,
        "elements": ELEMENTS,
    }
    return Scene("still", **{**given, **changes})


def moving_scene(frames: int = 8, **changes: Any) -> Scene:
    """A touch that crosses the skin, passing an electrode's neighbourhood; a coarse mesh."""
    end = (frames - 1) / 20.0
    path = (Keyframe(0.0, -80, 0, 10), Keyframe(end, 60, 30, 10))
    given = {
        "touches": (TouchTrack(path),), "frames": frames, "quiet_frames": 2, "elements": ELEMENTS,
    }  # fmt: skip
    return Scene("moving", **{**given, **changes})


@dataclass(frozen=True)
class Offset:
    offset_v: float = 0.001


def effect_module(
    name: str,
    make: Callable[[Any, EffectSession], Any] | None = None,
    stage: Stage = Stage.FRONT_END,
) -> str:
    """Put a module with the effect ``name`` into sys.modules, and return its name there."""

    def add_offset(parameters: Offset, session: EffectSession) -> VoltageStep:
        return VoltageStep(
            name, stage, EffectCost(), "adds", lambda v, time_s, frame: v + parameters.offset_v
        )

    module = ModuleType(f"effects_of_tests_{name}")
    vars(module).update(
        NAME=name, STAGE=stage, ORDER=50, SUMMARY="adds", Parameters=Offset,
        make=make or add_offset,
    )  # fmt: skip
    sys.modules[module.__name__] = module
    return module.__name__


def scene_command(*arguments: str) -> int:
    parser = argparse.ArgumentParser()
    cmd_scene.add_options(parser)
    options = parser.parse_args(arguments)
    return int(options.run(options))
