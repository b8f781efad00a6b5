"""The tables of studies/results/tradeoff.md, written by the command between the page's marks."""

import shutil
from dataclasses import replace
from pathlib import Path

from eitskin.errors import UsageError
from eitskin.fileio import write_beside
from eitskin.tuning.configuration import Configuration
from eitskin.tuning.front import (
    MEASURED_DB,
    REPORT_US,
    Conditions,
    Front,
    Limit,
    OperatingPoint,
    Preset,
    choose,
    default_point,
    named_preset,
)
from eitskin_studies.harness.sections import Tabular, fill_marks
from eitskin_studies.tradeoff.equal import best_table, equal_table, scan_table
from eitskin_studies.tradeoff.fronts import chosen_presets
from eitskin_studies.tradeoff.scene_sets import HEADLINE
from eitskin_studies.tradeoff.table import best_points

PICTURES = "pictures/tradeoff"
F767_MS = (2, 5, 10, 50)
HOST_MS = (0.05, 0.1, 0.2, 0.5, 1.0)


def _share(value: float) -> str:
    return f"{value:.3f}".lstrip("0")


FRONT_HEAD = (
    "point",
    "rank, pixels, mu",
    "iterations, lambda",
    "image MIoU (95 %)",
    "mean of worst 10 %",
    "discs",
    "exact",
    "image at 40 / 80 dB",
    "kMAC",
    "million instructions, mean / most",
    "F767 ms, mean / most",
    "host us",
    "flash, RAM kB",
)
PRESET_HEAD = (
    "preset",
    "point",
    "scan, ms",
    "solve, ms, mean / most",
    "contact to report, ms",
    "solver's image, 40 / 60 / 80 dB",
    "image shown, 40 / 60 / 80 dB",
)
FOLLOWED_HEAD = (
    "SNR by the tare",
    "point",
    "solve and touches, ms, mean / most",
    "solver's image: accurate / default",
    "image shown: accurate / default",
)
SETTINGS_HEAD = (
    "setting", "image, 40 dB", "image, 60 dB", "image, 80 dB", "shown, 40 dB", "shown, 60 dB",
    "shown, 80 dB", "discs", "discs, light touches", "kMAC",
)  # fmt: skip
RECOMMENDED_HEAD = (
    "budget",
    "point for the mean frame",
    "image MIoU",
    "solve, ms, mean / most",
    "point with --worst",
    "its MIoU",
    "at 40 dB (--snr-db 40)",
    "MIoU at 40 dB",
)


def front_table(front: Front) -> Tabular:
    """The front of images: model, solver, accuracy and cost of each point."""
    where = Conditions()
    rows = []
    for point in best_points(front.points, where):
        one, score = point.configuration, point.score(where)
        macs, counted, host = point.macs(where), point.instructions, point.host_us
        assert score is not None and macs is not None
        image = score["image"]
        at_snr = (point.accuracy(Conditions(snr_db=snr)) for snr in (40.0, 80.0))
        both = [] if counted is None else [counted["mean"], counted["most"]]
        rows.append(
            (
                point.name,
                f"{one.rank}, {one.pixels}, {one.regularisation:g}",
                f"{one.iterations}, {one.lambda_rel:g}",
                f"{_share(image['mean'])} ({_share(image['low'])} to {_share(image['high'])})",
                _share(image["worst_tenth"]),
                _share(score["discs"]["mean"]),
                f"{100 * score['exact_count']:.0f} %",
                " / ".join("-" if value is None else _share(value) for value in at_snr),
                f"{macs[0] / 1e3:.0f}",
                " / ".join(f"{value / 1e6:.2f}" for value in both) or "-",
                " / ".join(f"{value / 216e3:.1f}" for value in both) or "-",
                "-" if host is None else f"{host['p50']:.0f}",
                f"{point.costs['flash_bytes'] / 1e3:.0f}, {point.costs['ram_bytes'] / 1e3:.0f}",
            )
        )
    return FRONT_HEAD, rows


def settings_table(front: Front) -> Tabular:
    """Mean MIoU and multiply-accumulates of every setting, which the page's sentences quote."""

    def mean(point: OperatingPoint, what: str, name: str = HEADLINE, snr_db: float = 60.0) -> str:
        score = point.scores.get(name, {}).get(f"{snr_db:g}")
        return "-" if score is None or what not in score else _share(score[what]["mean"])

    rows = []
    for point in front.points:
        macs = point.macs(Conditions())
        seen = (
            mean(point, what, snr_db=snr_db)
            for what in ("image", "drawn")
            for snr_db in MEASURED_DB
        )
        discs = mean(point, "discs"), mean(point, "discs", "light")
        rows.append((point.name, *seen, *discs, "-" if macs is None else f"{macs[0] / 1e3:.0f}"))
    return SETTINGS_HEAD, rows


def preset_table(front: Front) -> Tabular:
    """Return a table of the presets on the board and on a host."""
    points = [one for one in front.points if not one.configuration.warm_start]
    rows = []
    for board in ("f767", "host"):
        rows.append(_preset_row("default", default_point(points), board))
        for name, point in chosen_presets(points, board).items():
            rows.append(_preset_row(name, point, board))
    return PRESET_HEAD, rows


