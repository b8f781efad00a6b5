"""The whole measurement: train, score, count and time every configuration; each result is kept as
soon as it is measured."""

import hashlib
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from eitskin import __version__
from eitskin.core.engine import load_core
from eitskin.errors import ConfigError, FileError, UsageError
from eitskin.progress import Progress
from eitskin.skin.protocol import Protocol, adjacent
from eitskin.skin.skin import Skin, paper_skin
from eitskin.skin.uncertainty import DEFAULT_UNCERTAINTY
from eitskin.tuning.configuration import ELEMENTS, Configuration
from eitskin.tuning.front import Front, OperatingPoint
from eitskin_studies.harness.commit import last_commit
from eitskin_studies.harness.machine import machine
from eitskin_studies.harness.sessions import FrameSession
from eitskin_studies.harness.store import Store
from eitskin_studies.tradeoff.accuracy import SolvedSet, TrainedPoint, score, solve_session, train
from eitskin_studies.tradeoff.costs import static_costs
from eitskin_studies.tradeoff.emulation import Emulator, count_instructions, make_emulator
from eitskin_studies.tradeoff.engines import Built, ModelShop
from eitskin_studies.tradeoff.fronts import estimated_instructions, recorded_front
from eitskin_studies.tradeoff.host_times import host_times
from eitskin_studies.tradeoff.peers import SCANS, Peers
from eitskin_studies.tradeoff.scene_sets import HEADLINE, HEADLINE_DB, SETS, TRAIN, SceneFactory

RESULTS = "results.jsonl"


@dataclass(frozen=True)
class RunSettings:
    """The extent of the measurement.

    Attributes:
        scenes, train_scenes, set_scenes: of the set "random", of "train", and of each other set.
        sets: those beside "random".
        snrs_db: of the set "random"; the other sets are measured at 60 dB alone. 60 is always among
            them: t and costs are of 60 dB.
        seed: of all that is random.
        simulated_elements: of the mesh that frames come from; models are made on one of about
            3,000.
        counted, costliest: scenes whose instructions are counted: evenly spread, and those with the
            most MACs; 0: none.
        rounds: of eight scenes in which times are taken; 0: none.
        random_skins: that model errors are drawn from; 0: models without, and no test of touches.
        peers: whether other methods are measured on the same scenes.
    """

    scenes: int = 180
    train_scenes: int = 60
    set_scenes: int = 30
    sets: tuple[str, ...] = tuple(
        name for name, one in SETS.items() if name not in (TRAIN, HEADLINE) and not one.other_world
    )
    snrs_db: tuple[float, ...] = (40.0, 60.0, 80.0)
    seed: int = 1
    simulated_elements: int = 11_000
    counted: int = 24
    costliest: int = 8
    rounds: int = 25
    random_skins: int = DEFAULT_UNCERTAINTY.samples
    peers: bool = True

    def __post_init__(self) -> None:
        for name in ("scenes", "train_scenes", "set_scenes"):
            if not 1 <= getattr(self, name) <= 100_000:
                value = getattr(self, name)
                raise UsageError(
                    f"tradeoff run: {name.replace('_', ' ')} = {value} is out of range; use 1 to"
                    " 100000"
                )
        for name in self.sets:
            if name not in SETS or name in (TRAIN, HEADLINE):
                others = ", ".join(one for one in SETS if one not in (TRAIN, HEADLINE))
                raise UsageError(
                    f"tradeoff run: no set of scenes is named {name!r}; known are {others}"
                )
        if HEADLINE_DB not in self.snrs_db or not all(0 <= snr <= 200 for snr in self.snrs_db):
            raise UsageError(
                f"tradeoff run: SNRs must be within 0 to 200 dB, with {HEADLINE_DB:g} among them"
            )

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {**vars(self), "sets": list(self.sets), "snrs_db": list(self.snrs_db)}


@dataclass(eq=False)
class _Desk:
    """The data that the steps of a run share."""

    settings: RunSettings
    store: Store
    workshop: SceneFactory
    shop: ModelShop
    world: dict[str, Any]
    progress: Progress

    def __post_init__(self) -> None:
        self._built: dict[tuple[Any, ...], Built] = {}

    def built(self, one: Configuration) -> Built:
        key = (*one.model_settings, one.solver, one.iterations, one.lambda_rel)
        if key not in self._built:
            self._built[key] = self.shop.build(one)
        return self._built[key]

    def session(self, name: str) -> FrameSession:
        counts = {TRAIN: self.settings.train_scenes, HEADLINE: self.settings.scenes}
        return self.workshop.session(
            name, counts.get(name, self.settings.set_scenes), self.progress
        )

    def kept(self, facts: dict[str, Any], make: Callable[[], Any]) -> Any:
        """Return what is stored for ``facts``; it is made and stored if it is not there yet."""
        facts = {**self.world, **facts}
        found = self.store.get(facts)
        return self.store.put(facts, make()) if found is None else found

    def facts(self, one: Configuration, what: str, **more: Any) -> dict[str, Any]:
        settings = {name: value for name, value in one.as_dict().items() if name != "name"}
        return {**self.world, "what": what, "configuration": settings, **more}


