"""Read the list of known weights that belongs to a recording: CSV with a header, or TOML with
``[[press]]`` tables."""

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eitskin.config import check_keys, integer, load_toml, number
from eitskin.core.results import NEWTONS_PER_GRAM
from eitskin.errors import ConfigError
from eitskin.fileio import read_bytes

KEYS = ("first", "last", "weight_g", "force_n", "x_mm", "y_mm")
MAX_FRAMES = 2**32 - 1
MAX_FORCE_N = 1e6


@dataclass(frozen=True)
class Weight:
    """One weight on the skin, from frame ``first`` to ``last`` inclusive, with its force in N and,
    if known, its place in mm."""

    first: int
    last: int
    force_n: float
    place_mm: tuple[float, float] | None = None


def load_weights(path: Path) -> list[Weight]:
    """Return the weights listed in the file ``path``.

    Raises:
        FileError: the file cannot be read.
        ConfigError: a line does not follow docs/guide/calibration.md.
    """
    rows = _toml_rows(path) if path.suffix.lower() == ".toml" else _csv_rows(path)
    if not rows:
        raise ConfigError(f"{path}: lists no weight; give the frames and the force of each")
    return [_weight(row, where) for row, where in rows]


def _toml_rows(path: Path) -> list[tuple[Mapping[str, Any], str]]:
    whole = load_toml(path, "list of weights")
    check_keys(whole, ("press",), str(path))
    tables = whole.get("press", [])
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise ConfigError(f"{path}: press must be tables; write [[press]] before each")
    return [(table, f"{path}: [[press]] {k + 1}") for k, table in enumerate(tables)]


def _csv_rows(path: Path) -> list[tuple[Mapping[str, Any], str]]:
    try:
        text = read_bytes(path, "list of weights").decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: not UTF-8 text, so not a list of weights") from None
    lines = [line for line in csv.reader(text.splitlines()) if any(cell.strip() for cell in line)]
    if not lines:
        return []
    head = [cell.strip() for cell in lines[0]]
    check_keys(dict.fromkeys(head), KEYS, f"{path}: its first line")
    rows: list[tuple[Mapping[str, Any], str]] = []
    for k, cells in enumerate(lines[1:]):
        where = f"{path}: row {k + 1} below the header"
        if len(cells) != len(head):
            raise ConfigError(f"{where}: {len(cells)} cells under {len(head)} names; give as many")
        named = zip(head, cells, strict=True)
        row = {name: _number(cell, name, where) for name, cell in named if cell.strip()}
        rows.append((row, where))
    return rows


def _number(cell: str, name: str, where: str) -> float:
    try:
        return float(cell)
    except ValueError:
        raise ConfigError(f"{where}: {name} must be a number, not {cell.strip()!r}") from None


def _weight(row: Mapping[str, Any], where: str) -> Weight:
    check_keys(row, KEYS, where)
    if ("weight_g" in row) == ("force_n" in row):
        raise ConfigError(
            f"{where}: give the force either as weight_g (grams) or as force_n (newtons)"
        )
    if ("x_mm" in row) != ("y_mm" in row):
        raise ConfigError(f"{where}: a place needs x_mm and y_mm; give both or none")
    first = integer(row, "first", None, where, low=0, high=MAX_FRAMES)
    last = integer(row, "last", first, where, low=first, high=MAX_FRAMES)
    key, unit_n = ("weight_g", NEWTONS_PER_GRAM) if "weight_g" in row else ("force_n", 1.0)
    force = number(row, key, None, where, low=0, high=MAX_FORCE_N / unit_n, open_low=True)
    place = None
    if "x_mm" in row:
        place = number(row, "x_mm", None, where), number(row, "y_mm", None, where)
    return Weight(first, last, unit_n * force, place)
