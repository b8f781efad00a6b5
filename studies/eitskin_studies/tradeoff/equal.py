"""All methods on equal scans: the accuracy of a front's configurations and other methods on each
scan at each SNR, and the time of a frame."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from eitskin.tuning.front import Conditions, Front, OperatingPoint
from eitskin.tuning.report_time import report_us
from eitskin_studies.harness.sections import Tabular
from eitskin_studies.tradeoff.costs import slot_us
from eitskin_studies.tradeoff.peers import SCANS, Scan

ROWS = {"full": 208, "reciprocal": 104}
COUNTED = "conjugate gradient"  # the method whose parameter is a number of iterations
# configurations beside other methods: the name in tables, the point's name on the full scan with 80
# samples, and which of its images
SHOWN = (
    ("eitskin: image shown", "standard", "drawn"),
    ("eitskin: solver's image", "standard", "image"),
    ("eitskin: solver's image, lambda by the noise", "good noise 1.0", "image"),
    ("eitskin: solver's image, rank 80", "best noise 0.6", "image"),
)


@dataclass(frozen=True)
class Reached:
    """A method on a scan at an SNR.

    Attributes:
        name, scan, snr_db: which.
        mean, low, high, worst_tenth: image MIoU, its 95 % interval, the mean of the worst 10 %; of
            the image that is shown only the mean is kept in short results, so the others may be
            None.
        frame_us, most_us: of a frame on the host: the median, and the slowest frame; of the
            solver's image the slowest is not known.
    """

    name: str
    scan: Scan
    snr_db: float
    mean: float
    low: float | None
    high: float | None
    worst_tenth: float | None
    frame_us: float
    most_us: float | None

    @property
    def ours(self) -> bool:
        """Return whether it is of this project."""
        return self.name.startswith("eitskin")

    @property
    def report_ms(self) -> float:
        """Milliseconds from contact to report with the solver on a host."""
        return report_us(scan_us(self.scan), self.frame_us, "host") / 1e3


def scan_us(scan: Scan) -> float:
    """Return what measuring a frame takes, us."""
    return float(slot_us(scan.samples) * ROWS[scan.scan])


def reached(front: Front) -> list[Reached]:
    """All that was measured of ``SHOWN`` and of the other methods."""
    return [*_ours(front), *_others(front.settings.get("peers", ()))]


def _others(peers: Sequence[dict[str, Any]]) -> list[Reached]:
    scans = {scan.name: scan for scan in SCANS}
    timed = [one for one in peers if "host_us" in one]
    fastest = _fastest(timed)
    return [
        Reached(
            one["name"],
            scans[one["scan"]],
            one["snr_db"],
            one["mean"],
            one["low"],
            one["high"],
            one["worst_tenth"],
            fastest[_work(one)]["host_us"],
            fastest[_work(one)]["host_most_us"],
        )
        for one in timed
    ]


def _work(one: dict[str, Any]) -> tuple[str, float | None]:
    """Return what the work of a frame depends on: the method, and its parameter if that is a number
    of iterations. A half scan copies its rows to the reciprocal ones, so that it saves no work."""
    return one["name"], one["value"] if one["name"] == COUNTED else None


def _fastest(timed: Sequence[dict[str, Any]]) -> dict[tuple[str, float | None], dict[str, Any]]:
    """Return the fastest measurement of the same work: other programs on the machine can only slow
    a measurement down."""
    found: dict[tuple[str, float | None], dict[str, Any]] = {}
    for one in timed:
        key = _work(one)
        if key not in found or one["host_us"] < found[key]["host_us"]:
            found[key] = one
    return found


def _ours(front: Front) -> list[Reached]:
    found = []
    for name, base, judged in SHOWN:
        for scan in SCANS:
            point = _on_scan(front.points, base, scan)
            if point is None or point.host_us is None:
                continue
            host = point.host_us
            # the image that is shown needs the touches, the solver's does not
            frame_us = host["p50"] if judged == "drawn" else host.get("solve_p50", host["p50"])
            for snr_db in front.settings["snrs_db"]:
                score = point.score(Conditions(snr_db=snr_db))
                if score is not None:
                    of = score[judged]
                    interval = (of.get("low"), of.get("high"), of.get("worst_tenth"))
                    most_us = host["most"] if judged == "drawn" else None
                    found.append(
                        Reached(name, scan, snr_db, of["mean"], *interval, frame_us, most_us)
                    )
    return found


def _on_scan(points: Sequence[OperatingPoint], base: str, scan: Scan) -> OperatingPoint | None:
    """The settings of the point named ``base`` on ``scan``."""
    named = {one.name: one for one in points}
    if base not in named:
        return None
    wanted = {
        **named[base].configuration.as_dict(),
        "scan": scan.scan,
        "samples": scan.samples,
        "name": "",
    }
    return next((p for p in points if {**p.configuration.as_dict(), "name": ""} == wanted), None)


def equal_table(front: Front) -> Tabular:
    """A row for each method: the time of a frame on the host, then image MIoU at each SNR on each
    scan, and the mean of the worst 10 % at each SNR on the full scan with 80 samples."""
    every = reached(front)
    snrs_db = sorted({one.snr_db for one in every})
    at = {(one.name, one.scan, one.snr_db): one for one in every}
    shown = " / ".join(f"{snr:g}" for snr in snrs_db)
    head = (
        "method", "frame on the host, us: median / slowest",
        *(f"{scan.name}: {shown} dB" for scan in SCANS),
        f"worst 10 %, {SCANS[0].name}: {shown} dB",
    )  # fmt: skip
    rows = []
    for name in dict.fromkeys(one.name for one in every):
        first = at.get((name, SCANS[0], 60.0))
        if first is None:
            continue
        worst = [at.get((name, SCANS[0], snr)) for snr in snrs_db]
        cells = [
            " / ".join(
                _share(at[name, scan, snr].mean) if (name, scan, snr) in at else "-"
                for snr in snrs_db
            )
            for scan in SCANS
        ]
        slowest = "-" if first.most_us is None else f"{first.most_us:.0f}"
        times = f"{first.frame_us:.0f} / {slowest}"
        shares = " / ".join(
            "-" if one is None or one.worst_tenth is None else _share(one.worst_tenth)
            for one in worst
        )
        rows.append((name, times, *cells, shares))
    return head, rows


def scan_table() -> Tabular:
    """A row a scan: what measuring takes, and the report on a host whose solver takes no time."""
    rows = [
        (
            scan.name,
            f"{scan_us(scan) / 1e3:.1f}",
            f"{report_us(scan_us(scan), 0.0, 'host') / 1e3:.1f}",
        )
        for scan in SCANS
    ]
    return ("scan", "measuring a frame, ms", "contact to report without the solve, ms"), rows


def _share(value: float) -> str:
    return f"{value:.3f}".lstrip("0")


BEST_HEAD = ("SNR", "scan", "image shown", "best solver's image", "best other method")


def best_table(front: Front) -> Tabular:
    """For each SNR, on the longest and on the shortest scan: eitskin's image shown, and the best of
    its solver's images and of the other methods."""
    every, rows = reached(front), []
    for snr_db in sorted({one.snr_db for one in every}):
        for scan in (SCANS[0], SCANS[-1]):
            here = [one for one in every if (one.scan, one.snr_db) == (scan, snr_db)]
            shown = next((one for one in here if one.name == SHOWN[0][0]), None)
            ours = max((one for one in here if one.ours and one is not shown), key=_mean)
            other = max((one for one in here if not one.ours), key=_mean, default=None)
            rows.append(
                (
                    f"{snr_db:g} dB",
                    scan.name,
                    _share(shown.mean) if shown else "-",
                    _share(ours.mean),
                    f"{_share(other.mean)}, {other.name}" if other else "-",
                )
            )
    return BEST_HEAD, rows


def _mean(one: Reached) -> float:
    return one.mean
