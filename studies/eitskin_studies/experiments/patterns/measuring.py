"""Compute the bound and measure the product's touches, by pattern and by noise."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.fem.cem import ForwardModel
from eitskin.fem.fields import electrode_fields
from eitskin.fem.grid import grid_for
from eitskin.fem.mesh import mesh_for_elements
from eitskin.fem.sensitivity import sensitivity
from eitskin.frames.front_end import FrontEnd, demand_of, suitable
from eitskin.frames.homogeneous_fem import transfer_by_elements
from eitskin.model.build import BuildSettings, Linearisation, make_model
from eitskin.model.model import Model
from eitskin.oracle.round_skin import RoundSkin
from eitskin.scene.random_touches import TouchSet, random_touches
from eitskin.scene.simulate import Measurement
from eitskin.scene.streams import stream
from eitskin.scoring import metrics
from eitskin.skin.protocol import Protocol, independent_rows, pattern
from eitskin.skin.skin import Skin, paper_skin
from eitskin_studies.benchmarks.limit_bound import bounds_of, touch_slopes_v
from eitskin_studies.experiments.electrodes.patterns import from_transfer, transfer
from eitskin_studies.experiments.electrodes.tuning import tuned
from eitskin_studies.experiments.experiment import MODEL_ELEMENTS, Workspace
from eitskin_studies.experiments.patterns.noise import HEADROOM, NOISES, Rows, row_gain, rows_of
from eitskin_studies.experiments.scored import session_in_parts
from eitskin_studies.harness.sessions import FrameSession

ELECTRODES = 16
PATTERNS = (
    "adjacent", "skip-1", "skip-2", "skip-3", "skip-4", "skip-3/adjacent", "opposite"
)  # fmt: skip
BOUND, TUNING, TESTED = 100, 48, 100  # scenes
SNR_DB = 60.0
KEPT = ("image", "exact", "error_mm")


@dataclass(frozen=True)
class Scan:
    """A pattern's facts: its rows and how many are independent, rms and greatest |V0| in V at 1 mA,
    and the front end that suits it with one gain."""

    pattern: str
    rows: int
    independent: int
    rms_v: float
    greatest_v: float
    source_v: float
    front_end: FrontEnd


@dataclass(eq=False)
class PatternNoise:
    """The paper's disk, scanned by every pattern; scenes are solved once for all of them."""

    workspace: Workspace

    @cached_property
    def protocols(self) -> dict[str, Protocol]:
        """The patterns by name."""
        named = {name: name.partition("/")[::2] for name in PATTERNS}
        return {name: pattern(ELECTRODES, one, two or None) for name, (one, two) in named.items()}

    @cached_property
    def rows(self) -> dict[str, Rows]:
        """Each pattern's untouched rows, of the exact model."""
        untouched_v, by_elements = self._exact.voltages([]), transfer_by_elements(self._skin)
        return {
            name: rows_of(
                protocol,
                from_transfer(untouched_v, protocol),
                demand_of(by_elements, protocol),
            )
            for name, protocol in self.protocols.items()
        }

    @cached_property
    def sigma_v(self) -> float:
        """60 dB below rms(V0) of the adjacent pattern, in V at 1 mA."""
        return float(10 ** (-SNR_DB / 20) * np.sqrt(np.mean(self.rows["adjacent"].v0_v ** 2)))

    def noise_v(self, name: str, noise: str) -> FloatArray:
        """Sigma (m,) of a pattern's rows in V at 1 mA."""
        return NOISES[noise](self.rows[name], self.rows["adjacent"], self.sigma_v)

    def scan(self, name: str) -> Scan:
        """The facts of a pattern."""
        size, demand = np.abs(self.rows[name].v0_v), self.rows[name].demand
        return Scan(
            name,
            len(size),
            independent_rows(self.protocols[name]),
            float(np.sqrt(np.mean(size**2))),
            float(size.max()),
            demand.at_source_v(FrontEnd()),
            suitable(demand),
        )

    def bounds_mm(self) -> Mapping[str, Mapping[str, list[float]]]:
        """By noise and pattern, the bound of each touch of the reported scenes."""
        drawn = self._drawn("bound", BOUND)

        def make() -> dict[str, dict[str, list[float]]]:
            found: dict[str, dict[str, list[float]]] = {
                noise: {name: [] for name in PATTERNS} for noise in NOISES
            }
            for scene in self.workspace.progress(drawn.scenes, "bounds"):
                slopes = touch_slopes_v(self._exact, scene.touches)
                for name, protocol in self.protocols.items():
                    rows = from_transfer(slopes, protocol)
                    for noise in NOISES:
                        sigma_v = self.noise_v(name, noise)
                        found[noise][name] += [
                            one.median_mm for one in bounds_of(rows / sigma_v, scene.touches)
                        ]
            return found

        facts = {
            "patterns": "bounds of rows by log radius",
            "scenes": len(drawn.scenes),
            "noises": list(NOISES),
        }
        kept: Mapping[str, Mapping[str, list[float]]] = self.workspace.kept(facts, make)
        return kept

    def found(self, name: str, noise: str) -> Mapping[str, Any]:
        """Return what the product finds with a pattern at a noise: settings, scores of each scene,
        and the part of the rows that touches drive out of range with a gain for each row."""
        sigma_v = self.noise_v(name, noise)
        facts = {
            "patterns": "found",
            "pattern": name,
            "sigma_v": [float(f"{value:.6g}") for value in sigma_v],
            "scenes": [len(self.sessions[role].touches.scenes) for role in self.sessions],
        }
        kept: Mapping[str, Any] = self.workspace.kept(facts, lambda: self._find(name, sigma_v))
        return kept

    @cached_property
    def sessions(self) -> dict[str, FrameSession]:
        """The transfer matrices of the scenes for choosing settings, and of the reported ones."""
        solver = self.workspace.scenes(self._skin, transfer(ELECTRODES))
        sets = {"train": self._drawn("train", TUNING), "test": self._drawn("test", TESTED)}
        return {
            role: session_in_parts(solver, drawn, self.workspace.progress, f"patterns {role}")
            for role, drawn in sets.items()
        }

    def beyond_range(self, name: str) -> float:
        """The part of all touched rows that leaves the range of a gain for each row."""
        exact_v = from_transfer(self.sessions["test"].exact_v, self.protocols[name])
        rows = self.rows[name]
        range_v = HEADROOM * np.abs(rows.v0_v).max() / row_gain(rows)
        return float(np.mean(np.abs(exact_v) > range_v))

    def _find(self, name: str, sigma_v: FloatArray) -> dict[str, Any]:
        model = self._model(name)
        scorer = metrics.judge_for(self._skin.outline, model.grid)
        train, test = self.sessions["train"].touches.scenes, self.sessions["test"].touches.scenes
        evaluator, chosen = tuned(model, scorer, train, *self._frames("train", name, sigma_v))
        scores = evaluator.scores(test, *self._frames("test", name, sigma_v), chosen.t)
        return {"chosen": asdict(chosen), "scores": {key: scores[key] for key in KEPT}}

    def _frames(self, role: str, name: str, sigma_v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Untouched frames (q, m) and one frame per scene (k, m); no converter steps."""
        session, protocol = self.sessions[role], self.protocols[name]
        untouched = from_transfer(session.exact_untouched_v, protocol)
        parts = {
            "quiet": np.tile(untouched, (Measurement.quiet_frames, 1)),
            "frame": from_transfer(session.exact_v, protocol),
        }
        seed = session.touches.seed
        noisy = [
            exact_v + sigma_v * np.array([
                stream(seed, f"noise {kind} {role}", k).standard_normal(exact_v.shape[1])
                for k in range(len(exact_v))
            ])
            for kind, exact_v in parts.items()
        ]  # fmt: skip
        return noisy[0], noisy[1]

    def _model(self, name: str) -> Model:
        protocol, whole = self.protocols[name], self._linear
        linear = Linearisation(
            whole.grid,
            from_transfer(np.ascontiguousarray(whole.jacobian.T), protocol).T,
            from_transfer(whole.v0_v, protocol),
            whole.elements,
            whole.electrode_fields,
        )
        return make_model(self._skin, protocol, linear, BuildSettings(elements=MODEL_ELEMENTS))

    def _drawn(self, role: str, usual: int) -> TouchSet:
        settings = self.workspace.settings
        seed = settings.tuning_seed if role == "train" else settings.seed
        return random_touches(self._skin.outline, seed, settings.count(usual), role)

    @cached_property
    def _skin(self) -> Skin:
        return paper_skin()

    @cached_property
    def _exact(self) -> RoundSkin:
        return RoundSkin(self._skin, transfer(ELECTRODES))

    @cached_property
    def _linear(self) -> Linearisation:
        skin, grid = self._skin, grid_for(self._skin.outline, 32)
        forward = ForwardModel(mesh_for_elements(skin, MODEL_ELEMENTS), skin, transfer(ELECTRODES))
        jacobian, v0_v = sensitivity(forward, skin.conductivity_s_per_m, grid)
        fields = electrode_fields(forward, skin.conductivity_s_per_m, grid)
        return Linearisation(grid, jacobian, v0_v, forward.mesh.n_elements, fields)
