"""The picture of touches that came over a link, by the core: the same bits as on the board."""

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.core.diagnostics_table import Touch
from eitskin.core.engine import aligned, load_core
from eitskin.errors import ModelError

_NAMES = tuple(one.name for one in fields(Touch))


class TouchDrawing:
    """Draws touches on the pixels of the model with the bytes ``blob``, in float32.

    Raises:
        ModelError: the core rejects the model.
        UsageError: the core is not built.
    """

    def __init__(self, blob: bytes) -> None:
        module = load_core("float32")
        self._lib, self._ffi = module.lib, module.ffi
        self._blob = aligned(len(blob))
        self._blob[:] = np.frombuffer(blob, dtype=np.uint8)
        self._model = self._ffi.new("eits_model *")
        given = self._ffi.from_buffer(self._blob)
        status = self._lib.eits_model_open(self._model, given, len(blob))
        if status != 0:
            text = self._ffi.string(self._lib.eits_status_text(status)).decode()
            raise ModelError(f"model: {text} (C core, status {int(status)})")

    def image(self, touches: Sequence[Touch]) -> npt.NDArray[np.float32]:
        """Return the image of ``touches``, (n,) S/m (``eits_draw_touches``)."""
        given = self._ffi.new("eits_touch[]", [_numbers(touch) for touch in touches])
        image = np.empty(int(self._model.n_pixels), dtype=np.float32)
        pointer = self._ffi.from_buffer("eits_real[]", image)
        self._lib.eits_draw_touches(self._model, given, len(touches), pointer)
        return image


def _numbers(touch: Touch) -> dict[str, Any]:
    """Return the numbers of a touch for C, where 0 stands for what is not known."""
    return {name: getattr(touch, name) or 0 for name in _NAMES}
