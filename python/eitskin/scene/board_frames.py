"""A scene as what lies before a simulated or emulated board."""

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.scene.description import Scene
from eitskin.skin.protocol import Protocol, in_order, table

WHOLE_FRAMES = 512  # a scene of no more frames, quiet ones included, is simulated at once
WINDOW_FRAMES = 64  # of a longer one: so many are compiled together, and made one at a time
SAME_S = 1e-7  # rows so near to a frame's own are its own
HEADROOM = 2.0  # of a longer one's range over its first quiet frames: touches may raise voltages


class BoardFrames:
    """The frames of ``scene`` for whatever protocol a board scans; each protocol is prepared once.
    Effects named in ``without`` are left to the board."""

    def __init__(self, scene: Scene, without: Collection[str] = ()) -> None:
        effects = {name: one for name, one in scene.effects.items() if name not in without}
        self.scene = replace(scene, effects=effects)
        self._rows: dict[tuple[int, tuple[int, ...]], SceneRows] = {}

    def rows(self, protocol: Protocol) -> "SceneRows":
        """The frames in the rows of ``protocol``. Electrodes that it does not name stay unused."""
        key, own = (protocol.hash, protocol.drive_order), self.scene.protocol
        if key not in self._rows:
            scene = self.scene
            if key != (own.hash, own.drive_order):
                rows, electrodes = protocol.drive_measure.tolist(), scene.skin.electrodes.count
                made = table(electrodes, rows, protocol.current_a)
                scene = replace(scene, protocol=in_order(made, protocol.drive_order))
            self._rows[key] = SceneRows(scene)
        return self._rows[key]

    def voltage_v(self, protocol: Protocol) -> FloatArray:
        """All of them, (n, m) in V: the scene's quiet frames, then its own. Raises as ``rows``."""
        return self.rows(protocol).part(range(self.scene.n_frames))


class SceneRows:
    """All frames of ``scene``, quiet ones first, made as they are asked for; the same values in
    whatever order. Of a long scene only the last ``WINDOW_FRAMES`` are kept."""

    def __init__(self, scene: Scene) -> None:
        from eitskin.scene.compiler import prepare_scene
        from eitskin.scene.session import MeshCache

        self.scene = scene
        self._prepared = prepare_scene(scene, mesh_cache=MeshCache())
        self.solves = 0  # for whoever counts: right-hand sides solved so far
        self._window = range(0)
        whole = scene.n_frames <= WHOLE_FRAMES
        self._size = scene.n_frames if whole else WINDOW_FRAMES
        self.moves = not scene.frozen and any(
            track.moves or np.isfinite(track.keyframes[0].t_s) or not track.hold
            for track in scene.touches
        )
        """Whether touches change while they are scanned: each scan has rows of its own."""
        first = self.part(range(scene.n_frames if whole else min(scene.quiet_frames, self._size)))
        largest = float(np.abs(np.asarray(first, np.float32)).max(initial=0))
        self.largest_v = largest if whole else HEADROOM * largest
        """None is above it in a scene that was simulated at once; in a long one what is above it
        is beyond the range of a simulated converter."""

    def around(self, frame: int) -> tuple[int, FloatArray]:
        """Frames (k, m) among which is number ``frame``, and the number of the first of them: of a
        long scene only this one, since each takes its time; where touches move, the quiet ones or
        this one, with its rows as in its own scan."""
        quiet = self.scene.quiet_frames
        if self._size == self.scene.n_frames and not (self.moves and frame >= quiet):
            return 0, self.part(range(quiet if self.moves else self._size))
        return frame, self.part(range(frame, frame + 1))

    def scan(self, frame: int, row_times_s: FloatArray) -> FloatArray:
        """Recorded frame number ``frame`` (m,), quiet ones counted, with rows at ``row_times_s``
        (m,) after the scene's time 0; after the last frame's scan all stays as it is."""
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

    def part(self, frames: range) -> FloatArray:
        """``frames`` (k, m) in V."""
        if not len(frames):
            return np.zeros((0, self.scene.protocol.n_rows))
        return np.array([self._frame(frame) for frame in frames])

    def _open(self, frame: int) -> None:
        """Compile the window that ``frame`` is in, where it is another than before."""
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
