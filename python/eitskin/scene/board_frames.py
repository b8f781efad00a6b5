"""The frames of a scene for a simulated or emulated board."""

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.errors import ProtocolError
from eitskin.scene.description import Scene
from eitskin.scene.random_touches import TrueTouch
from eitskin.skin.protocol import Protocol, in_order, table

# A scene with up to this number of frames, untouched ones included, is simulated at once.
WHOLE_FRAMES = 512
WINDOW_FRAMES = 64  # frames of a longer scene that are compiled together and made one at a time
SAME_S = 1e-7  # rows within this time of a frame's own rows count as the same
# Range of a longer scene over the voltages of its first untouched frames, as touches may raise
# voltages.
HEADROOM = 2.0


class BoardFrames:
    """The frames of ``scene`` for any protocol that a board scans; each protocol is prepared once.
    Effects named in ``without`` are left to the board."""

    def __init__(self, scene: Scene, without: Collection[str] = ()) -> None:
        effects = {name: one for name, one in scene.effects.items() if name not in without}
        self.scene = replace(scene, effects=effects)
        self._rows: dict[tuple[int, tuple[int, ...]], SceneRows] = {}

    def rows(self, protocol: Protocol) -> "SceneRows":
        """Return the frames in the rows of ``protocol``. Electrodes that the protocol does not name
        stay unused.

        Raises:
            ProtocolError: it is for another number of electrodes than the scene's skin has.
            ConfigError: as ``prepare_scene``.
        """
        self._check_electrodes(protocol)
        key, own = (protocol.hash, protocol.drive_order), self.scene.protocol
        if key not in self._rows:
            scene = self.scene
            if key != (own.hash, own.drive_order):
                rows, electrodes = protocol.drive_measure.tolist(), scene.skin.electrodes.count
                made = table(electrodes, rows, protocol.current_a)
                scene = replace(scene, protocol=in_order(made, protocol.drive_order))
            self._rows[key] = SceneRows(scene)
        return self._rows[key]

    def _check_electrodes(self, protocol: Protocol) -> None:
        scene = self.scene
        if protocol.n_electrodes == scene.skin.electrodes.count:
            return
        file = scene.skin_file
        skin, model = ("SKIN.toml", "SKIN.eitm") if file is None else (file, f"{file.stem}.eitm")
        raise ProtocolError(
            f"{scene.where}: its skin has {scene.skin.electrodes.count} electrodes, but the board's"
            f" model is for {protocol.n_electrodes}; build the skin's with  eitskin model build"
            f" {skin} -o {model}  and name it with  --model {model}"
        )

    def voltage_v(self, protocol: Protocol) -> FloatArray:
        """Return all frames (n, m) in V: the untouched frames of the scene, then the others. Errors
        are those of ``rows``."""
        return self.rows(protocol).part(range(self.scene.n_frames))


class SceneRows:
    """All frames of ``scene``, untouched ones first, made when they are asked for. The values do
    not depend on the order of requests. Of a long scene only the last ``WINDOW_FRAMES`` are
    kept."""

    def __init__(self, scene: Scene) -> None:
        from eitskin.scene.compiler import prepare_scene
        from eitskin.scene.session import MeshCache

        self.scene = scene
        self._prepared = prepare_scene(scene, mesh_cache=MeshCache())
        self.solves = 0  # number of right-hand sides solved so far
        self._window = range(0)
        whole = scene.n_frames <= WHOLE_FRAMES
        self._size = scene.n_frames if whole else WINDOW_FRAMES
        self.moves = not scene.frozen and any(
            track.moves or np.isfinite(track.keyframes[0].t_s) or not track.hold
            for track in scene.touches
        )
        """Whether touches change during a scan, so that each scan has its own rows."""
        first = self.part(range(scene.n_frames if whole else min(scene.quiet_frames, self._size)))
        largest = float(np.abs(np.asarray(first, np.float32)).max(initial=0))
        self.largest_v = largest if whole else HEADROOM * largest
        """The range of a simulated converter. A scene that was simulated at once has no greater
        voltage; greater voltages of a long scene are out of range."""

    def around(self, frame: int) -> tuple[int, FloatArray]:
        """Return frames (k, m) that include number ``frame``, and the number of the first of them.
        For a long scene this is only the frame itself, since each frame takes time. If touches
        move, it is either the untouched frames or the frame itself with the rows of its own
        scan."""
        untouched = self.scene.quiet_frames
        if self._size == self.scene.n_frames and not (self.moves and frame >= untouched):
            return 0, self.part(range(untouched if self.moves else self._size))
        return frame, self.part(range(frame, frame + 1))

    def scan(self, frame: int, row_times_s: FloatArray) -> FloatArray:
        """Return the frame number ``frame`` (m,), untouched ones included, with its rows measured
        at ``row_times_s`` (m,) after the scene's time 0. After the scan of the last frame nothing
        changes any more."""
        scene, recorded = self.scene, frame - self.scene.quiet_frames
        nominal = recorded / scene.rate_hz + scene.row_delays_s
        if not self.moves or np.abs(row_times_s - nominal).max() < SAME_S:
            return np.asarray(self.part(range(frame, frame + 1))[0])
        self._open(frame)
        end_s = (scene.frames - 1) / scene.rate_hz + scene.scan_s
        before = self._maker.work.solves
        volts = self._maker.frame(frame, np.minimum(row_times_s, end_s))
        self.solves += self._maker.work.solves - before
        return volts

    def pressed(self, frame: int, fingers: tuple[TrueTouch, ...]) -> FloatArray:
        """Return the frame number ``frame`` (m,) with ``fingers`` beside the scene's touches, as if
        all of them were still during its scan."""
        self._open(frame)
        before = self._maker.work.solves
        volts = self._maker.pressed(frame, fingers)
        self.solves += self._maker.work.solves - before
        return volts

    def part(self, frames: range) -> FloatArray:
        """Return ``frames`` (k, m) in V."""
        if not len(frames):
            return np.zeros((0, self.scene.protocol.n_rows))
        return np.array([self._frame(frame) for frame in frames])

    def _open(self, frame: int) -> None:
        """Compile the window that contains ``frame``, unless it is the current one."""
        from eitskin.scene.compiler import compile_frames
        from eitskin.scene.runner import FrameMaker

        if frame not in self._window:
            start = frame // self._size * self._size
            self._window = range(start, min(start + self._size, self.scene.n_frames))
            self._maker = FrameMaker(compile_frames(self._prepared, self._window))
            self._made: dict[int, FloatArray] = {}

    def _frame(self, frame: int) -> FloatArray:
        self._open(frame)
        if frame not in self._made:
            before = self._maker.work.solves
            self._made[frame] = self._maker.frame(frame)
            self.solves += self._maker.work.solves - before
        return self._made[frame]
