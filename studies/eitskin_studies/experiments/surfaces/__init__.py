"""Touches on curved surfaces: shapes that unroll and shapes that do not, and a forearm that
flexes."""

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.diagnostics_table import Touch
from eitskin.errors import EitskinError, FrameError
from eitskin.model.build import BuildSettings, build_model
from eitskin.model.eitm import load_model, save_model
from eitskin.scene.simulate import Measurement, measure
from eitskin.scene.streams import stream
from eitskin.scoring.matching import match
from eitskin.skin.protocol import adjacent, pattern
from eitskin.skin.skin import Skin
from eitskin.solve.reconstructor import Reconstructor
from eitskin.surface.outline import surface_map
from eitskin.surface.shapes import disk_net, flexed_forearm
from eitskin.surface.surface_map import SurfaceMap
from eitskin_studies.experiments.electrodes.patterns import from_transfer, transfer
from eitskin_studies.experiments.experiment import ExperimentOutcome, Table, Workspace
from eitskin_studies.experiments.multitouch.counts import share
from eitskin_studies.experiments.surfaces.scenes import (
    ELECTRODES,
    MODEL_TRIANGLES,
    SCENE_TRIANGLES,
    SolvedSurface,
    SpaceTouch,
    bounds_mm,
    draw_touches,
    flat_map,
    on_copy,
    same_on,
    shape_map,
    size_of,
    skin_on,
    slopes_v,
    solved,
)
from eitskin_studies.harness.sessions import converter_for
from eitskin_studies.harness.snr import noise_deviation_v

TITLE = "Touches on curved surfaces, and on a forearm that flexes"
USUAL, SNR_DB, SAMPLES = 20, 60.0, 200
CURVED = ("hemisphere", "saddle", "fingertip", "forearm")
UNROLLED = ("cylinder", "cone")
MANY, COMPARED, DRIVES = 60, ("flat disk", "forearm"), ("adjacent", "opposite")
GATE_MM = 10.0  # of a skin of 194 mm
BULGES_MM = (6.0, 9.0, 12.0)
CAPS_DEG = (60, 90, 120, 150, 165)
PROTOCOL = adjacent(ELECTRODES)


def run(workspace: Workspace) -> ExperimentOutcome:
    """Run the whole study; results that the workspace has kept are not computed again."""
    steps: list[tuple[str, Any]] = [("flat disk", partial(_surface, workspace, "flat disk"))]
    steps += [(name, partial(_unrolled, workspace, name)) for name in UNROLLED]
    steps += [(name, partial(_surface, workspace, name)) for name in CURVED]
    steps += [("flexed", partial(_flexed, workspace))]
    steps += [(f"many {name}", partial(_many, workspace, name)) for name in COMPARED]
    settings = workspace.settings
    scores: dict[str, Any] = {}
    for name, step in workspace.progress(steps, "surfaces"):
        scenes = settings.count(MANY if name.startswith("many ") else USUAL)
        facts = {"part": name, "scenes": scenes, "samples": SAMPLES}
        scores[name] = workspace.kept(facts, step)
    flexed = scores.pop("flexed")
    many = {name: scores.pop(f"many {name}") for name in COMPARED}
    caps = [_cap(angle) for angle in CAPS_DEG]
    count, many_count, seed = settings.count(USUAL), settings.count(MANY), settings.seed
    words = (
        f"{count} scenes of 1 to 3 discs per surface, and {many_count} where more are compared,"
        f" seed {seed}, {SNR_DB:g} dB, 12 bits, contacts spread by 20 %, {ELECTRODES} electrodes"
        " along the rim. Radii of 6 to 12 mm, gaps and electrodes are those of the flat skin of 194"
        f" mm, scaled to the surface's size. Models are built from {MODEL_TRIANGLES} triangles with"
        f" {SAMPLES} random skins; frames come from another triangulation of about"
        f" {SCENE_TRIANGLES} triangles, flattened by itself."
    )
    return ExperimentOutcome(
        (
            _table(scores),
            _zones(scores["hemisphere"]),
            _many_table(many),
            _caps(caps),
            _flex_table(flexed),
        ),
        {"scores": scores, "many": many, "flexed": flexed, "caps": caps},
        {},
        {"sets": words},
    )


