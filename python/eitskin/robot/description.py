"""Robot files: the skins of a robot, their boards, and the links that they sit on
(docs/guide/robot.md)."""

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from eitskin.config import check_keys, load_toml, nearest, number, subtable, word
from eitskin.device.timing import TIMED, Timing, check_name, split_name, split_timing
from eitskin.errors import ConfigError, EitskinError, GeometryError, UsageError
from eitskin.kinematics.pose import IDENTITY, Pose, from_quaternion, from_rpy
from eitskin.kinematics.urdf import Urdf, load_urdf

SCHEME = "robot:"
SUFFIXES = (".toml", ".urdf")
MAX_SKINS = 64
MAX_M = 1e3
SKIN_KEYS = ("name", "device", "link", "xyz_m", "rpy_rad", "quaternion_xyzw", "model", "starts_s")


@dataclass(frozen=True, eq=False)
class RobotSkin:
    """A skin of a robot.

    Attributes:
        name: its own among the robot's; the source of its messages.
        device: the URL of its board.
        link: the frame of reference of its touches; None: the one that its model names, else
            ``name``.
        pose: where its drawing (or the mesh of a surface) is in the link's frame.
        base: where the link is in the robot's own frame while all joints are at zero; the identity
            where no URDF says it.
        model: a file, where the board's model is not the prebuilt one.
        starts_s: of a recording, when its first frame came by the robot's clock.
    """

    name: str
    device: str
    link: str | None = None
    pose: Pose = IDENTITY
    base: Pose = IDENTITY
    model: Path | None = None
    starts_s: float = 0.0


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot's skins, as a file and perhaps its ``urdf`` describe them."""

    name: str
    skins: tuple[RobotSkin, ...]
    urdf: Path | None = None


def is_robot(url: str) -> bool:
    """Return whether ``url`` names a robot: robot:FILE, or the path of a TOML file or URDF
    alone."""
    if url.startswith(SCHEME):
        return True
    bare = split_name(url)[0].rpartition("?")[0] or url
    return bare.endswith(SUFFIXES) and not re.match(r"[a-z]{2,}:", bare)


def open_robot(url: str) -> tuple[Robot, Timing]:
    """The robot of a URL, and how fast its simulated skins are.

    Raises:
        UsageError: the URL cannot be read, or names the robot.
        FileError, ConfigError, GeometryError: as ``load_robot``.
    """
    bare, name = split_name(url)
    if name is not None:
        raise UsageError(f"device {url!r}: the robot's file names its skins; leave name= out")
    rest = bare.removeprefix(SCHEME)
    if not rest:
        raise UsageError(f"device {url!r}: write  robot:FILE.toml  or  robot:FILE.urdf")
    path, timing = split_timing(f"file:{rest}")  # the same settings as a recording
    return load_robot(path.removeprefix("file:")), timing


def load_robot(path: str | Path) -> Robot:
    """Read a robot file: TOML, or a URDF whose elements <eitskin> name its skins.

    Raises:
        FileError: it, or its URDF, cannot be read.
        ConfigError: a key is unknown, missing or out of range, a name or port comes twice, or a
            link is unknown.
        GeometryError: a pose is no rotation.
    """
    path = Path(path)
    if path.suffix == ".urdf":
        urdf = load_urdf(path)
        if not urdf.skins:
            raise ConfigError(
                f'{path}: names no skin; add  <eitskin reference="LINK" device="URL"/>  below'
                " <robot>, or write a robot file in TOML"
            )
        return Robot(urdf.name, _skins(list(urdf.skins), urdf, path, "<eitskin>"), path)
    table = load_toml(path, "robot file")
    if "scene" in table:
        raise ConfigError(f"{path}: a scene, not a robot file; as a device it is  sim:{path}")
    check_keys(table, ("robot", "skin"), str(path))
    head = subtable(table, "robot", str(path))
    check_keys(head, ("name", "urdf"), f"{path} [robot]")
    rows = table.get("skin", [])
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows) or not rows:
        raise ConfigError(f"{path}: names no skin; write each as a table  [[skin]]")
    file, found = None, None
    if "urdf" in head:
        file = path.parent / word(head, "urdf", None, f"{path} [robot]")
        found = load_urdf(file)
    usual = path.stem if found is None else found.name
    name = word(head, "name", usual, f"{path} [robot]")
    return Robot(name, _skins(rows, found, path, "[[skin]]"), file)