def followed_table(front: Front) -> Tabular:
    """What "accurate" takes for frames of a full scan with 80 samples and the prebuilt model, by
    the SNR that the tare measures."""
    usual = Configuration("")
    frames = [
        one
        for one in front.points
        if not one.configuration.warm_start
        and one.configuration.model_settings == usual.model_settings
        and (one.configuration.samples, one.configuration.scan) == (usual.samples, usual.scan)
    ]
    rows, default = [], default_point(frames)
    for snr_db in MEASURED_DB:
        where = Conditions(snr_db=snr_db)
        drawn = replace(where, judged="drawn")
        point = choose(frames, named_preset("accurate", "host", snr_db=snr_db), default=default)
        rows.append(
            (
                f"{snr_db:g} dB",
                point.name,
                _times(point, "host"),
                f"{_cells(point, where)[1]} / {_cells(default, where)[1]}",
                f"{_cells(point, drawn)[1]} / {_cells(default, drawn)[1]}",
            )
        )
    return FOLLOWED_HEAD, rows


def _preset_row(name: str, point: OperatingPoint | None, board: str) -> tuple[str, ...]:
    assert point is not None
    one = point.configuration
    report = point.cost(REPORT_US, board, Conditions())
    assert report is not None

    def at_snrs(judged: str) -> str:
        values = [point.accuracy(Conditions(snr_db=snr, judged=judged)) for snr in MEASURED_DB]
        return " / ".join("-" if value is None else _share(value) for value in values)

    return (
        f"{name}, {'board' if board == 'f767' else 'host'}",
        point.name,
        f"{one.scan}, {one.samples} samples, {point.costs['acquisition_us'] / 1e3:.1f}",
        _times(point, board),
        f"{report / 1e3:.0f}",
        at_snrs("image"),
        at_snrs("drawn"),
    )


def recommendation_table(front: Front) -> Tabular:
    """Return a table of what ``recommend`` chooses for times on the F767 and the host."""
    rows = []
    points = [one for one in front.points if not one.configuration.warm_start]
    for board, budgets in (("f767", F767_MS), ("host", HOST_MS)):
        for ms in budgets:
            target = Preset(Limit(1000.0 * ms, "us"), None, board, Conditions())
            noisy = Preset(target.limit, None, board, Conditions(snr_db=40.0), 20_800.0)
            mean, worst, calm = (
                _chosen(points, one)
                for one in (
                    target,
                    Preset(target.limit, None, board, Conditions(), worst=True),
                    noisy,
                )
            )
            rows.append(
                (
                    f"{board}, {ms:g} ms",
                    *_cells(mean, Conditions()),
                    _times(mean, board),
                    *_cells(worst, Conditions()),
                    *_cells(calm, noisy.where),
                )
            )
    return RECOMMENDED_HEAD, rows


def _chosen(points: list[OperatingPoint], target: Preset) -> OperatingPoint | None:
    try:
        return choose(points, target)
    except UsageError:
        return None


def _cells(point: OperatingPoint | None, where: Conditions) -> tuple[str, str]:
    accuracy = None if point is None else point.accuracy(where)
    return ("none", "-") if point is None or accuracy is None else (point.name, _share(accuracy))


def _times(point: OperatingPoint | None, board: str) -> str:
    if point is None:
        return "-"
    both = [point.cost("us", board, Conditions(), worst) for worst in (False, True)]
    return " / ".join("-" if us is None else f"{us / 1000:.3g}" for us in both)


def conditions(front: Front) -> str:
    """How the numbers came about, in a sentence or two."""
    how = front.settings
    return (
        f"Commit {how.get('commit')}; {len(front.points)} configurations; seed {how.get('seed')};"
        f" {how.get('scenes')} test scenes, {how.get('train_scenes')} training scenes,"
        f" {how.get('set_scenes')} of each other set; frames from a mesh of about"
        f" {how.get('simulated_elements')} elements, models from one of about"
        f" {how.get('model_elements')}. Instructions: {how.get('instructions')}. Host:"
        f" {how.get('machine')}, {how.get('kernels')} kernels, one thread of a shared virtual"
        f" machine, medians of {how.get('rounds')} interleaved rounds."
    )


def fill_page(page: Path, front: Front, pictures: Path, names: tuple[str, ...]) -> None:
    """Fill the marks ``conditions``, ``best``, ``presets``, ``followed``, ``equal``, ``scans``,
    ``front`` and ``knobs`` of ``page``; pictures go into ``PICTURES`` beside it.

    Raises:
        FileError: the page cannot be read or written.
        ConfigError: a mark is missing.
    """
    tables = {
        "presets": preset_table(front),
        "followed": followed_table(front),
        "best": best_table(front),
        "equal": equal_table(front),
        "scans": scan_table(),
        "front": front_table(front),
        "recommendations": recommendation_table(front),
        "settings": settings_table(front),
    }
    texts = {"conditions": conditions(front)}
    fill_marks(page, "tradeoff", (texts, tables))
    folder = page.parent / PICTURES
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        if (pictures / name).is_file():
            with write_beside(folder / name) as temporary:
                shutil.copyfile(pictures / name, temporary)
