"""Hands in time through a simulated board: what frames and reports after drives show while fingers
land, slide and lift."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import numpy as np

from eitskin.model.prebuilt import load_prebuilt
from eitskin.scene.library_scenes import find_scene, library
from eitskin_studies.experiments.experiment import ExperimentOutcome, Table, Workspace
from eitskin_studies.experiments.hands import scenes
from eitskin_studies.experiments.hands.judged import Judged, judge, stream
from eitskin_studies.experiments.multitouch.counts import share

TITLE = "Hands in time: false touches, delay and error in frames and in reports after drives"
ELEMENTS = 5000
# effects that are in every skin; the scenes of the library with others have something to name
HEALTHY = {"noise", "adc", "contact_impedance", "background", "misplacement", "jitter"}
RESAMPLES = 2000


@dataclass(frozen=True)
class Kind:
    """``count`` scenes by ``draw``."""

    name: str
    draw: scenes.Draw
    count: int = 40
    snr_db: float = 60.0


def kinds() -> list[Kind]:
    """Return the kinds of scenes that the page has."""
    listed = [
        Kind("piano", scenes.piano),
        Kind("chord of 3 to 5", scenes.chord),
        Kind("pairs, 24 to 34 mm", scenes.pair, 80),
        Kind("two sliding", scenes.moving),
        Kind("palm, then a finger", scenes.palm),
        Kind("piano, 40 dB", scenes.piano, snr_db=40.0),
        Kind("two sliding, 40 dB", scenes.moving, snr_db=40.0),
    ]
    listed += [
        Kind(f"one finger, rise {ms} ms", scenes.single(ms / 1e3), 60) for ms in (0, 30, 60, 120)
    ]
    return [
        *listed,
        Kind("swipe at 1 m/s", scenes.swipe(1000.0)),
        Kind("crossing at 300 mm/s", scenes.crossing),
        Kind("five fingers, 60 ms apart", scenes.five),
        Kind("hand, then a finger", scenes.hand),
        Kind("creep", scenes.creeping),
    ]


def run(workspace: Workspace) -> ExperimentOutcome:
    """Run the whole study; results that the workspace has kept are not computed again."""
    settings, (_, blob) = workspace.settings, load_prebuilt()
    listed = [(number, one, settings.count(one.count)) for number, one in enumerate(kinds())]
    todo = [(number, one, k) for number, one, count in listed for k in range(count)]
    judged: dict[str, list[Judged]] = {one.name: [] for _, one, _ in listed}
    for number, one, k in workspace.progress(todo, "streaming"):
        facts = {"kind": one.name, "scene": k, "elements": ELEMENTS}
        make = partial(_streamed, one, number, k, settings.seed, blob)
        made = workspace.kept(facts, make)
        judged[one.name].append(Judged(**made))
    found = [{"name": name, **_summary(each)} for name, each in judged.items()]
    named = _library(workspace, blob)
    words = (
        f"Seed {settings.seed}; fingers of radius 6.5 to 9.5 mm and contrast 3 to 8, a palm of 22"
        f" mm and contrast 2; frames from {ELEMENTS} elements; 60 dB unless a line says"
        f" otherwise; a tare of {scenes.UNTOUCHED} frames; 48 frames per second, 100 us per row;"
        " the prebuilt model."
    )
    tables = (_false_table(found), _time_table(found), named)
    return ExperimentOutcome(tables, {"kinds": found}, {}, {"sets": words})


def _streamed(one: Kind, number: int, k: int, seed: int, blob: bytes) -> dict[str, Any]:
    fingers = one.draw(np.random.default_rng([seed, number, k]))
    scene = scenes.scene(fingers, 1000 * seed + k, one.snr_db, ELEMENTS)
    return asdict(judge(stream(scene, blob), fingers))


def _library(workspace: Workspace, blob: bytes) -> Table:
    """The diagnostics of each scene of the library on a healthy skin, that are not true."""
    names = [name for name in library() if set(find_scene(name).effects) <= HEALTHY]
    lines = []
    for name in workspace.progress(names[: workspace.settings.count(len(names))], "library"):
        counted = dict(workspace.kept({"library": name}, partial(_diagnosed, name, blob)))
        frames = counted.pop("frames")
        text = ", ".join(f"{what} in {count}" for what, count in counted.items()) or "none"
        lines.append((f"`{name}`", str(frames), text))
    return Table("library", ("scene", "frames", "diagnostics, in how many frames"), tuple(lines))


def _diagnosed(name: str, blob: bytes) -> dict[str, int]:
    return dict(diagnosed(stream(find_scene(name), blob)))


def diagnosed(messages: Sequence[Any]) -> Counter[str]:
    """Return the number of ``frames`` of a stream, and how many of them have each diagnostic."""
    counted: Counter[str] = Counter()
    for message in messages:
        if hasattr(message, "diagnostics"):
            counted["frames"] += 1
            counted.update(message.diagnostics)
    return counted


# ---- what came of it ----


def _summary(each: list[Judged]) -> dict[str, Any]:
    def per(part: str, whole: str) -> list[float]:
        """Percent of all, and its interval by drawing scenes again."""
        pairs = np.array([(getattr(one, part), getattr(one, whole)) for one in each], float)
        drawn = np.random.default_rng(1).integers(0, len(pairs), (RESAMPLES, len(pairs)))
        sums = pairs[drawn].sum(axis=1)
        low, high = np.quantile(sums[:, 0] / np.maximum(sums[:, 1], 1), [0.025, 0.975])
        total = pairs.sum(axis=0)
        return [100 * float(v) for v in (total[0] / max(total[1], 1), low, high)]

    def scenes_with(what: str) -> list[float]:
        found = share(sum(getattr(one, what) > 0 for one in each), len(each))
        return [100 * found.mean, 100 * found.low, 100 * found.high]

    def quantiles(what: str) -> list[float]:
        values = np.concatenate([np.asarray(getattr(one, what), float) for one in each])
        return [float(np.quantile(values, q)) for q in (0.5, 0.95)] if values.size else []

    return {
        "scenes": len(each),
        "reports_false": per("reports_false", "reports"),
        "confirmed_false": per("confirmed_false", "reports"),
        "scenes_reports_false": scenes_with("reports_false"),
        "scenes_frames_false": scenes_with("frames_false"),
        "frames_exact": per("frames_exact", "frames"),
        "untrue": per("untrue", "frames"),
        "named": dict(Counter(name for one in each for name in one.named)),
        "missed": sum(one.fingers - len(one.first) for one in each),
        "fingers": sum(one.fingers for one in each),
        "first_ms": [1e3 * v for v in quantiles("first")],
        "still_mm": quantiles("still"),
        "moving_mm": quantiles("moving"),
    }


def _percent(value: Sequence[float], digits: int = 2) -> str:
    mean, low, high = value
    return f"{mean:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


def _two(values: Sequence[float], digits: int) -> str:
    return ", ".join(f"{each:.{digits}f}" for each in values) or "-"


def _false_table(found: list[dict[str, Any]]) -> Table:
    head = ("scenes of", "scenes", "reports with a false touch, %", "with a confirmed false one, %",
            "scenes with any in reports, %", "scenes with any in frames, %", "frames exact, %",
            "frames with an untrue diagnostic, %")  # fmt: skip
    lines = tuple(
        (
            one["name"], str(one["scenes"]), _percent(one["reports_false"]),
            _percent(one["confirmed_false"]), _percent(one["scenes_reports_false"], 0),
            _percent(one["scenes_frames_false"], 0), f"{one['frames_exact'][0]:.1f}",
            _percent(one["untrue"]),
        )
        for one in found
    )  # fmt: skip
    return Table("false", head, lines)


def _time_table(found: list[dict[str, Any]]) -> Table:
    head = ("scenes of", "fingers never reported", "first report, ms after contact: median, p95",
            "still finger while another lands, mm: median, p95",
            "moving finger, mm: median, p95")  # fmt: skip
    lines = tuple(
        (
            one["name"], f"{one['missed']} of {one['fingers']}", _two(one["first_ms"], 1),
            _two(one["still_mm"], 2), _two(one["moving_mm"], 2),
        )
        for one in found
    )  # fmt: skip
    return Table("time", head, lines)
