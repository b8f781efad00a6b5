"""One weight, anywhere: how readings of a weight scatter over the skin, raw and after the
calibration of ``eitskin calibrate``."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.calibration.fit import calibrate
from eitskin.calibration.presses import WeighedPresses
from eitskin.core.results import NEWTONS_PER_GRAM
from eitskin_studies.experiments.experiment import Table
from eitskin_studies.experiments.force.law import WEIGHTS_G
from eitskin_studies.experiments.force.readouts import LOG_TOUCH, READOUTS, TOUCH, Readout
from eitskin_studies.experiments.force.scenes import PressSet

RESAMPLES = 1000


@dataclass(frozen=True, eq=False)
class Anywhere:
    """One readout at one SNR, on places that nothing was tuned on.

    Attributes:
        raw: readings over the mean of their weight, less 1: (places, weights); NaN if the press
            was not found.
        calibrated: forces over the true ones, less 1; likewise.
        order, form: of the gain and the law that leaving places out chose on the tuning places.
        found: share of the presses that were.
        macs: of a frame.
    """

    raw: FloatArray
    calibrated: FloatArray
    order: int
    form: str
    found: float
    macs: float

    @classmethod
    def from_dict(cls, facts: dict[str, Any]) -> "Anywhere":
        """From the store."""
        raw, calibrated = (
            np.array(facts[name], dtype=np.float64) for name in ("raw", "calibrated")
        )
        return cls(
            raw,
            calibrated,
            int(facts["order"]),
            str(facts["form"]),
            float(facts["found"]),
            float(facts["macs"]),
        )

    def as_dict(self) -> dict[str, Any]:
        """Return a dictionary for the store; NaN becomes null."""

        def plain(values: FloatArray) -> list[list[float | None]]:
            return [[None if v != v else v for v in row] for row in values.tolist()]

        return {**vars(self), "raw": plain(self.raw), "calibrated": plain(self.calibrated)}


def scored(
    tuned: PressSet, on: Readout, reported: PressSet, read: Readout, radius_mm: float
) -> Anywhere:
    """Calibrate on the set ``tuned``, read the set ``reported``."""
    seen = np.isfinite(on.value) & (on.value > 0)
    presses = WeighedPresses(
        tuned.grams[seen] * NEWTONS_PER_GRAM, on.value[seen], on.place_mm[seen]
    )
    found = calibrate(presses, radius_mm, resamples=0)
    there = np.isfinite(read.value) & (read.value > 0)
    forces = np.full(len(read.value), np.nan)
    forces[there] = found.law.forces_at(read.place_mm[there], read.value[there]) / NEWTONS_PER_GRAM
    values = np.where(there, read.value, np.nan).reshape(-1, len(WEIGHTS_G))
    raw = values / np.nanmean(values, axis=0) - 1
    off = (forces / reported.grams - 1).reshape(raw.shape)
    return Anywhere(raw, off, found.fitted.order, found.fitted.form, float(there.mean()), read.macs)


def scatter(errors: FloatArray) -> float:
    """Relative standard deviation over places, pooled over weights, each around its own mean; of
    errors (places, weights)."""
    return float(
        np.sqrt(
            np.nanmean(np.nanvar(errors, axis=0, ddof=1) / (1 + np.nanmean(errors, axis=0)) ** 2)
        )
    )


def scatter_interval(errors: FloatArray) -> tuple[float, float]:
    """95 % of it over places drawn with replacement."""
    generator = np.random.default_rng(0)
    drawn = [
        scatter(errors[generator.integers(0, len(errors), len(errors))]) for _ in range(RESAMPLES)
    ]
    low, high = np.nanquantile(drawn, [0.025, 0.975])
    return float(low), float(high)


def _of(errors: FloatArray) -> str:
    low, high = scatter_interval(errors)
    return f"{100 * scatter(errors):.1f} % ({100 * low:.1f} to {100 * high:.1f})"


def _macs(macs: float) -> str:
    return f"{macs / 1e6:.2f} million" if macs else "not counted"


def table_of(results: dict[tuple[str, float], Anywhere], snrs_db: tuple[float, float]) -> Table:
    """Every readout at a frame's and at an averaged SNR."""
    rows = []
    for name in READOUTS:
        cells = []
        for snr in snrs_db:
            one = results[name, snr]
            cells += [_of(one.raw), _of(one.calibrated)]
        rows.append((name, *cells, _macs(results[name, snrs_db[0]].macs)))
    head = [part for snr in snrs_db for part in (f"raw, {snr:g} dB", f"calibrated, {snr:g} dB")]
    return Table("anywhere", ("reading", *head, "MACs a frame"), tuple(rows))


def by_load(results: dict[tuple[str, float], Anywhere], snrs_db: tuple[float, float]) -> Table:
    """The touch's calibrated force, weight by weight: scatter, bias, mean of worst 10 %."""
    rows = []
    for name in (TOUCH, LOG_TOUCH):
        for snr in snrs_db:
            errors = results[name, snr].calibrated
            for k, grams in enumerate(WEIGHTS_G):
                one = errors[:, k][np.isfinite(errors[:, k])]
                tenth = np.sort(np.abs(one))[-max(1, -(-len(one) // 10)) :]
                cells = (
                    f"{100 * one.std(ddof=1):.1f} %",
                    f"{100 * one.mean():+.1f} %",
                    f"{100 * tenth.mean():.1f} %",
                )
                rows.append((name, f"{snr:g} dB", f"{grams:g} g", *cells))
    return Table(
        "by-load",
        ("reading", "SNR", "weight", "deviation over places", "bias", "mean of worst 10 %"),
        tuple(rows),
    )


def over_snr(results: dict[tuple[str, float], Anywhere], snrs_db: tuple[float, ...]) -> Table:
    """Calibrated scatter by SNR, with the share found where not all were, and the order that was
    chosen."""
    rows = []
    for name in READOUTS:
        cells = []
        for snr in snrs_db:
            one = results[name, snr]
            lost = "" if one.found == 1 else f", {100 * one.found:.0f} % found"
            cells.append(f"{100 * scatter(one.calibrated):.1f} %, order {one.order}{lost}")
        rows.append((name, *cells))
    return Table(
        "over-snr", ("reading, calibrated", *(f"{snr:g} dB" for snr in snrs_db)), tuple(rows)
    )
