"""Suboptimality of the objective against MIoU of the image, a line a solver."""

from pathlib import Path

from eitskin.view.panels import save_picture
from eitskin.view.pictures import load_matplotlib
from eitskin_studies.benchmarks.suboptimality import MIN, GapCurves

COLOURS = {
    "fista": "#777777",
    "working-set": "#1f6fb2",
    "active-set": "#2a8a3f",
}
NAMES = {
    "fista": "FISTA, iterations",
    "working-set": "FISTA on a working set, iterations",
    "active-set": "active set, kMAC at most",
}


def draw(path: Path, curves: GapCurves) -> None:
    """Write the picture.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    matplotlib = load_matplotlib()
    figure = matplotlib.figure.Figure(figsize=(8, 4.8), layout="constrained")
    matplotlib.backends.backend_agg.FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for solver, colour in COLOURS.items():
        stops = [s for s in curves.stops if s.solver == solver]
        x, y = [max(s.suboptimality, MIN) for s in stops], [s.miou for s in stops]
        front = 1 if solver == "fista" else 2
        axes.plot(
            x, y, "o-", color=colour, label=NAMES[solver], markersize=4, linewidth=1.3, zorder=front
        )
        for number, stop in enumerate(stops):
            if solver == "fista":
                continue
            label = (
                f"{stop.effort // 1000}"
                if solver == "active-set" and stop.effort
                else f"{stop.effort or 'optimum'}"
            )
            below = solver == "active-set" and number % 2
            axes.annotate(
                label, (x[number], y[number]), color=colour, fontsize=7,
                xytext=(0, -10 if below else 5),
                textcoords="offset points", ha="center",
            )  # fmt: skip
    axes.set_xscale("log")
    axes.invert_xaxis()
    axes.set_xlabel(
        "suboptimality of the objective, (F - F*) / F*, mean over scenes: to the right, nearer to"
        " the optimum"
    )
    axes.set_ylabel("MIoU of the image, mean")
    axes.set_title(
        f"The optimum is not the best picture ({curves.test}, 60 dB, rank 64)", fontsize=10
    )
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, loc="lower right")
    save_picture(figure, path)
