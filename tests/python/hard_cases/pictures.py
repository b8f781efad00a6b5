"""Pictures of hard cases: one function a file."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import touch_scenes
from losses import LEVELS, UNITS, all_steps, errors_of
from precision import CHANGES, CONDITIONS, by_change, by_condition, condition_steps
from touch_scenes import frames_of, groups

from eitskin.model.options import default_options
from eitskin.scene.random_touches import TouchScene
from eitskin.view.panels import draw_panels, save_picture
from eitskin.view.pictures import INK, STYLE, Mark, Panel, load_matplotlib
from eitskin_studies.harness.emulated_steps import Choose, Load, Play, TareStep
from eitskin_studies.pictures.comparison_pictures import truth_marks
from everywhere import on_host
from small_models import prebuilt

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
    """One scene's image with what was there and what was found."""
    model, blob = prebuilt()
    options = replace(default_options(model), sign=sign)
    frames = frames_of(group)[which : which + 1]
    _, (one,) = on_host(
        [Load(blob), Choose(options), TareStep(touch_scenes.simulated().quiet_v), Play(frames)]
    )
    truth = truth_marks(TouchScene(title, groups()[group][which]), model.skin.conductivity_s_per_m)
    found = tuple(Mark(t.x_mm, t.y_mm, t.radius_mm) for t in one.touches)
    count = len(found)
    return Panel(
        f"{title}\n{count} touch{'' if count == 1 else 'es'} found", one.image, truth, found
    )


def draw_touches(path: Path) -> None:
    """Hard touches, their images and what was found."""
    model, _ = prebuilt()
    note = "solid circles: touches that are there; crosses and dashed circles: found"
    panels = [panel(*each) for each in SHOWN]
    draw_panels(
        path, model.skin, model.grid, panels, 4, title="Touches that are hard to see", note=note
    )


def draw_losses(path: Path) -> None:
    """How much the image changes with the damage to its frames."""
    errors = errors_of(on_host(all_steps())[1])
    matplotlib = load_matplotlib()
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(9.0, 3.0), layout="constrained")
        for k, (kind, values) in enumerate(errors.items()):
            axes = figure.add_subplot(1, 3, k + 1)
            axes.plot(
                [float(level) for level in LEVELS[kind]][1:], values[1:], "o-", color="#1f6fb4"
            )
            axes.set_ylim(0, 0.26)
            axes.set_xlabel(UNITS[kind], color=INK)
            if kind == "noise":
                axes.set_xscale("log")
            if kind == "bits":
                axes.invert_xaxis()
            if k == 0:
                axes.set_ylabel("change of the image,\nshare of its norm")
        save_picture(figure, path)


def draw_precision(path: Path) -> None:
    """Errors of float32 over the condition number, and over the size of the change."""
    by_number, sizes = by_condition(on_host(condition_steps())[1]), by_change()
    panels = (
        (
            "condition number of S",
            CONDITIONS,
            {
                "coefficients": [one.coefficients for one in by_number],
                "S x": [one.data for one in by_number],
            },
        ),
        (
            "size of the change, golden frame: 1",
            CHANGES,
            {"image": [one.image for one in sizes], "reduced data": [one.data for one in sizes]},
        ),
    )
    matplotlib = load_matplotlib()
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(9.0, 3.2), layout="constrained")
        for k, (label, at, lines) in enumerate(panels):
            axes = figure.add_subplot(1, 2, k + 1)
            for (name, values), style in zip(lines.items(), ("o-", "s--"), strict=True):
                axes.loglog(at, values, style, label=name)
            axes.set_xlabel(label, color=INK)
            axes.legend(frameon=False)
            if k == 0:
                axes.set_ylabel("float32 from float64,\nshare of the norm", color=INK)
            else:
                axes.invert_xaxis()
        save_picture(figure, path)


DRAWN: dict[str, Callable[[Path], None]] = {
    "hard-touches.png": draw_touches,
    "hard-losses.png": draw_losses,
    "hard-precision.png": draw_precision,
}


def draw(name: str, path: Path) -> None:
    DRAWN[name](path)
