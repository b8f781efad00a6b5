"""Models taught from presses at known places, on a measured hydrogel skin: error by number of
presses, in order of time, with hand-given places, with rows out, and every baseline on the same
splits."""

import time
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np

from eitskin.errors import UsageError
from eitskin.model.model import Model
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import disk
from eitskin.skin.skin import Skin
from eitskin.solve.reconstructor import Reconstructor
from eitskin.teaching.left_out import CHI2_90
from eitskin.teaching.presses import Presses, load_presses
from eitskin.teaching.teach import Taught, solve_presses, teach
from eitskin_studies.experiments.experiment import ExperimentOutcome, Table, Workspace
from eitskin_studies.experiments.teaching.baselines import BASELINES
from eitskin_studies.experiments.teaching.remounted import (
    CHANGES,
    FIRST_SEED,
    TAUGHT,
    Change,
    update_table,
    updates,
)
from eitskin_studies.experiments.teaching.untaught import untaught
from eitskin_studies.harness.drawings import Drawing
from eitskin_studies.pictures.teaching_picture import draw_teaching

TITLE = "A skin taught from presses at known places"
FILE = "hydrogel_presses.npz"
COUNTS = (10, 20, 50, 100, 400)
SPLITS, JUDGED = 5, 100
SIZE_MM = 171.0
SKIN = Skin("hydrogel", disk(SIZE_MM), Electrodes(count=16, width_mm=4.0, start_angle_deg=0.0))
PAIR_MM = 15.0  # a touch of two counts within so far
PAIR_RANGES = ((15, 30), (30, 45), (45, 70), (70, 200))
PAIRS = 150
HAND_SD_MM = 5.0
ELECTRODE_OUT = 5
TARE, FOLLOW_FRAMES = 8, 1  # chosen on presses 200 to 299, one untouched frame a press
AGES = (1, 5, 20)  # presses, of a reference
AGE_TAUGHT = 4  # of 100 of 500 presses, 20 of all
TARGETS = {
    "20": "3.2 / 13", "50": "2.0 / 6", "100": "1.5 / 4.5", "400": "1.1 / 4",
    "100, first to last in time": "3.4", "pairs over 45 mm": ".90", "singles": ".97",
    "depth": "1.3", "ellipses": ".87 to .93", "places by hand": "3.2", "one electrode out": "2.5",
}  # fmt: skip


def load_measured(workspace: Workspace, study: str) -> Presses:
    """Load the measured presses from the folder that ``study`` was given.

    Raises:
        UsageError: the presses are not there.
    """
    folder = workspace.settings.data
    if folder is None or not (folder / FILE).is_file():
        raise UsageError(
            f"study {study}: needs --data DIR with {FILE}, presses that are not part of the"
            " project; studies/results/teaching.md says which"
        )
    return load_presses(folder / FILE)


def run(workspace: Workspace) -> ExperimentOutcome:
    """Every split by every method.

    Raises:
        UsageError: the presses are not there.
    """
    presses = load_measured(workspace, "teaching")
    splits = workspace.settings.count(SPLITS, 1)
    jobs = [(count, seed) for count in COUNTS for seed in range(splits)]
    taught = {
        f"{count}/{seed}": workspace.kept(
            {"study": "teaching", "count": count, "split": seed},
            partial(_split, presses, count, seed),
        )
        for count, seed in workspace.progress(jobs, "splits")
    }
    rivals = {
        f"{name}/{count}/{seed}": workspace.kept(
            {"study": "teaching", "rival": name, "count": count, "split": seed},
            partial(_rival, presses, name, count, seed),
        )
        for name in BASELINES
        for count, seed in workspace.progress(jobs, name)
    }
    more = workspace.kept(
        {"study": "teaching", "what": "more", "splits": splits}, partial(_more, presses, splits)
    )
    changed = [(change, FIRST_SEED + k) for change in CHANGES for k in range(splits)]
    updated = {
        f"{change.text}/{seed}": workspace.kept(
            {"study": "teaching", "update": change.text, "seed": seed},
            partial(_updated, presses, change, seed),
        )
        for change, seed in workspace.progress(changed, "updates")
    }
    data = {"taught": taught, "rivals": rivals, "more": more, "updated": updated}
    return ExperimentOutcome(
        (_by_count(taught, rivals, splits), _targets(taught, more, splits), update_table(updated)),
        data,
        {"teaching.png": Drawing(draw_teaching, _drawn(data, splits))},
        {"conditions": _conditions(splits)},
    )


