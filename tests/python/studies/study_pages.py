"""What all experiments' tests ask of their pages."""

from __future__ import annotations

import re
from pathlib import Path

from eitskin.config import load_toml
from eitskin_studies.experiments.experiment import ExperimentOutcome, ExperimentSettings
from eitskin_studies.experiments.write import write_page
from eitskin_studies.harness.sections import PARTS

PAGES = Path(__file__).resolve().parents[3] / "docs" / "results"


def fills_its_page(
    outcome: ExperimentOutcome, name: str, folder: Path, but: tuple[str, ...] = ()
) -> str:
    """Tables are whole, and pictures are drawn, ``but`` for some. A copy of the page takes the
    outcome, all of its marks are of it, and it shows every picture; returns what it says then."""
    for table in outcome.tables:
        assert table.rows and all(len(row) == len(table.head) for row in table.rows)
    for picture in outcome.pictures.keys() - set(but):
        outcome.pictures[picture](folder / picture)
        assert (folder / picture).read_bytes().startswith(b"\x89PNG")
    page, settings = folder / f"{name}.md", ExperimentSettings(share=0.01)
    page.write_bytes((PAGES / page.name).read_bytes())
    write_page(outcome, folder, page, name, settings)
    text = page.read_text(encoding="utf-8")
    tables = {table.name for table in outcome.tables}
    assert set(load_toml(PARTS, "list").get(name, {})) <= tables
    assert set(re.findall("<!-- end (.*) -->", text)) <= {"command", *outcome.words, *tables}
    assert (
        f"`eitskin study {name} -o out/{name} --share 0.01 --page docs/results/{name}.md`" in text
    )
    assert all(f"pictures/{name}/{picture}" in text for picture in outcome.pictures)
    return text
