"""Scenes, frames and methods of the experiment; every result through the workspace, a part of some
seconds each."""

from dataclasses import asdict
from functools import cached_property

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.model.build import make_model, scaled_defaults
from eitskin.model.model import Model
from eitskin.progress import silent
from eitskin.scene.random_touches import TouchSet
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin_studies.compare.families import Family, Method, Setup, setup_for
from eitskin_studies.compare.methods import baseline_methods
from eitskin_studies.experiments.experiment import MODEL_ELEMENTS, Workspace
from eitskin_studies.experiments.multitouch.cells import Cell, draw, mixed_cells
from eitskin_studies.experiments.multitouch.variants import (
    SeenFrame,
    TouchVariant,
    TrainedMethod,
    differences_v,
    read_images,
    solve,
    train,
)
from eitskin_studies.harness.sessions import FrameSession

SNRS_DB, HEADLINE_DB = (40.0, 60.0, 80.0), 60.0
# of the two signs of FISTA this one counts better on tuning scenes
CLASSICAL = ("Gauss-Newton (Tikhonov)", "NOSER", "plain FISTA 300, non-negative")
CLASSICAL_SCENES = 24
TRAINING_PARTS = 2


class TouchData:
    """One workspace's scenes and methods. Models and meshes are made when a result is not kept yet,
    not before."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace, self.skin = workspace, paper_skin()
        self.protocol = adjacent(self.skin.electrodes.count)
        self._scenes = workspace.scenes(self.skin, self.protocol)
        self._drawn: dict[tuple[str, bool], TouchSet] = {}
        self._sessions: dict[tuple[str, bool], FrameSession] = {}
        self._models: dict[str, Model] = {}
        self._methods: dict[str, Method] = {}

    @cached_property
    def setup(self) -> Setup:
        """Jacobian and grid that all methods share."""
        return setup_for(self.skin, self.protocol, elements=MODEL_ELEMENTS)

    def model(self, variant: TouchVariant) -> Model:
        """The variant's."""
        if variant.name not in self._models:
            s = self.setup
            self._models[variant.name] = make_model(
                self.skin, self.protocol, s.linearisation, variant.settings
            )
        return self._models[variant.name]

    def seed_radius_mm(self, variant: TouchVariant) -> float:
        """Return the radius of a touch about which nothing is known."""
        usual = scaled_defaults(self.skin, variant.settings.data_kind).touch_seed_radius_mm
        return float(variant.options.get("touch_seed_radius_mm", usual))

    def scenes(self, cell: Cell, tuning: bool = False) -> TouchSet:
        """Return the touches; raises GeometryError if they do not fit."""
        if (cell.name, tuning) not in self._drawn:
            settings = self.workspace.settings
            seed = settings.tuning_seed if tuning else settings.seed
            self._drawn[cell.name, tuning] = draw(
                cell, self.skin.outline, seed, settings.count(cell.usual, 3)
            )
        return self._drawn[cell.name, tuning]

    def session(self, cell: Cell, tuning: bool = False) -> FrameSession:
        """Solved without noise."""
        if (cell.name, tuning) not in self._sessions:
            name = f"{cell.name}{' tuning' if tuning else ''}"
            self._sessions[cell.name, tuning] = self._scenes.session(
                self.scenes(cell, tuning), silent, name
            )
        return self._sessions[cell.name, tuning]

    def truths_mm(self, cell: Cell, tuning: bool = False) -> list[FloatArray]:
        """Each scene's true centres (k, 2)."""
        return [scene.centres_mm() for scene in self.scenes(cell, tuning).scenes]

    def facts(self, what: str, cell: Cell, snr_db: float, tuning: bool) -> dict[str, object]:
        """Return the facts by which a part is kept."""
        return {"part": what, "set": self.scenes(cell, tuning).name, "snr_db": snr_db}

    def seen(
        self, cell: Cell, variant: TouchVariant, snr_db: float, tuning: bool = False
    ) -> list[SeenFrame]:
        """Return the core's result for each scene."""

        def make() -> list[dict[str, object]]:
            return [
                asdict(one)
                for one in solve(
                    self.model(variant), variant, self.session(cell, tuning).measured(snr_db)
                )
            ]

        facts = {**self.facts("core", cell, snr_db, tuning), **variant.facts()}
        return [SeenFrame(**values) for values in self.workspace.kept(facts, make)]

    @cached_property
    def _families(self) -> dict[str, Family]:
        return {
            one.make(one.values[0]).name: one
            for one in baseline_methods(self.setup.jacobian, self.setup.grid)
        }

    def method(self, name: str) -> Method:
        """A trained classical method."""
        if name not in self._methods:
            self._methods[name] = self._families[name].make(self.trained(name).value)
        return self._methods[name]

    def trained(self, name: str) -> TrainedMethod:
        """On mixed tuning scenes at 60 dB."""

        def make() -> dict[str, float]:
            parts = mixed_cells()[:TRAINING_PARTS]
            frames = np.concatenate(
                [differences_v(self.session(part, True).measured(HEADLINE_DB)) for part in parts]
            )
            truths = [truth for part in parts for truth in self.truths_mm(part, True)]
            grid = self.setup.grid
            return asdict(
                train(self._families[name], frames, truths, grid.index, grid.centres_mm())
            )

        facts = {
            "part": "training",
            "method": name,
            "scenes": self.workspace.settings.count(mixed_cells()[0].usual, 3),
        }
        return TrainedMethod(**self.workspace.kept(facts, make))

    def classical(self, cell: Cell, name: str) -> list[FloatArray]:
        """Places that a classical method's images show at 60 dB, of the first scenes."""
        trained = self.trained(name)

        def make() -> list[list[list[float]]]:
            frames, grid = (
                differences_v(self.session(cell).measured(HEADLINE_DB))[:CLASSICAL_SCENES],
                self.setup.grid,
            )
            found = read_images(
                self.method(name), frames, trained.threshold, grid.index, grid.centres_mm()
            )
            return [places.round(3).tolist() for places in found]

        facts = {
            **self.facts("classical", cell, HEADLINE_DB, False),
            "method": name,
            **asdict(trained),
        }
        kept = self.workspace.kept(facts, make)
        return [np.array(places, dtype=np.float64).reshape(-1, 2) for places in kept]
