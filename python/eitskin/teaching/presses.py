"""Presses at known places, and the .npz file that holds them (docs/reference/presses-format.md)."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from eitskin.arrays import FloatArray
from eitskin.errors import EitskinError, FrameError
from eitskin.fileio import write_beside
from eitskin.frames.arrays import read_npz
from eitskin.skin.protocol import Protocol, table

FORMAT, VERSION = "eitskin-presses", 1
MAX_PRESSES = 20_000
MAX_BYTES = 400_000_000  # after unpacking
MAX_TEXT = 1_000_000
MAX_MM = 1e5
ARRAYS = {"untouched": 2, "pressed": 2, "place_mm": 2, "drive_measure": 2}
OPTIONAL = {"depth_mm": 1, "force_n": 1, "time_s": 1}
WORDS = ("format", "version", "n_electrodes", "current_a", "skin")


@dataclass(frozen=True, eq=False)
class Presses:
    """n presses with a scan of m rows.

    ``untouched`` and ``pressed`` (n, m) are the frames just before and during each press, in V or
    any other unit. ``place_mm`` (n, 2) is the centre of each press. ``depth_mm`` or ``force_n``
    (n,) is at least 0, or NaN if unknown. ``time_s`` (n,) counts from any start. ``skin`` is the
    text of the skin's description (TOML), or empty.

    Raises:
    FrameError: a shape is wrong, there are no presses or too many, or a number is not valid.
    """

    protocol: Protocol
    untouched: FloatArray
    pressed: FloatArray
    place_mm: FloatArray
    depth_mm: FloatArray | None = None
    force_n: FloatArray | None = None
    time_s: FloatArray | None = None
    skin: str = ""

    def __post_init__(self) -> None:
        count, rows = len(self.place_mm), self.protocol.n_rows
        if not 1 <= count <= MAX_PRESSES:
            raise FrameError(f"presses: {count} presses; record 1 to {MAX_PRESSES}")
        wanted = {"untouched": (count, rows), "pressed": (count, rows), "place_mm": (count, 2)}
        for name in (*wanted, *OPTIONAL):
            given = getattr(self, name)
            if given is None:
                continue
            values, shape = np.array(given, dtype=np.float64), wanted.get(name, (count,))
            if values.shape != shape:
                raise FrameError(
                    f"presses: {name} of shape {values.shape} for {count} places and a protocol of"
                    f" {rows} rows; it must be {shape}"
                )
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        _refuse_numbers(self)

    def __len__(self) -> int:
        return len(self.place_mm)

    @property
    def difference(self) -> FloatArray:
        """Pressed minus untouched frames, (n, m) in V."""
        return np.asarray(self.pressed - self.untouched)

    def take(self, which: npt.ArrayLike) -> "Presses":
        """Return the presses that ``which`` selects, by number or as a mask (n,)."""
        k = np.asarray(which)
        parts: dict[str, Any] = {}
        for name in ("untouched", "pressed", "place_mm", *OPTIONAL):
            given = getattr(self, name)
            parts[name] = None if given is None else given[k]
        return replace(self, **parts)


def _refuse_numbers(presses: Presses) -> None:
    for name in ("untouched", "pressed"):
        finite = np.isfinite(getattr(presses, name))
        dead = np.flatnonzero(~finite.any(axis=0))
        if 0 < len(dead) < finite.shape[1]:
            raise FrameError(
                f"presses: row {dead[0]} (from 0) of {name} is never finite, as {len(dead)} of"
                f" {finite.shape[1]} are not; leave those rows out, of drive_measure too"
            )
        if name == "untouched" and not np.any(presses.untouched[finite.all(axis=1)]):
            raise FrameError(
                "presses: every untouched frame is 0; take the frame just before each press"
            )
        bad = np.flatnonzero(~finite.all(axis=1))
        if len(bad):
            raise FrameError(
                f"presses: press {bad[0]} (from 0) has a number in {name} that is not finite, as"
                f" {len(bad)} of {len(presses)} do; leave those presses out or record them again"
            )
    bad = np.flatnonzero(~(np.abs(presses.place_mm) <= MAX_MM).all(axis=1))
    if len(bad):
        raise FrameError(
            f"presses: press {bad[0]} (from 0) has no place within {MAX_MM:g} mm; give it in mm"
        )
    for name in ("depth_mm", "force_n"):
        given = getattr(presses, name)
        if given is not None and not ((given >= 0) & (given <= 1e6) | np.isnan(given)).all():
            raise FrameError(f"presses: {name} must be 0 to 1e6, or NaN if it is unknown")
    if presses.time_s is not None and not np.isfinite(presses.time_s).all():
        raise FrameError("presses: time_s has a number that is not finite; leave the array out")


def shifted(presses: Presses, by: int) -> Presses:
    """Return each press with the place, depth and force of the press ``by`` later; presses at the
    ends are dropped."""
    count = np.arange(len(presses) - abs(by))
    frames, places = presses.take(count + max(-by, 0)), presses.take(count + max(by, 0))
    return replace(
        frames, place_mm=places.place_mm, depth_mm=places.depth_mm, force_n=places.force_n
    )


def aged(presses: Presses, by: int) -> Presses:
    """Return each press with the untouched frame of the press ``by`` earlier, or, for the first
    ones, ``by`` later. Presses must be in order of time."""
    count = np.arange(len(presses))
    other = np.where(count < by, np.minimum(count + by, count[-1]), count - by)
    return replace(presses, untouched=presses.untouched[other])


def joined(first: Presses, second: Presses) -> Presses:
    """Return the presses of both, one after the other. What only one has becomes NaN for the other;
    times are dropped.

    Raises:
        FrameError: the protocols differ.
    """
    if first.protocol.hash != second.protocol.hash:
        raise FrameError("presses: made with different protocols; teach them separately")
    optional: dict[str, Any] = {"time_s": None}
    for name in ("depth_mm", "force_n"):
        both = [(one, getattr(one, name)) for one in (first, second)]
        if all(given is None for _, given in both):
            continue
        optional[name] = np.concatenate(
            [np.full(len(one), np.nan) if given is None else given for one, given in both]
        )
    stacked: dict[str, Any] = {
        name: np.concatenate([getattr(first, name), getattr(second, name)])
        for name in ("untouched", "pressed", "place_mm")
    }
    return replace(first, **stacked, **optional)


def save_presses(path: str | Path, presses: Presses) -> None:
    """Write the presses to ``path``, completely or not at all.

    Raises:
        FileError: the file cannot be written.
    """
    with write_beside(path) as temporary, temporary.open("wb") as stream:
        write_presses(stream, presses)


def write_presses(stream: IO[bytes], presses: Presses) -> None:
    """Write the presses to an open file."""
    optional = {n: getattr(presses, n) for n in OPTIONAL if getattr(presses, n) is not None}
    np.savez_compressed(
        stream, format=FORMAT, version=VERSION, n_electrodes=presses.protocol.n_electrodes,
        current_a=presses.protocol.current_a, drive_measure=presses.protocol.drive_measure,
        untouched=presses.untouched, pressed=presses.pressed, place_mm=presses.place_mm,
        skin=presses.skin, **optional,
    )  # fmt: skip


def load_presses(path: str | Path) -> Presses:
    """Read the presses in ``path``. A plain .npz with untouched, pressed, place_mm and
    drive_measure is accepted too.

    Raises:
        FileError: the file cannot be read.
        FrameError, ProtocolError: it holds something else; the text names the file.
    """
    wanted = (*ARRAYS, *OPTIONAL, *WORDS)
    found = read_npz(path, "presses file", wanted, MAX_BYTES)
    try:
        return _checked({name: one for name, one in found.items() if name in wanted})
    except EitskinError as error:
        raise type(error)(f"{path}: {error}") from None
    except (ValueError, TypeError, OverflowError) as error:
        raise FrameError(
            f"{path}: an array has the wrong type ({error}); record a file with  eitskin teach"
            " record"
        ) from None


def _checked(found: dict[str, Any]) -> Presses:
    absent = [name for name in ARRAYS if name not in found]
    if absent:
        raise FrameError(
            f"presses: no array {absent[0]!r}; each press needs the untouched frame just before it,"
            " the pressed frame and its place_mm, and the file needs a drive_measure"
            if absent[0] == "untouched"
            else f"presses: no array {absent[0]!r}; see docs/reference/presses-format.md"
        )
    if str(found.get("format", FORMAT)) != FORMAT or found.get("version", VERSION) != VERSION:
        raise FrameError("presses: a file of another kind or version; upgrade eitskin")
    for name, axes in {**ARRAYS, **OPTIONAL}.items():
        if name in found and (found[name].dtype.kind not in "iuf" or found[name].ndim != axes):
            raise FrameError(f"presses: {name} must be numbers on {axes} axes")
    drive_measure = found.pop("drive_measure")
    if drive_measure.size == 0:
        raise FrameError("presses: drive_measure has no rows; give [I+, I-, V+, V-] of each")
    words = [found.pop(name, None) for name in ("n_electrodes", "current_a", "skin")]
    count, current = (None if one is None or one.ndim else one for one in words[:2])
    protocol = table(
        int(drive_measure.max()) + 1 if count is None else int(count),
        drive_measure,
        1e-3 if current is None else float(current),
    )
    skin = "" if words[2] is None else str(words[2])[:MAX_TEXT]
    return Presses(protocol, skin=skin, **{n: found[n] for n in found if n not in WORDS})
