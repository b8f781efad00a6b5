"""The results of ``eitskin bench diagnostics`` as text, and for studies/results/diagnostics.md."""

from collections.abc import Sequence

from eitskin_studies.benchmarks.diagnostics import (
    BETWEEN_DB,
    HEADLINE_DB,
    SNRS_DB,
    Crowd,
    DetectionRate,
    Findings,
    Mean,
)
from eitskin_studies.benchmarks.diagnostics_faults import DETACHED, FAULTS, NONE
from eitskin_studies.harness.sections import AS_EVERYWHERE, Filling, text_table

SNR_WORDS = tuple(f"{snr:g} dB" for snr in SNRS_DB)
FAULT_HEAD = (
    "fault", *(f"named, {snr}" for snr in SNR_WORDS), *(f"lost, {snr}" for snr in SNR_WORDS),
    f"mean of worst 10 %, {HEADLINE_DB:g} dB", f"lost without diagnostics, {HEADLINE_DB:g} dB",
)  # fmt: skip
DETACHED_HEAD = ("SNR", "named", "whole", "image lost", "mean of worst 10 %", "discs lost")
PEAK_HEAD = ("gain", *SNR_WORDS)
CROWD_HEAD = (
    "touches",
    *(f"{snr}: {what}" for snr in SNR_WORDS for what in ("right", "not reported", "reported")),
)
IMPERFECT_HEAD = ("front end", "full scans", "half scans")


def _number(value: float) -> str:
    """Three digits; a loss of less than half of the last is 0."""
    text = f"{value:.3f}"
    return text.replace("0.", ".", 1) if float(text) else ".000"


def _share(value: float) -> str:
    """1 and 0 are all and none."""
    return f"{value:g}" if value in (0, 1) else _number(min(max(value, 0.001), 0.999))


def _mean(value: Mean | None, interval: bool = True) -> str:
    if value is None:
        return ""
    return _number(value.mean) + (f" ± {_number(value.half_95)}" if interval else "")


def fault_rows(result: Findings) -> list[tuple[str, ...]]:
    """Rows under ``FAULT_HEAD``."""
    rows = []
    for fault in FAULTS:
        each = [result.rate(fault.name, snr) for snr in SNRS_DB]
        middle = result.rate(fault.name)
        rows.append((
            fault.name,
            *(_share(one.other if one.named is None else one.named) for one in each),
            *(_mean(one.lost, interval=one is middle) for one in each),
            _number(middle.lost.worst_tenth) if middle.lost else "",
            _mean(middle.lost_blind, interval=False),
        ))  # fmt: skip
    return rows


def detached_rows(result: Findings) -> list[tuple[str, ...]]:
    """Rows under ``DETACHED_HEAD``."""
    rows: list[tuple[str, ...]] = []
    for snr in sorted((*SNRS_DB, BETWEEN_DB)):
        one, whole = result.rate(DETACHED, snr), result.rate(NONE, snr)
        assert one.named is not None and one.lost is not None and whole.miou is not None
        worst = _number(one.lost.worst_tenth)
        rows.append(
            (
                f"{snr:g} dB",
                _share(one.named),
                _number(whole.miou),
                _mean(one.lost),
                worst,
                _mean(one.lost_discs),
            )
        )
    return rows


def peak_rows(result: Findings) -> list[tuple[str, ...]]:
    """Rows under ``PEAK_HEAD``."""
    gains = [fault.name for fault in FAULTS if fault.gain is not None]
    return [(name, *(_mean(result.rate(name, snr).peak_lost) for snr in SNRS_DB)) for name in gains]


def _crowd_cells(crowds: Sequence[Crowd]) -> tuple[str, str, str]:
    frames, right, said, both = (
        sum(getattr(one, name) for one in crowds)
        for name in ("frames", "right", "said", "right_said")
    )
    unsaid = frames - said
    return (
        f"{right}/{frames}",
        f"{right - both}/{unsaid}" if unsaid else "none",
        f"{both}/{said}" if said else "none",
    )


