"""``eitskin compare``: reconstructions side by side on the same simulated scenes."""

import argparse
import json
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eitskin.cli.arguments import Output, option
from eitskin.cli.progress import named_bar
from eitskin.errors import FileError, UsageError

if TYPE_CHECKING:
    from eitskin.skin.protocol import Protocol
    from eitskin.skin.skin import Skin
    from eitskin_studies.compare.run import CompareSettings


def add_parser(subparsers: Any) -> None:
    """Add ``compare``."""
    parser = subparsers.add_parser(
        "compare",
        help="compare reconstructions on the same simulated scenes",
        description=(
            "Draw random touches, simulate their frames on a fine mesh, reconstruct them with every"
            " method, and print how well each shows and counts the touches. Parameters and"
            " thresholds are fixed on training scenes."
        ),
    )
    option(parser, "--skin TOML", "skin description (default: the paper's 194 mm disk)", Path)
    option(parser, "--scenes N", "test scenes", default=180)
    option(parser, "--train N", "training scenes", default=60)
    option(parser, "--seed S", "seed of all that is random", default=1)
    option(parser, "--snr-db DB", "20 log10(rms(V0)/sigma)", default=60.0)
    option(
        parser,
        "--lookup",
        "what a cell of MIoU's raster shows: the nearest pixel, or one interpolated (default:"
        " bilinear)",
        choices=("nearest", "bilinear"),
    )
    option(
        parser,
        "--shape",
        "shape of all touches; ellipses and fingers have axes of 1.4 to 2.2",
        choices=("disc", "ellipse", "hertz", "gauss", "finger"),
        default="disc",
    )
    option(
        parser,
        "--methods WORDS",
        "only methods with one of these words in their names, such as eitskin,noser",
    )
    option(
        parser,
        "--learned FOLDER",
        "also a small network that is trained on this dataset (eitskin dataset; needs"
        " scikit-learn)",
        Path,
    )
    option(
        parser,
        "--give FRAMES.mat",
        "write the frames for a program of your own (.mat or .npz), and end",
        Output,
    )
    option(
        parser,
        "--images FILES",
        "also the images that your programs made of these frames, such as mine.mat,other.npz",
    )
    option(parser, "--threads N", "threads for the C core's frames", default=1)
    option(parser, "--json", "print JSON, with the curves over the threshold")
    option(parser, "--csv FILE", "write the numbers of every scene", Output)
    option(parser, "--picture PNG", "draw test scenes as each method shows them", Output)
    option(parser, "--curves PNG", "draw MIoU over the threshold", Output)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Compare and print."""
    from eitskin.fileio import write_bytes
    from eitskin.scene.random_touches import TouchRules
    from eitskin.scene.simulate import Measurement
    from eitskin.scoring import metrics
    from eitskin.skin.protocol import adjacent
    from eitskin.skin.skin import load_skin, paper_skin
    from eitskin_studies.compare.methods import methods
    from eitskin_studies.compare.run import CompareSettings, compare
    from eitskin_studies.compare.table import to_csv, to_json, to_text

    _check(options)
    images = [Path(name.strip()) for name in (options.images or "").split(",") if name.strip()]
    skin, protocol = (
        (paper_skin(), adjacent(16)) if options.skin is None else load_skin(options.skin)
    )
    settings = CompareSettings(
        scenes=options.scenes,
        train_scenes=options.train,
        seed=options.seed,
        measurement=Measurement(snr_db=options.snr_db),
        rules=TouchRules(
            shape=options.shape,
            aspect=(1.4, 2.2) if options.shape in ("ellipse", "finger") else None,
        ),
        lookup=options.lookup or metrics.LOOKUP,
    )
    if options.give is not None:
        return _give(options.give, skin, protocol, settings)
    comparison = compare(
        skin,
        protocol,
        settings,
        families=partial(methods, threads=options.threads, dataset=options.learned, images=images),
        only=[word.strip() for word in (options.methods or "").split(",") if word.strip()],
        progress=named_bar,
    )
    if options.csv is not None:
        write_bytes(options.csv, to_csv(comparison).encode("utf-8"))
    if options.picture is not None or options.curves is not None:
        from eitskin_studies.pictures import comparison_pictures

        if options.picture is not None:
            comparison_pictures.draw_scenes(options.picture, comparison)
        if options.curves is not None:
            comparison_pictures.draw_curves(options.curves, comparison)
    print(json.dumps(to_json(comparison), indent=2) if options.json else to_text(comparison))
    return 0


def _give(path: Path, skin: "Skin", protocol: "Protocol", settings: "CompareSettings") -> int:
    """Simulate, and write the frames."""
    from eitskin_studies.compare.families import setup_for
    from eitskin_studies.compare.run import simulated_scenes
    from eitskin_studies.datasets.exchange import give_frames

    setup = setup_for(skin, protocol, elements=settings.elements)
    scenes = simulated_scenes(skin, protocol, settings, named_bar)
    count = give_frames(path, setup, scenes.train, scenes.test, scenes.targets)
    print(
        f"{path}: dv of {count} frames of {protocol.n_rows} rows, J of {setup.grid.n_pixels}"
        f" pixels; save dv with images ({count}, {setup.grid.n_pixels}) in a file, and give it to "
        " eitskin compare --images FILE  with the same options"
    )
    return 0


def _check(options: argparse.Namespace) -> None:
    """Reject before the work what would fail after it."""
    from eitskin.solve.batch import check_threads
    from eitskin_studies.datasets.exchange import check_suffix

    if not -20 <= options.snr_db <= 200:
        raise UsageError(f"--snr-db {options.snr_db:g} is out of range; use -20 to 200")
    check_threads(options.threads)
    if options.give is not None:
        check_suffix(options.give)
        if options.images is not None:
            raise UsageError("--give writes frames and ends; give --images to a later run")
    if options.learned is not None and not options.learned.is_dir():
        raise FileError(f"--learned {options.learned}: no such folder; run  eitskin dataset")
    if options.seed < 0:
        raise UsageError(f"--seed {options.seed} must be 0 or above")
    for path in (options.csv, options.picture, options.curves, options.give):
        if path is not None and not path.parent.is_dir():
            raise FileError(f"{path}: the folder {path.parent} does not exist; make it first")
    if options.picture is not None or options.curves is not None:
        from eitskin.view.panels import check_picture

        check_picture(options.picture)
        check_picture(options.curves)
