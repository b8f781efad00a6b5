"""The study's tables and sentences."""

from collections.abc import Mapping, Sequence
from typing import Any

from eitskin_studies.experiments.constants.judged import Scene
from eitskin_studies.experiments.constants.sweep import IN_TIME, Effect
from eitskin_studies.experiments.constants.variant import Constant
from eitskin_studies.experiments.experiment import Table

MOST = 20
DELTAS = {
    "exact": "exact frames",
    "median_mm": "median, mm",
    "p95_mm": "p95, mm",
    "miou_image": "MIoU of images",
    "miou_discs": "MIoU of discs",
    "false_names": "false diagnostics",
    "missing_names": "missing diagnostics",
    "gestures_right": "gestures right",
    "gestures_invented": "gestures invented",
    "mega_macs": "10^6 MACs",
}
Effects = Mapping[str, Sequence[Effect]]


def tables_of(
    constants: Sequence[Constant],
    effects: Effects,
    needed: Mapping[str, Sequence[str]],
    commit: str,
) -> tuple[Table, ...]:
    """Everything; by module; the most sensitive; those that change nothing, with the C tests that
    need them."""
    return (
        _all(constants, effects, commit), _by_module(constants, effects), _most(constants, effects),
        _unchanged(constants, effects, needed),
    )  # fmt: skip


def any_change(effects: Effects, constant: Constant) -> bool:
    """Return whether one of its values changes a bit of a scene, or ends the run."""
    return any(one.changed or one.failed for one in effects[constant.name])


def most_of(constant: Constant) -> float:
    """Return the limit below which a value is ranked: a fraction that is doubled beyond 1 is no
    fraction, and says only what happens without its rule."""
    return 1.0 if 0.5 < constant.value < 1 else float("inf")


def harm(one: Effect) -> float:
    """How much worse a value is, in points: the sum of what is lost of exact frames, of right
    diagnostics, of gestures, each in percent, and of the MIoU of discs, in hundredths."""
    if not one.after:
        return 0.0
    frames = max(1.0, one.before["frames"])
    names = one.change("false_names") + one.change("missing_names")
    gestures = one.change("gestures_right") - one.change("gestures_invented")
    return 100 * (
        (names - one.change("exact")) / frames
        - one.change("miou_discs")
        - gestures / max(1.0, one.before["gestures_right"])
    )


def _all(constants: Sequence[Constant], effects: Effects, commit: str) -> Table:
    rows = []
    for constant in constants:
        for one in effects[constant.name]:
            rows.append(
                (
                    constant.module, constant.name, f"{constant.value:.7g}", f"{one.value:.7g}",
                    str(one.used), str(one.changed), one.failed or "",
                    *(_signed(one.change(name)) for name in DELTAS), f"{harm(one):.2f}",
                    commit,
                )
            )  # fmt: skip
    head = ("module", "constant", "value", "tried", "scenes that use it", "that change", "failed",
            *DELTAS.values(), "harm, points", "commit")  # fmt: skip
    return Table("constants", head, tuple(rows))


def _by_module(constants: Sequence[Constant], effects: Effects) -> Table:
    rows = []
    for module in dict.fromkeys(one.module for one in constants):
        some = [one for one in constants if one.module == module]
        sizes = [one for one in some if one.is_size]
        tried = [one for one in some if not one.is_size]
        still = [one for one in tried if not any_change(effects, one)]
        unused = sum(not effects[one.name][0].used for one in still)
        rows.append(
            (
                module, str(len(some)), str(sum(one.by_hand for one in some)),
                str(len(tried) - len(still)), str(len(still) - unused), str(unused),
                str(len(sizes)),
            )
        )  # fmt: skip
    total = [str(sum(int(row[k]) for row in rows)) for k in range(1, 7)]
    head = ("module", "constants", "by hand", "change something", "used, change nothing",
            "not used", "sizes of arrays")  # fmt: skip
    return Table("by_module", head, (*rows, ("all", *total)))


def _most(constants: Sequence[Constant], effects: Effects) -> Table:
    """The twenty whose worse value does most harm."""
    worst = {
        one.name: max((e for e in effects[one.name] if e.value < most_of(one)), key=harm)
        for one in constants
        if not one.is_size
    }
    ranked = sorted(
        (one for one in constants if one.name in worst), key=lambda one: -harm(worst[one.name])
    )
    rows = []
    for constant in ranked[:MOST]:
        one = worst[constant.name]
        other = next((each for each in effects[constant.name] if each is not one), one)
        rows.append(
            (
                f"`{constant.name}`", constant.module, f"{constant.value:g}", f"{one.value:g}",
                f"{one.changed} of {one.used}", _signed(one.change("exact")),
                _signed(1e3 * one.change("median_mm")), f"{one.change('miou_discs'):+.3f}",
                _signed(one.change("false_names") + one.change("missing_names")),
                _signed(one.change("gestures_right")), _signed(one.change("gestures_invented")),
                f"{harm(one):.1f}", f"{harm(other):.1f}",
            )
        )  # fmt: skip
    head = ("constant", "module", "value", "worse value", "scenes changed", "exact frames",
            "median, um", "MIoU of discs", "wrong diagnostics", "gestures right", "invented",
            "harm, points", "of the other value")  # fmt: skip
    return Table("most", head, tuple(rows))


def _unchanged(
    constants: Sequence[Constant], effects: Effects, needed: Mapping[str, Sequence[str]]
) -> Table:
    rows = [
        (
            f"`{one.name}`", one.module, f"{one.value:g}", str(effects[one.name][0].used),
            ", ".join(name.removesuffix("_f32") for name in needed.get(one.name, ())) or "none",
        )
        for one in constants
        if not one.is_size and not any_change(effects, one)
    ]  # fmt: skip
    head = ("constant", "module", "value", "scenes that use it", "C tests that fail")
    return Table("unchanged", head, tuple(rows))


def _signed(value: float) -> str:
    return "0" if not value else f"{value:+.4g}"


def words_of(
    constants: Sequence[Constant],
    effects: Effects,
    scenes: Sequence[Scene],
    facts: Mapping[str, Any],
) -> dict[str, str]:
    """Return a text about the run."""
    whole = [one.name for one in constants if one.module not in IN_TIME]
    some = next((one.before for name in whole for one in effects[name] if one.before), {})
    return {
        "set": (
            f"Commit {facts['commit']}; {len(scenes)} scenes of"
            f" {len({one.kind for one in scenes})} kinds, {some.get('frames', 0):.0f} frames with a"
            f" known truth besides the fast path's; {some.get('exact', 0):.0f} of them are exact."
            f" {facts['seconds'] / 60:.0f} minutes of processor time."
        )
    }