def crowd_rows(result: Findings) -> list[tuple[str, ...]]:
    """Rows under ``CROWD_HEAD``, the last of all together."""
    counts = sorted({one.touches for one in result.crowds})
    groups = [(f"{count}", [count]) for count in counts] + [("all", counts)]
    return [
        (name, *(cell for snr in SNRS_DB
                 for cell in _crowd_cells([
                     c for c in result.crowds if c.snr_db == snr and c.touches in group
                 ])))
        for name, group in groups
    ]  # fmt: skip


def imperfect_rows(result: Findings) -> list[tuple[str, ...]]:
    """Rows under ``IMPERFECT_HEAD``."""
    return [
        (one.effect, f"{one.full}/{one.frames}", f"{one.half}/{one.frames}")
        for one in result.imperfect
    ]


def summary(result: Findings) -> str:
    """The headline."""
    one = result.rate(DETACHED)
    assert one.lost is not None and one.named is not None
    low, high = one.lost.mean - one.lost.half_95, one.lost.mean + one.lost.half_95
    return (
        f"a detached electrode at {HEADLINE_DB:g} dB: named in {round(one.named * one.scenes)} of"
        f" {one.scenes} frames; image MIoU lost {_number(one.lost.mean)}, 95 % interval"
        f" {_number(low)} to {_number(high)}"
    )


def false_alarms(result: Findings) -> str:
    """Return a line on false alarms in clean frames. If there was none, it names the rate that
    would show one in 95 % of such runs: 3 over the number of frames."""
    clean = [result.rate(NONE, snr) for snr in SNRS_DB]
    other, frames = (
        sum(round(one.other * one.scenes) for one in clean),
        sum(one.scenes for one in clean),
    )
    said = f"of {frames} clean frames {other or 'none'}" + (
        "" if other else f" (95 %: fewer than {300 / clean[0].scenes:.1f} %)"
    )
    crowded = ", ".join(f"{_share(one.crowded)} at {one.snr_db:g} dB" for one in clean)
    return f"- **False alarms**: {said}; `crowded` is reported of {crowded}."


def refused(rates: Sequence[DetectionRate]) -> str:
    """Return the number of rejected frames, by fault."""
    named = {f"{one.fault} at {one.snr_db:g} dB: {one.refused}" for one in rates if one.refused}
    return "; ".join(sorted(named)) or "none"


def as_text(result: Findings) -> str:
    """For a terminal."""
    parts = [
        (
            f"seed {result.seed}, {result.rates[0].scenes} scenes; refused frames:"
            f" {refused(result.rates)}"
        ),
        text_table(FAULT_HEAD, fault_rows(result)),
        text_table(DETACHED_HEAD, detached_rows(result)),
        "share of the peak lost, gain apart\n" + text_table(PEAK_HEAD, peak_rows(result)),
        "right counts of touches, by whether the frame is said to be crowded\n"
        + text_table(CROWD_HEAD, crowd_rows(result)),
        "clean frames about which anything but crowded was said\n"
        + text_table(IMPERFECT_HEAD, imperfect_rows(result)),
        summary(result),
    ]
    return "\n\n".join(parts)


def for_page(result: Findings, command: str) -> Filling:
    """The marks of studies/results/diagnostics.md."""
    run = (
        f"By `{command}`: {result.rate(NONE).scenes} scenes of one to three touches,"
        f" {AS_EVERYWHERE} (16 bits at 80 dB), the fault at electrode k mod 16 in scene k; 16"
        " frames of reference, then one frame, cold, the paper's model with its own options. Rules"
        " and thresholds were chosen under seeds 77 and 177. Frames rejected, which count as empty"
        f" images: {refused(result.rates)}."
    )
    texts = {"run": run, "false-alarms": false_alarms(result)}
    return texts, {
        "faults": (FAULT_HEAD, fault_rows(result)),
        "detached": (DETACHED_HEAD, detached_rows(result)),
        "peaks": (PEAK_HEAD, peak_rows(result)),
        "crowds": (CROWD_HEAD, crowd_rows(result)),
        "imperfect": (IMPERFECT_HEAD, imperfect_rows(result)),
    }
