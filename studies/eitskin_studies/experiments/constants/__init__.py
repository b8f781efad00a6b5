"""Each constant of the core halved and doubled: what changes on judging scenes."""

import time
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from eitskin_emulator.core_on_qemu import checkout_root
from eitskin_studies.experiments.constants.in_time import fast_scenes, gesture_scenes
from eitskin_studies.experiments.constants.judged import Scene
from eitskin_studies.experiments.constants.models import of_other_models, of_presses
from eitskin_studies.experiments.constants.protected import Tests, protecting, test_objects
from eitskin_studies.experiments.constants.scenes import SceneMaker
from eitskin_studies.experiments.constants.sweep import Effect, baselines, effects_of
from eitskin_studies.experiments.constants.tables import (
    any_change,
    tables_of,
    words_of,
)
from eitskin_studies.experiments.constants.variant import build_variant
from eitskin_studies.experiments.experiment import ExperimentOutcome, Workspace
from eitskin_studies.harness.commit import last_commit

TITLE = "Constants halved and doubled, one at a time"


def run(workspace: Workspace) -> ExperimentOutcome:
    """All constants.

    Raises:
        UsageError: this is no checkout, there is no compiler, the C tests are not built, or no
            measured presses are given.
    """
    began = time.process_time()
    test_objects()  # refused now, not after the sweep
    variant = build_variant(workspace.folder / "variant", checkout_root())
    scenes = _scenes(SceneMaker.of(workspace))
    known = baselines(variant, scenes)
    effects: dict[str, list[Effect]] = {}
    seconds = time.process_time() - began
    for constant in workspace.progress(variant.constants, "constants"):
        facts = {"study": "constants", "name": constant.name, "value": constant.value,
                 "scenes": [one.digest for one in known]}  # fmt: skip
        kept = workspace.kept(
            facts,
            lambda constant=constant: _timed(  # type: ignore[misc]
                lambda: effects_of(constant, variant, scenes, known)
            ),
        )
        seconds += kept["seconds"]
        effects[constant.name] = [Effect(**one) for one in kept["effects"]]
    still = [one for one in variant.constants if not one.is_size and not any_change(effects, one)]
    needed = workspace.kept(
        {"study": "constants", "tests of": [one.name for one in still]},
        lambda: protecting(Tests(workspace.folder / "tests"), still),
    )
    commit = last_commit(("csrc", "tables/constants.toml"))
    facts = {"commit": commit, "seconds": round(seconds), "scenes": len(scenes)}
    return ExperimentOutcome(
        tables_of(variant.constants, effects, needed, commit),
        {
            **facts,
            "tests": needed,
            "constants": {
                name: [asdict(effect) for effect in some] for name, some in effects.items()
            },
        },
        {},
        words_of(variant.constants, effects, scenes, facts),
    )


def _scenes(maker: SceneMaker) -> list[Scene]:
    frames = maker.scenes()
    return [
        *frames, *of_other_models(maker, frames), *of_presses(maker), *gesture_scenes(maker),
        *fast_scenes(maker),
    ]  # fmt: skip


def _timed(make: Any) -> dict[str, Any]:
    import resource

    def used() -> float:
        return sum(
            resource.getrusage(who).ru_utime + resource.getrusage(who).ru_stime
            for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
        )

    before = used()
    effects: Sequence[Effect] = make()
    return {"effects": [asdict(one) for one in effects], "seconds": used() - before}