def _model(workspace: Workspace, skin: Skin) -> Reconstructor:
    path = workspace.folder / f"{skin.name.replace(' ', '-')}.eitm"
    if not path.is_file():
        workspace.folder.mkdir(parents=True, exist_ok=True)
        save_model(path, build_model(skin, PROTOCOL, BuildSettings(samples=SAMPLES)))
    model, blob = load_model(path)
    return Reconstructor(model, blob=blob)


def _contacts(workspace: Workspace, skin: Skin) -> FloatArray:
    spread = stream(workspace.settings.seed, "contact surfaces").uniform(-1, 1, ELECTRODES)
    impedance = skin.electrodes.contact_impedance_ohm_m2
    return np.asarray(impedance * (1 + Measurement.contact_spread * spread))


def _converter(tare_v: FloatArray) -> tuple[float, float]:
    """The step and the span of the converter in V."""
    how = converter_for(SNR_DB)
    span_v = how.adc_headroom * float(np.abs(tare_v).max())
    return 2 * span_v / 2 ** (how.adc_bits or 12), span_v


def _sigma_v(tare_v: FloatArray) -> float:
    """The deviation of noise and converter in V."""
    return float(np.hypot(noise_deviation_v(tare_v, SNR_DB), _converter(tare_v)[0] / 12**0.5))


def _found(
    finder: Reconstructor, volts: dict[str, FloatArray], tare_v: FloatArray, seed: int
) -> list[tuple[Touch, ...]]:
    """The touches of each frame, measured with noise and converter."""
    lsb_v, span_v = _converter(tare_v)
    converter = (noise_deviation_v(tare_v, SNR_DB), lsb_v, span_v, seed)
    finder.set_options(noise_floor_v=lsb_v / 12**0.5)
    finder.tare(measure(np.tile(tare_v, (64, 1)), *converter, "quiet surfaces")[0])
    touches: list[tuple[Touch, ...]] = []
    for frame in measure(volts["frames"], *converter, "frame surfaces")[0]:
        finder.forget()
        try:
            touches.append(tuple(finder.reconstruct(frame).touches))
        except FrameError:
            touches.append(())
    return touches


def _scored(
    drawn: list[list[SpaceTouch]],
    found: list[tuple[Touch, ...]],
    surface: SurfaceMap,
    placed: SurfaceMap | None = None,
) -> dict[str, Any]:
    """Exact scenes and errors in space; touches are put on ``placed``, which is ``surface`` unless
    it is given."""
    size, on = size_of(surface), surface if placed is None else placed
    exact, far, radii, scales, ratios = 0, [], [], [], []
    for scene, touches in zip(drawn, found, strict=True):
        seen = [on.touch(one) for one in touches]
        true = np.array([one.point_mm for one in scene])
        points = np.array([1e3 * one.point_m for one in seen]).reshape(-1, 3)
        one = match(true, points, GATE_MM * size)
        exact += one.exact
        far += list(one.distances_mm)
        for a, b in one.pairs:
            radii.append(1e3 * seen[b].radius_m / scene[a].radius_mm)
            scales.append(seen[b].scale)
            covariance = seen[b].covariance_m2
            if covariance is not None:
                t = seen[b].tangents
                off = t.T @ (true[a] - points[b]) * 1e-3
                ratios.append(float(off @ np.linalg.solve(t.T @ covariance @ t, off)))
    return {
        "size": size,
        "scale": list(surface.scale_range),
        "exact": exact,
        "scenes": len(drawn),
        "median_mm": float(np.median(far)) if far else None,
        "p95_mm": float(np.quantile(far, 0.95)) if far else None,
        "radius": float(np.median(radii)) if radii else None,
        "within_90": float(np.mean(np.array(ratios) <= 4.605)) if ratios else None,
        "far_mm": [float(x) for x in far],
        "scales": [float(x) for x in scales],
    }


@dataclass(frozen=True, eq=False)
class Skins:
    """A skin and its surface, as the model has them and as they really are, with another
    triangulation."""

    skin: Skin
    surface: SurfaceMap
    true_skin: Skin
    fine: SurfaceMap


