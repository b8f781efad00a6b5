"""Sentences with numbers in them, for the page's marks."""

from collections.abc import Sequence

from eitskin_studies.experiments.experiment import Workspace
from eitskin_studies.experiments.multitouch.ambiguity import calibration
from eitskin_studies.experiments.multitouch.cells import (
    GEOMETRIES,
    MAX,
    MIN,
    MIXED_SCENES,
)
from eitskin_studies.experiments.multitouch.counts import Share
from eitskin_studies.experiments.multitouch.measure import Ambiguities, CountedScenes, Limit
from eitskin_studies.experiments.multitouch.tables import NAMES, SHORT
from eitskin_studies.experiments.multitouch.test_data import (
    CLASSICAL,
    HEADLINE_DB,
    TRAINING_PARTS,
    TouchData,
)
from eitskin_studies.harness.sections import AS_EVERYWHERE

GOOD = 0.90


def conditions(touch_data: TouchData, workspace: Workspace) -> str:
    """Return the conditions that all tables share."""
    settings = workspace.settings
    chosen = ((name, touch_data.trained(name)) for name in CLASSICAL)
    trained = "; ".join(
        f"{SHORT.get(name, name)}: {one.value:g} and t' = {one.threshold:g}" for name, one in chosen
    )
    return (
        f"Seed {settings.seed}, {AS_EVERYWHERE}, 16 bits from 70 dB on; SNR at 80 samples. The core"
        " has its models' defaults. Parameter and threshold t' of the classical methods were chosen"
        f" together, for most exact counts, on {TRAINING_PARTS * settings.count(MIXED_SCENES, 3)}"
        f" mixed tuning scenes at 60 dB (seed {settings.tuning_seed}): {trained}. Brackets: 95 %"
        " intervals, Wilson's for fractions, bootstrap for errors."
    )


def closing(counted: CountedScenes, limited: Sequence[Limit]) -> str:
    """Say how many touches the core counts, and what limits the count."""
    default = NAMES[0]
    far = ", ".join(f"{where} {_far(counted, where, default)}" for where in GEOMETRIES)
    frames, core, told, nonlinear = (
        sum(values)
        for values in zip(
            *((one.scenes, one.core[default], one.told[default], one.nonlinear) for one in limited),
            strict=True,
        )
    )
    return (
        f"- Up to this number of touches, at least {100 * GOOD:.0f} % of the scenes are exact at"
        f" {HEADLINE_DB:g} dB: {far}.\n"
        f"- {core} of {frames} frames with many touches are exact. If the same fit starts from the"
        f" true places, {told} are. By a nonlinear fit that starts there, {nonlinear} are."
        f"{_cause(frames, core, told, nonlinear)}"
    )


def _cause(frames: int, core: int, told: int, nonlinear: int) -> str:
    """Return what loses most of the frames that the core does not count exactly."""
    lost = {
        "the core's search, which misses the true places": told - core,
        "the approximations of the fit, which has no joint fit after it": (
            nonlinear - max(core, told)
        ),
        "the data, which do not hold enough": frames - max(core, told, nonlinear),
    }
    cause = max(lost, key=lambda name: lost[name])
    return f" Most of the others are lost to {cause}." if lost[cause] > 0 else ""


def doubtful(ambiguous: Ambiguities) -> str:
    """Return how right ``crowded`` is about the core's counts, by SNR."""
    told = []
    for snr_db in (HEADLINE_DB, 40.0):
        one = calibration([f for f in ambiguous.mixed[NAMES[0]] if f.snr_db == snr_db])
        told.append(
            f"At {snr_db:g} dB {_pc(one.not_said)} of the mixed scenes are not reported as"
            f" `crowded`. {_pc(one.right_not_said)} of these are counted right, and"
            f" {_pc(one.right_said)} of the reported ones. {_pc(one.wrong_said)} of the wrong"
            " counts are reported."
        )
    return " ".join(told)


def _far(counted: CountedScenes, geometry: str, name: str) -> str:
    most = MIN - 1
    for k in range(MIN, MAX + 1):
        score = counted.scores.get((geometry, k, name, HEADLINE_DB))
        if score is None or score.exact.mean < GOOD:
            break
        most = k
    return str(most)


def _pc(share: Share) -> str:
    return (
        f"{100 * share.mean:.0f} % ({100 * share.low:.0f} to {100 * share.high:.0f})"
        if share.count
        else "none"
    )
