"""Readings over weight at four radii: slopes, how straight they are, and how far the law's
uncertainty moves them."""

from dataclasses import dataclass

import numpy as np

from eitskin.arrays import FloatArray
from eitskin_studies.experiments.experiment import Table
from eitskin_studies.experiments.force.law import WEIGHTS_G
from eitskin_studies.experiments.force.readouts import READOUTS, Readout
from eitskin_studies.experiments.force.scenes import RADIUS_SHARES, PressSet


@dataclass(frozen=True, eq=False)
class ForceCurves:
    """One readout: ``mean`` (radii, weights) over angles under the nominal law; ``bands`` (laws,
    radii, weights) under others."""

    mean: FloatArray
    bands: FloatArray

    @property
    def slopes(self) -> FloatArray:
        """(radii,) of the straight line through the weights, a g."""
        return slopes_of(self.mean)

    def centre_share_band(self) -> tuple[float, float]:
        """The centre's slope over that near the rim: 95 % of it over the laws."""
        shares = [slopes_of(one)[0] / slopes_of(one)[-1] for one in self.bands]
        low, high = np.nanquantile(shares, [0.025, 0.975])
        return float(low), float(high)

    def straightness(self) -> tuple[float, float]:
        """Least R^2 over the radii; and the greatest distance from the line, relative to the
        reading at the greatest weight."""
        weights = np.array(WEIGHTS_G)
        r2, off = [], []
        for values in self.mean:
            line = np.polyval(np.polyfit(weights, values, 1), weights)
            r2.append(1 - ((values - line) ** 2).sum() / ((values - values.mean()) ** 2).sum())
            off.append(np.abs(values - line).max() / abs(values[-1]))
        return float(np.nanmin(r2)), float(np.nanmax(off))


def slopes_of(values: FloatArray) -> FloatArray:
    """Slopes (radii,) of readings (radii, weights)."""
    return np.asarray(np.polyfit(WEIGHTS_G, values.T, 1)[0])


def curves_of(
    nominal: PressSet, read: dict[str, Readout], laws: PressSet, of_laws: dict[str, Readout]
) -> dict[str, ForceCurves]:
    """Each readout's curves; the first of ``laws`` is the nominal one, to which the others'
    readings are held."""
    found = {}
    for name in READOUTS:
        mean = [
            [
                np.nanmean(read[name].value[(nominal.group == radius) & (nominal.grams == grams)])
                for grams in WEIGHTS_G
            ]
            for radius in range(len(RADIUS_SHARES))
        ]
        at_one_angle = of_laws[name].value.reshape(-1, len(RADIUS_SHARES), len(WEIGHTS_G))
        found[name] = ForceCurves(
            np.array(mean), np.array(mean) * at_one_angle[1:] / at_one_angle[0]
        )
    return found


def table_of(curves: dict[str, ForceCurves]) -> Table:
    """Slopes relative to the one near the rim, straightness."""
    rows = []
    for name, one in curves.items():
        relative, (low, high), (r2, off) = (
            one.slopes / one.slopes[-1],
            one.centre_share_band(),
            one.straightness(),
        )
        centre = f"{relative[0]:.2f} ({low:.2f} to {high:.2f})"
        rows.append(
            (name, centre, *(f"{s:.2f}" for s in relative[1:]), f"{r2:.3f}", f"{100 * off:.1f} %")
        )
    radii = (f"at {share:g} R" for share in RADIUS_SHARES[1:])
    head = (
        "reading",
        "slope at the centre (95 % over laws)",
        *radii,
        "least R²",
        "off the line, at most",
    )
    return Table("slopes", head, tuple(rows))
