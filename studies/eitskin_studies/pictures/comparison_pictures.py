"""A comparison as pictures: test scenes as each method shows them, and MIoU over the threshold."""

from collections.abc import Sequence
from pathlib import Path

from eitskin.scene.random_touches import TouchScene
from eitskin.view.panels import draw_panels, save_picture
from eitskin.view.pictures import INK, STYLE, Mark, Panel, load_matplotlib
from eitskin_studies.compare.run import CompareResult, Comparison
from eitskin_studies.harness.thresholds import THRESHOLDS
from eitskin_studies.pictures.style import COLOURS


def truth_marks(scene: TouchScene, sheet_s_per_m: float) -> tuple[Mark, ...]:
    """A scene's touches with their change of conductivity in S/m."""
    return tuple(
        Mark(t.x_mm, t.y_mm, t.radius_mm, (t.contrast - 1.0) * sheet_s_per_m) for t in scene.touches
    )


def found_marks(result: CompareResult, scene: int) -> tuple[Mark, ...]:
    """Return the places that a method found in one test scene."""
    return tuple(Mark(float(x), float(y)) for x, y in result.found_mm[scene])


def chosen_scenes(comparison: Comparison, count: int) -> list[int]:
    """The first scenes with 1 touch, 2, 3, ... in turn, ``count`` in all where there are as
    many."""
    by_number: dict[int, list[int]] = {}
    for k, scene in enumerate(comparison.test.touches.scenes):
        by_number.setdefault(len(scene.touches), []).append(k)
    chosen: list[int] = []
    queues = [by_number[number] for number in sorted(by_number)]
    while any(queues) and len(chosen) < count:
        for queue in queues:
            if queue and len(chosen) < count:
                chosen.append(queue.pop(0))
    return sorted(chosen, key=lambda k: (len(comparison.test.touches.scenes[k].touches), k))


def draw_scenes(
    path: str | Path, comparison: Comparison, scenes: Sequence[int] | None = None
) -> None:
    """A row a scene (three by default), a column a method, truth first, as a PNG.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    setup, test = comparison.setup, comparison.test
    snr_db = test.measurement.snr_db
    noise = "no noise" if snr_db is None else f"SNR {snr_db:g} dB"
    panels = []
    for k in chosen_scenes(comparison, 3) if scenes is None else scenes:
        marks = truth_marks(test.touches.scenes[k], setup.skin.conductivity_s_per_m)
        panels.append(Panel(f"truth\nscene {k}", None, marks, fill_truth=True))
        for result in comparison.results:
            title = f"{_short(result.name)}\nMIoU {result.miou[k]:.2f}"
            panels.append(Panel(title, result.images[k], marks, found_marks(result, k)))
    draw_panels(
        path,
        setup.skin,
        setup.grid,
        panels,
        1 + len(comparison.results),
        title="The same frames, reconstructed",
        note=(
            f"simulated, {test.touches.name}, {noise}; circles: true touches, crosses: found ones; "
            "red: more conductive, blue: less"
        ),
    )


def draw_curves(path: str | Path, comparison: Comparison) -> None:
    """Mean test MIoU over the threshold t, a line a method, the trained t marked, as a PNG.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    matplotlib = load_matplotlib()
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(7.2, 4.4), layout="constrained")
        axes = figure.add_subplot()
        for k, result in enumerate(comparison.results):
            style = ("-", "--", ":")[k // len(COLOURS) % 3]
            colour = COLOURS[k % len(COLOURS)]
            (line,) = axes.plot(THRESHOLDS, result.curve, style, color=colour, label=result.name)
            at = THRESHOLDS.index(result.threshold)
            axes.plot(result.threshold, result.curve[at], "o", color=line.get_color(), markersize=5)
        axes.axhline(
            comparison.ceiling, color=INK, linewidth=0.8, linestyle=":", label="perfect image"
        )
        axes.set_xlabel("threshold t: a touch is where x > t max(x)")
        axes.set_ylabel("mean MIoU of the test scenes")
        axes.set_xlim(0, 1)
        axes.set_title(
            f"MIoU over the threshold; dots: t chosen on {comparison.train.touches.name}"
        )
        axes.grid(linewidth=0.4, alpha=0.5)
        axes.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
        save_picture(figure, path)


def _short(name: str) -> str:
    """A name that fits above a small panel."""
    return (
        name.replace("linear back projection", "back projection")
        .replace(" (Tikhonov)", "")
        .replace("plain ", "")
    )
