"""``eitskin surface make | show``: meshes of example surfaces, and what a skin on a surface is."""

import argparse
from pathlib import Path

from eitskin.cli.arguments import Output, option
from eitskin.cli.printing import answer
from eitskin.fileio import refuse_unwritable
from eitskin.skin.skin import Skin, load_skin
from eitskin.surface.shapes import MEASURES, SHAPES, make_shape, write_obj

WIDE = 3.0  # a scale above which the answer warns


def add_options(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    make = actions.add_parser(
        "make",
        help="write the mesh of an example surface",
        description="Write an OBJ file, in mm: "
        + "; ".join(f"{name}, {shape.what}" for name, shape in SHAPES.items())
        + ". A tube and a dome have measures, such as those of a URDF's <cylinder> or <sphere>.",
    )
    option(make, "shape", None, choices=tuple(SHAPES))
    option(make, "--radius-mm MM", "radius of a tube or dome (default: 40)", float)
    option(make, "--length-mm MM", "length of a tube (default: 200)", float)
    option(
        make,
        "--angle-deg DEG",
        "angle that a tube or dome covers, as seen from its axis or its middle (default: 300 for a"
        " tube; 180 for a dome, half a ball)",
        float,
    )
    option(make, "--triangles", "about how many", default=4000, within=(50, 2_000_000))
    option(make, "-o --output MESH.obj", "file to write", Output, required=True)
    option(make, "--json")
    make.set_defaults(run=run_make)
    show = actions.add_parser(
        "show",
        help="check a skin on a surface: size, electrodes, and how its flattened copy differs",
        description=(
            "Read a skin description with a surface, flatten it, and print its size, the scale of"
            " the flattened copy, and where the copy is not conformal; --picture draws both."
        ),
    )
    option(show, "skin SKIN.toml", "skin description", Path)
    option(show, "--picture FILE.png", "draw the surface and its flattened copy", Output)
    option(show, "--json")
    show.set_defaults(run=run_show, extras=("model", "surface"))


def run_make(options: argparse.Namespace) -> int:
    given = {name: getattr(options, name) for name in MEASURES}
    measures = {name: value for name, value in given.items() if value is not None}
    points, triangles = make_shape(options.shape, options.triangles, **measures)
    write_obj(options.output, points, triangles)
    facts = {
        "written": str(options.output),
        "vertices": len(points),
        "triangles": len(triangles),
    }
    text = (
        f"{options.output}: {SHAPES[options.shape].what}, {len(points)} vertices and"
        f" {len(triangles)} triangles"
    )
    return answer(options, facts, text)


def run_show(options: argparse.Namespace) -> int:
    refuse_unwritable(options.picture)
    skin, _ = load_skin(options.skin)
    facts = surface_facts(skin)
    if options.picture is not None:
        from eitskin.view.surface_picture import draw_surface

        draw_surface(options.picture, skin)
    return answer(options, facts, surface_text(skin))


def surface_facts(skin: Skin) -> dict[str, object]:
    """The numbers of ``surface show``; all empty for a flat skin."""
    surface = skin.surface
    if surface is None:
        return {"skin": skin.name, "surface": None}
    low, high = surface.scale_range
    return {
        "skin": skin.name,
        "link": surface.link,
        "vertices": len(surface.points_mm),
        "triangles": len(surface.triangles),
        "simplified_from": surface.simplified_from,
        "area_mm2": surface.area_mm2,
        "rim_mm": skin.outline.perimeter_mm,
        "electrodes": skin.electrodes.count,
        "scale_min": low,
        "scale_max": high,
        "angle_error": surface.angle_error,
    }


def surface_text(skin: Skin) -> str:
    """The same in words."""
    surface = skin.surface
    if surface is None:
        return f"skin {skin.name!r} is flat; [skin] surface = a mesh file makes it a surface"
    low, high = surface.scale_range
    lines = [
        f"skin {skin.name!r} on a surface of {surface.area_mm2 / 100:.4g} cm2, rim"
        f" {skin.outline.perimeter_mm:.4g} mm, {skin.electrodes.count} electrodes",
        f"  mesh: {len(surface.triangles)} triangles"
        + (
            f", simplified from {surface.simplified_from}; make it coarser yourself if its shape"
            " matters"
            if surface.simplified_from
            else ""
        ),
        f"  flattened copy: 1 mm stands for {low:.3g} to {high:.3g} mm; it stretches one"
        f" direction by up to {surface.angle_error:.3f} times the other (1: conformal)",
    ]
    if high > WIDE:
        lines.append(
            f"  where 1 mm stands for {high:.3g} mm, places are {high:.3g} times less precise than"
            " at the rim; bring electrodes nearer, or divide the skin"
        )
    return "\n".join(lines)