def _conditions(splits: int) -> str:
    return (
        f"The 500 presses are split at random {splits} times (seeds 0 to {splits - 1}). The last"
        f" {JUDGED} of each split are scored, each against the untouched frame just before it;"
        " numbers are medians over the splits. No number of a method was chosen on scored presses,"
        " but the method as a whole was developed on this set. Two presses at once are sums of two"
        " real ones; their count is exact if two touches are found, each within"
        f" {PAIR_MM:g} mm of its own press."
    )


def _parts(presses: Presses, count: int, seed: int) -> tuple[Presses, Presses]:
    order = np.random.default_rng(seed).permutation(len(presses))
    return presses.take(order[:count]), presses.take(order[-JUDGED:])


def _split(presses: Presses, count: int, seed: int) -> dict[str, Any]:
    known, judged = _parts(presses, count, seed)
    begun = time.process_time()
    taught = teach(known, SKIN)
    seconds = time.process_time() - begun
    return {"fit_s": seconds, **_judged(taught, judged, seed)}


def _judged(taught: Taught, judged: Presses, seed: int) -> dict[str, Any]:
    error, number, strength, squared = solve_presses(taught.model, judged)
    out: dict[str, Any] = {
        "median": float(np.median(error)),
        "p95": float(np.quantile(error, 0.95)),
        "single": float(np.mean(number == 1)),
    }
    law = taught.model.force_law
    if law is not None and judged.depth_mm is not None:
        depth = law.forces_at(judged.place_mm, strength)
        out["depth_rms"] = float(np.sqrt(np.mean((depth - judged.depth_mm) ** 2)))
    if taught.model.place_factor > 0:
        out["covered"] = float(np.mean(squared < CHI2_90))
    out["pairs"] = _pairs(taught.model, judged, seed)
    return out


def _pairs(model: Model, judged: Presses, seed: int) -> dict[str, float]:
    """The share of sums of two presses that are exact, by their distance."""
    draw, core = np.random.default_rng(1000 + seed), Reconstructor(model)
    hits: dict[str, list[bool]] = {f"{low} to {high}": [] for low, high in PAIR_RANGES}
    while min(map(len, hits.values())) < PAIRS // 4:
        i, j = draw.choice(len(judged), 2, replace=False)
        apart = float(np.linalg.norm(judged.place_mm[i] - judged.place_mm[j]))
        kind = next((f"{a} to {b}" for a, b in PAIR_RANGES if a <= apart < b), None)
        if kind is None or len(hits[kind]) >= PAIRS // 4:
            continue
        core.forget()
        core.tare(judged.untouched[i])
        touches = core.reconstruct(judged.pressed[i] + judged.difference[j]).touches
        found = np.array([(one.x_mm, one.y_mm) for one in touches]).reshape(-1, 2)
        both = judged.place_mm[[i, j]]
        near = np.linalg.norm(found[:, None] - both[None], axis=2) < PAIR_MM
        exact = len(found) == 2 and bool((near[0, 0] and near[1, 1]) or (near[0, 1] and near[1, 0]))
        hits[kind].append(exact)
    return {kind: float(np.mean(listed)) for kind, listed in hits.items()}


def _rival(presses: Presses, name: str, count: int, seed: int) -> dict[str, float]:
    known, judged = _parts(presses, count, seed)
    unit = np.sqrt(np.mean(known.difference**2, axis=0))
    found = BASELINES[name](known.difference / unit, known.place_mm, judged.difference / unit)
    error = np.linalg.norm(found - judged.place_mm, axis=1)
    return {"median": float(np.median(error)), "p95": float(np.quantile(error, 0.95))}


