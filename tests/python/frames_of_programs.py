"""Frames that tests/emulated/frames_m7.c solves on any processor, and what the host gives for
them."""

import zlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from eitskin.core.engine import CoreEngine
from eitskin.model.options import default_options
from eitskin.model.prebuilt import load_prebuilt
from eitskin_emulator.core_on_qemu import run_steps
from eitskin_emulator.core_steps import Choose, Load, Play, Step, TareStep
from printed_touches import printed_touches
from small_models import session


def assert_the_bits_of_the_host(
    program: Path, folder: Path, emulator: Sequence[str], kernels: str = "portable", most: int = 10
) -> None:
    """Up to ten frames of up to three touches by three solvers, cold and warm, tracked, with an
    electrode lost and with no touch: solve, touches, their test and tracks."""
    model, blob = load_prebuilt()
    random = session()
    frames = np.concatenate([random.frames_v[:8], random.frames_v[:2]])
    frames[2, (model.protocol.drive_measure == 6).any(axis=1)] = np.nan
    frames[3] = random.untouched_v.mean(axis=0)
    frames = frames[:most]
    usual = default_options(model)
    ways = [
        usual,
        replace(usual, solver="active-set", sign="both", second_pass=True),
        replace(usual, solver="working-set", warm_start=True),
    ]
    steps: list[Step] = []
    expected = []
    for options in ways:
        steps += [Load(blob), Choose(options), TareStep(random.untouched_v[:16]), Play(frames)]
        host = CoreEngine(blob)
        host.set_options(options)
        host.set_reference(random.untouched_v[:16].astype(np.float32).astype(np.float64))
        results = [host.reconstruct(frame.astype(np.float32)) for frame in frames]
        expected += [
            (zlib.crc32(r.solver_image.tobytes()), printed_touches(r.touches)) for r in results
        ]
    done = run_steps(program, folder, steps, emulator=emulator)
    assert done.kernels == kernels
    assert [(frame.image_crc, frame.touches) for frame in done.frames] == expected
    assert sum(touches[0] != "0" for _, touches in expected) > len(expected) // 2