def run(
    configurations: Sequence[Configuration], settings: RunSettings, folder: Path, progress: Progress
) -> Front:
    """Measure ``configurations``; what ``folder`` holds already is not measured again.

    Raises:
        FileError: the folder cannot be written.
        UsageError, ConfigError: a configuration cannot be.
        GeometryError, MissingExtraError: from meshing.
        VerificationError: the emulated core disagrees with this host's.
    """
    skin, protocol = paper_skin(), adjacent(16)
    shop = ModelShop(skin, protocol)
    for one in configurations:  # what cannot be is refused before anything is written
        shop.refuse(one)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(
            f"{folder}: cannot make this folder ({error.strerror}); name another with -o"
        ) from None
    workspace = _Desk(
        settings,
        Store(folder / RESULTS),
        SceneFactory(skin, protocol, settings.seed, settings.simulated_elements, folder / "frames"),
        shop,
        _world(settings, skin, protocol),
        progress,
    )
    if settings.random_skins:
        shop.draw_errors(configurations, settings.random_skins, progress)
    for name in (TRAIN, HEADLINE, *settings.sets):
        workspace.session(name)
    trained = {
        one.name: _train(workspace, one) for one in progress(configurations, "choosing thresholds")
    }
    cells = [(HEADLINE, snr_db) for snr_db in settings.snrs_db]
    cells += [(name, HEADLINE_DB) for name in settings.sets]
    scores: dict[str, dict[str, dict[str, Any]]] = {one.name: {} for one in configurations}
    # cell by cell, so that frames with noise are made once for all configurations that measure
    # alike
    for name, snr_db, one in progress(
        [(*cell, one) for cell in cells for one in configurations], "scoring"
    ):
        scores[one.name].setdefault(name, {})[f"{snr_db:g}"] = _score(
            workspace, one, name, snr_db, trained[one.name]
        )
    counted, why = _instructions(workspace, configurations, folder)
    times, kernels = _host(workspace, configurations)
    points = [
        OperatingPoint(
            one,
            trained[one.name].threshold,
            trained[one.name].force_scale,
            static_costs(one, workspace.built(one)),
            counted[one.name],
            times[one.name],
            scores[one.name],
        )
        for one in configurations
    ]
    facts: dict[str, Any] = {
        "made_by": f"eitskin {__version__}, eitskin tradeoff run",
        "machine": machine(),
        "kernels": kernels,
    }
    facts |= {"skin": skin.name, "instructions": why, "model_elements": ELEMENTS}
    facts["commit"] = last_commit(("csrc", "python", "studies/eitskin_studies"))
    facts["peers"] = _peers(workspace, skin, protocol)
    return Front({**settings.as_dict(), **facts}, tuple(_estimated(points)), str(folder))


def _world(settings: RunSettings, skin: Skin, protocol: Protocol) -> dict[str, Any]:
    """Return what a result depends on besides its configuration. The core's own bytes are part of
    it, so that another build measures again."""
    module = load_core("float32")
    core = hashlib.sha256(Path(module.__file__).read_bytes()).hexdigest()[:16]
    counts = [
        settings.train_scenes,
        settings.simulated_elements,
        ELEMENTS,
        settings.seed,
        settings.random_skins,
    ]
    return {
        "version": __version__,
        "core": core,
        "skin": skin.name,
        "protocol": f"{protocol.hash:016x}",
        "counts": counts,
    }


def _train(workspace: _Desk, one: Configuration) -> TrainedPoint:
    facts = workspace.facts(one, "train")
    kept = workspace.store.get(facts)
    if kept is None:
        session = workspace.session(TRAIN)
        done = train(
            workspace.built(one),
            session,
            solve_session(one, workspace.built(one), session, HEADLINE_DB),
        )
        kept = workspace.store.put(facts, vars(done))
    return TrainedPoint(**kept)


def _score(
    workspace: _Desk, one: Configuration, name: str, snr_db: float, trained: TrainedPoint
) -> dict[str, Any]:
    session = workspace.session(name)
    facts = workspace.facts(one, "score", set=name, scenes=session.scenes, snr_db=snr_db)
    kept = workspace.store.get(facts)
    if kept is None:
        solved = solve_session(one, workspace.built(one), session, snr_db)
        kept = workspace.store.put(facts, score(workspace.built(one), session, solved, trained))
    values: dict[str, Any] = kept
    return values


