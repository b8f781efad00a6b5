"""A scene as what lies before a simulated board: frames of the untouched skin until it begins, then
the scene's own."""

from __future__ import annotations

import zlib
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from eitskin.scene.description import Scene
from eitskin.skin.protocol import Protocol, table


class SceneSkin:
    """The frames of ``scene``, simulated when first asked for, for whatever protocol the board
    scans. Times: the board's, us."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._frames: dict[int, npt.NDArray[np.float32]] = {}
        self._began_us: int | None = None
        self._quiet_shown = 0

    @property
    def electrodes(self) -> int:
        return self.scene.skin.electrodes.count

    @property
    def serial(self) -> str:
        """The same for the same scene."""
        text = self.scene.text or repr(self.scene)
        return f"{zlib.crc32(text.encode()):08X}"

    @property
    def period_us(self) -> int:
        """Between the scene's frames."""
        return max(round(1e6 / self.scene.rate_hz), 1)

    def begin(self, time_us: int) -> None:
        """Let the scene's time 0 be ``time_us``."""
        self._began_us = time_us

    def begin_quiet(self) -> None:
        """Show the quiet frames from their first on: a tare of as many takes the reference that the
        scene's own frames have."""
        self._quiet_shown = 0

    def ended(self, time_us: int) -> bool:
        """Whether the scene is over at ``time_us``."""
        return self._began_us is not None and self._number(time_us) >= self.scene.frames

    def frame(self, protocol: Protocol, time_us: int) -> npt.NDArray[np.float32]:
        """The voltages (m,) of the frame nearest to ``time_us``; untouched, the quiet frames over
        and over.

        Raises:
            EitskinError: the scene cannot be simulated.
        """
        frames, quiet = self._simulated(protocol), self.scene.quiet_frames
        if self._began_us is None:
            number = self._quiet_shown % quiet
            self._quiet_shown += 1
        else:
            number = quiet + min(self._number(time_us), self.scene.frames - 1)
        return np.array(frames[number])

    def _number(self, time_us: int) -> int:
        assert self._began_us is not None
        return int((time_us - self._began_us) * self.scene.rate_hz / 1e6 + 0.5)

    def _simulated(self, protocol: Protocol) -> npt.NDArray[np.float32]:
        if protocol.hash not in self._frames:
            from eitskin.scene.compiler import compile_scene
            from eitskin.scene.runner import simulate_frames

            own = self.scene.protocol.hash == protocol.hash
            scene = self.scene
            if not own:  # electrodes that the protocol does not name stay unused
                rows = protocol.drive_measure.tolist()
                scene = replace(scene, protocol=table(self.electrodes, rows, protocol.current_a))
            self._frames[protocol.hash] = simulate_frames(compile_scene(scene)).voltage_v.astype(
                np.float32
            )
        return self._frames[protocol.hash]
