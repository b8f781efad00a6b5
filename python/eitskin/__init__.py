"""eitskin: electrical impedance tomography skins, from a skin's description to touches.

The names in ``__all__`` are public and stable (docs/reference/python-api.md); all others may
change. Each name is imported when it is first used.
"""

from importlib import import_module

TYPE_CHECKING = False  # as in typing, whose import would take time
if TYPE_CHECKING:
    from typing import Any

    from eitskin.device.open import open_device
    from eitskin.frames.frames import Frames, load_frames
    from eitskin.model.model import Model
    from eitskin.public import load_model, preset, stream
    from eitskin.scene.description import Scene
    from eitskin.skin.protocol import Protocol
    from eitskin.skin.skin import Skin
    from eitskin.solve.reconstructor import Reconstructor

__version__ = "0.1.0"
__all__ = [
    "Frames",
    "Model",
    "Protocol",
    "Reconstructor",
    "Scene",
    "Skin",
    "load_frames",
    "load_model",
    "open_device",
    "preset",
    "stream",
]

_WHERE = {
    "Frames": "frames.frames",
    "Model": "model.model",
    "Protocol": "skin.protocol",
    "Reconstructor": "solve.reconstructor",
    "Scene": "scene.description",
    "Skin": "skin.skin",
    "load_frames": "frames.frames",
    "load_model": "public",
    "open_device": "device.open",
    "preset": "public",
    "stream": "public",
}


def __getattr__(name: str) -> "Any":
    if name not in _WHERE:
        raise AttributeError(f"module 'eitskin' has no attribute {name!r}")
    return getattr(import_module(f"eitskin.{_WHERE[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
