"""The drawing of docs/guide/hardware.md: board, generator, current source, multiplexers, skin and
receiver.

Made by ``eitskin draw wiring -o docs/pictures/wiring.png``.
"""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import TYPE_CHECKING

from eitskin.fileio import write_beside
from eitskin.view.pictures import ELECTRODE, INK, STYLE, load_matplotlib
from eitskin_hardware.circuit.nucleo import MULTIPLEXERS, WIRES, Wire

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH, HEIGHT = 124.0, 76.0
DPI = 110
BOARD, ANALOG, DIGITAL, SIGNAL = "#e8eef5", "#fbf3e2", "#3465a4", "#a0410d"
SMALL = 7.0
MUX_X, MUX_WIDTH, MUX_HEIGHT = 77.0, 13.0, 10.0
MUX_Y = (60.0, 44.0, 28.0, 12.0)
BUS_Y = (54.5, 46.0, 36.0, 14.0)
BOARD_EDGE = 27.0


def draw_wiring(path: str | Path) -> None:
    """The drawing as a PNG.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    matplotlib = load_matplotlib()
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(WIDTH / 10.5, HEIGHT / 10.5))
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set(xlim=(0, WIDTH), ylim=(0, HEIGHT), aspect="equal")
        axes.axis("off")
        _board(axes)
        _generator(axes)
        _multiplexers(axes)
        _skin(axes)
        _receiver(axes)
        with write_beside(path) as temporary:
            figure.savefig(temporary, format="png", dpi=DPI, metadata={"Software": None})


def _box(
    axes: Axes,
    x: float,
    y: float,
    width: float,
    height: float,
    title: str,
    text: str = "",
    colour: str = ANALOG,
) -> None:
    from matplotlib.patches import Rectangle

    axes.add_patch(
        Rectangle((x, y), width, height, facecolor=colour, edgecolor=INK, linewidth=1.0, zorder=2)
    )
    middle = x + width / 2
    if not text:
        axes.text(
            middle, y + height / 2, title, ha="center", va="center", fontweight="bold", zorder=3
        )
        return
    axes.text(middle, y + height - 1.2, title, ha="center", va="top", fontweight="bold", zorder=3)
    axes.text(
        middle,
        y + height - 4.0,
        text,
        ha="center",
        va="top",
        fontsize=SMALL,
        linespacing=1.35,
        zorder=3,
    )


def _arrow(
    axes: Axes, points: list[tuple[float, float]], colour: str, width: float = 1.2, label: str = ""
) -> None:
    """A line with corners; its last piece ends in an arrow head, the label stands over its
    first."""
    for start, end in itertools.pairwise(points):
        last = end == points[-1]
        style = "-|>" if last else "-"
        axes.annotate(
            "",
            end,
            start,
            arrowprops={
                "arrowstyle": style,
                "color": colour,
                "lw": width,
                "shrinkA": 0,
                "shrinkB": 0,
            },
            zorder=1,
        )
    if label:
        (x, y), (to_x, _) = points[0], points[1]
        axes.text(
            (x + to_x) / 2, y + 0.5, label, ha="center", va="bottom", fontsize=SMALL, color=colour
        )


def _pin(wire: Wire) -> str:
    return f"{wire.zio or wire.morpho}  {wire.pin}"


def _to(end: str) -> list[Wire]:
    return [wire for wire in WIRES if wire.to.startswith(end)]


def _board(axes: Axes) -> None:
    _box(
        axes,
        3,
        4,
        BOARD_EDGE - 3,
        68,
        "NUCLEO-F767ZI",
        "MB1137, STM32F767ZI\n216 MHz, 3.3 V",
        BOARD,
    )
    own = [
        f"{wire.pin}  {wire.to if wire.to.startswith('LD') else wire.function}"
        for wire in WIRES
        if not wire.morpho
    ]
    axes.text(5, 60, "on the board:\n" + "\n".join(own), fontsize=SMALL, va="top", linespacing=1.6)
    power = (
        "3.3 V (CN8-7) and GND (CN8-11):\nAD9833\nAVDD (CN10-1) and AGND (CN10-3):\n"
        "clamps, REF, receiver\nCN8-8, PC11: supply good"
    )
    axes.text(5, 36, power, fontsize=SMALL, va="top", linespacing=1.6)
    axes.text(5, 8, "CN1: USB to the host", fontsize=SMALL, va="top", fontweight="bold")


def _generator(axes: Axes) -> None:
    _box(axes, 44, 58, 12, 14, "AD9833", "50 kHz sine\nMCLK 8 MHz\n3.3 V, 100 nF")
    names = {"MCLK": 69.5, "SCLK": 66.5, "SDATA": 63.5, "FSYNC": 60.5}
    for wire in _to("AD9833"):
        name = wire.to.split()[1]
        _arrow(
            axes,
            [(BOARD_EDGE, names[name]), (44, names[name])],
            DIGITAL,
            label=f"{_pin(wire)}  {name}",
        )
    source = "low-pass 200 kHz\ngain 3.3: 1 V peak\nHowland, buffered:\n0.5 mA peak, no DC"
    _box(axes, 59, 58, 15, 14, "current source", source)
    _arrow(axes, [(56, 65), (59, 65)], SIGNAL)
    _arrow(axes, [(74, 65), (MUX_X, 65)], SIGNAL)


def _multiplexers(axes: Axes) -> None:
    for name, y, bus in zip(MULTIPLEXERS, MUX_Y, BUS_Y, strict=True):
        _box(
            axes,
            MUX_X,
            y,
            MUX_WIDTH,
            MUX_HEIGHT,
            f"ADG1206  {name}",
            "S1 ... S16: electrodes\n$\\pm$15 V, EN pulled down",
        )
        wires = _to(f"ADG1206 {name}")
        points = [(BOARD_EDGE, bus), (MUX_X, bus)]
        if bus < y:  # from below
            points[1:] = [(MUX_X + MUX_WIDTH / 2, bus), (MUX_X + MUX_WIDTH / 2, y)]
        axes.plot(
            *zip(*points, strict=True),
            color=DIGITAL,
            linewidth=3.0,
            solid_capstyle="butt",
            zorder=1,
        )
        text = f"{wires[0].pin} ... {wires[3].pin}  A0 ... A3,   {wires[4].pin}  EN"
        axes.text(BOARD_EDGE + 1, bus + 0.7, text, fontsize=SMALL, color=DIGITAL, va="bottom")
    axes.text(
        MUX_X - 4.4, MUX_Y[1] + 6.4, "minus the\nsource", fontsize=SMALL, ha="right", va="center"
    )
    _arrow(axes, [(MUX_X - 4, MUX_Y[1] + 6.4), (MUX_X, MUX_Y[1] + 6.4)], SIGNAL)


def _skin(axes: Axes) -> None:
    from matplotlib.patches import Circle

    x, y, radius = 108.5, 41.0, 12.0
    axes.add_patch(
        Circle((x, y), radius, facecolor="#f4f8f4", edgecolor=INK, linewidth=1.2, zorder=2)
    )
    axes.text(
        x,
        y,
        "skin\n16 electrodes\nseen from above",
        ha="center",
        va="center",
        fontsize=SMALL + 1,
        zorder=3,
    )
    for electrode in range(16):
        angle = math.pi / 2 + 2 * math.pi * electrode / 16
        at = (x + radius * math.cos(angle), y + radius * math.sin(angle))
        axes.plot(*at, "s", color=ELECTRODE, markersize=5, zorder=3)
        outside = (x + 1.16 * radius * math.cos(angle), y + 1.16 * radius * math.sin(angle))
        axes.text(*outside, str(electrode), fontsize=SMALL - 1, ha="center", va="center")
    for mux_y in MUX_Y:
        middle = mux_y + MUX_HEIGHT / 2
        axes.plot(
            [MUX_X + MUX_WIDTH, 93.0],
            [middle, middle],
            color=SIGNAL,
            linewidth=3.0,
            solid_capstyle="butt",
            zorder=1,
        )
    low, high = MUX_Y[-1] + MUX_HEIGHT / 2, MUX_Y[0] + MUX_HEIGHT / 2
    axes.plot([93.0, 93.0], [low, high], color=SIGNAL, linewidth=3.0, zorder=1)
    axes.plot([93.0, x - radius - 2.6], [y, y], color=SIGNAL, linewidth=3.0, zorder=1)
    note = "S1 of all four to electrode 0,\nS2 to electrode 1 and so on:\n16 short single wires"
    axes.text(94.5, 66.0, note, fontsize=SMALL, color=SIGNAL, va="top")


def _receiver(axes: Axes) -> None:
    _box(
        axes,
        53,
        17,
        17,
        15,
        "amplifier",
        "AD8421, gain 3\nR$_G$ 4.87 k$\\Omega$\nREF 1.65 V\ninputs 1 M$\\Omega$ to AGND",
    )
    _box(axes, 35, 18.5, 13, 12, "to 3.3 V", "1 k$\\Omega$, 470 pF\nBAT54S to AVDD\nand AGND")
    for level in (MUX_Y[2] + 2.0, MUX_Y[3] + 7.5):
        _arrow(axes, [(MUX_X, level), (70, level)], SIGNAL)
    (wire,) = _to("output of the receiver")
    _arrow(axes, [(53, 24.5), (48, 24.5)], SIGNAL)
    _arrow(axes, [(35, 24.5), (BOARD_EDGE, 24.5)], SIGNAL)
    axes.text(
        BOARD_EDGE + 1, 25.2, f"{wire.zio}\n{wire.pin}", fontsize=SMALL, color=SIGNAL, va="bottom"
    )
