"""``eitskin bench gestures``: gestures of simulated fingers, reported by the C core and judged."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.core.gestures import Gestures
from eitskin.model.prebuilt import load_prebuilt
from eitskin.progress import Progress, silent
from eitskin.skin.skin import paper_skin
from eitskin.solve.reconstructor import Reconstructor
from eitskin_studies.gestures.drawn import EACH, KINDS, NONE, draw_session
from eitskin_studies.gestures.judged import GestureCount, judge, reported_gestures
from eitskin_studies.gestures.simulated import ELEMENTS, RATE_HZ, Simulator, found_touches
from eitskin_studies.gestures.stages import STAGES
from eitskin_studies.harness.sections import Filling, Tabular, text_table

ROLES = ("tuning", "judging")
WITHIN_S = 0.05


@dataclass(frozen=True)
class Settings:
    """The settings of a run."""

    sessions: int
    seed: int
    role: str
    snrs_db: tuple[float, ...]
    cache: Path | None = None


@dataclass(frozen=True)
class GestureBench:
    """The counts at each SNR."""

    settings: Settings
    counts: dict[float, GestureCount]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "sessions": self.settings.sessions,
            "seed": self.settings.seed,
            "role": self.settings.role,
            "snr_db": {f"{snr:g}": _facts(count) for snr, count in self.counts.items()},
        }


def run(settings: Settings, progress: Progress = silent) -> GestureBench:
    """Draw, simulate, reconstruct and judge ``settings.sessions`` sessions.

    Raises:
        UsageError, GeometryError, MissingExtraError: from the model and the forward model.
    """
    model, blob = load_prebuilt()
    skin, simulator = Reconstructor(model, blob=blob), Simulator(model, settings.cache)
    reach_mm = (paper_skin().outline.diameter_mm or 0.0) / 2
    counts = {snr: GestureCount() for snr in settings.snrs_db}
    for number in progress(range(settings.sessions)):
        session = draw_session(reach_mm, settings.seed, settings.role, number)
        exact_v = simulator.exact_v(session, settings.seed)
        for snr, count in counts.items():
            frames = found_touches(skin, exact_v, snr, settings.seed, session.name)
            count.add(judge(session, reported_gestures(frames, Gestures()), frames))
    return GestureBench(settings, counts)


def wilson(right: int, done: int) -> tuple[float, float]:
    """95 % interval of a fraction (Wilson, J. Am. Stat. Assoc. 22 (1927) 209-212)."""
    if not done:
        return 0.0, 1.0
    z, share = 1.959964, right / done
    middle = (share + z * z / (2 * done)) / (1 + z * z / done)
    half = z / (1 + z * z / done) * math.sqrt(share * (1 - share) / done + (z / (2 * done)) ** 2)
    return middle - half, middle + half


def _facts(count: GestureCount) -> dict[str, Any]:
    late = _late(count)
    return {
        "gestures": count.gestures,
        "right": count.right_gestures,
        "told": count.reported,
        "invented": count.invented.total(),
        "late_ms_median": 1e3 * float(np.median(late)),
        "late_ms_most": 1e3 * float(np.max(late)),
        "within_50_ms": float(np.mean(late <= WITHIN_S)),
        "taken_for": {
            f"{was}: {reported}": n for (was, reported), n in sorted(count.taken_for.items())
        },
    }


def _late(count: GestureCount) -> Any:
    return np.array([one for some in count.late_s.values() for one in some] or [math.nan])


def _share(right: int, done: int) -> str:
    low, high = wilson(right, done)
    return f"{100 * right / max(done, 1):.1f} ({100 * low:.1f} to {100 * high:.1f})"


def _summary(bench: GestureBench) -> Tabular:
    rows = []
    for snr, count in bench.counts.items():
        late = _late(count)
        within = int((late <= WITHIN_S).sum())
        rows.append(
            (
                f"{snr:g}", f"{count.gestures}", _share(count.right_gestures, count.gestures),
                _share(count.invented.total(), count.reported),
                f"{1e3 * np.median(late):.0f}", f"{1e3 * np.quantile(late, 0.99):.0f}",
                f"{1e3 * late.max():.0f}", _share(within, len(late)),
                _share(count.light_right[False], count.light[False]),
                _share(count.light_right[True], count.light[True]),
            )
        )  # fmt: skip
    head = (
        "SNR, dB", "gestures", "right, % (95 %)", "invented, % of those reported (95 %)",
        "reported after its end, median ms", "99 %", "most", "within 50 ms, % (95 %)",
        "right, all fingers firm, %", "right, one light, %",
    )  # fmt: skip
    return head, rows


def _by_kind(bench: GestureBench) -> Tabular:
    rows = []
    for kind in KINDS:
        row = [kind + (" (no gesture)" if kind in NONE else "")]
        for count in bench.counts.values():
            late = np.array(count.late_s.get(kind, [math.nan]))
            row.append(_share(count.right[kind], count.done[kind]))
            row.append(
                "-" if kind in NONE else f"{1e3 * np.median(late):.0f}, {1e3 * late.max():.0f}"
            )
        rows.append(row)
    head = ["what was done"]
    for snr in bench.counts:
        head += [f"{snr:g} dB: right, % (95 %)", f"{snr:g} dB: late ms, median, most"]
    return head, rows


def _confusion(bench: GestureBench) -> Tabular:
    rows = []
    for kind in KINDS:
        row = [kind]
        for count in bench.counts.values():
            wrong = [(n, reported) for (was, reported), n in count.taken_for.items() if was == kind]
            wrong.sort(key=lambda item: (-item[0], item[1]))
            row.append("; ".join(f"{reported} {n}" for n, reported in wrong))
        rows.append(row)
    return ["what was done", *(f"{snr:g} dB: reported, times" for snr in bench.counts)], rows


def _stages(bench: GestureBench) -> Tabular:
    rows = [[stage, *(str(c.stages[stage]) for c in bench.counts.values())] for stage in STAGES]
    return ["what failed", *(f"{snr:g} dB: gestures" for snr in bench.counts)], rows


def as_text(bench: GestureBench) -> str:
    """For a terminal."""
    parts = (_summary(bench), _by_kind(bench), _confusion(bench), _stages(bench))
    return "\n\n".join(text_table(*part) for part in parts)


def for_page(bench: GestureBench, command: str) -> Filling:
    """The marks of studies/results/gestures.md."""
    how = bench.settings
    text = (
        f"By `{command}`: {how.sessions} sessions of role {how.role}, seed {how.seed}, each of"
        f" {EACH} gestures of each kind in random order, {RATE_HZ:g} whole scans a second,"
        f" simulated on another mesh of about {ELEMENTS} elements, contacts ±20 %, 12 bits."
    )
    tables = {
        "summary": _summary(bench), "kinds": _by_kind(bench), "confusion": _confusion(bench),
        "stages": _stages(bench),
    }  # fmt: skip
    return {"gestures-run": text}, tables
