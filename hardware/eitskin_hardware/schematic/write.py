"""Writes the schematic: a page of SVG for each stage, and all of them as one PDF."""

from collections.abc import Iterator
from pathlib import Path

from eitskin.fileio import write_beside
from eitskin.view.pictures import load_matplotlib
from eitskin_hardware.circuit.design import Design
from eitskin_hardware.schematic.sheet import Sheet
from eitskin_hardware.schematic.stages import SHEETS

SALT = "eitskin"  # of the identifiers in an SVG file, so that it repeats


def sheets(design: Design) -> dict[str, Sheet]:
    """Return all pages by their stage."""
    return {name: draw(design) for name, draw in SHEETS.items()}


def write_schematic(design: Design, folder: Path) -> Iterator[str]:
    """Write STAGE.svg for each stage and schematic.pdf into ``folder``; yield their names."""
    matplotlib = load_matplotlib()
    from matplotlib.backends.backend_pdf import PdfPages

    folder.mkdir(exist_ok=True)
    with matplotlib.rc_context({"svg.hashsalt": SALT, "svg.fonttype": "none"}):
        figures = {name: sheet.figure() for name, sheet in sheets(design).items()}
        for name, figure in figures.items():
            with write_beside(folder / f"{name}.svg") as temporary:
                figure.savefig(
                    temporary, format="svg", bbox_inches="tight", metadata={"Date": None}
                )
            yield f"{name}.svg"
        with (
            write_beside(folder / "schematic.pdf") as temporary,
            PdfPages(
                temporary, metadata={"CreationDate": None, "Title": "eitskin instrument"}
            ) as pages,
        ):
            for figure in figures.values():
                pages.savefig(figure, bbox_inches="tight")
        yield "schematic.pdf"