def _skins(name: str) -> Skins:
    """The skin on the surface ``name``, or on the flat disk, which is the same for both."""
    if name == "flat disk":
        surface = shape_map("cylinder", MODEL_TRIANGLES)
        skin, plane = _unwrapped(name, skin_on("cylinder", surface)), flat_map(surface)
        return Skins(skin, plane, skin, plane)
    surface, fine = shape_map(name, MODEL_TRIANGLES), shape_map(name, SCENE_TRIANGLES)
    skin = skin_on(name, surface)
    return Skins(skin, surface, same_on(name, fine, skin), fine)


def _unwrapped(name: str, skin: Skin) -> Skin:
    """The flattened copy of ``skin`` as a flat skin."""
    return replace(skin, name=name, surface=None)


def _surface(workspace: Workspace, name: str) -> dict[str, Any]:
    """Surfaces that unroll have the bound of the flat disk."""
    count = workspace.settings.count(USUAL)
    return _judged(workspace, _skins(name), count, bounded=name not in UNROLLED)


def _drawn(workspace: Workspace, skins: Skins, count: int) -> list[list[SpaceTouch]]:
    return draw_touches(skins.fine, workspace.settings.seed, "surfaces", count)


def _judged(workspace: Workspace, skins: Skins, count: int, bounded: bool) -> dict[str, Any]:
    drawn, fine = _drawn(workspace, skins, count), skins.fine
    scenes = [on_copy(fine, one) for one in drawn]
    model = SolvedSurface(skins.true_skin, PROTOCOL, _contacts(workspace, skins.skin))
    quiet, frames = model.voltages(()), np.array([model.voltages(one) for one in scenes])
    found = _found(
        _model(workspace, skins.skin),
        {"quiet": quiet, "frames": frames},
        quiet,
        workspace.settings.seed,
    )
    score = _scored(drawn, found, skins.surface)
    if not bounded:
        return score
    places = [(one.x_mm, one.y_mm) for scene in scenes for one in scene]
    return score | {
        "bound_mm": bounds_mm(slopes_v(model, fine, scenes), fine, scenes, _sigma_v(quiet)),
        "true_scales": fine.at(places).scale.tolist(),
    }


def _many(workspace: Workspace, name: str) -> dict[str, Any]:
    """More scenes, because medians over few touches are uncertain, and the bounds with other
    drives. The voltages of all drives are combinations of those of neighbours."""
    skins, count = _skins(name), workspace.settings.count(MANY)
    score = _judged(workspace, skins, count, bounded=False)
    scenes = [on_copy(skins.fine, one) for one in _drawn(workspace, skins, count)]
    model = SolvedSurface(
        skins.true_skin, transfer(ELECTRODES), _contacts(workspace, skins.true_skin)
    )
    quiet, slopes = model.voltages(()), slopes_v(model, skins.fine, scenes)
    bounds = {}
    for drive in DRIVES:
        protocol = pattern(ELECTRODES, drive)
        rows = [np.asarray(from_transfer(one, protocol)) for one in slopes]
        sigma_v = _sigma_v(np.asarray(from_transfer(quiet, protocol)))
        bounds[drive] = bounds_mm(rows, skins.fine, scenes, sigma_v)
    return score | {"bounds_mm": bounds}


def _unrolled(workspace: Workspace, name: str) -> dict[str, Any]:
    """The same touches on the flat copy and wrapped: places and counts are compared one by one.
    Both have the same outline and electrodes, so their meshes differ by the wrapping alone."""
    settings, score = workspace.settings, _surface(workspace, name)
    skins = _skins(name)
    skin, true_skin, fine = skins.skin, skins.true_skin, skins.fine
    flat_name = "flat disk" if name == "cylinder" else f"flat {name}"
    drawn = draw_touches(flat_map(fine), settings.seed, "unrolled", settings.count(USUAL))
    scenes = [on_copy(flat_map(fine), one) for one in drawn]
    contacts = _contacts(workspace, skin)
    both = []
    for wrapped in (True, False):
        own, true = (one if wrapped else _unwrapped(flat_name, one) for one in (skin, true_skin))
        volts = solved(true, PROTOCOL, contacts, scenes)
        finder = _model(workspace, own)
        both.append((volts, _found(finder, volts, volts["quiet"], settings.seed)))
    (curved_v, curved), (flat_v, flat) = both
    moved = [
        distance
        for one, other in zip(curved, flat, strict=True)
        for distance in match(
            [(t.x_mm, t.y_mm) for t in other], [(t.x_mm, t.y_mm) for t in one], GATE_MM
        ).distances_mm
    ]
    change = [np.linalg.norm(curved_v[k] - flat_v[k]) / np.linalg.norm(flat_v[k])
              for k in ("quiet", "frames")]  # fmt: skip
    return score | {
        "same_count": sum(len(a) == len(b) for a, b in zip(curved, flat, strict=True)),
        "moved_median_mm": float(np.median(moved)),
        "moved_p95_mm": float(np.quantile(moved, 0.95)),
        "volts_change": [float(x) for x in change],
    }


