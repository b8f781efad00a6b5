"""A scene as the emulated skin's frames."""

from eitskin.errors import ProtocolError
from eitskin.scene.board_frames import BoardFrames, RecordedRows
from eitskin.scene.description import Scene
from eitskin.skin.protocol import Protocol
from eitskin_emulator.analog.skin import AnalogSkin

DONE_BY_THE_BOARD = ("adc",)
MAX_QUIET = 1024  # as many as a tare takes


def skin_of(scene: Scene, protocol: Protocol) -> AnalogSkin:
    """The skin of ``scene``, scanned by the rows of ``protocol``; its ``adc`` effect is left to the
    emulated converter.

    Raises:
        ProtocolError: the scene's skin has another number of electrodes than the model.
        ConfigError, MissingExtraError: the scene cannot be simulated.
    """
    electrodes = scene.skin.electrodes.count
    if electrodes != protocol.n_electrodes:
        raise ProtocolError(
            f"{scene.where}: its skin has {electrodes} electrodes, the model is for"
            f" {protocol.n_electrodes}; build a model of the scene's skin with  eitskin model build"
            "  and give it with  --model"
        )
    rows = BoardFrames(scene, DONE_BY_THE_BOARD).rows(protocol)
    quiet_v = rows.part(range(min(scene.quiet_frames, MAX_QUIET)))
    recorded = RecordedRows(rows)
    return AnalogSkin(protocol, quiet_v, recorded, scene.rate_hz, recorded if rows.moves else None)
