"""The presses of a session on disk, saved as they are made."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.errors import FileError, FrameError
from eitskin.fileio import Claim, followed, write_beside
from eitskin.skin.protocol import Protocol, pattern_name
from eitskin.teaching.plan import PressPlan
from eitskin.teaching.presses import Presses, joined, load_presses, write_presses

SAME_PLACE_MM = 0.02


class PressFile:
    """The file is complete after each press: a session that was killed can continue where it
    stopped. With ``start_again`` the first press overwrites an earlier file. ``following`` is the
    place after the last recorded one. Other recorders are kept out until it is closed.

    Raises:
    FrameError: an earlier file has another protocol, or places that are not in the plan.
    FileError: the file cannot be read or written, or another process records to it.
    """

    def __init__(
        self,
        path: Path,
        plan: PressPlan,
        protocol: Protocol,
        skin: str,
        *,
        start_again: bool = False,
    ) -> None:
        self.path, self.plan, self.protocol, self.skin = path, plan, protocol, skin
        self._claim: Claim | None = None
        self._saved: tuple[int, int, int] | None = None
        self.numbers: list[int] = []
        if path.is_file():
            self._claim = Claim(path)
            self._saved = _version(path)
        try:
            self.presses = load_presses(path) if path.exists() and not start_again else None
            self._find_places()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Let others write the file. It may be called twice."""
        if self._claim is not None:
            self._claim.release()

    def _find_places(self) -> None:
        path, plan, protocol = self.path, self.plan, self.protocol
        if self.presses is None:
            return
        if self.presses.protocol.hash != protocol.hash:
            raise FrameError(
                f"{path}: made with another protocol, {pattern_name(self.presses.protocol)}, not"
                f" with {pattern_name(protocol)}; give another -o, or --overwrite"
            )
        for place in self.presses.place_mm:
            away = np.linalg.norm(plan.place_mm - place, axis=1)
            self.numbers.append(int(np.argmin(away)))
            if away.min() > SAME_PLACE_MM or self.numbers != sorted(set(self.numbers)):
                raise FrameError(
                    f"{path}: its places are not this plan's; give another -o, or --overwrite"
                )

    @property
    def following(self) -> int:
        """The place after the last press, from 0."""
        return self.numbers[-1] + 1 if self.numbers else 0

    def add(self, number: int, untouched: FloatArray, pressed: FloatArray, time_s: float) -> None:
        """Add a press at place ``number``; it is on disk when this returns."""
        one = np.array([number])
        new = Presses(
            self.protocol, untouched[None], pressed[None], self.plan.place_mm[one],
            depth_mm=_known(self.plan.depth_mm[one]), force_n=_known(self.plan.force_n[one]),
            time_s=np.array([time_s]), skin=self.skin,
        )  # fmt: skip
        if self.presses is not None:
            times = self.presses.time_s
            new = joined(self.presses, new)
            if times is not None:
                new = replace(new, time_s=np.append(times, time_s))
        self._save(new)
        self.presses = new
        self.numbers.append(number)

    def _save(self, presses: Presses) -> None:
        """Write the presses."""
        if self.path.is_file() and _version(self.path) != self._saved:
            raise FileError(
                f"{self.path}: another program changed it meanwhile, and this press was not"
                " saved; name another file"
            )
        if self._claim is None:
            self._claim = Claim(self.path)
        with write_beside(self.path) as temporary, temporary.open("wb") as stream:
            write_presses(stream, presses)
        self._saved = _version(self.path)

    def back(self) -> int:
        """Remove the last press; return its place, or 0 if there was none."""
        if self.presses is None:
            return 0
        number = self.numbers.pop()
        if self.numbers:
            self.presses = self.presses.take(np.arange(len(self.numbers)))
            self._save(self.presses)
        else:
            self.presses = None
            if self.path.is_file():
                followed(self.path).unlink()
        return number


def _version(path: Path) -> tuple[int, int, int]:
    """Return what changes when another program writes the file."""
    found = path.stat()
    return found.st_ino, found.st_mtime_ns, found.st_size


def _known(values: FloatArray) -> FloatArray | None:
    return None if np.isnan(values).all() else values
