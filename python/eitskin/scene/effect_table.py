"""What the parameters of an effect are, for people: from its dataclass ``Parameters``."""

import dataclasses
import typing
from typing import Any

from eitskin.scene.effect import EffectModule


def describe_parameters(module: EffectModule) -> list[dict[str, Any]]:
    """Each parameter's name, type, default, range, unit and meaning, for ``eitskin scene effects
    NAME``."""
    declared: Any = module.Parameters
    hints = typing.get_type_hints(declared)
    rows = []
    for one in dataclasses.fields(module.Parameters):
        default = one.default
        if one.default_factory is not dataclasses.MISSING:
            default = one.default_factory()
        hint = hints[one.name]
        rows.append(
            {
                "name": one.name,
                "type": (
                    hint.__name__ if isinstance(hint, type) else str(hint).replace("typing.", "")
                ),
                "default": "required" if default is dataclasses.MISSING else default,
                **{
                    key: one.metadata[key]
                    for key in ("low", "high", "choices", "unit", "doc")
                    if key in one.metadata
                },
            }
        )
    return rows