def _flexed(workspace: Workspace) -> list[dict[str, Any]]:
    """The forearm's muscle bulges; the skin on it stretches, and keeps its volume."""
    settings = workspace.settings
    rest = shape_map("forearm", MODEL_TRIANGLES)
    fine = shape_map("forearm", SCENE_TRIANGLES)
    skin = skin_on("forearm", rest)
    true_skin, contacts = same_on("forearm", fine, skin), _contacts(workspace, skin)
    finder = _model(workspace, skin)
    rest_v, scores = solved(true_skin, PROTOCOL, contacts, [])["quiet"], []
    for bulge in BULGES_MM:
        posed = replace(fine, points_mm=flexed_forearm(SCENE_TRIANGLES, bulge)[0])
        coarse = replace(rest, points_mm=flexed_forearm(MODEL_TRIANGLES, bulge)[0])
        drawn = draw_touches(posed, settings.seed, "surfaces", settings.count(USUAL))
        scenes = [on_copy(posed, one) for one in drawn]
        volts = solved(replace(true_skin, surface=posed), PROTOCOL, contacts, scenes, fine)
        area = posed.area_mm2 / fine.area_mm2
        changed = float(np.linalg.norm(volts["quiet"] - rest_v) / np.linalg.norm(rest_v))
        for tare, quiet in (("at rest", rest_v), ("in the pose", volts["quiet"])):
            found = _found(finder, volts, quiet, settings.seed)
            for pose, placed in (("unknown", rest), ("known", coarse)):
                score = _scored(drawn, found, rest, placed)
                about = {"bulge_mm": bulge, "model": "rest", "tare": tare, "pose": pose}
                scores.append({**about, "area": area, "changed": changed, **score})
        if bulge == BULGES_MM[-1]:
            own = surface_map(*flexed_forearm(MODEL_TRIANGLES, bulge))
            best = _model(workspace, skin_on("flexed forearm", own))
            found = _found(best, volts, volts["quiet"], settings.seed)
            about = {"bulge_mm": bulge, "model": "of the pose", "tare": "in the pose"}
            score = _scored(drawn, found, own)
            scores.append({**about, "pose": "known", "area": area, "changed": changed, **score})
    return scores


def _cap(angle_deg: float) -> dict[str, Any]:
    """The flattened copy of a ball's cap up to this angle from its pole."""
    flat, faces = disk_net(MODEL_TRIANGLES)
    polar, turn = np.hypot(*flat.T) * np.radians(angle_deg), np.arctan2(flat[:, 1], flat[:, 0])
    points = 60 * np.column_stack(
        [np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)]
    )
    try:
        return {"angle_deg": angle_deg, "scale": surface_map(points, faces).scale_range[1]}
    except EitskinError as error:
        return {"angle_deg": angle_deg, "scale": None, "why": str(error)}


def _percent(score: dict[str, Any]) -> str:
    exact = share(score["exact"], score["scenes"])
    return f"{100 * exact.mean:.0f} % ({100 * exact.low:.0f} to {100 * exact.high:.0f})"


