"""The options of ``import`` and ``doctor`` that describe the frames of another instrument."""

import argparse
import os
import shlex
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from eitskin.cli.arguments import Output, option
from eitskin.errors import UsageError
from eitskin.frames.import_options import ImportOptions
from eitskin.frames.importer import accepted_counts
from eitskin.frames.layout import Layout, layout_of, load_layout, save_layout
from eitskin.frames.source import SourceOptions, read_source
from eitskin.frames.truth import TruthOptions
from eitskin.skin.protocol import PATTERNS_HELP, Protocol, pattern
from eitskin.skin.skin import Skin, load_skin

PAIRS = ("real-imag", "magnitude-degrees", "magnitude-radians")
ORDERS = ("fixed", "rotating", "fixed-all", "rotating-all", "table")


def add_import_options(parser: argparse.ArgumentParser) -> None:
    """Add all of them to ``parser``; the defaults change nothing."""
    known = parser.add_argument_group("layout: all of these options in a file")
    option(known, "--layout FILE", "read a layout (TOML); other options override it", Path)
    option(known, "--save-layout FILE", "write a layout, for import and text: boards", Output)
    _add_protocol(parser.add_argument_group("protocol: the order of the result"))
    _add_place(parser.add_argument_group("place of the frames in the source"))
    _add_repairs(parser.add_argument_group("differences of the source, and repairs"))
    _add_truth(parser.add_argument_group("truth in an NPZ or MAT source"))


def read_protocol(options: argparse.Namespace) -> tuple[Protocol | None, Skin | None, int | None]:
    """Return the protocol of the result (None: the source's own table), the skin if one is given,
    and the number of electrodes.

    Raises:
        UsageError: options contradict each other.
        EitskinError: the skin file cannot be read.
    """
    skin, protocol = load_skin(options.skin) if options.skin is not None else (None, None)
    count = options.electrodes if skin is None else skin.electrodes.count
    if skin is not None and options.electrodes not in (None, count):
        raise UsageError(
            f"--electrodes {options.electrodes}: the skin {options.skin} has {count}; leave it out"
        )
    if options.skip is not None and options.protocol != "skip":
        raise UsageError("--skip goes with --protocol skip")
    if options.measure is not None and options.protocol in (None, "table"):
        raise UsageError("--measure goes with --protocol PATTERN")
    layout = read_layout(options)
    if layout is not None and layout.protocol is not None and options.protocol is None:
        if protocol is None:
            protocol, count = layout.protocol, layout.protocol.n_electrodes
        if count != layout.protocol.n_electrodes:
            raise UsageError(
                f"{options.layout} is for {layout.protocol.n_electrodes} electrodes, not {count};"
                " leave out --skin and --electrodes, or use another layout"
            )
    if options.protocol is None or options.protocol == "table":
        return protocol, skin, count
    if count is None:
        raise UsageError(f"--protocol {options.protocol} needs --electrodes N or --skin FILE")
    drive = options.protocol
    if drive == "skip":
        if options.skip is None:
            raise UsageError("--protocol skip needs --skip K; or name it --protocol skip-K")
        drive = f"skip-{options.skip}"
    return pattern(count, drive, options.measure), skin, count


def read_options(options: argparse.Namespace) -> ImportOptions:
    """Return the import options of a command line."""
    named = vars(options)
    # fields without an option (comments) keep their defaults
    given_source = {f.name: named[f.name] for f in fields(SourceOptions) if f.name in named}
    source = SourceOptions(**given_source)
    extent = options.truth_mask_extent
    truth = TruthOptions(
        touch_frame=options.truth_frame,
        touch_xy=options.truth_xy,
        touch_radius=options.truth_radius,
        touch_strength=options.truth_strength,
        touch_sign=options.truth_sign,
        touch_unit_mm=options.truth_unit_mm,
        mask=options.truth_mask,
        mask_extent_mm=None if extent is None else _four(extent),
        mask_top_first=options.truth_mask_top_first,
    )
    meaning = ("potentials", "differences", "relative_differences")
    same = ("order", "table_file", "sign", "rotate", "equalise", "current_a")
    own: dict[str, Any] = {name: named[name] for name in (*same, *meaning)}
    for name in ("flip_channels", "impute_channels", "drop_channels", "drop_electrodes"):
        own[name] = whole_numbers(named[name], f"--{name.replace('_', '-')}")
    given = ImportOptions(
        source=source,
        truth=truth,
        keep_table=options.protocol == "table",
        mirror=options.mirror,
        clockwise=options.clockwise,
        swaps=tuple(_pair(text) for text in options.swap),
        **own,
    )
    layout = read_layout(options)
    if layout is None:
        return given
    source = _over(layout.options.source, given.source)
    merged: ImportOptions = _over(layout.options, given)
    return replace(merged, source=source, truth=truth)


