"""Each constant halved and doubled: which scenes change, and by how much.

A scene is played again only where it uses the constant. Each constant has a process of its own,
since a value that a promise rests on may end it.
"""

import multiprocessing
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from eitskin.errors import EitskinError
from eitskin_studies.experiments.constants.judged import Runner, Scene, Score
from eitskin_studies.experiments.constants.variant import Constant, Variant

LONGEST_S = 120.0
# modules that only the scenes drive by drive judge; these name the first as theirs
IN_TIME = ("fast", "search")


@dataclass(frozen=True)
class Baseline:
    """The result of one scene at the values of the table: its digest, its score, the constants it
    uses."""

    digest: str
    score: Score
    used: frozenset[int]


@dataclass(frozen=True)
class Effect:
    """The effect of one value of one constant.

    Attributes:
        value: in the place of the table's.
        used, changed: scenes that use the constant, and whose bits are others with this value.
        kinds: changed scenes by kind.
        before, after: numbers of :func:`numbers_of` over all scenes that judge the constant.
        failed: why there is no more to say: "ends the process", "does not end", or an error.
    """

    value: float
    used: int
    changed: int = 0
    kinds: dict[str, int] = field(default_factory=dict)
    before: dict[str, float] = field(default_factory=dict)
    after: dict[str, float] = field(default_factory=dict)
    failed: str | None = None

    def change(self, name: str) -> float:
        """After less before."""
        return self.after[name] - self.before[name] if self.after else 0.0


def baselines(variant: Variant, scenes: Sequence[Scene]) -> list[Baseline]:
    """By the product's core, and the constants that are used by the variant, whose bits must be the
    same.

    Raises:
        EitskinError: they are not.
    """
    product, found = Runner(), []
    for scene in scenes:
        played = scene.play(product)
        with variant.in_place():
            variant.used()
            varied = scene.play(Runner())  # with opening the model
            used = variant.used()
        if varied.digest != played.digest:
            raise EitskinError(
                f"constants: the variant of the core differs from the installed one in"
                f" {scene.kind} {scene.name}; install the package from this checkout"
            )
        found.append(Baseline(played.digest, played.score(), used))
    return found


def judges_of(constant: Constant, scenes: Sequence[Scene]) -> list[int]:
    """The places of the scenes by which a constant is judged."""
    if constant.module in IN_TIME:
        return [k for k, one in enumerate(scenes) if one.module == IN_TIME[0]]
    return [k for k, one in enumerate(scenes) if one.module in (None, constant.module)]


def effects_of(
    constant: Constant, variant: Variant, scenes: Sequence[Scene], known: Sequence[Baseline]
) -> list[Effect]:
    """Return the effects of the half and of the double."""
    judging = judges_of(constant, scenes)
    using = [k for k in judging if constant.place in known[k].used]
    if not using:
        return [Effect(value, 0) for value in constant.changed()]
    before = Score()
    for k in judging:
        before.add(known[k].score)
    effects = []
    for value in constant.changed():
        changed = _in_process(constant, value, variant, [(scenes[k], known[k]) for k in using])
        if isinstance(changed, str):
            effects.append(Effect(value, len(using), failed=changed))
            continue
        scores = {using[k]: score for k, score in changed.items()}
        after = Score()
        for k in judging:
            after.add(scores.get(k, known[k].score))
        kinds = Counter(scenes[k].kind for k in scores)
        effects.append(
            Effect(
                value, len(using), len(scores), dict(kinds), numbers_of(before), numbers_of(after)
            )
        )
    return effects


def _in_process(
    constant: Constant, value: float, variant: Variant, some: Sequence[tuple[Scene, Baseline]]
) -> dict[int, Score] | str:
    """The scores of the scenes that change, by their place in ``some``; or why there are none."""
    context = multiprocessing.get_context("fork")
    ours, theirs = context.Pipe(duplex=False)
    worker = context.Process(target=_play, args=(constant, value, variant, some, theirs))
    worker.start()
    theirs.close()
    found: Any = None
    try:
        if ours.poll(LONGEST_S):
            found = ours.recv()
        else:
            found = "does not end"
            worker.kill()
    except EOFError:
        found = "ends the process"
    worker.join()
    if isinstance(found, str):
        return found
    return {k: Score(**score) for k, score in found.items()}


def _play(
    constant: Constant,
    value: float,
    variant: Variant,
    some: Sequence[tuple[Scene, Baseline]],
    answer: Connection,
) -> None:
    variant.set(constant, value)
    changed: dict[int, dict[str, Any]] = {}
    try:
        with variant.in_place():
            runner = Runner()
            for k, (scene, known) in enumerate(some):
                played = scene.play(runner)
                if played.digest != known.digest:
                    changed[k] = asdict(played.score())
        answer.send(changed)
    except EitskinError as error:
        answer.send(f"rejected: {error}")


def numbers_of(score: Score) -> dict[str, float]:
    """Return the numbers that are compared: counts, and means or quantiles where they are sums."""
    errors, touched = score.errors_mm or [0.0], max(1, score.touched)
    return {
        "frames": score.frames,
        "exact": score.exact,
        "median_mm": float(np.median(errors)),
        "p95_mm": float(np.quantile(errors, 0.95)),
        "miou_image": score.miou_image / touched,
        "miou_discs": score.miou_discs / touched,
        "false_names": score.false_names,
        "missing_names": score.missing_names,
        "gestures_right": score.gestures_right,
        "gestures_invented": score.gestures_invented,
        "mega_macs": score.macs / 1e6,
    }
