"""The list of effects, and the import of those that a scene names.

Built-in effects are listed by name and module; a user's package adds its own by an entry point of
the group ``eitskin.effects`` (name = module). A module is imported only when a scene names its
effect; listing effects reads their source without running it. An entry point cannot replace a
built-in name.
"""

import ast
import importlib
import importlib.metadata
import importlib.util
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields
from pathlib import Path
from typing import Any, get_type_hints

from eitskin.config import nearest
from eitskin.errors import ConfigError
from eitskin.scene.effect import EffectModule, Stage

ENTRY_POINT_GROUP = "eitskin.effects"
BUILT_IN: dict[str, str] = {
    name: f"eitskin.scene.effects.{name}"
    for name in (
        "out_of_round",
        "misplacement",
        "stretch",
        "bend",
        "flex",
        "creep",
        "gel_drying",
        "temperature",
        "background",
        "sheet_change",
        "contact_impedance",
        "detached",
        "bridged",
        "phase",
        "source_impedance",
        "amplitude_drift",
        "channel_gain",
        "mux",
        "charge_injection",
        "crosstalk",
        "mains",
        "common_mode",
        "offset",
        "noise",
        "rectifier",
        "saturation",
        "adc",
        "jitter",
    )
}


@dataclass(frozen=True)
class Registry:
    """The module of each effect name: ``modules`` first, then, if ``entry_points`` is set, those of
    installed packages."""

    modules: Mapping[str, str] = field(default_factory=lambda: dict(BUILT_IN))
    entry_points: bool = True

    def names(self) -> dict[str, str]:
        """Return the module of every name; nothing is imported."""
        points = importlib.metadata.entry_points(group=ENTRY_POINT_GROUP)
        found = {one.name: one.value for one in points} if self.entry_points else {}
        return {**found, **self.modules}

    def load(self, name: str, where: str) -> EffectModule:
        """Import the module of the effect ``name``; ``where`` names the scene in errors.

        Raises:
            ConfigError: the effect is unknown, or its module cannot be imported or is not a valid
                effect.
        """
        target = self.modules.get(name) or self.names().get(name)
        if target is None:
            raise ConfigError(
                f"{where} [effects.{name}]: unknown effect {name!r}; {nearest(name, self.names())}"
            )
        try:
            module = importlib.import_module(target)
        except ImportError as error:
            raise ConfigError(
                f"{where} [effects.{name}]: its module {target} cannot be imported ({error})"
            ) from None
        _check_contract(module, name, f"{where} [effects.{name}]")
        return module


def _check_contract(module: object, name: str, where: str) -> None:
    for attribute in ("NAME", "STAGE", "ORDER", "SUMMARY", "Parameters", "make"):
        if not hasattr(module, attribute):
            raise ConfigError(
                f"{where}: its module defines no {attribute}; docs/guide/scenes.md lists what an"
                " effect defines"
            )
    if name != module.NAME or not isinstance(module.STAGE, Stage):  # type: ignore[attr-defined]
        raise ConfigError(
            f"{where}: its module's NAME must be {name!r} and its STAGE a Stage; repair the module"
        )


def summary_of(target: str) -> str:
    """Return the SUMMARY that the module ``target`` assigns, read from its source without importing
    it, or "" if unknown."""
    package, _, last = target.rpartition(".")
    try:
        if not package.startswith("eitskin."):
            return f"from {target}"
        origin = importlib.util.find_spec(package)
        folders = list(origin.submodule_search_locations or []) if origin is not None else []
        tree = ast.parse((Path(folders[0]) / f"{last}.py").read_text(encoding="utf-8"))
    except (ImportError, OSError, SyntaxError, IndexError):
        return ""
    for node in tree.body:
        if isinstance(node, ast.Assign) and any(
            isinstance(t, ast.Name) and t.id == "SUMMARY" for t in node.targets
        ):
            try:
                return str(ast.literal_eval(node.value))
            except ValueError:
                return ""
    return ""


def describe_parameters(module: EffectModule) -> list[dict[str, Any]]:
    """Return name, type, default, range, unit and meaning of each parameter, for ``eitskin scene
    effects NAME``."""
    hints = get_type_hints(module.Parameters)
    rows = []
    for one in fields(module.Parameters):
        default = one.default if one.default_factory is MISSING else one.default_factory()
        kind, shown = hints[one.name], ("low", "high", "choices", "unit", "doc")
        rows.append(
            {
                "name": one.name,
                "type": kind.__name__ if isinstance(kind, type) else str(kind),
                "default": "required" if default is MISSING else default,
                **{key: one.metadata[key] for key in shown if key in one.metadata},
            }
        )
    return rows
