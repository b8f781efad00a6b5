"""A scene as what lies before a simulated or emulated board."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from eitskin.scene.description import Scene
from eitskin.skin.protocol import Protocol, table


class BoardFrames:
    """The frames of ``scene`` for whatever protocol a board scans; each protocol is simulated once.
    Effects named in ``without`` are left to the board."""

    def __init__(self, scene: Scene, without: Collection[str] = ()) -> None:
        effects = {name: one for name, one in scene.effects.items() if name not in without}
        self.scene = replace(scene, effects=effects)
        self._simulated: dict[int, npt.NDArray[np.float64]] = {}

    def voltage_v(self, protocol: Protocol) -> npt.NDArray[np.float64]:
        """Voltages (n, m) in the rows of ``protocol``: the scene's quiet frames, then its own.
        Electrodes that the protocol does not name stay unused.

        Raises:
            ProtocolError: the scene's skin has fewer electrodes than the protocol names.
            ConfigError, MissingExtraError: the scene cannot be simulated.
        """
        if protocol.hash not in self._simulated:
            from eitskin.scene.compiler import compile_scene
            from eitskin.scene.runner import simulate_frames

            scene = self.scene
            if scene.protocol.hash != protocol.hash:
                rows, electrodes = protocol.drive_measure.tolist(), scene.skin.electrodes.count
                scene = replace(scene, protocol=table(electrodes, rows, protocol.current_a))
            self._simulated[protocol.hash] = simulate_frames(compile_scene(scene)).voltage_v
        return self._simulated[protocol.hash]
