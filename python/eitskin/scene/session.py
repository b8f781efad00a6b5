"""The session of a scene: its named effects imported and made, and the meshes and models that
scenes share."""

from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.errors import ConfigError, EitskinError
from eitskin.fem.cem import ForwardModel
from eitskin.fem.mesh import Mesh, mesh_for_elements
from eitskin.scene.cover import Cover
from eitskin.scene.description import Scene
from eitskin.scene.effect import EffectModule, EffectSession, GeometryStep, Stage, Step
from eitskin.scene.registry import Registry
from eitskin.scene.streams import stream
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin


class MeshCache:
    """Meshes, models and untouched skins that are kept for further scenes with the same skin and
    the same protocol object (dataset mode)."""

    def __init__(self) -> None:
        self._meshes: dict[tuple[Skin, int], Mesh] = {}
        self._models: dict[tuple[Skin, int, Protocol, bytes], ForwardModel] = {}
        self._covers: dict[tuple[Skin, int], Cover] = {}
        self._untouched: dict[tuple[Skin, int, Protocol], FloatArray] = {}

    def mesh(self, skin: Skin, elements: int) -> Mesh:
        """Return the mesh of ``skin`` with about ``elements`` elements."""
        key = (skin, elements)
        if key not in self._meshes:
            self._meshes[key] = mesh_for_elements(skin, elements)
        return self._meshes[key]

    def model(
        self, skin: Skin, protocol: Protocol, elements: int, contacts: FloatArray
    ) -> ForwardModel:
        """Return a copy of a forward model of ``skin`` whose matrix has the sparsity pattern for
        ``contacts`` (L,), which depends on which are 0."""
        key = (skin, elements, protocol, (contacts == 0).tobytes())
        if key not in self._models:
            self._models[key] = ForwardModel(self.mesh(skin, elements), skin, protocol, contacts)
        return copy(self._models[key])

    def cover(self, skin: Skin, elements: int) -> Cover:
        """Return the cover, which finds the elements under touches."""
        key = (skin, elements)
        if key not in self._covers:
            self._covers[key] = Cover(self.mesh(skin, elements))
        return self._covers[key]

    def known(self, scene: Scene) -> FloatArray | None:
        """Return the electrodes' potentials (L, P) of ``scene``'s untouched skin if they were
        calculated before, or None."""
        return self._untouched.get((scene.skin, scene.elements, scene.protocol))

    def v0_v(self, scene: Scene, work: "SessionWork") -> FloatArray:
        """Return the reference frame (m,) of ``scene``'s skin without any effect; the first call
        factorises."""
        model = self.model(
            scene.skin, scene.protocol, scene.elements, np.zeros(scene.skin.electrodes.count)
        )
        electrodes = self.known(scene)
        if electrodes is None:
            solution = model.solve(scene.skin.conductivity_s_per_m, 0.0)
            electrodes, work.v0_factors = solution.electrodes, solution.factors
            self._untouched[scene.skin, scene.elements, scene.protocol] = electrodes
            work.v0_factorisations += 1
            work.v0_solves += electrodes.shape[1]
        return model.patterns.voltages(electrodes) * scene.protocol.current_a


@dataclass
class SessionWork:
    """The cost of making a session apart from its forward solves: the reference V0, and random
    generators. ``v0_factors`` are those of the untouched skin's matrix, if they were made."""

    v0_factorisations: int = 0
    v0_solves: int = 0
    v0_factors: Any = None
    generators: int = 0


def load_effects(scene: Scene, registry: Registry) -> dict[str, EffectModule]:
    """Return the modules of the named effects in the order in which they will run."""
    modules = {name: registry.load(name, scene.where) for name in scene.effects}
    for name, module in modules.items():
        for other in getattr(module, "CONFLICTS", ()):
            if other in modules:
                raise ConfigError(
                    f"{scene.where} [effects.{name}]: it contradicts [effects.{other}]; keep one of"
                    " them"
                )
    return dict(sorted(modules.items(), key=lambda item: (item[1].STAGE, item[1].ORDER, item[0])))


def check_shared(
    scene: Scene, modules: dict[str, EffectModule], parameters: dict[str, Any]
) -> None:
    """Raise a ConfigError if effects state different values for something that they share, such as
    the excitation frequency."""
    stated: dict[str, tuple[str, Any]] = {}
    for name, module in modules.items():
        for key, meaning in getattr(module, "SHARED", {}).items():
            value = getattr(parameters[name], key)
            other, before = stated.setdefault(meaning, (f"[effects.{name}] {key}", value))
            if before != value:
                raise ConfigError(
                    f"{scene.where} [effects.{name}]: {key} = {value!r} contradicts {other} ="
                    f" {before!r}; both are the {meaning}, so make them equal"
                )


def make_steps(
    scene: Scene,
    modules: dict[str, EffectModule],
    parameters: dict[str, Any],
    mesh_cache: MeshCache,
    work: SessionWork,
) -> tuple[tuple[Step, ...], Skin]:
    """Return the step of every named effect, geometry first, and the true skin."""
    skin, in_geometry = scene.skin, True

    def build_mesh() -> Mesh:
        if in_geometry:
            raise ConfigError(
                "a geometry effect runs before the mesh is made and cannot ask for it; repair the"
                " effect"
            )
        return mesh_cache.mesh(skin, scene.elements)

    def make_stream(name: str, index: int) -> np.random.Generator:
        work.generators += 1
        return stream(scene.seed, name, index)

    session = EffectSession(
        skin=scene.skin,
        protocol=scene.protocol,
        n_frames=scene.n_frames,
        quiet_frames=scene.quiet_frames,
        rate_hz=scene.rate_hz,
        seed=scene.seed,
        build_mesh=build_mesh,
        solve_v0=lambda: mesh_cache.v0_v(scene, work),
        make_stream=make_stream,
        folder=scene.folder,
    )
    steps: list[Step] = []
    for name, module in modules.items():
        in_geometry = module.STAGE is Stage.GEOMETRY
        try:
            step = module.make(parameters[name], session)
            if isinstance(step, GeometryStep):
                skin = step.apply(skin)
        except EitskinError as error:
            raise type(error)(f"{scene.where} [effects.{name}]: {error}") from None
        if step.stage is not module.STAGE or step.name != name:
            raise ConfigError(
                f"{scene.where} [effects.{name}]: its step has another name or stage; repair the"
                " effect"
            )
        steps.append(step)
    return tuple(steps), skin
