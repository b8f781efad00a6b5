"""The mesh of a URDF's link: its file, its scale, and its pose in the link."""

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.config import listed, nearest, plain_number
from eitskin.errors import ConfigError, FileError
from eitskin.kinematics.pose import Pose
from eitskin.kinematics.urdf import attribute, link_elements, origin_of, three_numbers, urdf_root

KINDS = ("visual", "collision")
ROS1_PATH, ROS2_PATH = "ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"


@dataclass(frozen=True, eq=False)
class LinkMesh:
    """A mesh in the frame of ``link``: the numbers in ``file`` times ``scale`` (3,) are metres, and
    ``pose`` places these in the link."""

    link: str
    file: Path
    scale: FloatArray
    pose: Pose

    def points_m(self, points: FloatArray) -> FloatArray:
        """Return the file's ``points`` (N, 3) in the link's frame, m."""
        return self.pose.points(points * self.scale)

    def outward(self, triangles: IntArray) -> IntArray:
        """Return the file's ``triangles`` (T, 3) such that they face the same side as in the file,
        also where the scale mirrors the mesh."""
        return triangles if np.prod(self.scale) > 0 else triangles[:, ::-1]


def link_mesh(path: Path, name: str) -> LinkMesh:
    """Return the mesh that ``name``, LINK or LINK/MESH, names in the URDF ``path``. MESH is the
    name of an element <visual> or <collision> of the link, or ``visual`` or ``collision``. Without
    it, the mesh is the only one of the link's visuals, or of its collisions if no visual has one.

    Raises:
        FileError: the URDF, or the package of the mesh, cannot be found.
        ConfigError: there is no such link or mesh, several meshes fit, or its elements are wrong.
    """
    root = urdf_root(path)
    links = link_elements(root, path)
    link, chosen = name, ""
    if name not in links and "/" in name:
        link, _, chosen = name.rpartition("/")
    if not link:
        raise ConfigError(
            f'{path}: a URDF has several links; name the skin\'s:  surface = "{path.name}#LINK"'
        )
    if link not in links:
        raise ConfigError(f"{path}: it has no link {link!r}; {nearest(link, links)}")
    where = f"{path}: link {link!r}"
    element, mesh = _only_mesh(links[link], chosen, where)
    file = _file(attribute(mesh, "filename", where), path.parent, where)
    scale = three_numbers(mesh.get("scale", "1 1 1"), f"{where}: its mesh has scale")
    if not all(scale):
        raise ConfigError(f"{where}: its mesh has scale={mesh.get('scale')!r}, with a 0; remove it")
    return LinkMesh(link, file, np.array(scale), origin_of(element, where))


def _only_mesh(
    link: ElementTree.Element, chosen: str, where: str
) -> tuple[ElementTree.Element, ElementTree.Element]:
    """Return the <visual> or <collision> that ``chosen`` names, or the only one that can be meant,
    and its <mesh>."""
    parts = [part for kind in KINDS for part in link.findall(kind)]
    if chosen:
        names = {text for part in parts for text in (part.tag, part.get("name")) if text}
        if chosen not in names:
            raise ConfigError(f"{where}: it has no mesh {chosen!r}; {nearest(chosen, names)}")
        parts = [part for part in parts if chosen in (part.tag, part.get("name"))]
    meshes = [(part, mesh) for part in parts for mesh in part.findall("geometry/mesh")]
    if not chosen and any(part.tag == "visual" for part, _ in meshes):
        meshes = [(part, mesh) for part, mesh in meshes if part.tag == "visual"]
    if not meshes:
        raise ConfigError(f"{where}: {_without_mesh(parts, where)}")
    if len(meshes) > 1:
        called = [part.get("name") or f"a {part.tag} without a name" for part, _ in meshes]
        raise ConfigError(
            f"{where}: {len(meshes)} meshes can be meant ({listed(called)}); name the skin's by the"
            f' name of its <visual>, as in  surface = "FILE.urdf#{link.get("name")}/NAME"'
        )
    return meshes[0]


def _without_mesh(parts: list[ElementTree.Element], where: str) -> str:
    """Return what is wrong with a link without a mesh, and how to make one of its primitive."""
    shapes = [shape for part in parts for shape in part.findall("geometry/*")]
    if not shapes:
        return "it has no mesh; give it a <visual> with the mesh that the skin covers"
    shape = shapes[0]
    if shape.tag == "cylinder":
        radius, length = _millimetres(shape, "radius", where), _millimetres(shape, "length", where)
        make = f"make tube --radius-mm {radius:g} --length-mm {length:g} -o skin.obj"
        what = "its side, with an opening for the rim"
    elif shape.tag == "sphere":
        make = f"make dome --radius-mm {_millimetres(shape, 'radius', where):g} -o skin.obj"
        what = "half of it"
    elif shape.tag == "box":
        return (
            "its geometry is a box, whose faces are flat: describe a flat skin, without surface,"
            " and place it in the link by xyz_m and rpy_rad of a robot file"
        )
    else:
        return f"its geometry is a {shape.tag}, not a mesh; give it a <visual> with a mesh"
    return (
        f"its geometry is a {shape.tag}, which has no rim;  eitskin surface {make}  writes {what};"
        ' add a <visual name="skin"> with the same <origin> and <mesh filename="skin.obj"'
        ' scale="0.001 0.001 0.001"/>'
    )


def _millimetres(shape: ElementTree.Element, name: str, where: str) -> float:
    """Return an attribute in metres of a primitive, in mm."""
    text = attribute(shape, name, where)
    try:
        return 1e3 * plain_number(text)
    except ValueError:
        raise ConfigError(f"{where}: its {shape.tag} has {name}={text!r}; write a number") from None


def _file(name: str, folder: Path, where: str) -> Path:
    """Return the path of a mesh as a URDF in ``folder`` names it."""
    scheme, marked, rest = name.partition("://")
    if not marked:
        return folder / name
    package, _, inner = rest.partition("/")
    if scheme == "package" and package:
        return _in_package(package, inner, folder, where)
    if scheme == "file" and rest.startswith("/"):
        return Path(unquote(re.sub(r"^/(?=[A-Za-z]:)", "", rest)))
    raise ConfigError(
        f"{where}: its mesh {name!r} cannot be found by this name; write package://PACKAGE/FILE,"
        " file:///FILE, or the name relative to the URDF"
    )


def _in_package(name: str, inner: str, folder: Path, where: str) -> Path:
    """Return the path of the file ``inner`` of a ROS package; of several packages, in the first
    that has the file."""
    places = [place for place in _places(name, folder) if place.is_dir()]
    if not places:
        raise FileError(
            f"{where}: the package {name!r} of its mesh was not found in the folders above the"
            f" URDF, {ROS2_PATH} or {ROS1_PATH}; set one of these, or write the mesh's name"
            " relative to the URDF"
        )
    files = [place / inner for place in places]
    return next((file for file in files if file.is_file()), files[0])


def _places(name: str, folder: Path) -> Iterator[Path]:
    """Yield the folders that may be the package ``name``: those around the URDF's, then those that
    ROS 2 and ROS 1 search."""
    for above in (folder.resolve(), *folder.resolve().parents):
        if above.name == name:
            yield above
        yield above / name
    for prefix in _paths(ROS2_PATH):
        yield prefix / "share" / name
    for path in _paths(ROS1_PATH):
        if path.name == name:
            yield path
        yield path / name


def _paths(variable: str) -> list[Path]:
    return [Path(one) for one in os.environ.get(variable, "").split(os.pathsep) if one]
