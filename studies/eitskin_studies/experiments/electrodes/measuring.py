"""Measured scans: frames of any pattern from the scenes' transfer matrices, their models, and the
touches that are found with them."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.fem.cem import ForwardModel
from eitskin.fem.fields import electrode_fields
from eitskin.fem.grid import grid_for
from eitskin.fem.mesh import mesh_for_elements
from eitskin.fem.sensitivity import sensitivity
from eitskin.model.build import BuildSettings, Linearisation, make_model
from eitskin.model.eitm import encode_model
from eitskin.model.reduction import DEFAULT_COLUMN_POWER
from eitskin.scene.random_touches import TouchSet, random_touches
from eitskin.scene.simulate import Measurement, measure
from eitskin.scoring import metrics
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import disk
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import PAPER_DIAMETER_MM, Skin
from eitskin.tuning.configuration import BASE_SAMPLES
from eitskin_studies.experiments.electrodes.patterns import (
    FRAME_US,
    PATTERNS,
    ScanPattern,
    from_transfer,
    transfer,
    within_time,
)
from eitskin_studies.experiments.electrodes.tuning import tuned
from eitskin_studies.experiments.experiment import MODEL_ELEMENTS, Workspace
from eitskin_studies.experiments.scored import session_in_parts
from eitskin_studies.harness.discs import spaced_touches
from eitskin_studies.harness.sessions import FrameSession
from eitskin_studies.harness.snr import noise_deviation_v
from eitskin_studies.tradeoff.scene_sets import ring_touches

SNR_DB = 60.0
COUNTS = (16, 32, 64)
RANKS = {16: 64, 32: 128, 64: 192}
TUNING, TUNING_SIX, RANDOM, SIX, PAIRS = 32, 12, 120, 40, 12
TRAINING = ("train", "train six")
PAIR_MM = (20.0, 22.0, 24.0, 27.0, 30.0, 36.0)
KEPT = ("image", "discs", "exact", "false", "kmac", "error_mm")


@dataclass(frozen=True)
class PatternCase:
    """One scan with its model: ``equal`` says what it shares with the others, "noise" in each row
    or "time" of a frame; ``power`` is p of the reduction."""

    electrodes: int
    pattern: str = "adjacent"
    equal: str = "noise"
    rank: int = 64
    pixels: int = 32
    power: float = DEFAULT_COLUMN_POWER


def usual_case(electrodes: int, pattern: str, equal: str) -> PatternCase:
    """With the rank that its number of electrodes has in the tables."""
    return PatternCase(
        electrodes, pattern, equal, min(RANKS[electrodes], _folded(electrodes, pattern, equal))
    )


@cache
def scan_of(case: PatternCase) -> ScanPattern:
    """Return the scan: everything with the usual samples, or what fits into the usual frame."""
    protocol = PATTERNS[case.pattern](case.electrodes)
    return (
        ScanPattern(protocol, BASE_SAMPLES)
        if case.equal == "noise"
        else within_time(protocol, FRAME_US)
    )


def _folded(electrodes: int, pattern: str, equal: str) -> int:
    return len(scan_of(PatternCase(electrodes, pattern, equal)).protocol.reciprocal_pairs().first)


@dataclass(eq=False)
class PatternWorkspace:
    """A skin of some electrodes: scenes solved once for every pattern, and one Jacobian of the
    transfer matrix a grid."""

    workspace: Workspace
    electrodes: int

    @cached_property
    def skin(self) -> Skin:
        """The paper's disk with more electrodes of the same width."""
        return Skin(
            f"disk of {self.electrodes}", disk(PAPER_DIAMETER_MM), Electrodes(self.electrodes)
        )

    @cached_property
    def sets(self) -> dict[str, TouchSet]:
        """Return the touches: for choosing settings and to report, 1 to 3 random ones, six apart,
        and pairs at each distance."""
        settings, outline = self.workspace.settings, self.skin.outline
        sets = {
            "train": random_touches(outline, settings.tuning_seed, settings.count(TUNING), "train"),
            "train six": spaced_touches(
                outline, settings.tuning_seed, settings.count(TUNING_SIX), 6, 4.0
            ),
            "random": random_touches(outline, settings.seed, settings.count(RANDOM), "test"),
            "six": spaced_touches(outline, settings.seed, settings.count(SIX), 6, 4.0),
        }
        pairs = {
            f"pair {d:g}": ring_touches(outline, settings.seed, settings.count(PAIRS), 2, d)
            for d in PAIR_MM
        }
        return sets | pairs

    @cached_property
    def sessions(self) -> dict[str, FrameSession]:
        """The transfer matrices of every scene, without noise."""
        solver = self.workspace.scenes(self.skin, transfer(self.electrodes))
        name = f"{self.electrodes} electrodes"
        return {
            key: session_in_parts(solver, drawn, self.workspace.progress, f"{name} {key}")
            for key, drawn in self.sets.items()
        }

    @cached_property
    def _forward(self) -> ForwardModel:
        return ForwardModel(
            mesh_for_elements(self.skin, MODEL_ELEMENTS), self.skin, transfer(self.electrodes)
        )

    @cached_property
    def _grids(self) -> dict[int, Linearisation]:
        return {}

    def linear(self, case: PatternCase) -> Linearisation:
        """The Jacobian of a scan."""
        if case.pixels not in self._grids:
            grid = grid_for(self.skin.outline, case.pixels)
            jacobian, v0_v = sensitivity(self._forward, self.skin.conductivity_s_per_m, grid)
            fields = electrode_fields(self._forward, self.skin.conductivity_s_per_m, grid)
            self._grids[case.pixels] = Linearisation(
                grid, jacobian, v0_v, self._forward.mesh.n_elements, fields
            )
        whole, protocol = self._grids[case.pixels], scan_of(case).protocol
        jacobian = from_transfer(np.ascontiguousarray(whole.jacobian.T), protocol).T
        return Linearisation(
            whole.grid,
            jacobian,
            from_transfer(whole.v0_v, protocol),
            whole.elements,
            whole.electrode_fields,
        )

    def frames(self, key: str, case: PatternCase, noise_v: float) -> tuple[FloatArray, FloatArray]:
        """Untouched frames (q, m) and one a scene (k, m) of a set, with white noise of ``noise_v``
        in 80 samples and no converter."""
        session, scan = self.sessions[key], scan_of(case)
        sigma_v = noise_v * (BASE_SAMPLES / scan.samples) ** 0.5
        untouched = np.tile(
            from_transfer(session.exact_untouched_v, scan.protocol), (Measurement.quiet_frames, 1)
        )
        exact = from_transfer(session.exact_v, scan.protocol)
        role, seed = session.touches.role, session.touches.seed
        untouched_v, _ = measure(untouched, sigma_v, 0.0, 0.0, seed, f"quiet {role}")
        return untouched_v, measure(exact, sigma_v, 0.0, 0.0, seed, f"frame {role}")[0]

    def measured(self, case: PatternCase, noise_v: float) -> dict[str, Any]:
        """A case in plain values: its scan, its model, and the scores of each set."""
        scan = scan_of(case)
        facts = {
            "electrodes": vars(case),
            "noise_v": noise_v,
            "hash": f"{scan.protocol.hash:016x}",
            "samples": scan.samples,
        }
        sets = [drawn.name for drawn in self.sets.values()]
        return dict(
            self.workspace.kept({**facts, "sets": sets}, lambda: self._measure(case, noise_v))
        )

    def _measure(self, case: PatternCase, noise_v: float) -> dict[str, Any]:
        settings = BuildSettings(
            case.rank, case.pixels, elements=MODEL_ELEMENTS, column_power=case.power
        )
        model = make_model(self.skin, scan_of(case).protocol, self.linear(case), settings)
        image_scorer = metrics.judge_for(self.skin.outline, model.grid)
        chosen_on = [(self.sets[key].scenes, *self.frames(key, case, noise_v)) for key in TRAINING]
        scenes = [scene for drawn, _, _ in chosen_on for scene in drawn]
        evaluator, chosen = tuned(
            model,
            image_scorer,
            scenes,
            chosen_on[0][1],
            np.concatenate([frames_v for _, _, frames_v in chosen_on]),
        )
        tested = {key: drawn.scenes for key, drawn in self.sets.items() if key not in TRAINING}
        scores = {
            key: evaluator.scores(scenes, *self.frames(key, case, noise_v), chosen.t)
            for key, scenes in tested.items()
        }
        return {
            "chosen": asdict(chosen),
            "pixels": model.grid.n_pixels,
            "model_bytes": len(encode_model(model)),
            "rms_v0_mv": 1e3 * float(np.sqrt(np.mean(np.square(model.golden.reference_v)))),
            "scores": {
                key: {name: values[name] for name in KEPT} for key, values in scores.items()
            },
        }


def noise_v(workspace: Workspace) -> float:
    """Sigma in V of a row of 80 samples: 60 dB below rms(V0) of the 16-electrode adjacent scan."""

    def make() -> float:
        skin = Skin("disk of 16", disk(PAPER_DIAMETER_MM), Electrodes(16))
        forward = ForwardModel(mesh_for_elements(skin, MODEL_ELEMENTS), skin, adjacent(16))
        return noise_deviation_v(forward.voltages(skin.conductivity_s_per_m), SNR_DB)

    return float(workspace.kept({"electrodes": "noise", "snr_db": SNR_DB}, make))


def resolved_mm(scores: Mapping[str, Any], share: float = 0.9) -> float:
    """The least distance from which on ``share`` of the pairs are counted exactly, in mm; inf if
    even the widest are not."""
    least = float("inf")
    for distance in reversed(PAIR_MM):
        if np.mean(scores[f"pair {distance:g}"]["exact"]) < share:
            break
        least = distance
    return least
