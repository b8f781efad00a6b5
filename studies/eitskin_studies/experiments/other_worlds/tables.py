"""The tables of the study "other worlds": what fails first."""

from collections.abc import Mapping, Sequence
from typing import Any

from eitskin_studies.experiments.experiment import ExperimentSettings, Table
from eitskin_studies.harness.sections import AS_EVERYWHERE

Scores = Sequence[Mapping[str, Any]]

FAILS_BELOW = 0.9
HEAD = (
    "set",
    "exact (95 %)",
    "exact without guards",
    "false a scene",
    "missed a scene",
    "median, mm",
    "p95, mm",
    "radius, found / true",
    "wrong scenes with a diagnostic",
    "what",
)
MEDIAN, EXACT, FALSE = "median position error, mm", "exact", "false touches a frame"
# a headline number, the row that it is of, and its rows from other worlds
HEADLINES = (
    (
        "exact, 1 to 3 touches",
        EXACT,
        "discs_1_to_3",
        ("fingers", "fingers_mild_errors", "ellipses", "uneven_20_percent", "misplaced_3_mm"),
    ),
    (
        "median position error, 1 to 3 touches",
        MEDIAN,
        "discs_1_to_3",
        ("fingers", "fingers_mild_errors", "uneven_20_percent", "misplaced_3_mm"),
    ),
    (
        "exact, 8 touches 4 radii apart, 80 dB",
        EXACT,
        "eight_at_4_radii",
        ("eight_unlike_at_4_radii", "eight_mild_errors"),
    ),
    (
        "exact, 5 touches 2.5 radii apart",
        EXACT,
        "five_at_2_5_radii",
        ("five_unlike_at_2_5_radii",),
    ),
    (
        "exact, light touches",
        EXACT,
        "light_touches",
        ("drift_2_percent_light",),
    ),
    (
        "false touches of an untouched skin",
        FALSE,
        "no_touch",
        ("no_touch_drift_2_percent", "no_touch_converter_without_dither"),
    ),
)


def images_table(scores: Scores) -> Table:
    """Counts, places and images of each set with touches; the README's numbers are of it."""
    head = (
        "set", "exact (95 %)", "median / p95, mm", "image shown (95 %)", "worst 10 %",
        "solver's image",
    )  # fmt: skip
    rows = []
    for one in scores:
        if one["images"] is None:
            continue
        shown, solver = one["images"]["shown"], one["images"]["solver"]
        places = ("-" if one[key] is None else f"{one[key]:.2f}" for key in ("median_mm", "p95_mm"))
        rows.append(
            (
                f"`{one['name']}`",
                _number(one, EXACT),
                " / ".join(places),
                f"{_share(shown['mean'])} ({_share(shown['low'])} to {_share(shown['high'])})",
                _share(shown["worst_tenth"]),
                _share(solver["mean"]),
            )
        )
    return Table("images", head, tuple(rows))


def _share(value: float) -> str:
    return f"{value:.3f}".lstrip("0")


def fails_table(scores: Scores) -> Table:
    """The sets with fewer than 90 % exact scenes, the worst first."""
    return Table("fails", HEAD, tuple(map(_row, sorted(_failing(scores), key=_exact))))


def holds_table(scores: Scores) -> Table:
    """The others, in their order."""
    failing = {one["name"] for one in _failing(scores)}
    return Table("holds", HEAD, tuple(_row(one) for one in scores if one["name"] not in failing))


def headline_table(scores: Scores) -> Table:
    """Headline numbers beside those of other worlds."""
    by_name = {one["name"]: one for one in scores}
    rows = []
    for what, kind, own, others in HEADLINES:
        beside = "; ".join(f"`{name}` {_number(by_name[name], kind)}" for name in others)
        rows.append((what, _number(by_name[own], kind), beside))
    return Table("headline", ("what", "the model's own world", "other worlds"), tuple(rows))


def summary(scores: Scores) -> str:
    """Return a sentence with numbers about the sets that fail."""
    failing = sorted(_failing(scores), key=_exact)
    half = [one for one in failing if _exact(one) < 0.5]
    warned = [one["warned"] for one in failing if one["warned"] is not None]
    text = (
        f"In {len(failing)} of {len(scores)} sets fewer than 90 % of the scenes are counted"
        f" exactly, and in {len(half)} of them fewer than half."
    )
    if warned:
        text += (
            f" In these sets a diagnostic is reported for {100 * min(warned):.0f} to"
            f" {100 * max(warned):.0f} % of the wrong scenes, depending on the set."
        )
    return text


def conditions(settings: ExperimentSettings, count: int, knows_errors: bool) -> str:
    """The conditions of the numbers; ``knows_errors``: the model states its errors."""
    guards = (
        ""
        if knows_errors
        else " The prebuilt model does not say what it may be wrong by, so that these do nothing."
    )
    return (
        "The prebuilt model, float32, default options; without guards: without `row_gains` and"
        f' `touch_test`.{guards} Scenes of the family "judging", seed {settings.seed}, {count} a'
        f" set, each with a skin of its own, {AS_EVERYWHERE}, 60 dB (sets of eight: 80 dB, 16"
        " bits). *Exact*: every touch is found within 10 mm, and none is false. Brackets: Wilson's"
        " 95 % intervals."
    )


def _failing(scores: Scores) -> list[Mapping[str, Any]]:
    return [one for one in scores if _exact(one) < FAILS_BELOW]


def _exact(one: Mapping[str, Any]) -> float:
    return float(one["exact"][0])


def _number(one: Mapping[str, Any], kind: str) -> str:
    if kind == EXACT:
        share, low, high = (100 * value for value in one["exact"])
        return f"{share:.0f} % ({low:.0f} to {high:.0f})"
    value = one["median_mm"] if kind == MEDIAN else one["false_per_scene"]
    return "-" if value is None else f"{value:.2f}"


def _row(one: Mapping[str, Any]) -> tuple[str, ...]:
    def number(key: str, digits: int = 2) -> str:
        return "-" if one[key] is None else f"{one[key]:.{digits}f}"

    warned = "-" if one["warned"] is None else f"{100 * one['warned']:.0f} %"
    return (
        f"`{one['name']}`",
        _number(one, EXACT),
        _number(one["without"], EXACT),
        number("false_per_scene"),
        number("missed_per_scene"),
        number("median_mm"),
        number("p95_mm", 1),
        number("radius_ratio"),
        warned,
        one["text"],
    )
