"""``eitskin scene run | plan | picture | list | effects``: simulated sessions."""

import argparse

from eitskin.cli.arguments import SCENE_HELP, Output, option
from eitskin.cli.printing import answer
from eitskin.cli.progress import bar
from eitskin.fileio import refuse_unwritable
from eitskin.frames.frames import save_frames
from eitskin.scene.library_scenes import descriptions, find_scene
from eitskin.view.panels import check_picture
from eitskin.view.scene_pictures import draw_scene


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "A scene file describes what happens on a skin, and with which imperfections it is"
        " measured (docs/guide/scenes.md)."
    )
    what = parser.add_subparsers(dest="what", required=True, metavar="WHAT")
    one = what.add_parser("run", help="simulate a scene, and write frames with their truth")
    option(one, "scene SCENE", SCENE_HELP)
    option(one, "-o --output FRAMES", "frames file to write (.npz)", Output, required=True)
    pixels = "pixels of mask and conductivity, 0 for none (default: %(default)s)"
    option(one, "--truth-pixels N", pixels, default=64)
    option(one, "--json")
    one.set_defaults(run=run_scene, extras=("model",))
    plan = what.add_parser(
        "plan", help="show what a scene will compute, step by step, and the cost"
    )
    option(plan, "scene SCENE", SCENE_HELP)
    option(plan, "--json")
    plan.set_defaults(run=run_plan)
    picture = what.add_parser(
        "picture", help="draw a scene: touches on the skin, voltages over time"
    )
    option(picture, "scene SCENE", SCENE_HELP)
    option(picture, "-o --output FILE", None, Output, required=True)
    picture.set_defaults(run=run_picture, extras=("model", "plot"))
    names = what.add_parser("list", help="list the scenes that ship with the package")
    option(names, "--json")
    names.set_defaults(run=run_list)
    effects = what.add_parser(
        "effects", help="list the effects that a scene can name, or the parameters of one"
    )
    option(
        effects,
        "name NAME",
        "the effect whose parameters are listed (default: list all effects)",
        nargs="?",
    )
    option(effects, "--json")
    effects.set_defaults(run=run_effects)


def run_scene(options: argparse.Namespace) -> int:
    from eitskin.scene.compiler import compile_scene
    from eitskin.scene.runner import run

    refuse_unwritable(options.output)
    scene = find_scene(options.scene)
    frames = run(compile_scene(scene), truth_pixels=options.truth_pixels, progress=bar("solving"))
    save_frames(options.output, frames)
    counters = frames.meta["counters"]
    facts = {"scene": scene.name, "frames": scene.frames, "quiet_frames": scene.quiet_frames}
    more = {"effects": list(scene.effects), "counters": counters, "output": str(options.output)}
    return answer(
        options,
        facts | more,
        f"{scene.name}: {scene.frames} frames after {scene.quiet_frames} untouched ones ->"
        f" {options.output}",
        f"effects: {', '.join(scene.effects) or 'none'}",
        ", ".join(f"{value} {name.replace('_', ' ')}" for name, value in counters.items() if value),
    )


def run_plan(options: argparse.Namespace) -> int:
    from eitskin.scene.compiler import compile_scene

    plan = compile_scene(find_scene(options.scene)).plan
    return answer(options, plan.as_dict(), plan.text())


def run_picture(options: argparse.Namespace) -> int:
    from eitskin.scene.compiler import compile_scene
    from eitskin.scene.runner import run

    refuse_unwritable(options.output)
    check_picture(options.output)
    scene = find_scene(options.scene)
    frames = run(compile_scene(scene), truth_pixels=0, progress=bar("solving"))
    draw_scene(options.output, scene, frames)
    print(f"picture: {options.output}")
    return 0


def run_list(options: argparse.Namespace) -> int:
    found = descriptions()
    return answer(options, found, *(f"{name:<16} {line}" for name, line in found.items()))


def run_effects(options: argparse.Namespace) -> int:
    """Print the effects without importing them, or one effect with its parameters."""
    from eitskin.scene.registry import Registry, describe_parameters, summary_of
    from eitskin.scene.runner import plain

    registry = Registry()
    if options.name is None:
        rows = {name: summary_of(target) for name, target in registry.names().items()}
        return answer(options, rows, *(f"{name:<18} {line}" for name, line in rows.items()))
    module = registry.load(options.name, "eitskin scene effects")
    parameters = plain(describe_parameters(module))
    facts = {"name": module.NAME, "stage": module.STAGE.name.lower(), "summary": module.SUMMARY}
    lines = [f"[effects.{module.NAME}]   {module.SUMMARY}   (stage: {facts['stage']})"]
    for one in parameters:
        allowed = ""
        if "choices" in one:
            allowed = f"one of {', '.join(one['choices'])}"
        elif "low" in one or "high" in one:
            allowed = f"[{one.get('low', '')} .. {one.get('high', '')}]"
        unit, doc = one.get("unit", ""), one.get("doc", "")
        line = f"  {one['name']:<24} {one['default']!s:<12} {unit:<8} {allowed:<18} {doc}"
        lines.append(line.rstrip())
    return answer(options, facts | {"parameters": parameters}, *lines)
