"""The results of the tank study as tables, pictures and sentences."""

from pathlib import Path
from typing import Any

import numpy as np

from eitskin_studies.experiments.experiment import ExperimentOutcome, ExperimentSettings, Table
from eitskin_studies.experiments.tank.evaluation import EvaluationSets
from eitskin_studies.experiments.tank.imagers import DISCS, KINDS, TUNED_DISCS, Levers
from eitskin_studies.experiments.tank.levers import one_by_one, words_of
from eitskin_studies.experiments.tank.tanks import TOUCH_LIKE
from eitskin_studies.harness.drawings import Drawing
from eitskin_studies.harness.summary import summarise

CHOSEN = "eitskin, image, levers from simulation"
Found = dict[str, Any]


def outcome(
    evaluation_sets: EvaluationSets,
    results: list[Found],
    levers: dict[Levers, Found],
    best: Levers,
    discs: list[Found],
    ceiling: list[Found],
    settings: ExperimentSettings,
) -> ExperimentOutcome:
    """All that is shown."""
    tables = (
        touch_like_table(results),
        kinds_table(results),
        nine_table(evaluation_sets, results),
        rods_table(results),
        levers_table(levers, best),
        discs_table(discs),
        ceiling_table(ceiling),
    )
    from eitskin_studies.pictures import tank_pictures

    shown = [
        one
        for one in columns(ranked(of_best_kind(results, "tuned"), "touch_like"))
        if one["place_threshold"] is not None
    ]

    def draw_metal(path: Path) -> None:
        tank_pictures.draw_gallery(
            path, evaluation_sets, columns(of_best_kind(results, "tuned")), False
        )

    def draw_signs(path: Path) -> None:
        tank_pictures.draw_gallery(
            path, evaluation_sets, columns(of_best_kind(results, "tuned_both")), True
        )

    data = {
        "noise_share": evaluation_sets.noise_share,
        "sets": [evaluation_sets.metal.name, evaluation_sets.mixed.name, evaluation_sets.test.name],
        "results": [
            {key: value for key, value in one.items() if "images" not in key} for one in results
        ],
        "levers": [{"levers": vars(one), **found} for one, found in levers.items()],
        "chosen": vars(best),
        "discs": discs,
        "ceiling": ceiling,
    }
    return ExperimentOutcome(
        tables,
        data,
        {
            "touch_like.png": draw_metal,
            "all_frames.png": draw_signs,
            "curves.png": Drawing(tank_pictures.draw_curves, tank_pictures.curves_data(shown)),
        },
        {"conditions": conditions(evaluation_sets, settings), "chosen": chosen_words(levers, best)},
    )


def of_best_kind(results: list[Found], score: str) -> list[Found]:
    """Each method once, on the kind of data with which it did best on the simulated set; touches as
    discs on every kind, for what counts best is not what covers best."""
    best: dict[tuple[str, str], Found] = {}
    for one in results:
        key = one["name"], one["kind"] if one["name"] == DISCS else ""
        if score in one and (key not in best or one[score] > best[key][score]):
            best[key] = one
    return list(best.values())


def ranked(results: list[Found], score: str) -> list[Found]:
    """The best mean first."""
    return sorted(results, key=lambda one: -float(np.mean(one[score])))


def columns(results: list[Found]) -> list[Found]:
    """Return the entries for which a gallery has room: without short runs of plain FISTA, and discs
    of the defaults on ratios only."""
    return [
        one
        for one in results
        if "FISTA 30," not in one["name"] and (one["name"] != DISCS or one["kind"] == "log-ratio")
    ]


def touch_like_table(results: list[Found]) -> Table:
    """The ranking on the frames with metal only."""
    simulated = "simulated metal (95 %)"
    places = ("found, false", "error", "simulated found, false")
    head = (
        "method",
        "data",
        "parameter",
        "t",
        simulated,
        "touch-like",
        *TOUCH_LIKE,
        *places,
        "kMAC",
    )
    rows = []
    for one in ranked(of_best_kind(results, "tuned"), "touch_like"):
        summary = summarise(one["simulated"])
        rows.append(
            (
                one["name"],
                one["kind"],
                _parameter(one),
                _threshold(one, "threshold"),
                f"{_of(summary.mean)} ({_of(summary.low)} to {_of(summary.high)})",
                _of(float(np.mean(one["touch_like"]))),
                *(_of(value) for value in one["touch_like"]),
                *_places(one["touch_like_places"]),
                _places(one["simulated_places"])[0],
                f"{one['macs'] / 1e3:.0f}" if one["macs"] else "-",
            )
        )
    return Table("touch_like", head, tuple(rows))


def kinds_table(results: list[Found]) -> Table:
    """Touch-like mean, and in brackets that of the simulated set, on each kind of data."""
    names = list(
        dict.fromkeys(one["name"] for one in results if one["name"] not in (CHOSEN, TUNED_DISCS))
    )
    by = {(one["name"], one["kind"]): one for one in results}

    def cell(name: str, kind: str) -> str:
        one = by[name, kind]
        return f"{_of(float(np.mean(one['touch_like'])))} ({_of(float(np.mean(one['simulated'])))})"

    return Table(
        "kinds",
        ("method", *KINDS),
        tuple((name, *(cell(name, kind) for kind in KINDS)) for name in names),
    )