def _mm(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def _table(scores: dict[str, Any]) -> Table:
    flat = scores["flat disk"]
    flat_bound = float(np.median(flat["bound_mm"]))
    rows = []
    for name, one in scores.items():
        low, high = one["scale"]
        per_size = one["median_mm"] / one["size"] / flat["median_mm"]
        bound = float(np.median(one.get("bound_mm", np.nan)))
        rows.append(
            (
                name, f"{194 * one['size']:.0f}", f"{low:.2f} to {high:.2f}", _percent(one),
                _mm(one["median_mm"]), _mm(one["p95_mm"]), f"{per_size:.2f}",
                *((f"{bound:.2f}", f"{bound / one['size'] / flat_bound:.2f}")
                  if "bound_mm" in one else ("", "")),
                f"{100 * one['within_90']:.0f} %" if one["within_90"] is not None else "-",
                f"{one['same_count']} of {one['scenes']}, {one['moved_median_mm']:.3f}"
                f" ({one['moved_p95_mm']:.3f}) mm" if "same_count" in one else "",
            )
        )  # fmt: skip
    head = ("surface", "size, mm", "scale", "exact (95 %)", "median, mm", "p95, mm",
            "median over size, to the flat disk's", "bound, mm",
            "bound over size, to the flat disk's", "within the 90 % ellipse",
            "same count as flat, places moved: median (p95)")  # fmt: skip
    return Table("scores", head, tuple(rows))


def _zones(score: dict[str, Any]) -> Table:
    far, scales = np.array(score["far_mm"]), np.array(score["scales"])
    bound, true_scales = np.array(score["bound_mm"]), np.array(score["true_scales"])
    rows = []
    for low, high in ((1.0, 1.3), (1.3, 1.6), (1.6, 2.1)):
        own = far[(scales >= low) & (scales < high)]
        least = bound[(true_scales >= low) & (true_scales < high)]
        medians = [_mm(float(np.median(one)) if len(one) else None) for one in (own, least)]
        rows.append((f"{low:g} to {min(high, 2.0):g}", str(len(own)), *medians))
    return Table("zones", ("scale", "touches", "median, mm", "bound, mm"), tuple(rows))


def _many_table(many: dict[str, dict[str, Any]]) -> Table:
    """Medians over the size, and their ratios to the flat disk's, of errors and bounds."""

    def relative(name: str, kind: str) -> FloatArray:
        one = many[name]
        values = one["far_mm"] if kind == "error" else one["bounds_mm"][kind]
        return np.asarray(np.array(values) / one["size"], dtype=np.float64)

    rows = []
    for name, one in many.items():
        cells = [name, _percent(one), str(len(one["far_mm"])), _mm(one["median_mm"])]
        for kind in ("error", *DRIVES):
            middle, low, high = _ratio(relative(name, kind), relative("flat disk", kind))
            cells.append("" if name == "flat disk" else f"{middle:.2f} ({low:.2f} to {high:.2f})")
        rows.append(tuple(cells))
    head = ("surface", "exact (95 %)", "touches", "median, mm",
            "median over size, to the flat disk's (95 %)",
            *(f"the same of the bound, {drive} drives (95 %)" for drive in DRIVES))  # fmt: skip
    return Table("many", head, tuple(rows))


def _ratio(above: FloatArray, below: FloatArray) -> tuple[float, float, float]:
    """The ratio of two medians, and the ends of its interval of 95 %, by drawing the touches again
    (bootstrap)."""
    draw = np.random.default_rng(1)
    drawn = [np.median(draw.choice(one, (2000, len(one))), axis=1) for one in (above, below)]
    low, high = np.quantile(drawn[0] / drawn[1], (0.025, 0.975))
    return float(np.median(above) / np.median(below)), float(low), float(high)


def _caps(caps: list[dict[str, Any]]) -> Table:
    rows = [
        (f"{one['angle_deg']} degrees", "cannot be flattened" if one["scale"] is None
         else f"{one['scale']:.1f}")
        for one in caps
    ]  # fmt: skip
    return Table("caps", ("cap of a ball, from its pole to", "greatest scale"), tuple(rows))


def _flex_table(scores: list[dict[str, Any]]) -> Table:
    rows = tuple(
        (
            f"{one['bulge_mm']:g}", f"{100 * (one['area'] - 1):.1f} %",
            f"{100 * one['changed']:.2g} %", one["model"], one["tare"], one["pose"],
            _percent(one), _mm(one["median_mm"]), _mm(one["p95_mm"]),
        )
        for one in scores
    )  # fmt: skip
    head = ("muscle, mm", "area grows by", "untouched frame changed by", "model", "tare", "pose",
            "exact (95 %)", "median, mm", "p95, mm")  # fmt: skip
    return Table("flexed", head, rows)
