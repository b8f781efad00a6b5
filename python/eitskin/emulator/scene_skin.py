"""A scene as the emulated skin's frames."""

from __future__ import annotations

from eitskin.emulator.analog.skin import AnalogSkin
from eitskin.errors import ProtocolError
from eitskin.scene.board_frames import BoardFrames
from eitskin.scene.description import Scene
from eitskin.skin.protocol import Protocol

DONE_BY_THE_BOARD = ("adc",)


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
    voltage_v = BoardFrames(scene, DONE_BY_THE_BOARD).voltage_v(protocol)
    quiet = scene.quiet_frames
    return AnalogSkin(protocol, voltage_v[:quiet], voltage_v[quiet:], scene.rate_hz)