def _instructions(
    workspace: _Desk, configurations: Sequence[Configuration], folder: Path
) -> tuple[dict[str, dict[str, Any] | None], str]:
    """Counted instructions by configuration, None if they were not; and a word about how."""
    how, found = workspace.settings, {}
    wanted: list[Configuration] = []
    for one in configurations:
        found[one.name] = workspace.store.get(_counting(workspace, one)) if how.counted else None
        if found[one.name] is None:
            wanted.append(one)
    scenes = (
        f"{how.counted} test scenes evenly, and the {how.costliest} with the most MACs for the most"
    )
    text = f"counted under QEMU on {scenes}; at {HEADLINE_DB:g} dB"
    if not how.counted:
        return found, "not counted: estimated from MACs"
    if not wanted:
        return found, text
    emulator = make_emulator(folder)
    if isinstance(emulator, str):
        return found, f"estimated from MACs: {emulator}"
    session = workspace.session(HEADLINE)
    solved = {
        one.name: solve_session(one, workspace.built(one), session, HEADLINE_DB) for one in wanted
    }
    with ThreadPoolExecutor(2) as pool:
        jobs = [
            (one, pool.submit(_count, workspace, emulator, one, solved[one.name])) for one in wanted
        ]
        try:
            for one, job in workspace.progress(jobs, "emulating"):
                found[one.name] = workspace.store.put(_counting(workspace, one), job.result())
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return found, text


def _counting(workspace: _Desk, one: Configuration) -> dict[str, Any]:
    how = workspace.settings
    return workspace.facts(one, "instructions", counted=[how.scenes, how.counted, how.costliest])


def _count(
    workspace: _Desk, emulator: Emulator, one: Configuration, solved: SolvedSet
) -> dict[str, Any]:
    measured = workspace.session(HEADLINE).measured(HEADLINE_DB, one.samples, one.scan, one.held)
    how = workspace.settings
    return count_instructions(
        emulator, one, workspace.built(one), measured, solved, how.counted, how.costliest
    )


def _host(
    workspace: _Desk, configurations: Sequence[Configuration]
) -> tuple[dict[str, dict[str, Any] | None], str]:
    """Times by configuration; all are taken together, or none."""
    rounds = workspace.settings.rounds
    if not rounds:
        return {one.name: None for one in configurations}, "not timed"
    facts = {
        **workspace.world,
        "what": "host",
        "machine": machine(),
        "rounds": rounds,
        "scenes": workspace.settings.scenes,
    }
    facts["configurations"] = [
        workspace.facts(one, "host")["configuration"] for one in configurations
    ]
    kept = workspace.store.get(facts)
    if kept is None:
        session = workspace.session(HEADLINE)
        entries = [
            (
                one,
                workspace.built(one),
                session.measured(HEADLINE_DB, one.samples, one.scan, one.held),
            )
            for one in configurations
        ]
        rows, kernels = host_times(entries, rounds, workspace.progress)
        kept = workspace.store.put(facts, {"rows": rows, "kernels": kernels})
    return {one.name: row for one, row in zip(configurations, kept["rows"], strict=True)}, str(
        kept["kernels"]
    )


def _peers(workspace: _Desk, skin: Skin, protocol: Protocol) -> list[dict[str, Any]]:
    """The other methods on every scan and SNR, timed where configurations are; none where they are
    not wanted."""
    how = workspace.settings
    if not how.peers:
        return []
    peers = Peers(skin, protocol)
    sessions = workspace.session(TRAIN), workspace.session(HEADLINE)
    cells = [(scan, snr, name) for scan in SCANS for snr in how.snrs_db for name in peers.names]
    rows = []
    for scan, snr_db, name in workspace.progress(cells, "other methods"):
        facts = {"what": "peer", "name": name, "scan": vars(scan), "snr_db": snr_db}
        row = workspace.kept(
            facts | {"scenes": how.scenes},
            partial(peers.score, name, *sessions, scan, snr_db),
        )
        if how.rounds:
            timed = facts | {"what": "peer, host", "machine": machine(), "rounds": how.rounds}
            cell = (name, row["value"], sessions[1], scan, snr_db, how.rounds)
            row = row | workspace.kept(timed, partial(peers.time, *cell))
        rows.append(row)
    return rows


def _estimated(points: Sequence[OperatingPoint]) -> list[OperatingPoint]:
    """``points``, where nothing was counted with an estimate from those that were, or from the
    recorded results."""
    if all(one.instructions is not None for one in points):
        return list(points)
    table = [*points]
    with suppress(FileError, ConfigError):
        table += recorded_front().points
    result = []
    for one in points:
        score = one.scores[HEADLINE][f"{HEADLINE_DB:g}"]
        macs = (score["solve_macs"][0] + score["touch_macs"][0], score["most_macs"])
        counted = one.instructions or estimated_instructions(table, one.configuration, macs)
        result.append(OperatingPoint(**{**vars(one), "instructions": counted}))
    return result
