"""A scene: what happens on a skin, and with which imperfections it is measured. It is read from
TOML and checked completely.

The tables of effects are kept as they are; the compiler reads them when it imports the effects'
modules. docs/guide/scenes.md describes the format.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.config import check_keys, choice, flag, integer, load_toml, number, subtable, word
from eitskin.errors import ConfigError
from eitskin.scene.laws import DRIVING_KEY, LAW_KEYS, LAWS, law_from_table
from eitskin.scene.random_touches import rim_distance_mm
from eitskin.scene.touch_path import ALWAYS_S, Keyframe, TouchTrack, TrackSamples, sample
from eitskin.skin.outline import Outline
from eitskin.skin.protocol import Protocol, adjacent
from eitskin.skin.skin import Skin, load_skin, paper_skin

if TYPE_CHECKING:
    from eitskin.scene.touch_shape import TouchShape


SCENE_KEYS = (
    "name",
    "description",
    "skin",
    "seed",
    "frames",
    "rate_hz",
    "quiet_frames",
    "elements",
    "solver",
)
TOUCH_KEYS = {"law", "radius_mm", "hold", "path", "x_mm", "y_mm", "from_s", "to_s"}
TOUCH_KEYS |= {"shape", "aspect", "angle_deg"}
SCAN_KEYS = ("frozen", "row_us")
SOLVERS = ("auto", "factorise", "update")
ROW_US = 100.0  # time from row to row on a board with its default settings
MAX_FRAMES = 1_000_000
MAX_TIME_S = 1e7
# The mesh differs from the one of models (about 3,000 elements by default), so that a simulation
# does not share its errors with the solver.
DEFAULT_ELEMENTS = 5000


@dataclass(frozen=True)
class Scene:
    """The description of what happens on a skin.

    Attributes:
        name, description: a word and a line.
        skin, protocol: what is touched and how it is scanned.
        skin_file: the description that the skin was read from; None: of another origin.
        seed: the seed of everything random.
        frames: the number of recorded frames, the first at 0 s; ``rate_hz`` per second.
        quiet_frames: the number of untouched reference frames before them, at negative times.
        elements: the approximate number of elements of the mesh.
        solver: "factorise" again for each conductivity, "update" the untouched skin's factors, or
            "auto", which is the cheaper one if touches move and "factorise" if they do not.
        touches: the touches, in the order of [[touch]].
        frozen: whether each frame is a snapshot at its time; otherwise touches move during its
            scan.
        row_us: the time from row to row of a scan; None is 100, or less if frames follow faster.
        effects: the table of each effect by its name, as in TOML.
        where: the file, for errors.
        dataset: the table [dataset], as in TOML.
        text: the TOML that the scene was read from.
        folder: where files that effects name are searched.

    Raises:
        ConfigError: a number is out of range, or a touch lies outside the skin, overlaps another or
            has no size.
    """

    name: str
    skin: Skin = field(default_factory=paper_skin)
    protocol: Protocol = field(default_factory=lambda: adjacent(16))
    touches: tuple[TouchTrack, ...] = ()
    effects: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    seed: int = 1
    frames: int = 1
    rate_hz: float = 20.0
    quiet_frames: int = 16
    elements: int = DEFAULT_ELEMENTS
    solver: str = "auto"
    frozen: bool = False
    row_us: float | None = None
    description: str = ""
    where: str = "scene"
    skin_file: Path | None = None
    dataset: Mapping[str, Any] = field(default_factory=dict)
    text: str = ""
    folder: Path = Path()

    def __post_init__(self) -> None:
        place, numbers = f"{self.where} [scene]", {"seed": self.seed, "frames": self.frames}
        numbers |= {"quiet_frames": self.quiet_frames, "elements": self.elements}
        integer(numbers, "seed", None, place, low=0, high=2**63 - 1)
        integer(numbers, "frames", None, place, low=1, high=MAX_FRAMES)
        integer(numbers, "quiet_frames", None, place, low=1, high=MAX_FRAMES)
        integer(numbers, "elements", None, place, low=200, high=200_000)
        number({"rate_hz": self.rate_hz}, "rate_hz", None, place, low=0, high=1e6, open_low=True)
        choice({"solver": self.solver}, "solver", None, SOLVERS, place)
        if self.row_us is not None:
            most = 1e6 / (self.rate_hz * self.protocol.n_rows)
            if not 0 < self.row_us <= most * (1 + 1e-9):
                raise ConfigError(
                    f"{self.where} [scan]: row_us = {self.row_us:g} must be above 0 and at most"
                    f" {most:.4g}, or {self.protocol.n_rows} rows take longer than a frame; use"
                    " a lower rate_hz"
                )
        _check_touches(self)

    @property
    def n_frames(self) -> int:
        """The number of all frames, untouched ones included."""
        return self.quiet_frames + self.frames

    def times_s(self) -> FloatArray:
        """Return the times of the recorded frames (frames,), at which their scans begin."""
        return np.asarray(np.arange(self.frames) / self.rate_hz)

    @property
    def scan_s(self) -> float:
        """The duration of a scan."""
        rows = self.protocol.n_rows
        if self.row_us is not None:
            return 1e-6 * self.row_us * rows
        return min(1e-6 * ROW_US * rows, 1 / self.rate_hz)

    @property
    def row_delays_s(self) -> FloatArray:
        """When each row (m,) is measured after the beginning of the scan; 0 if ``frozen``."""
        row_s = 0.0 if self.frozen else self.scan_s / self.protocol.n_rows
        return np.asarray(row_s * self.protocol.scan_places)

    @property
    def truth_delay_s(self) -> float:
        """The delay from a frame's time to the instant that its truth describes: the end of its
        scan, or 0 if ``frozen``."""
        return 0.0 if self.frozen else self.scan_s

    def samples(self, frames: range | None = None) -> tuple[TrackSamples, ...]:
        """Return the samples of each track at the instants of the truth of the recorded frames, or
        of ``frames`` among them."""
        times = self.times_s() if frames is None else np.asarray(frames) / self.rate_hz
        return self.samples_at(times + self.truth_delay_s)

    def samples_at(self, times_s: FloatArray) -> tuple[TrackSamples, ...]:
        """Return the samples of each track at any instants (k,)."""
        return tuple(sample(track, times_s) for track in self.touches)


def load_scene(path: str | Path) -> Scene:
    """Read the scene in the TOML file ``path``.

    Raises:
        FileError: the file, or the skin that it names, cannot be read.
        ConfigError, GeometryError, ProtocolError: the description is not valid.
    """
    path = Path(path)
    table = load_toml(path, "scene")
    if not table:
        raise ConfigError(f"{path}: empty, so not a scene; it needs at least the table [scene]")
    return scene_from_table(table, str(path), path.parent, path.read_text(encoding="utf-8"))


def scene_from_table(table: Mapping[str, Any], where: str, folder: Path, text: str = "") -> Scene:
    """Return the scene in a parsed TOML ``table``; ``where`` names it in errors, and files of skins
    are searched in ``folder``.

    Raises:
        FileError, ConfigError, GeometryError, ProtocolError: as ``load_scene``.
    """
    check_keys(table, ("scene", "scan", "touch", "effects", "dataset"), where)
    head, place = subtable(table, "scene", where), f"{where} [scene]"
    check_keys(head, SCENE_KEYS, place)
    scan = subtable(table, "scan", where)
    check_keys(scan, SCAN_KEYS, f"{where} [scan]")
    skin_file = _skin_file(head, place, folder)
    skin, protocol = (paper_skin(), adjacent(16)) if skin_file is None else load_skin(skin_file)
    given = {
        "frames": integer(head, "frames", 1, place, low=1, high=MAX_FRAMES),
        "quiet_frames": integer(head, "quiet_frames", 16, place, low=1, high=MAX_FRAMES),
        "seed": integer(head, "seed", 1, place, low=0, high=2**63 - 1),
        "elements": integer(head, "elements", DEFAULT_ELEMENTS, place, low=200, high=200_000),
    }
    touches = table.get("touch", [])
    if not isinstance(touches, list) or not all(isinstance(one, Mapping) for one in touches):
        raise ConfigError(f"{where}: touches are written as tables [[touch]], with two brackets")
    effects = subtable(table, "effects", where)
    for name, one in effects.items():
        if not isinstance(one, Mapping):
            raise ConfigError(
                f"{where} [effects]: {name} = {one!r} must be a table: write [effects.{name}]"
            )
    row_us = None
    if "row_us" in scan:
        row_us = number(scan, "row_us", None, f"{where} [scan]", low=0, high=1e6, open_low=True)
    return Scene(
        name=word(head, "name", Path(where).stem, place),
        description=word(head, "description", "", place),
        skin=skin,
        protocol=protocol,
        touches=tuple(
            _track(one, f"{where} [[touch]] {k} (from 0)") for k, one in enumerate(touches)
        ),
        effects=effects,
        rate_hz=number(head, "rate_hz", 20.0, place, low=0, high=1e6, open_low=True),
        solver=choice(head, "solver", "auto", SOLVERS, place),
        frozen=flag(scan, "frozen", False, f"{where} [scan]"),
        row_us=row_us,
        where=where,
        skin_file=skin_file,
        dataset=subtable(table, "dataset", where),
        text=text,
        folder=folder,
        **given,
    )


def _skin_file(head: Mapping[str, Any], where: str, folder: Path) -> Path | None:
    """Return the path of the skin's description; None for the paper's skin."""
    name = word(head, "skin", "paper", where)
    if name == "paper":
        return None
    path = folder / name
    if "\0" in name or not path.is_file():
        raise ConfigError(
            f'{where}: skin = {name!r} is neither "paper" nor a file beside the scene'
        )
    return path


def _track(table: Mapping[str, Any], where: str) -> TouchTrack:
    name = choice(table, "law", "short_circuit", LAWS, where)
    driving = DRIVING_KEY[name]
    own = {key for keys in LAW_KEYS.values() for key in keys} | set(DRIVING_KEY.values())
    check_keys(table, TOUCH_KEYS | own, where)
    law, shape = law_from_table(table, name, where), _shape(table, where)
    hold = flag(table, "hold", False, where)
    path = table.get("path")
    if path is None:
        keyframes, hold = _standing(table, driving, where)
        return TouchTrack(keyframes, law, hold, shape)
    for key in ("x_mm", "y_mm", "from_s", "to_s"):
        if key in table:
            raise ConfigError(
                f"{where}: {key} beside path; give a path, or x_mm and y_mm of a touch that stays"
            )
    if not isinstance(path, list) or not path or not all(isinstance(one, Mapping) for one in path):
        raise ConfigError(
            f"{where}: path must be a list of keyframes {{ t_s = .., x_mm = .., y_mm = .. }}"
        )
    keys = []
    for k, one in enumerate(path):
        place = f"{where} path {k} (from 0)"
        check_keys(one, ("t_s", "x_mm", "y_mm", "radius_mm", driving), place)
        keys.append(_keyframe({**_defaults(table, driving), **one}, driving, place))
        if k and keys[-1].t_s <= keys[-2].t_s:
            raise ConfigError(
                f"{place}: t_s = {keys[-1].t_s:g} is not after {keys[-2].t_s:g}; keyframes must"
                " ascend"
            )
    return TouchTrack(tuple(keys), law, hold, shape)


def _shape(table: Mapping[str, Any], where: str) -> "TouchShape | None":
    """Return the shape that ``shape`` names; its module is imported only for shapes other than a
    disc."""
    name = table.get("shape", "disc")
    if name == "disc":
        for key in ("aspect", "angle_deg"):
            if key in table:
                raise ConfigError(f"{where}: a disc has no {key}; name a shape, or remove it")
        return None
    from eitskin.scene import touch_shape

    choice(table, "shape", None, ("disc", *touch_shape.SHAPES), where)
    most = touch_shape.MAX_ASPECT
    aspect = number(table, "aspect", touch_shape.SHAPES[name][1], where, low=1, high=most)
    angle_deg = number(table, "angle_deg", 0.0, where, low=-360, high=360)
    return touch_shape.named_shape(name, aspect, angle_deg)


def _defaults(table: Mapping[str, Any], driving: str) -> dict[str, Any]:
    return {key: table[key] for key in ("radius_mm", driving) if key in table}


def _standing(
    table: Mapping[str, Any], driving: str, where: str
) -> tuple[tuple[Keyframe, ...], bool]:
    """Return the keyframes of a touch without a path, which exists from from_s to to_s or always,
    and whether it stays."""
    start = ALWAYS_S[0]
    if "from_s" in table:
        start = number(table, "from_s", 0.0, where, low=-MAX_TIME_S, high=MAX_TIME_S)
    first = _keyframe({**table, "t_s": 0.0}, driving, where)
    if "to_s" not in table:
        return (replace(first, t_s=start),), True
    begin = max(start, -MAX_TIME_S)
    end = number(table, "to_s", None, where, low=begin, high=MAX_TIME_S, open_low=True)
    return (replace(first, t_s=begin), replace(first, t_s=end)), False


def _keyframe(table: Mapping[str, Any], driving: str, where: str) -> Keyframe:
    far = 1e5
    standard, most = (1.0, 1.0) if driving == "press" else (None, 1e5)
    return Keyframe(
        t_s=number(table, "t_s", None, where, low=-MAX_TIME_S, high=MAX_TIME_S),
        x_mm=number(table, "x_mm", None, where, low=-far, high=far),
        y_mm=number(table, "y_mm", None, where, low=-far, high=far),
        radius_mm=number(table, "radius_mm", None, where, low=0, high=far, open_low=True),
        drive=number(table, driving, standard, where, low=0, high=most),
    )


def _check_touches(scene: Scene) -> None:
    """Reject touches that lie outside the skin, have no size or overlap in any recorded frame: when
    its scan begins and ends, and at keyframes during it."""
    for k, track in enumerate(scene.touches):
        where = f"{scene.where} [[touch]] {k} (from 0)"
        if not track.keyframes:
            raise ConfigError(f"{where}: it has no keyframes; give a path")
        if not all(key.radius_mm > 0 for key in track.keyframes):
            raise ConfigError(f"{where}: radius_mm must be above 0; a touch needs a size")
        if not track.law.contrast_at(np.array([key.drive for key in track.keyframes])).min() > 0:
            raise ConfigError(
                f"{where}: contrast must be above 0; a conductivity cannot be negative"
            )
    times = _scanned_s(scene)
    samples = scene.samples_at(times)
    for k, one in enumerate(samples):
        if len(scene.touches[k].keyframes) and not one.there.any():
            continue
        at = np.flatnonzero(one.there)
        room = _room_mm(scene.skin.outline, one, at)
        if room.min() < -1e-9:
            worst = int(at[room.argmin()])
            raise ConfigError(
                f"{scene.where} [[touch]] {k} (from 0): at {times[worst]:g} s x_mm ="
                f" {one.x_mm[worst]:g}, y_mm = {one.y_mm[worst]:g} with radius_mm ="
                f" {one.radius_mm[worst]:g} reaches {-room.min():.3g} mm outside the skin"
                f" {scene.skin.name!r}; move it inwards or make it smaller"
            )
    _refuse_overlaps(scene, samples, times)


def _scanned_s(scene: Scene) -> FloatArray:
    """Return the instants at which touches, which move in straight lines, are checked."""
    times = scene.times_s()
    if scene.frozen:
        return times
    keys = np.array([key.t_s for track in scene.touches for key in track.keyframes])
    keys = keys[(keys >= 0) & (keys < scene.frames / scene.rate_hz)]
    keys = keys[keys % (1 / scene.rate_hz) <= scene.scan_s]
    return np.asarray(np.unique(np.concatenate([times, times + scene.scan_s, keys])))


def _room_mm(outline: Outline, one: TrackSamples, at: IntArray) -> FloatArray:
    """Return how far inside the rim the edge of the touch is in the frames ``at`` (k,), (k,)."""
    places = np.column_stack([one.x_mm[at], one.y_mm[at]])
    shape = one.shape
    if shape is None:
        return rim_distance_mm(outline, places) - one.radius_mm[at]
    edges = [place + shape.rim_mm(r) for place, r in zip(places, one.radius_mm[at], strict=True)]
    return np.array([rim_distance_mm(outline, edge).min() for edge in edges])


def _gap_mm(one: TrackSamples, other: TrackSamples) -> FloatArray:
    """Return the distance between the edges of two touches, (n,), below 0 if they overlap. For
    shapes it is approximate, but its sign is right."""
    x_mm, y_mm = other.x_mm - one.x_mm, other.y_mm - one.y_mm
    away_mm = np.hypot(x_mm, y_mm)
    if one.shape is None and other.shape is None:
        return np.asarray(away_mm - one.radius_mm - other.radius_mm)
    gap_mm = away_mm.copy()
    for k in np.flatnonzero(one.there & other.there):
        for here, there, sign in ((one, other, 1), (other, one, -1)):
            shape, radius_mm = here.shape or _disc(), float(here.radius_mm[k])
            edge = (there.shape or _disc()).rim_mm(float(there.radius_mm[k]))
            from_here = edge + sign * np.array([x_mm[k], y_mm[k]])
            rho = np.sqrt(shape.rho2(from_here[:, 0], from_here[:, 1], radius_mm).min())
            gap_mm[k] = min(gap_mm[k], (rho - 1) * radius_mm)
    return gap_mm


def _disc() -> "TouchShape":
    from eitskin.scene.touch_shape import TouchShape

    return TouchShape()


def _refuse_overlaps(scene: Scene, samples: Sequence[TrackSamples], times: FloatArray) -> None:
    for k, one in enumerate(samples):
        for j in range(k):
            other = samples[j]
            gap = _gap_mm(one, other)
            bad = np.flatnonzero(one.there & other.there & (gap < -1e-9))
            if len(bad):
                worst = int(bad[gap[bad].argmin()])
                raise ConfigError(
                    f"{scene.where} [[touch]] {k} (from 0): it overlaps touch {j} by"
                    f" {-gap[worst]:.3g} mm at {times[worst]:g} s; change x_mm, y_mm or radius_mm"
                    " so that they lie apart"
                )
