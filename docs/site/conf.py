"""Sphinx reads this file: it makes a site of the project's pages, of the Python docstrings, of the
command line and of the C headers. ``scripts/site`` calls it."""

import re
import sys
from importlib.metadata import version as installed_version
from pathlib import Path

from sphinx.application import Sphinx

sys.path.insert(0, str(Path(__file__).resolve().parent))

from site_tables import with_downloads

ROOT = Path(__file__).resolve().parents[2]
HEADERS = ROOT / "build" / "site-headers"
TABLES = ROOT / "build" / "site-tables"
RESULTS = "studies/results/"
BEHIND = re.compile(r"^( *)(\S.*[,;]) +/\* (.*) \*/$", re.MULTILINE)
BEFORE = re.compile(r"^( *)/\* (?!clang-format)", re.MULTILINE)
TOP = re.compile(r"^(?:#(?:ifndef|define) EITSKIN_\w+_H|#include .*)\n", re.MULTILINE)


def write_marked_headers() -> None:
    """Copy the C headers with their comments as Hawkmoth reads them: marked as documentation, and
    each before what it describes. Include guards and includes go to the top, so that the first
    comment belongs to the file."""
    for header in sorted((ROOT / "csrc" / "include" / "eitskin").glob("*.h")):
        text = header.read_text(encoding="utf-8")
        top = "".join(TOP.findall(text))
        text = BEHIND.sub(r"\1/* \3 */\n\1\2", TOP.sub("", text))
        copy = HEADERS / "eitskin" / header.name
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_text(top + BEFORE.sub(r"\1/** ", text), encoding="utf-8")


def comment_to_paragraphs(app: object, lines: list[str], *_: object) -> None:
    """Turn the plain text of a C comment into paragraphs: Sphinx would read its stars and bars as
    markup. Lines that are indented by four or more stay as they are."""
    out: list[str] = []
    for star_line in lines:
        line = re.sub(r"^ *\* ?", "", star_line)
        if line.startswith("    ") and (not out or out[-1] in ("", "::") or out[-1][:4] == "    "):
            if out[-1:] == [""]:
                out += ["::", ""]
            out.append(line)
        else:
            if line and out and out[-1].startswith("    "):
                out.append("")
            out.append(re.sub(r"([\\*|`_])", r"\\\1", line.strip()))
    lines[:] = out


def link_tables(_: Sphinx, name: str, source: list[str]) -> None:
    """Put a link to a CSV file below each table of a page of results."""
    if name.startswith(RESULTS):
        source[0] = with_downloads(name.removeprefix(RESULTS), source[0], TABLES, ROOT)


def setup(app: Sphinx) -> None:
    """Register what changes the comments of the C headers and the pages of results."""
    app.connect("hawkmoth-process-docstring", comment_to_paragraphs)
    app.connect("source-read", link_tables)


write_marked_headers()

project = "eitskin"
author = "The eitskin authors"
copyright = "The eitskin authors, MIT licence"
version = release = installed_version("eitskin")

extensions = [
    "myst_nb",
    "sphinx_external_toc",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinxarg.ext",
    "hawkmoth",
    "sphinx_copybutton",
]
include_patterns = [
    "*.md",
    "docs/**",
    "hardware/*.md",
    "hardware/made/*.md",
    "studies/results/**",
    "tests/python/docs/mistakes.md",
]
external_toc_path = "docs/site/_toc.yml"
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
nb_execution_in_temp = True
nb_execution_timeout = 300
nb_execution_raise_on_error = True
autodoc_member_order = "bysource"
autodoc_typehints = "description"
hawkmoth_root = str(HEADERS)
hawkmoth_clang = [f"-I{HEADERS}"]
hawkmoth_compiler = "cc"  # asked where the system's headers are; usually clang, which not all have
html_theme = "furo"
html_title = "eitskin"