def _skins(
    rows: list[dict[str, Any]], urdf: Urdf | None, path: Path, kind: str
) -> tuple[RobotSkin, ...]:
    if len(rows) > MAX_SKINS:
        raise ConfigError(f"{path}: has {len(rows)} skins; a robot has at most {MAX_SKINS}")
    skins = tuple(
        _skin(row, urdf, path.parent, f"{path} {kind} {k}") for k, row in enumerate(rows, 1)
    )
    names: set[str] = set()
    ports: dict[str, str] = {}
    for skin in skins:
        if skin.name in names:
            raise ConfigError(f"{path}: skin {skin.name!r} comes twice; give each its own name")
        names.add(skin.name)
        port = _port(skin.device)
        if port is not None and port in ports:
            raise ConfigError(
                f"{path}: skins {ports[port]!r} and {skin.name!r} have the same port,"
                f" {skin.device}; each needs a board of its own"
            )
        if port is not None:
            ports[port] = skin.name
    return skins


def _skin(row: Mapping[str, Any], urdf: Urdf | None, folder: Path, where: str) -> RobotSkin:
    check_keys(row, SKIN_KEYS, where)
    for key in ("name", "device"):
        if key not in row:
            raise ConfigError(f"{where}: the key {key!r} is required")
    try:
        name = check_name(word(row, "name", None, where), where)
    except UsageError as error:
        raise ConfigError(str(error)) from None
    where = f"{where} ({name})"
    link = word(row, "link", None, where) if "link" in row else None
    if link is not None and (not link or not link.isprintable() or " " in link):
        raise ConfigError(f"{where}: link {link!r} cannot be a frame; write a name without spaces")
    base = IDENTITY
    if urdf is not None:
        if link is None:
            raise ConfigError(f"{where}: the key 'link' is required if the file names a URDF")
        if link not in urdf.links:
            raise ConfigError(f"{where}: link {link!r}: {nearest(link, urdf.links)}")
        base = urdf.links[link]
    model = folder / word(row, "model", None, where) if "model" in row else None
    starts_s = number(row, "starts_s", 0.0, where, low=0.0, high=1e9)
    device = _device(word(row, "device", None, where), folder, where)
    return RobotSkin(name, device, link, _pose(row, where), base, model, starts_s)


def _pose(row: Mapping[str, Any], where: str) -> Pose:
    xyz_m = _numbers(row, "xyz_m", 3, where, MAX_M)
    if "quaternion_xyzw" not in row:
        return from_rpy(xyz_m, _numbers(row, "rpy_rad", 3, where, 100.0))
    if "rpy_rad" in row:
        raise ConfigError(f"{where}: has rpy_rad and quaternion_xyzw; leave one out")
    try:
        return from_quaternion(xyz_m, _numbers(row, "quaternion_xyzw", 4, where, 2.0))
    except GeometryError as error:
        raise GeometryError(f"{where}: {error}") from None


def _numbers(row: Mapping[str, Any], key: str, count: int, where: str, most: float) -> list[float]:
    given = row.get(key, [0.0] * count)
    if not isinstance(given, list) or len(given) != count:
        raise ConfigError(f"{where}: {key} must be a list of {count} numbers, not {given!r}")
    return [number({key: one}, key, None, where, low=-most, high=most) for one in given]


def _device(url: str, folder: Path, where: str) -> str:
    """The URL of a skin's board; files are searched beside the robot file."""
    try:
        bare, timing = split_timing(url)
        if split_name(url)[1] is not None:
            raise UsageError("the robot's file names the skin; leave name= out")
        if timing.speed is not None:
            raise UsageError(
                "the skins of a robot have one clock; name the speed after the robot's file, as in "
                " robot:FILE?speed=1"
            )
        if is_robot(url):
            raise UsageError("a robot cannot be the board of a skin; name one board")
    except EitskinError as error:
        raise ConfigError(f"{where}: device {url!r}: {error}") from None
    scheme, colon, rest = bare.partition(":")
    if not colon and scheme != "auto":
        raise ConfigError(f"{where}: device {url!r}: write a device's URL, as in  sim:two_touch")
    beside = scheme == "file" or (scheme in TIMED and rest.endswith(".toml"))
    if beside and rest:
        bare = f"{scheme}:{folder / rest}"
    return bare + ("?loop=1" if timing.loop else "")


def _port(url: str) -> str | None:
    """Return the port that only one board can be at; None for a device that may be opened twice."""
    scheme, _, rest = url.partition(":")
    if scheme in TIMED:
        return None
    path = rest.partition("?")[0]
    return os.path.realpath(path) if path else scheme


def looped(robot: Robot) -> Robot:
    """The same with every simulated or recorded skin repeated for ever."""
    return replace(robot, skins=tuple(map(_looped, robot.skins)))


def _looped(skin: RobotSkin) -> RobotSkin:
    timed = skin.device.partition(":")[0] in TIMED
    already = split_timing(skin.device)[1].loop
    return replace(skin, device=f"{skin.device}?loop=1") if timed and not already else skin
