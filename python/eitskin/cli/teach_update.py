"""``eitskin teach update MODEL PRESSES -o NEW``: adapt a taught model after remounting or
drying."""

import argparse
from pathlib import Path
from typing import Any

from eitskin.cli.arguments import Output, option
from eitskin.cli.printing import answer
from eitskin.cli.progress import named_bar
from eitskin.cli.teach_fit import NEXT
from eitskin.errors import FrameError
from eitskin.fileio import refuse_unwritable
from eitskin.model.eitm import load_model, save_model
from eitskin.teaching.presses import load_presses
from eitskin.teaching.update import update


def add_parser(actions: Any) -> None:
    parser = actions.add_parser(
        "update",
        help="adapt a taught model with a few new presses",
        description=(
            "Adapt a taught model after the skin was remounted, turned or has dried, with 5 to 20"
            " new presses in the coordinates that touches shall have. Everything else comes from"
            " the model. It is moved only, fully adapted, or kept, whichever is significantly the"
            " best on held-out presses; the report states which."
        ),
    )
    option(parser, "model MODEL.eitm", "from  eitskin teach fit  or  update", Path)
    option(parser, "presses PRESSES.npz", "new presses, from  eitskin teach record", Path)
    option(parser, "-o --output NEW.eitm", None, Output, required=True)
    option(parser, "--json")
    parser.set_defaults(run=run, extras=("model",))


def run(options: argparse.Namespace) -> int:
    refuse_unwritable(options.output)
    model, _ = load_model(options.model)
    presses = load_presses(options.presses)

    try:
        updated = update(model, presses, where=str(options.model), progress=named_bar)
    except FrameError as error:
        raise FrameError(f"{options.presses}: {error}") from None
    save_model(options.output, updated.model)
    facts = {"output": str(options.output), **updated.report}
    return answer(options, facts, *report_lines(updated.report), NEXT.format(options.output))


CHOSEN = {
    "kept": "kept as it was: these presses do not improve it significantly",
    "moved": "moved: new places, old responses",
    "full": "fully adapted: places, gains and responses",
}


def report_lines(report: dict[str, Any]) -> list[str]:
    """Return the report as lines for people."""
    found = report["update"]
    lines = [
        f"presses          {found['presses']} new",
        f"chosen           {CHOSEN[found['chosen']]}",
        "held out         "
        + ", ".join(f"{how} {error:.1f} mm" for how, error in found["held_out_mm"].items())
        + f" median; {report['error_mm']['held_out_p95']:.1f} mm p95 of the chosen model",
    ]
    if found["chosen"] != "kept":
        x, y = found["shift_mm"]
        turned = f"turned by {found['turn_deg']:.1f} degrees" if found["turn_deg"] else "not turned"
        lines.append(
            f"skin             the new places, {turned} and shifted by ({x:.1f}, {y:.1f}) mm, are"
            " the old ones"
        )
    return lines + [f"note             {note}" for note in report["notes"]]
