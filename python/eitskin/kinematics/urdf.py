"""Read what a robot file needs of a URDF: the names of links, their places while all joints are at
zero, and the elements  <eitskin reference="LINK" device="URL">  that name skins. The module
``link_mesh`` reads the meshes of links."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from eitskin.config import check_keys, plain_number
from eitskin.errors import ConfigError
from eitskin.fileio import read_bytes
from eitskin.kinematics.pose import IDENTITY, Pose, from_rpy

MAX_URDF_BYTES = 10_000_000
MAX_LINKS = 10_000


@dataclass(frozen=True, eq=False)
class Urdf:
    """``links``: where each link is in the root's frame. ``skins``: of each element eitskin, the
    table that a robot file would have."""

    name: str
    links: Mapping[str, Pose]
    skins: tuple[dict[str, Any], ...]


def load_urdf(path: str | Path) -> Urdf:
    """Read a URDF.

    Raises:
        FileError: it cannot be read.
        ConfigError: it is no URDF, or its joints do not make a tree of its links.
    """
    root = urdf_root(path)
    names = list(link_elements(root, path))
    skins = tuple(_skin(one, path) for one in root.findall("eitskin"))
    return Urdf(root.get("name") or Path(path).stem, _links(root, names, path), skins)


def urdf_root(path: str | Path) -> ElementTree.Element:
    """Return the element <robot> of a URDF.

    Raises:
        FileError: it cannot be read.
        ConfigError: it is no URDF.
    """
    content = read_bytes(path, "URDF", MAX_URDF_BYTES)
    if b"<!DOCTYPE" in content or b"<!ENTITY" in content:
        raise ConfigError(f"{path}: has a document type, which a URDF does not need; remove it")
    if b"xacro:" in content:
        raise ConfigError(f"{path}: is a xacro file; expand it first:  xacro FILE > robot.urdf")
    try:
        root = ElementTree.fromstring(content)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise ConfigError(f"{path}: not valid XML: {error}") from None
    if root.tag != "robot":
        raise ConfigError(f"{path}: not a URDF: its outer element is <{root.tag}>, not <robot>")
    return root


def link_elements(root: ElementTree.Element, path: str | Path) -> dict[str, ElementTree.Element]:
    """Return the elements <link> by their names.

    Raises:
        ConfigError: a link has no name, two have the same, or there are none or too many.
    """
    links: dict[str, ElementTree.Element] = {}
    for one in root.findall("link"):
        name = attribute(one, "name", path)
        if name in links:
            raise ConfigError(f"{path}: link {name!r} comes twice; give each its own name")
        links[name] = one
    if not 1 <= len(links) <= MAX_LINKS:
        raise ConfigError(f"{path}: has {len(links)} links; a URDF has 1 to {MAX_LINKS}")
    return links


def _links(root: ElementTree.Element, names: list[str], path: str | Path) -> dict[str, Pose]:
    joints: dict[str, tuple[str, Pose]] = {}  # of each child: its parent, and where it is there
    for joint in root.findall("joint"):
        where = f"{path}: joint {joint.get('name')!r}"
        ends = []
        for end in ("parent", "child"):
            element = joint.find(end)
            link = None if element is None else element.get("link")
            if link not in names:
                raise ConfigError(f"{where}: its {end} {link!r} is not a link of this URDF")
            ends.append(link)
        parent, child = ends
        if child in joints:
            raise ConfigError(f"{where}: link {child!r} has two parents; leave one joint out")
        joints[child] = parent, origin_of(joint, where)
    poses: dict[str, Pose] = {}
    for name in names:
        way = []  # from the link up to one whose pose is known
        while name in joints and name not in poses:
            if name in way:
                raise ConfigError(f"{path}: the joints of link {name!r} form a circle")
            way.append(name)
            name = joints[name][0]
        poses.setdefault(name, IDENTITY)
        for one in reversed(way):
            parent, pose = joints[one]
            poses[one] = poses[parent] @ pose
    return poses


def _skin(element: ElementTree.Element, path: str | Path) -> dict[str, Any]:
    link = attribute(element, "reference", path)
    table: dict[str, Any] = {"name": link, "link": link} | dict(element.attrib)
    del table["reference"]
    where = f"{path}: <eitskin> of link {link!r}"
    check_keys(table, ("name", "link", "device", "model"), where)
    for key, value in (("xyz_m", "xyz"), ("rpy_rad", "rpy")):
        table[key] = _origin(element, value, where)
    return table


def origin_of(element: ElementTree.Element, where: str) -> Pose:
    """Return the pose of an element's <origin>; ``where`` names the element in errors.

    Raises:
        ConfigError: it is not three numbers each for xyz and rpy.
    """
    return from_rpy(_origin(element, "xyz", where), _origin(element, "rpy", where))


def _origin(element: ElementTree.Element, name: str, where: str) -> list[float]:
    origin = element.find("origin")
    text = "0 0 0" if origin is None else origin.get(name, "0 0 0")
    return three_numbers(text, f"{where}: its origin has {name}")


def three_numbers(text: str, what: str) -> list[float]:
    """Return the three numbers in an attribute's ``text``; ``what`` names it in errors.

    Raises:
        ConfigError: there are others than three, or one is too large.
    """
    try:
        numbers = [plain_number(one) for one in text.split()]
    except ValueError:
        numbers = []
    if len(numbers) != 3 or not all(abs(one) < 1e6 for one in numbers):
        raise ConfigError(f"{what}={text!r}; write three numbers")
    return numbers


def attribute(element: ElementTree.Element, name: str, where: str | Path) -> str:
    """Return an attribute that ``element`` must have.

    Raises:
        ConfigError: it has none, or an empty one.
    """
    value = element.get(name)
    if not value:
        raise ConfigError(f"{where}: an element <{element.tag}> has no {name}")
    return value
