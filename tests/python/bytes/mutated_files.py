"""``python mutated_files.py COUNT [FORMAT...]``: reads so many mutated files of each format, each
within 2 s of processor time, all within 500 MB more than the program itself has."""

import io
import json
import re
import resource
import signal
import sys
import tempfile
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from bytes_damage import ODD_BYTES, ODD_WORDS, read_or_refuse
from test_bytes_descriptions import DISK, SCENE, SKIN
from test_bytes_drawings import CURVES, FOREARM, HAND
from test_bytes_frames import FIELDS, ODD_ARRAYS
from test_bytes_models import resealed, whole_models

from eitskin.core.engine import CoreEngine
from eitskin.fem import mesh
from eitskin.frames.frames import load_frames
from eitskin.frames.layout import load_layout
from eitskin.model.eitm import load_model
from eitskin.scene.compiler import compile_scene
from eitskin.scene.description import load_scene
from eitskin.session.zones import load_zones
from eitskin.skin.drawing import read_drawing
from eitskin.skin.drawing_shapes import DrawingReading
from eitskin.skin.protocol import opposite
from eitskin.skin.skin import load_skin
from eitskin.teaching.presses import load_presses
from kept_meshes import mesher_that_keeps

MOST_S, MOST_BYTES = 2.0, 500_000_000
MAGNITUDES = (b"0", b"1", b"7", b"33", b"1000", b"65537", b"1e6", b"99999999", b"4294967296")
NUMBER = re.compile(rb"\d+(?:\.\d+)?")
ROWS = np.asarray(opposite(8).drive_measure)
PRESSES = {
    "untouched": np.ones((3, len(ROWS))), "pressed": np.full((3, len(ROWS)), 1.5),
    "place_mm": np.ones((3, 2)), "drive_measure": ROWS, "depth_mm": np.ones(3),
    "version": np.array(1), "n_electrodes": np.array(8), "skin": np.array("[skin]"),
}  # fmt: skip

LAYOUT = b"""
[lines]
delimiter = "tab"
label = "frame"
cells = 58
columns = "2:58"
time = "1"
time_scale = 0.001
scale = 1e-3
skip_bad_lines = true
[channels]
order = "table"
table = [[0, 1, 2, 3], [1, 2, 3, 4], [4, 5, 6, 7]]
sign = "reversed"
rotate = 3
swaps = [[0, 5], [2, 3]]
drop_channels = [4, 9]
[protocol]
electrodes = 8
kind = "skip"
skip = 2
current_a = 1e-3
[port]
baud = 115200
send = "start"
rate_hz = 50
"""
ZONES = b"""
[[key]]
name = "a"
corners_mm = [[0, 0], [20, 0], [20, 20], [0, 20]]
[[pad]]
name = "b"
x_mm = -30
y_mm = 5.5
radius_mm = 12
[[ring]]
name = "c"
x_mm = 0
y_mm = 0
inner_mm = 60
outer_mm = 80
"""


class TooMuch(BaseException):
    """A reader took longer than it may."""


def damaged(draw: np.random.Generator, wholes: Sequence[bytes]) -> bytes:
    """One of ``wholes``, a few places of it cut, changed, or filled with what asks for much."""
    content = bytearray(wholes[draw.integers(len(wholes))])
    for _ in range(min(draw.geometric(0.6), 5)):
        a, b = sorted(draw.integers(0, len(content) + 1, 2).tolist())
        b = min(b, a + int(10 ** draw.uniform(0, 4)))
        kind = draw.integers(7)
        numbers = list(NUMBER.finditer(bytes(content)))
        if kind < 2 and numbers:  # a number of another magnitude
            one = numbers[draw.integers(len(numbers))]
            content[one.start() : one.end()] = MAGNITUDES[draw.integers(len(MAGNITUDES))]
        elif kind == 2:
            words = ODD_WORDS if draw.integers(2) else ODD_BYTES
            content[a:a] = words[draw.integers(len(words))]
        elif kind == 3:  # the same again and again, up to half a megabyte
            piece = content[a:b]
            content[a:b] = piece * int(min(10 ** draw.uniform(0, 5), 500_000 / (len(piece) + 1)))
        elif kind == 4:
            del content[a:b]
        elif kind == 5:
            del content[a:]
        elif a < len(content):
            content[a] ^= int(draw.integers(1, 256))
    return bytes(content)


def archive(draw: np.random.Generator, fields: dict[str, Any]) -> bytes:
    """An .npz whose checksums are right and whose arrays are not."""
    arrays = dict(fields)
    for _ in range(min(draw.geometric(0.6), 4)):
        names = list(arrays)
        name = names[draw.integers(len(names))] if names else "voltage_v"
        kind = draw.integers(5)
        if kind == 0:
            arrays[name] = ODD_ARRAYS[draw.integers(len(ODD_ARRAYS))]
        elif kind == 1:
            arrays[f"{name}{draw.integers(3)}"] = arrays.pop(name, np.zeros(2))
        elif kind == 2:
            shape = draw.integers(0, 60, draw.integers(0, 4)).tolist()
            arrays[name] = np.zeros([*shape, int(draw.integers(1, 3))])
        elif kind == 3 and np.issubdtype(np.asarray(fields.get(name, "")).dtype, np.number):
            arrays[name] = np.asarray(fields[name]) * 10.0 ** draw.integers(-300, 300)
        else:
            arrays[name] = np.zeros(int(10 ** draw.uniform(0, 7)), np.int8)
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, values in arrays.items():
            npy = io.BytesIO()
            np.save(npy, values)
            inside = npy.getvalue()
            inside = damaged(draw, [inside]) if draw.random() < 0.1 else inside
            packed.writestr(f"{name}.npy", inside)
    content = stream.getvalue()
    return damaged(draw, [content]) if draw.random() < 0.3 else content


