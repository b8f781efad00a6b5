"""The tables of studies/results/tradeoff.md, written by the command between the page's marks."""

import shutil
from pathlib import Path

from eitskin.errors import UsageError
from eitskin.fileio import write_beside
from eitskin.tuning.front import REPORT_US, Conditions, Front, Limit, OperatingPoint, Preset, choose
from eitskin_studies.harness.sections import Tabular, fill_marks
from eitskin_studies.pictures.report_time_picture import chosen_presets
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
    "image MIoU (95 %)",
    "exact",
)
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


def preset_table(front: Front) -> Tabular:
    """Return a table of the presets on the board and on a host."""
    points = [one for one in front.points if not one.configuration.warm_start]
    rows = []
    for board in ("f767", "host"):
        for name, point in chosen_presets(points, board).items():
            one, score = point.configuration, point.score(Conditions())
            report = point.cost(REPORT_US, board, Conditions())
            assert score is not None and report is not None
            image = score["image"]
            rows.append(
                (
                    f"{name}, {'board' if board == 'f767' else 'host'}",
                    point.name,
                    f"{one.scan}, {one.samples} samples, {point.costs['acquisition_us'] / 1e3:.1f}",
                    _times(point, board),
                    f"{report / 1e3:.0f}",
                    f"{_share(image['mean'])} ({_share(image['low'])} to {_share(image['high'])})",
                    f"{100 * score['exact_count']:.0f} %",
                )
            )
    return PRESET_HEAD, rows


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
        f"{len(front.points)} configurations; seed {how.get('seed')}; {how.get('scenes')} test"
        f" scenes, {how.get('train_scenes')} training scenes, {how.get('set_scenes')} of each other"
        f" set; frames from a mesh of about {how.get('simulated_elements')} elements, models from"
        f" one of about {how.get('model_elements')}. Instructions: {how.get('instructions')}. Host:"
        f" {how.get('machine')}, {how.get('kernels')} kernels, one thread of a shared virtual"
        f" machine, medians of {how.get('rounds')} interleaved rounds."
    )


def fill_page(page: Path, front: Front, pictures: Path, names: tuple[str, ...]) -> None:
    """Fill the marks ``conditions``, ``presets``, ``front`` and ``recommendations`` of ``page``;
    pictures go into ``PICTURES`` beside it.

    Raises:
        FileError: the page cannot be read or written.
        ConfigError: a mark is missing.
    """
    tables = {
        "presets": preset_table(front),
        "front": front_table(front),
        "recommendations": recommendation_table(front),
    }
    texts = {"conditions": conditions(front)}
    fill_marks(page, "tradeoff", (texts, tables))
    folder = page.parent / PICTURES
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        if (pictures / name).is_file():
            with write_beside(folder / name) as temporary:
                shutil.copyfile(pictures / name, temporary)
