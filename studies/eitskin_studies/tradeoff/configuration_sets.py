"""Sets of configurations: from a TOML file, and checked."""

from collections.abc import Sequence
from pathlib import Path

from eitskin.config import check_keys, load_toml
from eitskin.errors import ConfigError
from eitskin.tuning.configuration import Configuration, configuration_from


def load_set(path: str | Path) -> tuple[Configuration, ...]:
    """The configurations in a TOML file: tables ``[[configuration]]``, and ``[defaults]`` for what
    they share.

    Raises:
        FileError: it cannot be read.
        ConfigError: it is no such file, is empty, names something twice, or a value is out of
            range.
    """
    tables = load_toml(path, "set of configurations")
    check_keys(tables, ("defaults", "configuration"), str(path))
    shared, listed = tables.get("defaults", {}), tables.get("configuration", [])
    if (
        not isinstance(shared, dict)
        or not isinstance(listed, list)
        or not all(isinstance(one, dict) for one in listed)
    ):
        raise ConfigError(
            f"{path}: expects one [defaults] table at most and [[configuration]] tables"
        )
    return checked_set(
        [configuration_from({**shared, **one}, f"{path} [[configuration]]") for one in listed],
        str(path),
    )


def checked_set(configurations: Sequence[Configuration], where: str) -> tuple[Configuration, ...]:
    """``configurations`` if there are any and no two have one name.

    Raises:
        ConfigError: otherwise.
    """
    names = [one.name for one in configurations]
    if not names:
        raise ConfigError(f"{where}: holds no [[configuration]]; add at least one with a name")
    for name in names:
        if names.count(name) > 1:
            raise ConfigError(f"{where}: two configurations are named {name!r}; names must differ")
    return tuple(configurations)
