"""The paper's way: weights on a metal sheet of constant area, at four places at equal distances
from the centre to the boundary; the smallest one over the whole skin, of single frames and of
means."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from eitskin_studies.experiments.experiment import Table, Workspace
from eitskin_studies.experiments.force import scenes
from eitskin_studies.experiments.force.curves import slopes_of
from eitskin_studies.experiments.force.detection import Detection, detect
from eitskin_studies.experiments.force.law import GEL_LIMIT_KPA, NOMINAL, SHEET, WEIGHTS_G
from eitskin_studies.experiments.force.readouts import (
    READOUTS,
    Instruments,
    Readout,
    as_lists,
    from_lists,
)
from eitskin_studies.harness.sessions import SceneSolver

SNRS_DB = (40.0, 50.0, 60.0)
SECOND = 48  # frames, of 208 rows of 80 samples
MEANS = (1, 2, 4, 8, 16, SECOND)  # of frames at the last SNR
PAPERS_G = 50.0  # the paper's smallest weight over its whole sensing area


@dataclass(frozen=True)
class UnderSheet:
    """``reading`` of the weights under the sheet, by the number of the place; ``least``:
    ``Detection`` by contact ("sheet", "tip"), SNR and the number of frames averaged."""

    reading: dict[str, list[list[float]]]
    least: dict[tuple[str, float, int], Detection]

    def tables(self) -> tuple[Table, ...]:
        """Slopes at the four places, the smallest weights, and what reaches the paper's."""
        return self._slopes(), self._smallest(), self._reach()

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        least = [
            {"contact": contact, "mean_of": mean_of, **one.as_dict()}
            for (contact, _, mean_of), one in self.least.items()
        ]
        return {"reading": self.reading, "least": least}

    def _slopes(self) -> Table:
        rows = []
        for name, values in self.reading.items():
            slopes = slopes_of(np.array(values))
            line = [np.polyval(np.polyfit(WEIGHTS_G, one, 1), WEIGHTS_G) for one in values]
            off = np.array(values) - line
            r2 = 1 - (off**2).sum(axis=1) / np.var(values, axis=1) / len(WEIGHTS_G)
            rising = "yes" if (np.diff(slopes) > 0).all() else "no"
            relative = (f"{slope / slopes[-1]:.2f}" for slope in slopes)
            rows.append((name, *relative, rising, f"{r2.min():.3f}"))
        places = (f"at {share:g} R" for share in scenes.SHEET_SHARES[1:])
        head = ("reading", "slope at the centre", *places, "k1 < k2 < k3 < k4", "least R²")
        return Table("sheet-slopes", head, tuple(rows))

    def _smallest(self) -> Table:
        rows = []
        for snr in SNRS_DB:
            for mean_of, what in ((1, "one frame"), (SECOND, "mean of a second")):
                cells = [
                    self._over_the_skin(self.least[contact, snr, mean_of])
                    for contact in ("sheet", "tip")
                ]
                alarms = [
                    f"{self.least[contact, snr, mean_of].false} of"
                    f" {self.least[contact, snr, mean_of].untouched}"
                    for contact in ("sheet", "tip")
                ]
                rows.append((f"{snr:g} dB", what, *cells, "; ".join(alarms)))
        head = ("SNR", "of", "metal sheet", "round tip", "false alarms")
        return Table("smallest", head, tuple(rows))

    def _over_the_skin(self, one: Detection) -> str:
        worst = max(range(len(one.hits)), key=lambda radius: one.threshold(radius)[0])
        text = one.threshold_text(worst)
        return f"**{text}**" if one.threshold(worst)[0] > PAPERS_G else text

    def _reach(self) -> Table:
        rows = []
        for mean_of in MEANS:
            cells = [
                self.least[contact, SNRS_DB[-1], mean_of].threshold_text(0)
                for contact in ("sheet", "tip")
            ]
            rows.append((str(mean_of), f"{1e3 * mean_of / SECOND:.0f} ms", *cells))
        head = ("frames averaged", "they take", "metal sheet", "round tip")
        return Table("reach", head, tuple(rows))


def measured(
    workspace: Workspace,
    solver: SceneSolver,
    instruments: Instruments,
    tip: scenes.PressSet,
    tip_single: Sequence[Detection],
) -> UnderSheet:
    """All of it; ``tip`` and ``tip_single`` are the light presses of the round tip and what was
    found of their single frames."""
    settings = workspace.settings
    radius_mm = (solver.skin.outline.diameter_mm or 0.0) / 2
    put = partial(scenes.solved, workspace, solver, seed=settings.seed, laws=(SHEET,))
    curve = put("force sheet", rows=scenes.curve_rows(radius_mm, scenes.SHEET_SHARES))
    ladder = scenes.light_rows(
        radius_mm, settings.count(15, 6), scenes.SHEET_SHARES, scenes.SHEET_G
    )
    light = put("force sheet light", rows=ladder)
    facts = {"part": "readings", "set": curve.facts, "snr_db": SNRS_DB[-1]}
    read = from_lists(
        workspace.kept(facts, lambda: as_lists(instruments.read(curve.session, SNRS_DB[-1])))
    )
    least: dict[tuple[str, float, int], Detection] = {
        ("tip", one.snr_db, 1): one for one in tip_single
    }
    reps, untouched = settings.count(30, 4), settings.count(4000, 80)
    wanted = [(snr, mean_of) for snr in SNRS_DB for mean_of in (1, SECOND)]
    wanted += [(SNRS_DB[-1], mean_of) for mean_of in MEANS[1:-1]]
    for snr, mean_of in workspace.progress(wanted, "weights on a sheet"):
        for contact, presses in (("sheet", light), ("tip", tip)):
            if (contact, snr, mean_of) in least:
                continue
            still = untouched if mean_of == 1 else max(80, untouched // 8)
            what = {"part": "mean", "mean_of": mean_of, "reps": reps, "quiet": still}
            look = partial(detect, instruments, presses, snr, reps, still, mean_of)
            one = workspace.kept(
                {**what, "snr_db": snr, "set": presses.facts}, partial(_as_dict, look)
            )
            least[contact, snr, mean_of] = Detection.from_dict(one)
    return UnderSheet({name: _by_place(curve, read[name]) for name in READOUTS}, least)


def _as_dict(look: partial[Detection]) -> dict[str, Any]:
    return look().as_dict()


def _by_place(curve: scenes.PressSet, read: Readout) -> list[list[float]]:
    """The mean over angles, by place and weight."""
    return [
        [
            float(np.nanmean(read.value[(curve.group == place) & (curve.grams == grams)]))
            for grams in WEIGHTS_G
        ]
        for place in range(len(scenes.SHEET_SHARES))
    ]


def pressures() -> str:
    """Describe the two contacts in words."""

    def of(law: Any) -> str:
        first, last = (law.pressure_kpa(grams) for grams in (WEIGHTS_G[0], WEIGHTS_G[-1]))
        low, high = (law.contrast(grams) for grams in (WEIGHTS_G[0], WEIGHTS_G[-1]))
        return f"{first:.1f} to {last:.1f} kPa, contrast {low:.2f} to {high:.2f}"

    return (
        f"From {WEIGHTS_G[0]:g} to {WEIGHTS_G[-1]:g} g the sheet of {SHEET.sheet_mm:g} mm radius"
        f" presses with {of(SHEET)}, the round tip with {of(NOMINAL)}; the paper's gel bears"
        f" {GEL_LIMIT_KPA:g} kPa."
    )
