"""Pictures of hard cases: one function a file."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import touch_scenes
from losses import LEVELS, UNITS, all_steps, errors_of
from precision import CHANGES, CONDITIONS, by_change, by_condition, condition_steps
from touch_scenes import frames_of, groups

from eitskin.model.options import default_options
from eitskin.view.panels import draw_panels, save_picture
from eitskin.view.pictures import INK, STYLE, Mark, Panel, load_matplotlib
from eitskin_emulator.core_steps import Choose, Load, Play, TareStep
from everywhere import on_host
from small_models import prebuilt

BLUE, VERMILION = "#0072b2", "#d55e00"  # safe for colour-blind readers (Okabe and Ito)
LINES = (("o-", BLUE), ("s--", VERMILION))
LOST = {
    "noise": "The image with more noise",
    "rows left out": "The image without some rows",
    "bits": "The image with fewer bits",
}
PRECISION = (
    "Error of float32 for worse conditioned matrices S",
    "Error of float32 for touches that change the frame less",
)
SHOWN = (  # group, which of it, sign looked for, title
    ("on an electrode", 0, "increase", "on an electrode"),
    ("centre", 0, "increase", "at the centre"),
    ("merging", 2, "increase", "40 mm apart"),
    ("merging", 4, "increase", "24 mm apart"),
    ("radius 3 mm", 0, "increase", "radius 3 mm"),
    ("radius 40 mm", 0, "increase", "radius 40 mm"),
    ("contrasts", 6, "increase", "contrast 1,000"),
    ("insulating", 2, "decrease", "insulating"),
    ("insulating", 2, "increase", "insulating,\nincreases wanted"),
    ("crowds", 0, "increase", "10 on a ring"),
    ("crowds", 1, "increase", "14 on two rings"),
    ("crowds", 4, "increase", "6 in a row"),
)


def panel(group: str, which: int, sign: str, title: str) -> Panel:
    """Draw one scene's image with the true and the found touches."""
    model, blob = prebuilt()
    options = replace(default_options(model), sign=sign)
    frames = frames_of(group)[which : which + 1]
    tare = TareStep(touch_scenes.simulated().untouched_v)
    _, (one,) = on_host([Load(blob), Choose(options), tare, Play(frames)])
    sheet = model.skin.conductivity_s_per_m
    truth = tuple(
        Mark(t.x_mm, t.y_mm, t.radius_mm, (t.contrast - 1.0) * sheet)
        for t in groups()[group][which]
    )
    found = tuple(Mark(t.x_mm, t.y_mm, t.radius_mm) for t in one.touches)
    said = f"{len(found)} touch{'' if len(found) == 1 else 'es'} found"
    return Panel(f"{title}\n{said}", one.image, truth, found)


def draw_touches(path: Path) -> None:
    """Hard touches, their images and what was found."""
    model, _ = prebuilt()
    note = "solid circles: touches that are there; crosses and dashed circles: found"
    panels = [panel(*each) for each in SHOWN]
    draw_panels(
        path, model.skin, model.grid, panels, 4, title="Touches that are hard to see", note=note
    )


@contextmanager
def row_of(path: Path, count: int, height: float, label: str) -> Iterator[list[Any]]:
    """So many axes side by side, saved when they are drawn; ``label`` is that of their y."""
    matplotlib = load_matplotlib()
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(9.0, height), layout="constrained")
        row = [figure.add_subplot(1, count, k + 1) for k in range(count)]
        yield row
        for axes in row:
            axes.spines[["top", "right"]].set_visible(False)
            axes.grid(linewidth=0.4, alpha=0.5)
        row[0].set_ylabel(label, color=INK)
        save_picture(figure, path)


def draw_losses(path: Path) -> None:
    """How much the image changes with the damage to its frames."""
    errors = errors_of(on_host(all_steps())[1])
    with row_of(path, 3, 3.0, "change of the image,\nshare of its norm") as row:
        for axes, (kind, values) in zip(row, errors.items(), strict=True):
            axes.plot(LEVELS[kind][1:], values[1:], "o-", color=BLUE)
            axes.axhline(0.25, color=VERMILION, linestyle="--", linewidth=1.0)
            axes.set_ylim(0, 0.28)
            axes.set_xlabel(UNITS[kind], color=INK)
            axes.set_title(LOST[kind])
        row[0].text(LEVELS["noise"][1], 0.255, "bound", color=VERMILION, fontsize=8)
        row[0].set_xscale("log")
        row[2].invert_xaxis()


def draw_precision(path: Path) -> None:
    """Errors of float32 over the condition number, and over the size of the change."""
    by_number, sizes = by_condition(on_host(condition_steps())[1]), by_change()
    of_number = {"coefficients": "the image x", "data": "the data S x that it explains"}
    of_size = {"image": "the image", "data": "the data that the solver gets"}
    panels = (
        ("condition number of S", CONDITIONS, by_number, of_number),
        ("change of the voltages, 1: as in the model's test frame", CHANGES, sizes, of_size),
    )
    with row_of(path, 2, 3.2, "distance from float64,\nshare of the norm") as row:
        for axes, (label, at, errors, lines), title in zip(row, panels, PRECISION, strict=True):
            axes.set_title(title)
            for (name, said), (style, colour) in zip(lines.items(), LINES, strict=True):
                values = [getattr(one, name) for one in errors]
                axes.loglog(at, values, style, color=colour, label=said)
            axes.set_xlabel(label, color=INK)
            axes.legend(frameon=False)
        row[1].invert_xaxis()


DRAWN: dict[str, Callable[[Path], None]] = {
    "hard-touches.png": draw_touches,
    "hard-losses.svg": draw_losses,
    "hard-precision.svg": draw_precision,
}


def draw(name: str, path: Path) -> None:
    DRAWN[name](path)
