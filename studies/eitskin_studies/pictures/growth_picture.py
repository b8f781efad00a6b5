"""How a frame's cost grows, as a picture: a panel for each thing that is varied."""

from pathlib import Path

from eitskin.view.panels import save_picture
from eitskin.view.pictures import INK, STYLE, load_matplotlib
from eitskin_studies.benchmarks.growth import GrowthTimes, exponent
from eitskin_studies.pictures.style import BLUE, GREY, VERMILION

SOLVE, TOUCHES, MACS = BLUE, VERMILION, GREY


def draw_growth(path: str | Path, result: GrowthTimes) -> None:
    """Microseconds of solve and touches (left axis) and multiply-accumulates (right axis) over what
    is varied, as a PNG.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    matplotlib = load_matplotlib()
    names = list(dict.fromkeys(point.sweep for point in result.points))
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(3.1 * len(names), 3.4), layout="constrained")
        panels = figure.subplots(1, len(names), squeeze=False)
        most = 1.25 * max(point.whole_us for point in result.points)
        least = 0.7 * min(min(point.touch_us, point.solve_us) for point in result.points)
        per_us = max(point.macs + point.touch_macs for point in result.points) / max(
            point.whole_us for point in result.points
        )
        for number, (axes, name) in enumerate(zip(panels[0], names, strict=True)):
            points = result.sweep(name)
            values = [point.value for point in points]
            axes.loglog(
                values, [point.solve_us for point in points], "o-", color=SOLVE, label="solve, µs"
            )
            axes.loglog(
                values,
                [point.touch_us for point in points],
                "s-",
                color=TOUCHES,
                label="touches, µs",
            )
            other = axes.twinx()
            both = [point.macs + point.touch_macs for point in points]
            other.loglog(values, both, ":", color=MACS, label="MACs of both (right)")
            axes.set_ylim(least, most)
            other.set_ylim(least * per_us, most * per_us)
            axes.set_xticks(values, [str(value) for value in values])
            axes.minorticks_off()
            other.minorticks_off()
            slope = exponent(points, lambda point: point.whole_us) if len(points) > 1 else 0.0
            axes.set_title(f"{name}\ntime ~ value^{slope:.2f}", color=INK)
            axes.set_xlabel(name.split(",")[0])
            if number == 0:
                axes.set_ylabel("µs per frame")
                lines = [*axes.get_lines(), *other.get_lines()]
                axes.legend(
                    lines,
                    [line.get_label() for line in lines],
                    loc="upper left",
                    frameon=False,
                    fontsize=7,
                )
            if number == len(names) - 1:
                other.set_ylabel("multiply-accumulates per frame")
            else:
                other.set_yticklabels([])
            if number:
                axes.set_yticklabels([])
        save_picture(figure, path)
