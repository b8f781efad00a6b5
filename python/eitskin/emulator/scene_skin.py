"""A scene as the emulated skin's frames."""

from __future__ import annotations

from dataclasses import replace

from eitskin.emulator.analog.skin import Skin
from eitskin.errors import ProtocolError
from eitskin.scene.description import Scene
from eitskin.skin.protocol import Protocol

DONE_BY_THE_BOARD = ("adc",)


def skin_of(scene: Scene, protocol: Protocol) -> Skin:
    """The skin of ``scene``, scanned by the rows of ``protocol``; its ``adc`` effect is left to the
    emulated converter.

    Raises:
        ProtocolError: the scene's skin has another number of electrodes than the model.
        ConfigError, MissingExtraError: the scene cannot be simulated.
    """
    from eitskin.scene.compiler import compile_scene
    from eitskin.scene.runner import simulate_frames

    electrodes = scene.skin.electrodes.count
    if electrodes != protocol.n_electrodes:
        raise ProtocolError(
            f"{scene.where}: its skin has {electrodes} electrodes, the model is for"
            f" {protocol.n_electrodes}; build a model of the scene's skin with  eitskin model build"
            "  and give it with  --model"
        )
    effects = {
        name: table for name, table in scene.effects.items() if name not in DONE_BY_THE_BOARD
    }
    own = replace(
        scene,
        effects=effects,
        protocol=scene.protocol if scene.protocol.hash == protocol.hash else protocol,
    )
    voltage_v = simulate_frames(compile_scene(own)).voltage_v
    return Skin(
        own.protocol, voltage_v[: own.quiet_frames], voltage_v[own.quiet_frames :], own.rate_hz
    )
