"""Make the tables of the results downloadable: each is written as a CSV file, and a link to the
file is put below it."""

import csv
import re
from pathlib import Path

TABLE = re.compile(
    r"(?:<!-- ([\w.-]+) -->\n)?((?:^\|.*\|\n)+)(<!-- end [\w.-]+ -->\n)?", re.MULTILINE
)
RULE = re.compile(r"\|[\s:|-]+\|")
LINK = re.compile(r"!?\[([^\]]*)\]\([^)]*\)")


def cells(line: str) -> list[str]:
    """Return the cells of a table's line as plain text."""
    plain = LINK.sub(r"\1", line.strip())[1:-1].replace("**", "").replace("`", "")
    return [cell.strip().replace("&#124;", "|") for cell in plain.split("|")]


def with_downloads(page: str, text: str, folder: Path, root: Path) -> str:
    """Return a page's ``text`` with a link below each table to its CSV file.

    The files are written to ``folder``, which is below ``root``, the folder that Sphinx reads. A
    table is named after its page and its mark, or else its number on the page.
    """
    folder.mkdir(parents=True, exist_ok=True)
    count = 0

    def one(found: re.Match[str]) -> str:
        nonlocal count
        count += 1
        path = folder / f"{page}-{found[1] or count}.csv"
        lines = [line for line in found[2].splitlines() if not RULE.fullmatch(line)]
        with path.open("w", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows(cells(line) for line in lines)
        link = f"\n{{download}}`This table as CSV </{path.relative_to(root).as_posix()}>`\n"
        return found[0] + link

    return TABLE.sub(one, text)
