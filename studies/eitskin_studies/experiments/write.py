"""Writes the results of an experiment: data, tables, pictures, and the marked places of its
page."""

import csv
import io
import json
import shutil
from pathlib import Path
from typing import Any

from eitskin.fileio import write_beside, write_bytes
from eitskin_studies.experiments.experiment import ExperimentOutcome, ExperimentSettings, Table
from eitskin_studies.harness.drawings import Drawing, keep_drawings
from eitskin_studies.harness.sections import Tabular, fill_marks, text_table


def write_all(outcome: ExperimentOutcome, folder: Path, pictures: bool = True) -> None:
    """``data.json``, a CSV file a table, and the pictures, into ``folder``; each whole or not at
    all.

    Raises:
        FileError: it cannot be written.
        MissingExtraError: pictures are wanted and matplotlib is not installed.
    """
    write_bytes(folder / "data.json", to_json(outcome).encode("utf-8"))
    for table in outcome.tables:
        write_bytes(folder / f"{table.name}.csv", _csv(table).encode("utf-8"))
    if not pictures:
        return
    for name, draw in outcome.pictures.items():
        with write_beside(folder / name) as temporary:
            draw(temporary)


def write_page(
    outcome: ExperimentOutcome, folder: Path, page: Path, name: str, settings: ExperimentSettings
) -> None:
    """Fill the marks of ``page``: each table, the outcome's words, and ``command``; pictures go to
    ``pictures/NAME/`` beside it, and the numbers of those that are a ``Drawing`` are stored.

    Raises:
        FileError: the page cannot be read or written.
        ConfigError: a mark is missing.
    """
    texts = {**outcome.words, "command": _command(name, page, settings)}
    tables: dict[str, Tabular] = {table.name: (table.head, table.rows) for table in outcome.tables}
    fill_marks(page, name, (texts, tables))
    target = page.parent / "pictures" / name
    target.mkdir(parents=True, exist_ok=True)
    keep_drawings(
        page,
        {
            f"pictures/{name}/{picture}": draw
            for picture, draw in outcome.pictures.items()
            if isinstance(draw, Drawing)
        },
    )
    for picture in outcome.pictures:
        if (folder / picture).is_file():
            with write_beside(target / picture) as temporary:
                shutil.copyfile(folder / picture, temporary)


def to_text(outcome: ExperimentOutcome) -> str:
    """The tables, for a terminal."""
    return "\n\n".join(
        f"{table.name}\n{text_table(table.head, table.rows)}" for table in outcome.tables
    )


def to_json(outcome: ExperimentOutcome) -> str:
    """Everything; numbers that are none become null."""
    return json.dumps(_finite(outcome.data), indent=1, allow_nan=False) + "\n"


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if value == value and abs(value) != float("inf") else None
    if isinstance(value, dict):
        return {str(key): _finite(one) for key, one in value.items()}
    return [_finite(one) for one in value] if isinstance(value, (list, tuple)) else value


def _command(name: str, page: Path, settings: ExperimentSettings) -> str:
    more = f" --seed {settings.seed}" if settings.seed != ExperimentSettings.seed else ""
    more += f" --share {settings.share:g}" if settings.share != ExperimentSettings.share else ""
    more += "" if settings.data is None else " --data FOLDER"
    return f"Made by `eitskin study {name} -o out/{name}{more} --page studies/results/{page.name}`."


def _csv(table: Table) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([table.head, *table.rows])
    return text.getvalue()
