"""The fit of touches, by its cost: that of the C core's discs beside the best that the oracle finds
from many starts.

The core spends a fixed number of steps on one disc after another; the oracle moves all at once
until nothing is gained. What the core's limits cost is stated here. The fit is rebuilt in the next
version; then this is where its cost is defined.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.optimize import least_squares

from eitskin.oracle.discs import Disc, DiscFit, area_mm2, interaction
from eitskin.oracle.engine import OracleEngine
from eitskin.scene.random_touches import TouchRules, random_touches
from eitskin.scene.simulate import Measurement, simulate
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin.solve.reconstructor import Reconstructor
from small_models import prebuilt

STARTS = 4
PLAIN = {"touch_test": 0, "touch_fit": 0, "row_gains": 0}  # discs and nothing else: one cost


@cache
def scenes(count: int, snr_db: float) -> tuple[np.ndarray, np.ndarray]:
    """Untouched frames, and five of ``count`` touches each."""
    drawn = random_touches(paper_skin().outline, 11, 5, "test", TouchRules(count=(count, count)))
    made = simulate(paper_skin(), adjacent(16), drawn, measurement=Measurement(snr_db=snr_db))
    return made.untouched_v, made.frames_v


def discs_of(fit: DiscFit, touches: tuple) -> list[Disc]:
    """As the core reports them: the strength over the area is the change."""
    out = []
    for t in touches:
        unit = Disc(t.x_mm, t.y_mm, t.radius_mm, 1.0)
        change = t.strength_s_per_m_mm2 / area_mm2(fit.model, unit)
        out.append(replace(unit, change=change))
    return out


def best_of_many(fit: DiscFit, discs: list[Disc], seed: int) -> float:
    """The least cost with so many discs, from these and from others near and far."""
    draw, costs = np.random.default_rng(seed), [fit.cost(fit.improved(discs))]
    for k in range(STARTS):
        off = 8.0 if k < STARTS / 2 else 25.0
        moved = [
            fit.within(
                replace(
                    one,
                    x_mm=one.x_mm + off * draw.normal(),
                    y_mm=one.y_mm + off * draw.normal(),
                    radius_mm=one.radius_mm * np.exp(0.3 * draw.normal()),
                ),
                1.0,
            )
            for one in discs
        ]
        costs.append(fit.cost(fit.improved(fit.with_strengths(moved))))
    return min(costs)


def judged(count: int, snr_db: float) -> list[float]:
    """How much more the core's discs cost than the best found with as many, over the cost without
    any."""
    untouched_v, frames_v = scenes(count, snr_db)
    core = Reconstructor(prebuilt()[0], engine="c64", blob=prebuilt()[1])
    oracle = OracleEngine(prebuilt()[0])
    core.set_options(**PLAIN)
    oracle.set_options(core.options)
    core.tare(untouched_v)
    oracle.set_reference(untouched_v)
    above = []
    for k, frame in enumerate(frames_v):
        core.forget()
        seen, found = oracle.explain(frame), core.reconstruct(frame).touches
        fit = oracle.disc_fit(seen)
        discs = discs_of(fit, found)
        best = best_of_many(fit, discs, k)
        above.append((fit.cost(discs) - best) / fit.cost([]))
    return above


@pytest.mark.parametrize("snr_db", [40.0, 60.0])
@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_the_cores_fit_costs_little_more_than_the_best(count, snr_db):
    """The core's cost exceeds the best by at most 5e-4 of the cost without touches in any scene,
    and by 1e-4 in four of five. On 80 scenes of this kind, looked at once when the test was
    written, it was at most 2e-4, and 5e-5 in half of them."""
    above = np.sort(judged(count, snr_db))
    assert above[-1] < 5e-4 and above[-2] < 1e-4


def test_the_cores_discs_fit_the_data_less_what_they_do_to_each_other():
    """With the whole touch fit, three touches at 60 dB: the oracle takes the interaction of the
    core's discs out of the data. Then the discs cost at most 1e-4 of |y|^2 more than the best near
    them; the interaction itself is many times that."""
    untouched_v, frames_v = scenes(3, 60.0)
    model, options = prebuilt()[0], {"touch_test": 0, "row_gains": 0}
    core = Reconstructor(model, engine="c64", blob=prebuilt()[1])
    oracle, added, above = OracleEngine(model), [], []
    core.set_options(**options)
    oracle.set_options(core.options)
    core.tare(untouched_v)
    oracle.set_reference(untouched_v)
    for frame in frames_v:
        core.forget()
        seen = oracle.explain(frame)
        fit = oracle.disc_fit(seen)
        discs = discs_of(fit, core.reconstruct(frame).touches)
        between, whole = oracle.reduced(seen, interaction(model, discs)), float(seen.y @ seen.y)
        fit = replace(fit, y=seen.y - between)
        added.append(float(between @ between) / whole)
        above.append((fit.cost(discs) - fit.cost(fit.improved(discs))) / whole)
    assert max(above) < 1e-4 and np.median(added) > 1e-3


def test_the_best_fit_is_scipys():
    """Trust region reflective on the same residuals, from the same starts: no better."""
    untouched_v, frames_v = scenes(3, 60.0)
    oracle = OracleEngine(prebuilt()[0])
    oracle.set_options(replace(oracle.options, **PLAIN))
    oracle.set_reference(untouched_v)
    for frame in frames_v[:4]:
        seen = oracle.explain(frame)
        fit = oracle.disc_fit(seen)
        image = oracle.reconstruct(frame, touches=False).solver_image
        discs = fit.with_strengths(fit.peaks(image))
        scale = np.tile([1.0, 1.0, 1.0, 0.01], len(discs))

        def residuals(v: np.ndarray, fit: DiscFit = fit) -> np.ndarray:
            some = [Disc(*one) for one in v.reshape(-1, 4).tolist()]
            priors = [fit.prior(one, fit.answer(one)) for one in some]
            return np.append(fit.residual(some), priors)

        o = fit.options
        low = [-np.inf, -np.inf, o.touch_min_radius_mm, 0.0]
        high = [np.inf, np.inf, o.touch_max_radius_mm, np.inf]
        start = np.array([one.numbers for one in discs]).ravel()
        bounds = np.tile(low, len(discs)), np.tile(high, len(discs))
        theirs = least_squares(residuals, start, bounds=bounds, x_scale=scale)
        ours = fit.cost(fit.improved(discs))
        assert ours <= 2 * theirs.cost + 1e-3 * fit.cost([])
