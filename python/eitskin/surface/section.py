"""The section SURF of an .eitm file: the map between a surface and its flattened copy."""

import struct
from typing import NoReturn

import numpy as np

from eitskin.errors import ModelError
from eitskin.surface.surface_map import SurfaceMap

HEAD = struct.Struct("<IIII")
MAX_COUNT, MAX_LINK_BYTES, MAX_MM = 65535, 255, 1e6


def encode_surface(surface: SurfaceMap) -> bytes:
    """Return the bytes of section SURF.

    Raises:
        ModelError: the surface has too many vertices or triangles, or its link's name is too long.
    """
    link = surface.link.encode()
    if max(len(surface.points_mm), len(surface.triangles)) > MAX_COUNT:
        raise ModelError(f"model: a surface has at most {MAX_COUNT} vertices and triangles")
    if len(link) > MAX_LINK_BYTES:
        raise ModelError(f"model: the link's name has more than {MAX_LINK_BYTES} bytes; shorten it")
    head = HEAD.pack(len(surface.points_mm), len(surface.triangles), len(link), 0)
    vertices = np.column_stack([surface.flat_mm, surface.points_mm])
    return (
        head + vertices.astype("<f4").tobytes() + surface.triangles.astype("<u2").tobytes() + link
    )


def decode_surface(content: bytes, where: str) -> SurfaceMap:
    """Return the map that section SURF holds.

    Raises:
        ModelError: the length does not fit the counts, a number is out of range, or a triangle of
            the copy is not counterclockwise.
    """
    if len(content) < HEAD.size:
        _refuse(where, "of a size that does not fit its counts")
    vertices, triangles, link, _ = HEAD.unpack_from(content)
    middle = HEAD.size + 20 * vertices
    end = middle + 6 * triangles
    if (
        not 3 <= vertices <= MAX_COUNT
        or not 1 <= triangles <= MAX_COUNT
        or link > MAX_LINK_BYTES
        or len(content) != end + link
    ):
        _refuse(where, "of a size that does not fit its counts")
    numbers = np.frombuffer(content[HEAD.size : middle], dtype="<f4").reshape(vertices, 5)
    corners = np.frombuffer(content[middle:end], dtype="<u2").reshape(triangles, 3).astype(np.int64)
    if not (np.abs(numbers) <= MAX_MM).all() or corners.max() >= vertices:
        _refuse(where, "with a number that is out of range")
    if len(np.unique(corners)) != vertices:
        _refuse(where, "with a vertex of no triangle")
    places = numbers.astype(np.float64)
    u, v = (places[corners[:, k], :2] - places[corners[:, 0], :2] for k in (1, 2))
    if (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).min() <= 0:
        _refuse(where, "with a triangle that is not counterclockwise")
    try:
        name = content[end:].decode("utf-8")
    except UnicodeDecodeError:
        _refuse(where, "with a link's name that is not UTF-8")
    return SurfaceMap(places[:, :2].copy(), places[:, 2:].copy(), corners, name)


def _refuse(where: str, what: str) -> NoReturn:
    raise ModelError(f"{where}: holds section 'SURF' {what}; build the model again")
