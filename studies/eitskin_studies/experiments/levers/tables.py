"""The levers as tables."""

from collections.abc import Mapping
from typing import Any

from eitskin_studies.experiments.experiment import (
    ExperimentSettings,
    Table,
)
from eitskin_studies.experiments.levers.measure import (
    COUNTED,
    IMAGE_SNRS_DB,
    RANDOM,
    SCENES,
    TUNING,
)
from eitskin_studies.experiments.multitouch.counts import share_of
from eitskin_studies.harness.sections import AS_EVERYWHERE

Found = Mapping[str, Mapping[str, Any]]


def _short(value: float) -> str:
    return f"{value:.3f}".lstrip("0")


def _miou(summary: Mapping[str, float]) -> str:
    return f"{_short(summary['mean'])} ({_short(summary['low'])} to {_short(summary['high'])})"


def _exact(values: list[int]) -> str:
    share = share_of([bool(v) for v in values])
    return f"{100 * share.mean:.0f} ({100 * share.low:.0f} to {100 * share.high:.0f}) %"


def search_table(searches: Found) -> Table:
    """Every search on every set."""
    counted = (f"exact, {name}" for name in COUNTED)
    head = ("search", *counted, "discs, random 60 dB (95 %)", "mean of worst 10 %",
        "position, median / p95, mm",
            "strength, sd", "left, median", "kMAC of the touches, random / 8")  # fmt: skip
    rows = []
    for name, found in searches.items():
        random, eight = found[RANDOM], found["8 at 4 radii, 80 dB"]
        rows.append((
            name,
            *(_exact(found[one]["exact"]) for one in COUNTED),
            _miou(random["discs"]),
            _short(random["discs"]["worst_tenth"]),
            f"{random['position_mm']['median']:.2f} / {random['position_mm']['p95']:.2f}",
            f"{100 * random['strength_sd']:.1f} %",
            f"{100 * random['unexplained']:.2f} %",
            f"{random['touch_macs'] / 1e3:.0f} / {eight['touch_macs'] / 1e3:.0f}",
        ))  # fmt: skip
    return Table("search", head, tuple(rows))


def image_table(images: Found) -> Table:
    """Every image at every SNR."""
    head = (
        "image",
        "t",
        *(f"MIoU, {snr:g} dB (95 %)" for snr in IMAGE_SNRS_DB),
        "mean of worst 10 %, 60 dB",
        "kMAC, 60 dB",
    )
    rows = [
        (name, f"{found['threshold']:.2f}",
        *(_miou(found[f"{snr:g}"]["image"]) for snr in IMAGE_SNRS_DB),
         _short(found["60"]["image"]["worst_tenth"]), f"{found['60']['macs'] / 1e3:.0f}")
        for name, found in images.items()
    ]  # fmt: skip
    return Table("images", head, tuple(rows))


def asked_table(images: Found) -> Table:
    """Return a table of the goals for the image, each with the cheapest setting that reaches it."""
    rows = []
    for snr, goals in (("60", (0.86, 0.90)), ("40", (0.78, 0.82))):
        for goal, what in zip(goals, ("at least", "aim"), strict=True):
            best = max(images, key=lambda name: images[name][snr]["image"]["mean"])
            enough = [
                name for name in images if round(images[name][snr]["image"]["mean"], 3) >= goal
            ]
            name = min(enough, key=lambda one: images[one][snr]["macs"]) if enough else best
            found = images[name][snr]
            rows.append((f"image MIoU, 1 to 3 random touches, {snr} dB",
                f"{what} {_short(goal)}0"[: len(what) + 4], name,
                         _miou(found["image"]), f"{found['macs'] / 1e3:.0f}",
                         "yes" if enough else "no"))  # fmt: skip
    return Table(
        "asked",
        ("what", "asked", "cheapest that has it, or the best", "measured (95 %)", "kMAC", "met"),
        tuple(rows),
    )


def conditions(settings: ExperimentSettings) -> str:
    """How the numbers came about."""
    return (
        f"Seed {settings.seed}: {settings.count(SCENES)} scenes of 1 to 3 random touches, and"
        f" {settings.count(60)} of each other set (radius 9 mm, contrast 5), {AS_EVERYWHERE}, 16"
        f" bits from 70 dB on; t chosen on {settings.count(TUNING)} scenes of seed"
        f" {settings.tuning_seed} at 60 dB, for each row, and kept. Brackets: 95 % intervals,"
        " Wilson's for fractions, bootstrap for means."
    )
