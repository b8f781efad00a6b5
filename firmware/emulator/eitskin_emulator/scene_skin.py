"""A scene as the emulated skin's frames."""

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.scene.board_frames import BoardFrames, SceneRows
from eitskin.scene.description import Scene
from eitskin.skin.protocol import Protocol
from eitskin_emulator.analog.skin import AnalogSkin

DONE_BY_THE_BOARD = ("adc",)
MAX_UNTOUCHED = 1024  # as many as a tare takes


class RecordedRows:
    """The scene's own frames of ``rows`` as a sequence, without the untouched ones."""

    def __init__(self, rows: SceneRows) -> None:
        self._rows = rows

    def __len__(self) -> int:
        return self._rows.scene.frames

    def at(self, frame: int, time_s: float) -> FloatArray:
        """Frame number ``frame`` (m,) with all rows as they are ``time_s`` after time 0."""
        rows = self._rows
        instants_s = np.full(rows.scene.protocol.n_rows, time_s)
        return rows.scan(rows.scene.quiet_frames + frame, instants_s)

    @property
    def moves(self) -> bool:
        """Return whether a row depends on when it is read, and not on its frame alone."""
        return self._rows.moves

    def __getitem__(self, frame: int) -> FloatArray:
        number = self._rows.scene.quiet_frames + frame
        return np.asarray(self._rows.part(range(number, number + 1))[0])


def skin_of(scene: Scene, protocol: Protocol) -> AnalogSkin:
    """The skin of ``scene``, scanned by the rows of ``protocol``; its ``adc`` effect is left to the
    emulated converter.

    Raises:
        ProtocolError, ConfigError: as ``BoardFrames.rows``.
        MissingExtraError: the scene cannot be simulated.
    """
    rows = BoardFrames(scene, DONE_BY_THE_BOARD).rows(protocol)
    untouched_v = rows.part(range(min(scene.quiet_frames, MAX_UNTOUCHED)))
    recorded = RecordedRows(rows)
    return AnalogSkin(
        protocol, untouched_v, recorded, scene.rate_hz, recorded if rows.moves else None
    )