def read_layout(options: argparse.Namespace) -> Layout | None:
    """Return the layout that ``--layout`` names, or None."""
    if options.layout is None:
        return None
    layout = load_layout(options.layout)
    source = layout.options.source
    if source.reference_file is not None:
        source = replace(source, reference_file=str(options.layout.parent / source.reference_file))
    return replace(layout, options=replace(layout.options, source=source))


def write_layout(
    path: Path, sources: list[Path], named: ImportOptions, protocol: Protocol | None
) -> None:
    """Write a layout that reads ``sources`` as the options ``named`` do."""
    raw = read_source(sources, named.source, *accepted_counts(named, protocol))
    reference = named.source.reference_file
    if reference is not None:  # a layout names files from its own folder on
        source = replace(
            named.source, reference_file=os.path.relpath(reference, path.resolve().parent)
        )
        named = replace(named, source=source)
    save_layout(path, layout_of(raw, named, protocol, str(sources[0])))


def import_command(options: argparse.Namespace, repair: str) -> str:
    """Return the command that imports the sources of ``options`` with these options and with those
    in ``repair``, to be pasted into a shell."""
    parser = argparse.ArgumentParser(add_help=False)
    add_import_options(parser)
    repairing = shlex.split(repair)
    again = {word for word in repairing if word.startswith("--")}
    sources = [str(one) for one in options.source]
    out = "frames.npz" if "frames.npz" not in sources else "repaired.npz"
    words = ["eitskin", "import", *sources, "-o", out]
    for action in parser._actions:
        value, name = getattr(options, action.dest), action.option_strings[-1]
        if value == action.default or name in (*again, "--save-layout"):
            continue
        for one in value if isinstance(value, list) else [value]:
            words += [name] if action.nargs == 0 else [name, f"{one}"]
    return shlex.join([*words, *repairing])


def _over(base: Any, given: Any) -> Any:
    """Return ``base`` with those values of ``given`` that differ from their defaults."""
    default = type(given)()
    pairs = ((f.name, getattr(given, f.name)) for f in fields(given))
    named = {name: value for name, value in pairs if value != getattr(default, name)}
    return replace(base, **named)


def whole_numbers(text: str | None, option: str) -> tuple[int, ...]:
    """Return the integers in a text such as "3,17,20:24" (a range excludes its end); empty for
    None."""
    numbers: list[int] = []
    for part in () if text is None else text.split(","):
        first, colon, last = part.partition(":")
        try:
            start = int(first)
            numbers.extend(range(start, int(last)) if colon else [start])
        except ValueError:
            raise UsageError(f"{option} {text}: {part!r} is not an integer or range a:b") from None
    return tuple(dict.fromkeys(numbers))


def floats(text: str, option: str) -> tuple[float, ...]:
    """Return the numbers in a text such as "1.5,-2"."""
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = (float("nan"),)
    if not all(abs(value) < float("inf") for value in values):
        raise UsageError(f"{option} {text}: must be numbers separated by commas")
    return values


def _pair(text: str) -> tuple[int, int]:
    numbers = whole_numbers(text, "--swap")
    if len(numbers) != 2:
        raise UsageError(f"--swap {text}: name two electrodes, as in --swap 3,9")
    return numbers[0], numbers[1]


def _four(text: str) -> tuple[float, float, float, float]:
    values = floats(text, "--truth-mask-extent")
    if len(values) != 4:
        raise UsageError(f"--truth-mask-extent {text}: must be XMIN,YMIN,XMAX,YMAX in mm")
    return values[0], values[1], values[2], values[3]


def _add_protocol(group: Any) -> None:
    option(group, "--skin FILE", "skin description (TOML) with its protocol", Path)
    option(
        group,
        "--protocol PATTERN",
        f"pattern of the pairs: {PATTERNS_HELP}; or table: keep the source's own table",
    )
    option(
        group,
        "--measure PATTERN",
        "pairs that measure (default: as they drive; adjacent if those are opposite)",
    )
    option(group, "--skip K", "electrodes to skip, with --protocol skip", int)
    option(group, "--electrodes N", "number of electrodes, if no skin is given", int)
    option(group, "--current-a A", "drive current in A (default: the protocol's)", float)