def nine_table(evaluation_sets: EvaluationSets, results: list[Found]) -> Table:
    """All frames, both signs."""
    names = evaluation_sets.phantoms.frame_name
    head = ("method", "data", "t", *names, "mean", "found, false", "error")
    rows = [
        (
            one["name"],
            one["kind"],
            _threshold(one, "threshold_both"),
            *(_of(value) for value in one["nine"]),
            _of(float(np.mean(one["nine"]))),
            *_places(one["nine_places"]),
        )
        for one in ranked(of_best_kind(results, "tuned_both"), "nine")
    ]
    return Table("nine", head, tuple(rows))


def rods_table(results: list[Found]) -> Table:
    """The raw exports: which rods are where they are said to be."""
    rows = []
    for one in of_best_kind(results, "tuned_both"):
        metal = [rods["metal"] for rods in one["rods"]]
        plastic = [rods["plastic"] for rods in one["rods"]]
        distances = [d for part in (*metal, *plastic) for d in part["distances_mm"]]
        rows.append(
            (
                one["name"],
                one["kind"],
                *(
                    f"{sum(p['found'] for p in parts)} of {sum(p['true'] for p in parts)}"
                    for parts in (metal, plastic)
                ),
                str(sum(part["false"] for part in (*metal, *plastic))),
                f"{np.median(distances):.1f} mm" if distances else "-",
            )
        )
    return Table("rods", ("method", "data", "metal", "plastic", "false", "error"), tuple(rows))


def levers_table(levers: dict[Levers, Found], best: Levers) -> Table:
    """Each lever alone on each kind of data, then what was chosen."""
    plain = {kind: [(words_of(one), levers[one]) for one in one_by_one(kind)] for kind in KINDS}
    rows = [
        (
            word,
            *(_pair(plain[kind][k][1]) for kind in KINDS),
            f"{plain['difference'][k][1]['macs'] / 1e3:.0f}",
        )
        for k, (word, _) in enumerate(plain[KINDS[0]])
    ]
    place = ["-"] * len(KINDS)
    place[KINDS.index(best.kind)] = _pair(levers[best])
    rows.append((f"chosen: {words_of(best)}", *place, f"{levers[best]['macs'] / 1e3:.0f}"))
    return Table("levers", ("lever", *KINDS, "kMAC"), tuple(rows))


def discs_table(discs: list[Found]) -> Table:
    """Return a table of what touches as discs depend on."""
    rows = [
        (
            one["name"],
            _of(one["tuned"]),
            f"{100 * one['tuned_exact']:.0f} %",
            _of(float(np.mean(one["touch_like"]))),
            f"{one['found']} of {one['true']}, {one['false']}",
        )
        for one in discs
    ]
    head = (
        "touches as discs, log-ratio",
        "simulated",
        "counted exactly",
        "touch-like",
        "found, false",
    )
    return Table("discs", head, tuple(rows))


def ceiling_table(ceiling: list[Found]) -> Table:
    """Return a table of what an image without error would have."""
    rows = [
        (
            f"{one['off']:.2f} of the radius",
            *(_of(value) for value in one["miou"]),
            _of(float(np.mean(one["miou"]))),
        )
        for one in ceiling
    ]
    return Table("ceiling", ("truth off by", *TOUCH_LIKE, "mean"), tuple(rows))


def conditions(evaluation_sets: EvaluationSets, settings: ExperimentSettings) -> str:
    """Sets, seeds, noise, thresholds."""
    tuned, tested = len(evaluation_sets.metal.frames_v), len(evaluation_sets.test.frames_v)
    return (
        f"Parameters and t are chosen on {tuned} simulated scenes with metal, and for both signs on"
        f' as many with metal and plastic, seed {settings.tuning_seed}. The columns "simulated"'
        f" are of {tested} other scenes with metal, seed {settings.seed}. The simulated noise is"
        f" {100 * evaluation_sets.noise_share:.1f} % of the rms of each frame's change, the median"
        " that the reciprocal readings of the measured frames show. The MIoU is bilinear."
    )


def chosen_words(levers: dict[Levers, Found], best: Levers) -> str:
    """Return the lever that simulation chose, and the spread of those that it cannot tell apart."""
    top = levers[best]["tuned"]
    near = [one for one in levers.values() if one["tuned"] >= top - 0.01]
    means = sorted(float(np.mean(one["touch_like"])) for one in near)
    measured = float(np.mean(levers[best]["touch_like"]))
    return (
        f"Among {len(levers)} settings, the highest MIoU on simulated frames is {_of(top)}, with"
        f" {best.kind} data, {words_of(best)}. The same setting has {_of(measured)} on the measured"
        f" touch-like frames. {len(near)}"
        " settings are within .010 of it on the simulated set; on the measured frames they have"
        f" {_of(means[0])} to {_of(means[-1])}, median {_of(float(np.median(means)))}."
    )


def _pair(one: Found) -> str:
    return f"{_of(float(np.mean(one['touch_like'])))} ({_of(one['tuned'])})"


def _parameter(one: Found) -> str:
    return f"{one['parameter']} {one['value']:g}" if one["parameter"] else "-"


def _threshold(one: Found, name: str) -> str:
    return "-" if one["place_threshold"] is None else f"{one[name]:.2f}"


def _places(counts: Found) -> tuple[str, str]:
    distances = counts["distances_mm"]
    error = f"{np.median(distances):.1f} mm" if distances else "-"
    return f"{counts['found']} of {counts['true']}, {counts['false']}", error


def _of(value: float) -> str:
    return f"{value:.3f}".removeprefix("0")