def _more(presses: Presses, splits: int) -> dict[str, Any]:
    """In order of time, shuffled places, places by hand, one electrode out, no description."""
    out: dict[str, Any] = {}
    first, judged = teach(presses.take(np.arange(100)), SKIN), presses.take(np.arange(400, 500))
    out["in time"] = _middle(first, judged)
    out["stays"], out["follows"] = (_one_tare(first.model, presses, n) for n in (0, FOLLOW_FRAMES))
    known, judged = _parts(presses, 100, 0)
    draw = np.random.default_rng(11)
    shuffled = replace(known, place_mm=known.place_mm[draw.permutation(100)])
    out["shuffled"] = _middle(teach(shuffled, SKIN, refuse=False), judged)
    out["untaught"] = untaught(presses, SKIN)
    out["no description"] = _middle(teach(known, None), judged)
    hand, electrode, aged = [], [], []
    for seed in range(splits):
        known, judged = _parts(presses, 100, seed)
        off = draw.normal(0, HAND_SD_MM, known.place_mm.shape)
        given = replace(known, place_mm=known.place_mm + off)
        hand.append((_middle(teach(given, SKIN), judged),
                     _middle(teach(given, SKIN, place_sd_mm=HAND_SD_MM), judged)))  # fmt: skip
        plain = teach(known, SKIN).model
        electrode.append(_electrode_out(plain, judged))
        aged.append(
            (_by_age(plain, presses, seed), _by_age(_drift_known(presses, seed), presses, seed))
        )
    out["by hand, as given"], out["by hand"] = np.median(hand, axis=0).tolist()
    out["electrode out"] = float(np.median(electrode))
    out["old reference"], out["old reference, drift known"] = np.median(aged, axis=0).tolist()
    return out


def _updated(presses: Presses, change: Change, seed: int) -> dict[str, Any]:
    return updates(first_model(presses), presses, change, seed)


@cache
def first_model(presses: Presses) -> Model:
    """Return the model that the first presses teach."""
    return teach(presses.take(np.arange(TAUGHT)), SKIN).model


def _middle(taught: Taught, judged: Presses) -> float:
    return float(np.median(solve_presses(taught.model, judged)[0]))


def _drift_known(presses: Presses, seed: int) -> Model:
    """Return the model of the same presses in the order of time, with drift as noise."""
    order = np.random.default_rng(seed).permutation(len(presses))
    known = presses.take(np.sort(order[:100]))
    return teach(known, SKIN, reference_age=AGE_TAUGHT).model


def _by_age(model: Model, presses: Presses, seed: int) -> list[float]:
    """Median error of the judged presses by a reference of each of ``AGES``."""
    judged = np.random.default_rng(seed).permutation(len(presses))[-JUDGED:]
    some, found = presses.take(judged), []
    for age in AGES:
        old = replace(some, untouched=presses.untouched[np.maximum(judged - age, 0)])
        found.append(float(np.median(solve_presses(model, old)[0])))
    return found


def _electrode_out(model: Model, judged: Presses) -> float:
    """Median error where every row of one electrode is left out."""
    core, error = Reconstructor(model), []
    core.mask_rows((model.protocol.drive_measure == ELECTRODE_OUT).any(axis=1))
    for i in range(len(judged)):
        core.forget()
        core.tare(judged.untouched[i])
        touches = core.reconstruct(judged.pressed[i]).touches
        at = [(one.x_mm, one.y_mm) for one in touches[:1]] or [(171.0, 0.0)]
        error.append(float(np.linalg.norm(at[0] - judged.place_mm[i])))
    return float(np.median(error))


def _one_tare(model: Model, presses: Presses, frames: int) -> float:
    """Median error of the last presses after one tare, before the 400 that follow the first 100;
    ``frames``: the reference's time constant, two a press."""
    core, error = Reconstructor(model), []
    core.set_options(reference_frames=frames)
    core.tare(presses.untouched[100 - TARE : 100])
    for i in range(100, len(presses)):
        core.reconstruct(presses.untouched[i])
        touches = core.reconstruct(presses.pressed[i]).touches
        at = [(one.x_mm, one.y_mm) for one in touches[:1]] or [(171.0, 0.0)]
        error.append(float(np.linalg.norm(at[0] - presses.place_mm[i])))
    return float(np.median(error[-JUDGED:]))


def _over_splits(found: dict[str, Any], key: str, what: str, splits: int) -> float:
    return float(np.median([found[f"{key}/{seed}"][what] for seed in range(splits)]))


def _pair_text(found: dict[str, Any], key: str, splits: int) -> str:
    return f"{_over_splits(found, key, 'median', splits):.1f} / " + (
        f"{_over_splits(found, key, 'p95', splits):.1f}"
    )


