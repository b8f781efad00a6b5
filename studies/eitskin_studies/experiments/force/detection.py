"""The smallest weight that is detected, over SNR and radius; and how often an untouched frame shows
a touch that is none."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.results import Reconstruction
from eitskin.scene.simulate import measure
from eitskin_studies.experiments.experiment import Table
from eitskin_studies.experiments.force.readouts import Instruments
from eitskin_studies.experiments.force.scenes import RADIUS_SHARES, PressSet
from eitskin_studies.harness.sessions import converter_for
from eitskin_studies.harness.snr import noise_deviation_v

SNRS_DB = (30.0, 40.0, 50.0, 60.0, 70.0, 80.0)
PROBABILITY = 0.9
NEAR_MM = 10.0
TARES, UNTOUCHED = 8, 64
RESAMPLES = 400


@dataclass(frozen=True, eq=False)
class Detection:
    """At one SNR: ``hits`` of ``tries``, both (radii, weights), presses of ``loads_g`` (weights,);
    ``false`` of ``untouched`` frames."""

    snr_db: float
    loads_g: FloatArray
    hits: FloatArray
    tries: FloatArray
    false: int
    untouched: int

    @classmethod
    def from_dict(cls, facts: dict[str, Any]) -> "Detection":
        """From the store."""
        weights, hits, tries = (
            np.array(facts[name], dtype=np.float64) for name in ("loads_g", "hits", "tries")
        )
        return cls(
            float(facts["snr_db"]),
            weights,
            hits,
            tries,
            int(facts["false"]),
            int(facts["untouched"]),
        )

    def as_dict(self) -> dict[str, Any]:
        """For the store."""
        return {
            name: value.tolist() if isinstance(value, np.ndarray) else value
            for name, value in vars(self).items()
        }

    def threshold(self, radius: int) -> tuple[float, float, float]:
        """The weight in g that is detected with probability 0.9 at the radius of this number, and
        its 95 % by the bootstrap; infinite where no weight of the ladder is."""
        hits, tries = self.hits[radius], self.tries[radius]
        generator = np.random.default_rng(radius)
        drawn = [
            least_weight(self.loads_g, generator.binomial(tries.astype(int), hits / tries) / tries)
            for _ in range(RESAMPLES)
        ]
        low, high = np.quantile(drawn, [0.025, 0.975], method="nearest")
        return least_weight(self.loads_g, hits / tries), float(low), float(high)

    def threshold_text(self, radius: int) -> str:
        """Return the threshold in words."""
        weight, low, high = self.threshold(radius)
        if weight == float("inf"):
            return f"more than {grams_text(self.loads_g[-1])} g"
        return f"{grams_text(weight)} g ({grams_text(low)} to {grams_text(high)})"

    def false_share(self) -> tuple[float, float]:
        """False alarms an untouched frame, and the upper 95 % bound (Clopper and Pearson,
        Biometrika 26, 1934)."""
        from scipy.stats import beta

        upper = (
            1.0
            if self.false == self.untouched
            else float(beta.ppf(0.95, self.false + 1, self.untouched - self.false))
        )
        return self.false / self.untouched, upper


def least_weight(loads_g: FloatArray, share: FloatArray) -> float:
    """From which on the ``share`` detected (weights,) stays at 0.9 or more, between weights by
    their logarithms; infinite: never."""
    below = np.flatnonzero(share < PROBABILITY)
    if not len(below):
        return float(loads_g[0])
    k = int(below[-1])
    if k == len(loads_g) - 1:
        return float("inf")
    part = (PROBABILITY - share[k]) / (share[k + 1] - share[k])
    return float(np.exp(np.log(loads_g[k]) + part * np.log(loads_g[k + 1] / loads_g[k])))


def detect(
    instruments: Instruments,
    light: PressSet,
    snr_db: float,
    reps: int,
    quiet_frames: int,
    mean_of: int = 1,
) -> Detection:
    """``reps`` frames of each press; untouched frames after several tares. With ``mean_of`` each
    frame, also of the tare, is the mean of so many."""
    session, seed = light.session, light.session.touches.seed
    how, exact = converter_for(snr_db), session.exact_untouched_v
    span_v = how.adc_headroom * float(np.abs(exact).max())
    lsb_v = 0.0 if how.adc_bits is None else 2 * span_v / 2**how.adc_bits
    converter = noise_deviation_v(exact, snr_db), lsb_v, span_v, seed

    def measured(exact_v: FloatArray, name: str) -> FloatArray:
        frames, _ = measure(np.repeat(exact_v, mean_of, axis=0), *converter, name)
        return np.asarray(frames.reshape(len(exact_v), mean_of, -1).mean(axis=1))

    false, looked, each = 0, 0, -(-quiet_frames // TARES)
    for tare in range(TARES):
        untouched = measured(np.tile(exact, (UNTOUCHED, 1)), f"force tare {tare} {snr_db:g}")
        batch = instruments.batch("difference", untouched)
        still = measured(np.tile(exact, (each, 1)), f"force still {tare} {snr_db:g}")
        results = list(batch.each(still))
        false += sum(isinstance(r, Reconstruction) and len(r.touches) > 0 for r in results)
        looked += len(results)
    frames = measured(np.repeat(session.exact_v, reps, axis=0), f"force light {snr_db:g}")
    weights = np.unique(light.grams)
    hits, tries = np.zeros((2, len(RADIUS_SHARES), len(weights)))
    for k, result in enumerate(batch.each(frames)):
        press = k // reps
        at = int(light.group[press]), int(np.searchsorted(weights, light.grams[press]))
        tries[at] += 1
        if isinstance(result, Reconstruction):
            hits[at] += any(
                np.hypot(*(light.place_mm[press] - (t.x_mm, t.y_mm))) <= NEAR_MM
                for t in result.touches
            )
    return Detection(snr_db, weights, hits, tries, false, looked)


def grams_text(value: float) -> str:
    """With two digits."""
    return "none" if value == float("inf") else f"{value:.2g}" if value < 10 else f"{value:.0f}"


def table_of(found: list[Detection]) -> Table:
    """Thresholds with their intervals, and false alarms."""
    rows = []
    for one in found:
        cells = []
        for radius in range(len(RADIUS_SHARES)):
            cells.append(one.threshold_text(radius))
        share, upper = one.false_share()
        rows.append(
            (
                f"{one.snr_db:g} dB",
                *cells,
                f"{one.false} of {one.untouched}",
                f"{100 * upper:.2f} %" if share < 1 else "all",
            )
        )
    head = (
        "SNR",
        "centre",
        *(f"{share:g} R" for share in RADIUS_SHARES[1:]),
        "false alarms",
        "at most, 95 %",
    )
    return Table("detection", head, tuple(rows))