def _add_place(group: Any) -> None:
    option(group, "--voltage KEY", "NPZ, MAT: array of the frames")
    option(group, "--reference KEY", "NPZ, MAT: array of the untouched frame or frames")
    option(
        group, "--columns LIST", "text: columns of voltages, from 0: 2, 1:209, 0:416:2, or names"
    )
    option(group, "--reference-columns LIST", "text: columns of the untouched frames")
    option(group, "--reference-frames LIST", "numbers of the untouched frames, such as 0:20")
    option(
        group,
        "--reference-file FILE",
        "file, folder or pattern whose frames are all untouched; it may have another delimiter",
    )
    option(group, "--names KEY", "NPZ, MAT: array of the frames' names")
    option(group, "--time KEY", "array or column of the frames' times in s")
    option(group, "--time-scale FACTOR", "seconds per unit of the source's times", default=1.0)
    sides = ("auto", "rows", "columns")
    option(group, "--frames-in", "needed only if both fit", choices=sides, default="auto")
    parts = ("real", "imag", "abs", "in-phase")
    part = "part of complex numbers to keep; in text, of pairs of columns"
    option(group, "--complex-part", part, choices=parts)
    option(group, "--pairs", "meaning of pairs of columns (default: from header)", choices=PAIRS)
    option(
        group,
        "--offset NUMBER",
        "added to the source's numbers before --scale; a 12-bit converter with 0 V at mid-scale"
        " needs --offset -2048",
        default=0.0,
    )
    option(group, "--scale FACTOR", "volts per unit of the source's numbers; 1 for volts", float)
    option(
        group,
        "--delimiter WORD",
        "comma, semicolon, tab, bar, space, a character, or decimals:N (no delimiter; each number"
        " has N decimals); default: detected",
    )
    option(group, "--label WORD", "text: frames are the lines with this label (default: detected)")
    option(group, "--header-rows N", "rows before the numbers (default: detected)", int)
    option(group, "--skip-bad-lines", "leave out lines whose length differs from most")


def _add_repairs(group: Any) -> None:
    option(group, "--order", "order of the source's channels", choices=ORDERS, default="fixed")
    option(group, "--table-file FILE", "text table of the source's rows: I+, I-, V+, V- or ground")
    option(group, "--protocol-table KEY", "NPZ, MAT: array with that table")
    option(group, "--table-base N", "number of the first electrode in the table", default=0)
    option(
        group,
        "--potentials",
        "a channel is the potential of one electrode against ground; rows are their differences",
    )
    option(
        group,
        "--differences",
        "the reference was subtracted already; the skin's prediction takes its place",
    )
    option(group, "--relative-differences", "the same, and divided by the reference")
    signs = ("signed", "reversed", "magnitude")
    option(
        group,
        "--sign",
        "reversed: negate; magnitude: take signs from the homogeneous prediction",
        choices=signs,
        default="signed",
    )
    option(group, "--rotate K", "the source's first electrode is electrode K", default=0)
    turned = group.add_mutually_exclusive_group()
    option(turned, "--mirror", "the source numbers its electrodes in the other direction")
    text = "the source numbers clockwise; mirror it unless the skin does too"
    option(turned, "--clockwise", text)
    group.add_argument(
        "--swap",
        action="append",
        default=[],
        metavar="I,J",
        help="the wires of these electrodes are exchanged; can be repeated",
    )
    option(group, "--flip-channels LIST", "change the sign of these rows (numbers in our order)")
    option(group, "--impute-channels LIST", "fill these rows from their reciprocals")
    option(group, "--drop-channels LIST", "leave out these rows (the result is a table protocol)")
    option(group, "--drop-electrodes LIST", "leave out all rows of these electrodes")
    option(group, "--equalise", "give each row the gain of the homogeneous prediction")


def _add_truth(group: Any) -> None:
    option(group, "--truth-frame KEY", "touches: their frames, as numbers from 0 or names")
    option(group, "--truth-xy KEY", "touches: centres (t, 2)")
    option(group, "--truth-radius KEY", "touches: radii (t,)")
    option(group, "--truth-sign KEY", "touches: true or above 0 if more conductive")
    option(group, "--truth-strength KEY", "touches: relative conductivity change")
    option(group, "--truth-unit-mm MM", "mm per unit of centres and radii", default=1.0)
    option(group, "--truth-mask KEY", "masks (frames, rows, columns) of +1, -1, 0")
    option(group, "--truth-mask-extent X,Y,X,Y", "box of the masks in mm (default: the skin's)")
    option(group, "--truth-mask-top-first", "row 0 of a mask is the top, not the bottom")