def finite(*values: Any) -> None:
    assert all(np.isfinite(np.asarray(one, np.float64)).all() for one in values), "not finite"


def read_skin(path: Path) -> None:
    skin, protocol = load_skin(path)
    finite(skin.outline.vertices_mm, protocol.current_a, skin.conductivity_s_per_m)


def read_scene(path: Path) -> None:
    scene = load_scene(path)
    finite(scene.rate_hz)
    if scene.frames + scene.quiet_frames <= 100:  # else it asks for long work in so many words
        compile_scene(scene)


def read_shapes(path: Path) -> None:
    drawing = read_drawing(path, DrawingReading(1.0))
    for element in (None, "skin", "a"):
        found = read_or_refuse(drawing.outline, element)
        if found is not None:
            finite(found.vertices_mm)


def read_frames(path: Path) -> None:
    frames = load_frames(path)
    finite(frames.voltage_v, frames.reference_voltage_v)


def read_model(path: Path) -> None:
    model, blob = load_model(path)
    finite(model.golden.frame_v, model.golden.reference_v, model.golden.image)
    CoreEngine(blob, prepared=False)


def read_layout(path: Path) -> None:
    layout = load_layout(path)
    source = layout.options.source
    finite(*(one or 0.0 for one in (layout.rate_hz, source.time_scale, source.scale)))


def read_zones(path: Path) -> None:
    for zone in load_zones(path):
        finite(zone.x_mm, zone.y_mm, zone.inner_mm, zone.outer_mm, *zone.corners_mm)


def read_presses(path: Path) -> None:
    presses = load_presses(path)
    finite(presses.untouched, presses.pressed, presses.place_mm)


Make = Callable[[np.random.Generator], bytes]
FORMATS: dict[str, tuple[str, Make, Callable[[Path], None]]] = {
    "skin": ("a.toml", lambda draw: damaged(draw, [SKIN, DISK]), read_skin),
    "scene": ("b.toml", lambda draw: damaged(draw, [SCENE]), read_scene),
    "svg": ("a.svg", lambda draw: damaged(draw, [CURVES, HAND]), read_shapes),
    "dxf": ("a.dxf", lambda draw: damaged(draw, [FOREARM]), read_shapes),
    "frames": ("a.npz", lambda draw: archive(draw, FIELDS), read_frames),
    "eitm": ("a.eitm", lambda draw: resealed(damaged(draw, whole_models())), read_model),
    "layout": ("c.toml", lambda draw: damaged(draw, [LAYOUT]), read_layout),
    "zones": ("d.toml", lambda draw: damaged(draw, [ZONES]), read_zones),
    "presses": ("b.npz", lambda draw: archive(draw, PRESSES), read_presses),
}


def too_long(*signal_and_frame: object) -> None:
    raise TooMuch(f"over {MOST_S:g} s")


def main(count: int, names: Sequence[str]) -> None:
    """Reads them; what goes wrong is raised, with the file kept and named."""
    folder = Path(tempfile.mkdtemp())
    (folder / "skin.toml").write_bytes(SKIN)
    mesh.run_mesher = mesher_that_keeps()
    whole_models()  # whatever is made or loaded on first use
    for name in ("skin", "svg", "dxf"):
        path = folder / FORMATS[name][0]
        path.write_bytes({"skin": SKIN, "svg": CURVES, "dxf": FOREARM}[name])
        FORMATS[name][2](path)
    now = int(re.findall(r"VmSize:\s+(\d+)", Path("/proc/self/status").read_text())[0]) * 1024
    resource.setrlimit(resource.RLIMIT_AS, (now + MOST_BYTES, now + MOST_BYTES))
    signal.signal(signal.SIGPROF, too_long)
    reported = {}
    for name in names or FORMATS:
        file, make, read = FORMATS[name]
        draw, used, opened = np.random.default_rng(3), 0.0, 0
        for k in range(count):
            path = folder / file
            path.write_bytes(make(draw))
            signal.setitimer(signal.ITIMER_PROF, MOST_S)
            try:
                opened += read_or_refuse(lambda: read(path) or True) is not None  # noqa: B023
                used = max(used, MOST_S - signal.setitimer(signal.ITIMER_PROF, 0)[0])
            except BaseException:
                signal.setitimer(signal.ITIMER_PROF, 0)
                print(f"{name}, file {k} of seed 3: {path}", file=sys.stderr)
                raise
        reported[name] = {"files": count, "opened": opened, "longest_s": round(used, 2)}
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    print(json.dumps({**reported, "peak_mb": peak}))


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2:])