def _by_count(taught: dict[str, Any], rivals: dict[str, Any], splits: int) -> Table:
    rows = [
        (
            str(count),
            _pair_text(taught, str(count), splits),
            *(_pair_text(rivals, f"{name}/{count}", splits) for name in BASELINES),
            f"{_over_splits(taught, str(count), 'fit_s', splits):.0f} s",
        )
        for count in COUNTS
    ]
    head = ("presses", "taught, mm median / p95", *BASELINES, "fit, processor")
    return Table("by_count", head, tuple(rows))


def _targets(taught: dict[str, Any], more: dict[str, Any], splits: int) -> Table:
    def over(count: int, what: str) -> str:
        values = [taught[f"{count}/{seed}"].get(what) for seed in range(splits)]
        known = [one for one in values if one is not None]
        return f"{np.median(known):.2f}" if known else "-"

    pairs = {
        kind: [np.median([taught[f"{n}/{s}"]["pairs"][kind] for s in range(splits)])
               for n in (20, 50, 100, 400)]
        for kind in taught["20/0"]["pairs"]
    }  # fmt: skip
    rows = [(f"{n} presses, median / p95 mm", _pair_text(taught, str(n), splits), TARGETS[str(n)])
            for n in (20, 50, 100, 400)]  # fmt: skip
    rows += [
        ("100, first to last in time, mm", f"{more['in time']:.1f}",
         TARGETS["100, first to last in time"]),
        ("the same, one tare 300 presses before, reference stays / follows, mm",
         f"{more['stays']:.0f} / {more['follows']:.1f}", TARGETS["100, first to last in time"]),
        (f"100, reference {' / '.join(map(str, AGES))} presses old, plain; drift as noise, mm",
         "; ".join(" / ".join(f"{one:.1f}" for one in more[key])
                   for key in ("old reference", "old reference, drift known")), "-"),
        ("100, shuffled places, mm", f"{more['shuffled']:.0f}", "chance, about 50"),
        ("100, no description, mm", f"{more['no description']:.1f}", "-"),
        ("untaught, presses 0 to 249 and 250 to 499, % of the diameter; touches a press",
         f"{' and '.join(f'{100 * mm / SIZE_MM:.1f}' for mm in more['untaught']['medians'])};"
         f" {more['untaught']['touches']:.2f}", "10; 1.5"),
        ("the same, 90 % ellipses cover", f"{more['untaught']['covered']:.2f}", "-"),
        ("singles counted as one, 20 / 50 / 100 / 400",
         " / ".join(over(n, "single") for n in (20, 50, 100, 400)), TARGETS["singles"]),
        *((f"two presses {kind} mm apart, exact, 20 / 50 / 100 / 400",
           " / ".join(f"{one:.2f}" for one in shares),
           TARGETS["pairs over 45 mm"] + " with 100" if int(kind.split()[0]) >= 45 else "-")
          for kind, shares in pairs.items()),
        ("depth, rms mm, 20 / 50 / 100 / 400",
         " / ".join(over(n, "depth_rms") for n in (20, 50, 100, 400)),
         TARGETS["depth"] + " with 100"),
        ("90 % ellipses cover, 50 / 100 / 400",
         " / ".join(over(n, "covered") for n in (50, 100, 400)), TARGETS["ellipses"]),
        ("places by hand, 5 mm sd, 100, as given / refined, mm",
         f"{more['by hand, as given']:.1f} / {more['by hand']:.1f}", TARGETS["places by hand"]),
        ("one electrode out, 100, mm", f"{more['electrode out']:.1f}",
         TARGETS["one electrode out"]),
    ]  # fmt: skip
    return Table("targets", ("what", "measured", "at least"), tuple(rows))


def _drawn(data: dict[str, Any], splits: int) -> dict[str, Any]:
    """Median errors in mm by method and number of presses."""
    found = {"taught": [_over_splits(data["taught"], str(n), "median", splits) for n in COUNTS]}
    for name in BASELINES:
        keys = [f"{name}/{n}" for n in COUNTS]
        found[name] = [_over_splits(data["rivals"], key, "median", splits) for key in keys]
    return {"presses": list(COUNTS), "median_mm": found}
