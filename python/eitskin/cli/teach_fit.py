"""``eitskin teach fit PRESSES -o MODEL``: fit a model to presses, and report its errors."""

import argparse
from pathlib import Path
from typing import Any

from eitskin.cli.arguments import Output, option
from eitskin.cli.printing import answer
from eitskin.cli.progress import named_bar
from eitskin.config import parse_toml
from eitskin.errors import ConfigError, FrameError
from eitskin.fileio import refuse_unwritable
from eitskin.model.eitm import save_model
from eitskin.skin.skin import Skin, load_skin, skin_from_table
from eitskin.teaching.presses import Presses, load_presses
from eitskin.teaching.teach import teach
from eitskin.view.panels import check_picture
from eitskin.view.taught_picture import draw_taught

NEXT = "{}: tare before use; eitskin model upload sends it to a board"


def add_parser(actions: Any) -> None:
    parser = actions.add_parser("fit", help="fit a model to presses, and report its errors")
    option(parser, "presses PRESSES.npz", "from  eitskin teach record", Path)
    option(parser, "-o --output MODEL.eitm", None, Output, required=True)
    option(parser, "--skin SKIN.toml", "default: the description in the presses' file", Path)
    option(
        parser,
        "--place-sd MM",
        "standard deviation per axis of places given by hand; the fit then refines them",
        default=0.0,
    )
    option(
        parser,
        "--reference-age PRESSES",
        "how old a reference will be, in presses; this much drift counts as noise",
        default=0,
    )
    option(parser, "--picture OUT.png", "draw presses with their predictions, and the rows", Output)
    option(parser, "--json")
    parser.set_defaults(run=run, extras=("model",))


def run(options: argparse.Namespace) -> int:
    refuse_unwritable(options.output, options.picture)
    if options.picture is not None:
        check_picture(options.picture)
    presses = load_presses(options.presses)
    skin = described_skin(presses, options.skin)

    try:
        taught = teach(
            presses,
            skin,
            place_sd_mm=options.place_sd,
            reference_age=options.reference_age,
            progress=named_bar,
        )
    except FrameError as error:
        raise FrameError(f"{options.presses}: {error}") from None
    if options.picture is not None:
        draw_taught(options.picture, taught)
    save_model(options.output, taught.model)
    facts = {"output": str(options.output), **taught.report}
    return answer(options, facts, *report_lines(taught.report), NEXT.format(options.output))


def described_skin(presses: Presses, path: Path | None) -> Skin | None:
    """Return the skin in the file ``path``, otherwise that of the presses' own description,
    otherwise None. The presses' own table of rows counts, whatever protocol the description has."""
    if path is not None:
        return load_skin(path)[0]
    if not presses.skin:
        return None
    where = "the presses' own description"
    try:
        table = parse_toml(presses.skin, "skin", where)
    except ConfigError as error:
        raise ConfigError(f"{error}; give --skin") from None
    return skin_from_table(table, where)


def report_lines(report: dict[str, Any]) -> list[str]:
    """Return the report as lines for people."""
    error, place = report["error_mm"], report["placement"]
    curve, age = report["held_out_by_presses"], report["reference_age"]
    lines = [
        f"presses          {report['presses']}, {report['fit_s']:g} s",
        f"error            left out {error['left_out_median']:.1f} mm median,"
        f" {error['left_out_p95']:.1f} mm p95;"
        f" by the core for held-out presses {error['held_out_median']:.1f},"
        f" {error['held_out_p95']:.1f}" + (f", with a reference {age} presses old" if age else ""),
        f"found as one     {100 * report['counted_as_one']:.0f} % of held-out presses, if each"
        f" touch must explain {100 * report['least_share']:g} % of the data's energy",
        f"noise            {100 * report['noise']['of_a_press']:.0f} % of a press",
        "more presses     "
        + ", ".join(
            f"{name.split('_')[1]}: {value:.1f} mm"
            + (" (expected)" if name.startswith("expected") else "")
            for name, value in curve.items()
        ),
        "90 % ellipse     "
        + (
            "unknown: too few presses"
            if report["ellipse_factor"] is None
            else f"the covariance of the fit times {report['ellipse_factor']:.3g}"
        ),
        f"skin             {place['text']}",
        "useless rows     " + (", ".join(map(str, report["silent_rows"][:20])) or "none"),
    ]
    return lines + [f"note             {note}" for note in report["notes"]]
