"""The steps that ``tests/emulated/frames_m7.c`` can run, and the files that list them."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from eitskin.arrays import AnyArray, BoolArray
from eitskin.core.options_table import CHOICES
from eitskin.core.results import Options


@dataclass(frozen=True, eq=False)
class Load:
    """Open a model and start a context; nothing of the last one stays."""

    blob: bytes


@dataclass(frozen=True)
class Choose:
    """Put options in force."""

    options: Options


@dataclass(frozen=True, eq=False)
class Mask:
    """Leave the protocol rows where ``rows`` (m,) is true out of every frame, and use the
    others."""

    rows: BoolArray


@dataclass(frozen=True, eq=False)
class TareStep:
    """Take the reference from untouched frames (k, m), volts, until one is refused; fewer than
    four: each again."""

    untouched_v: AnyArray


@dataclass(frozen=True, eq=False)
class Play:
    """Reconstruct frames (k, m), volts."""

    frames_v: AnyArray


@dataclass(frozen=True, eq=False)
class Solve:
    """The solver alone on reduced data (k, r)."""

    data: AnyArray


@dataclass(frozen=True, eq=False)
class Drives:
    """Play scans (k, m), volts, through the fast path, each drive ``step`` after the last; the
    solver sees what that trusts."""

    scans_v: AnyArray
    step: int


@dataclass(frozen=True)
class Forget:
    """Forget the warm start and the touches that were followed."""


Step = Load | Choose | Mask | TareStep | Play | Solve | Drives | Forget


def write_steps(folder: Path, steps: Sequence[Step], *, portable: bool = False) -> None:
    """Write "script.txt", the models and "frames.f32" into ``folder``."""
    lines, numbers, models = [f"portable {int(portable)}"], [], 0
    for step in steps:
        if isinstance(step, Load):
            (folder / f"model{models}.eitm").write_bytes(step.blob)
            lines.append(f"model model{models}.eitm")
            models += 1
        elif isinstance(step, Choose):
            lines += [*_option_lines(step.options), "choose"]
        elif isinstance(step, Mask):
            lines += [f"mask {row} {int(bad)}" for row, bad in enumerate(step.rows)]
        elif isinstance(step, Forget):
            lines.append("forget")
        else:
            word, values = _numbers_of(step)
            lines.append(
                f"{word} {len(values)}" + (f" {step.step}" if isinstance(step, Drives) else "")
            )
            numbers.append(np.asarray(values).astype("<f4").tobytes())
    (folder / "script.txt").write_text("\n".join(lines) + "\n", encoding="ascii")
    (folder / "frames.f32").write_bytes(b"".join(numbers))


def _numbers_of(step: TareStep | Play | Solve | Drives) -> tuple[str, AnyArray]:
    if isinstance(step, TareStep):
        return "quiet", step.untouched_v
    if isinstance(step, Drives):
        return "drives", step.scans_v
    return ("frames", step.frames_v) if isinstance(step, Play) else ("solve", step.data)


def _option_lines(options: Options) -> list[str]:
    """Reals with the digits that give a float32 again."""
    values = asdict(options)
    values |= {name: known[values[name]] for name, known in CHOICES.items()}
    return [
        f"option {name} {int(value) if isinstance(value, bool) else f'{value:.10g}'}"
        for name, value in values.items()
    ]
