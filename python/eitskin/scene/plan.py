"""The plan of a compiled scene, as text: its steps in order, and the cost of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from eitskin.scene.effect import (
    ContactStep,
    DeformationStep,
    EffectCost,
    GeometryStep,
    MaterialStep,
    PhaseStep,
    Stage,
    Step,
)

if TYPE_CHECKING:
    from eitskin.fem.cem import ForwardModel
    from eitskin.scene.description import Scene
    from eitskin.scene.session import SessionWork


@dataclass(frozen=True)
class PlanStep:
    """One step; ``effect`` tells whether it comes from an effect of the scene or is part of every
    scene."""

    name: str
    stage: Stage
    note: str
    cost: EffectCost
    effect: bool


@dataclass(frozen=True)
class ScenePlan:
    """All steps of a scene in order, and the cost of the whole session.

    ``factorisations`` and ``solves`` cover recorded and untouched frames, and the reference V0 if
    an effect asks for it. ``states`` is the number of distinct states of skin, touches and
    contacts.
    """

    scene: str
    steps: tuple[PlanStep, ...]
    frames: int
    quiet_frames: int
    states: int
    factorisations: int
    solves: int
    vector_passes: float
    random_numbers: float
    is_complex: bool
    method: str

    def as_dict(self) -> dict[str, Any]:
        """Return the plan as JSON values."""
        return {
            "scene": self.scene,
            "steps": [
                {**vars(step), "stage": step.stage.name.lower(), "cost": dict(vars(step.cost))}
                for step in self.steps
            ],
            **{name: value for name, value in vars(self).items() if name not in ("scene", "steps")},
        }

    def text(self) -> str:
        """Return the plan as a table."""
        costs = [cost_text(step.cost) for step in self.steps]
        wide = max(len(cost) for cost in costs)
        lines = [
            (
                f"scene {self.scene}: {self.frames} frames after {self.quiet_frames} untouched"
                f" ones, {self.states} distinct state{'s' if self.states != 1 else ''}"
            ),
            "",
            f"{'':2} {'step':<18} {'stage':<11} {'cost':<{wide}} what",
        ]
        for k, (step, cost) in enumerate(zip(self.steps, costs, strict=True), 1):
            mark = "*" if step.effect else " "
            stage = step.stage.name.lower()
            lines.append(
                f"{k:>2}{mark}{step.name:<18} {stage:<11} {cost:<{wide}} {step.note}".rstrip()
            )
        kind = "complex" if self.is_complex else "real"
        lines += [
            "",
            (
                f"in all: {self.factorisations} factorisations ({kind}, {self.method}),"
                f" {self.solves} solves, {self.vector_passes:.0f} vector passes,"
                f" {self.random_numbers:.0f} random numbers"
            ),
            "* an effect that the scene names; nothing else is imported or computed",
        ]
        return "\n".join(lines)


def cost_text(cost: EffectCost) -> str:
    """Return a cost in words, without entries of 0."""
    parts = [
        (cost.factorisations, "factorisations"),
        (cost.factorisations_per_frame, "factorisations/frame"),
        (cost.solves_per_frame, "solves/frame"),
        (cost.vector_passes_per_frame, "vector passes/frame"),
        (cost.random_numbers, "random"),
        (cost.random_numbers_per_frame, "random/frame"),
    ]
    return ", ".join(f"{value:.3g} {name}" for value, name in parts if value) or "-"


def make_plan(
    scene: Scene,
    model: ForwardModel,
    steps: Sequence[Step],
    states: int,
    known: int,
    method: str,
    reach: int,
    work: SessionWork,
    factorised: bool = False,
    moving: int = 0,
) -> ScenePlan:
    """Return the plan of a compiled scene: the steps of every scene with those of the named effects
    in their places. ``factorised`` tells that the untouched skin is already factorised, for V0;
    ``moving`` is the number of frames during which touches change."""
    own = [PlanStep(step.name, step.stage, step.note, step.cost, True) for step in steps]
    kinds = dict(zip(own, steps, strict=True))
    patterns, total = len(model.patterns.solved), scene.n_frames
    if method == "update":
        factorisations, solves = int(not factorised), patterns + reach
        note = "the untouched skin once, then low-rank updates on"
        note += f" {reach} unknowns that touches reach"
    else:
        factorisations, solves = states - known, (states - known) * patterns
        note = f"a factorisation for each distinct state, {states}"
        note += f", of which V0 is {known}" if known else ""
    solve = EffectCost(
        factorisations_per_frame=factorisations / total,
        solves_per_frame=solves / total,
        vector_passes_per_frame=4 * states / total,
    )
    mesh = model.mesh
    sheet = f"{scene.skin.conductivity_s_per_m:g} S/m, {scene.skin.thickness_mm:g} mm"
    size = f"{mesh.n_elements} elements, {mesh.n_nodes} nodes"
    base = [
        PlanStep("mesh", Stage.GEOMETRY, size, EffectCost(), False),
        PlanStep("sheet", Stage.MATERIAL, sheet, EffectCost(), False),
    ]
    touches = []
    if scene.touches:
        changing = sum(track.moves for track in scene.touches)
        note_touches = f"{len(scene.touches)}, of which {changing} change over time"
        shapes = {track.shape.profile for track in scene.touches if track.shape is not None}
        if shapes:
            note_touches += f"; shapes: {', '.join(sorted(shapes))}"
        cost = EffectCost(vector_passes_per_frame=states / total)
        touches = [PlanStep("touches", Stage.MATERIAL, note_touches, cost, False)]
    read = EffectCost(vector_passes_per_frame=1)
    forward = [PlanStep("solve", Stage.BOUNDARY, f"{patterns} patterns; {note}", solve, False)]
    if moving:
        note = (
            f"{1e3 * scene.scan_s:.3g} ms; touches change in {moving} frames, whose rows are"
            f" interpolated between the {states} states"
        )
        cost = EffectCost(vector_passes_per_frame=4 * moving / total)
        forward.append(PlanStep("scan", Stage.BOUNDARY, note, cost, False))
    rows = f"{scene.protocol.n_rows} voltages"
    forward.append(PlanStep("read", Stage.BOUNDARY, rows, read, False))

    def of(*kind: type) -> list[PlanStep]:
        return [line for line in own if isinstance(kinds[line], kind)]

    lines = [*of(GeometryStep), *base, *of(DeformationStep, MaterialStep), *touches]
    lines += [*of(ContactStep, PhaseStep), *forward]
    lines += [line for line in own if line not in lines]
    every = [line.cost for line in lines]
    return ScenePlan(
        scene=scene.name,
        steps=tuple(lines),
        frames=scene.frames,
        quiet_frames=scene.quiet_frames,
        states=states,
        factorisations=factorisations + work.v0_factorisations,
        solves=solves + work.v0_solves,
        vector_passes=sum(cost.vector_passes_per_frame for cost in every) * total,
        random_numbers=sum(
            cost.random_numbers + cost.random_numbers_per_frame * total for cost in every
        ),
        is_complex=bool(of(PhaseStep)),
        method=method,
    )
