"""``eitskin model build | voltages | info | verify | upload``: commands for models."""

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from eitskin.cli.arguments import RING_OHM, Output, option
from eitskin.cli.device_options import DEVICE_HELP
from eitskin.cli.pattern_options import add_pattern, skin_and_protocol, with_pattern
from eitskin.cli.printing import answer, print_json, say
from eitskin.cli.progress import bar
from eitskin.core.engine import CoreEngine
from eitskin.core.results import force_text
from eitskin.device.open import open_device
from eitskin.errors import UsageError, VerificationError
from eitskin.fem.grid import grid_for
from eitskin.fileio import refuse_unwritable
from eitskin.frames.eidors import jacobian_on
from eitskin.frames.front_end import advice, demand_of
from eitskin.frames.homogeneous import resistor_ring, voltages_of
from eitskin.model.build import BuildSettings, build_model
from eitskin.model.eitm import load_model, save_model
from eitskin.model.model import Model
from eitskin.model.prebuilt import load_or_prebuilt
from eitskin.skin.eidors import read_eidors
from eitskin.skin.protocol import Protocol, independent_rows, pattern_name
from eitskin.skin.skin import Skin, skin_of_eidors
from eitskin.solve.reconstructor import ENGINES, Reconstructor

NUMPY_BOUND = 1e-4

MIN_PIXELS_ACROSS = 4  # of a skin's width, below which model build warns


def add_options(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    build = actions.add_parser("build", help="mesh a skin, reduce its Jacobian and store the model")
    option(
        build, "skin SKIN.toml", "skin description, or a .mat with an EIDORS model", Path, nargs="?"
    )
    option(build, "--paper", "use the paper's 194 mm disk instead of a file")
    add_pattern(build)
    option(build, "-o --output MODEL.eitm", None, Output, required=True)
    option(
        build,
        "--rank",
        "rows of the reduced Jacobian (default: 4 per electrode and at least 64, or all independent"
        " rows if fewer)",
        int,
    )
    option(build, "--pixels", "number of pixels along the longer side", default=32)
    option(build, "--storage", choices=("f32", "f16", "i16", "i8"), default="f32")
    option(
        build,
        "--data",
        "data that the solver uses: v - v0; (v - v0)/v0, for channels with different gains; or"
        " v0 log(v/v0)",
        choices=("difference", "normalised", "log-ratio"),
        default="difference",
    )
    option(build, "--elements", "approximate size of the mesh", default=3000, within=(100, 500_000))
    option(build, "--regularisation", "mu of the whitening", default=0.01)
    option(
        build,
        "--touch-change RATIO",
        "expected change of conductivity under a touch, relative to the skin's: 1.35 for contrasts"
        " 3 to 10, 2 for metal, 0 if unknown",
        default=1.35,
        within=(0, 100),
    )
    option(
        build,
        "--samples",
        "number of random skins drawn for the model errors, 0 for none (default: from"
        " [uncertainty] in SKIN.toml, or 500)",
        int,
    )
    option(build, "--json")
    build.set_defaults(run=run_build, extras=("model",))
    voltages = actions.add_parser(
        "voltages",
        help="predict the voltage of each row, and suitable current and gain",
        description=(
            "Print the voltage of each row for the untouched skin, or for a ring of equal resistors"
            " instead, and state whether the instrument's current and gain suit."
        ),
    )
    option(voltages, "skin SKIN.toml", "skin description", Path, nargs="?")
    option(voltages, "--paper", "use the paper's 194 mm disk instead of a file")
    add_pattern(voltages)
    option(
        voltages,
        "--resistor-ring OHM",
        "resistance between neighbours, if a ring of equal resistors replaces the skin",
        float,
        within=RING_OHM,
    )
    option(voltages, "--json")
    voltages.set_defaults(run=run_voltages)
    info = actions.add_parser("info", help="describe a model")
    option(info, "model MODEL.eitm", "default: the prebuilt one", Path, nargs="?")
    option(info, "--json")
    info.set_defaults(run=run_info)
    verify = actions.add_parser(
        "verify",
        help="run the golden frame with the C core in both widths, and with numpy",
    )
    option(verify, "model MODEL.eitm", "default: the prebuilt one", Path, nargs="?")
    option(verify, "--json")
    verify.set_defaults(run=run_verify)
    upload = actions.add_parser(
        "upload",
        help="put a model on a board",
        description=(
            "Put a model into the unused bank of a board's flash. The board verifies it and then"
            " switches banks; if the upload is interrupted at any byte, the board keeps its old"
            " model. The board forgets its reference."
        ),
    )
    option(upload, "model MODEL.eitm", None, Path)
    option(upload, "--device URL", DEVICE_HELP, default="auto")
    option(upload, "--json")
    upload.set_defaults(run=run_upload)


def run_build(options: argparse.Namespace) -> int:
    from eitskin.frames.homogeneous_fem import transfer_by_elements

    eidors = read_eidors(options.skin) if _is_eidors(options) else None
    if eidors is None:
        skin, protocol = _skin_of(options)
    else:
        skin, own = skin_of_eidors(eidors)
        protocol = with_pattern(options, own)
        if protocol.hash != own.hash:
            raise UsageError(
                "model build: an EIDORS model has its own Jacobian, for its own pattern; leave out"
                " --drive, --measure and --rows-of"
            )
    refuse_unwritable(options.output)
    settings = BuildSettings(
        rank=options.rank or 0,
        pixels_across=options.pixels,
        storage=options.storage,
        data_kind=options.data,
        regularisation=options.regularisation,
        elements=options.elements,
        touch_change_ratio=options.touch_change,
        samples=options.samples,
    )
    jacobian = None
    if eidors is not None:
        jacobian = jacobian_on(eidors, grid_for(skin.outline, options.pixels))
    model = build_model(skin, protocol, settings, progress=bar("random skins"), jacobian=jacobian)
    size = save_model(options.output, model)
    _print_info(model, size, str(options.output), options.json)
    if skin.surface is not None and skin.surface.simplified_from:
        say(
            f"{options.skin}: the surface of {skin.surface.simplified_from} triangles was"
            f" simplified to {len(skin.surface.triangles)}"
        )
    width_mm = 2 * skin.outline.area_mm2 / skin.outline.perimeter_mm
    if width_mm < MIN_PIXELS_ACROSS * model.grid.pixel_mm:
        say(
            f"{options.output}: a pixel of {model.grid.pixel_mm:.3g} mm is too coarse for a skin"
            f" about {width_mm:.3g} mm wide, so touches cannot be resolved across it; build it with"
            "  --pixels N , or divide the skin"
        )
    if not options.json:
        print("\n".join(advice(demand_of(transfer_by_elements(skin), protocol))))
    return 0


def _is_eidors(options: argparse.Namespace) -> bool:
    return not options.paper and options.skin is not None and options.skin.suffix.lower() == ".mat"


def _skin_of(options: argparse.Namespace) -> tuple[Skin, Protocol]:
    if (options.skin is None) == (not options.paper):
        raise UsageError(f"model {options.action}: give either a SKIN.toml or --paper")
    if options.skin is not None and options.skin.suffix.lower() == ".npz":
        raise UsageError(
            f"model {options.action}: {options.skin} has frames and no skin; name the skin,"
            f" SKIN.toml or --paper, and add  --rows-of {options.skin}  to measure their rows"
        )
    return skin_and_protocol(options, options.skin)


def run_voltages(options: argparse.Namespace) -> int:
    """Print the predicted voltage of each row."""
    from eitskin.frames.homogeneous_fem import transfer_by_elements

    skin, protocol = _skin_of(options)
    ring_ohm = options.resistor_ring
    if ring_ohm is None:
        transfer_ohm, of = transfer_by_elements(skin), f"skin {skin.name!r}"
    else:
        ring = resistor_ring(protocol.n_electrodes, ring_ohm)
        transfer_ohm, of = ring.transfer_ohm, ring.source
    rows = protocol.drive_measure.astype(int)
    volts = voltages_of(transfer_ohm, rows) * protocol.current_a
    if options.json:
        table = [[*row, volt] for row, volt in zip(rows.tolist(), volts.tolist(), strict=True)]
        facts = {"of": of, "current_a": protocol.current_a, "columns": "I+ I- V+ V- V"}
        print(json.dumps(facts | {"rows": table}, indent=None))
        return 0
    print(f"{of}, {protocol.current_a * 1e3:g} mA; electrodes count from 0")
    print("  row   I+  I-  V+  V-     volts")
    for k, (row, volt) in enumerate(zip(rows, volts, strict=True)):
        print(f"{k:5d} {row[0]:4d}{row[1]:4d}{row[2]:4d}{row[3]:4d} {volt:10.6f}")
    print("\n".join(advice(demand_of(transfer_ohm, protocol))))
    return 0


def run_info(options: argparse.Namespace) -> int:
    model, blob, name = load_or_prebuilt(options.model)
    _print_info(model, len(blob), name, options.json)
    return 0


def _print_info(model: Model, size: int, name: str, as_json: bool) -> None:
    facts: dict[str, Any] = {
        "model": name,
        "bytes": size,
        "made_by": model.meta.get("made_by", "unknown"),
        "skin": model.meta.get("skin", {}).get("skin", {}).get("name", "unknown"),
        "electrodes": model.protocol.n_electrodes,
        "pattern": pattern_name(model.protocol),
        "protocol_rows": model.protocol.n_rows,
        "protocol_hash": f"{model.protocol.hash:016x}",
        "folded_rows": len(model.fold.first),
        "independent_rows": independent_rows(model.protocol),
        "rank": model.rank,
        "pixels": model.grid.n_pixels,
        "pixel_mm": round(model.grid.pixel_mm, 4),
        "storage": model.stored.storage,
        "data": model.data_kind,
        "lipschitz": model.lipschitz,
        "mesh_elements": model.meta.get("mesh_elements"),
        "calibration": _calibration_text(model),
        "model_errors": _model_errors_text(model),
        "defaults": asdict(model.defaults),
    }
    if as_json:
        print_json(facts)
        return
    defaults = facts.pop("defaults")
    for key, value in facts.items():
        print(f"{key.replace('_', ' '):16} {value}")
    shown = (
        f"{key} {value if isinstance(value, str) else format(value, 'g')}"
        for key, value in defaults.items()
    )
    print("defaults         " + ", ".join(shown))


def _calibration_text(model: Model) -> str:
    if model.force_law is None:
        return "none; touches have no force"
    law = model.force_law
    return (
        f"up to {force_text(law.force_n[-1])}, 95 % within {100 * law.uncertainty:.1f} %, gain"
        f" of order {law.order}"
    )


def _model_errors_text(model: Model) -> str:
    errors = model.model_errors
    if errors is None:
        return "none"
    return (
        f"{100 * errors.rms_error:.1f} % rms from the skin, {100 * errors.rms_shape_error:.1f} %"
        " from shapes of touches"
        + ("" if errors.row_gains else "; without row gains from the tare")
    )


def run_verify(options: argparse.Namespace) -> int:
    """Run the golden frame. The float32 core must reproduce the stored bits."""
    model, blob, name = load_or_prebuilt(options.model)
    portable = CoreEngine(blob, "float32", prepared=False, portable=True)
    differences = {
        "C float32": CoreEngine(blob, "float32").self_test(),
        "C float32, portable": portable.self_test(),
        "C float64": CoreEngine(blob, "float64").self_test(),
    }
    by_numpy = _differences_to_numpy(model, blob)
    same_bits = differences["C float32"] == 0 and differences["C float32, portable"] == 0
    within = max(differences["C float64"], *by_numpy.values()) <= NUMPY_BOUND
    facts = {
        "model": name,
        "difference_to_golden_over_peak": differences,
        "difference_to_numpy_over_peak": by_numpy,
    }
    answer(
        options,
        facts | {"ok": same_bits and within},
        f"{name}: golden frame, greatest difference from the stored image over its peak",
        *(
            f"  {engine:20} {'the same bits' if difference == 0 else f'{difference:.2e}'}"
            for engine, difference in differences.items()
        ),
        "and to the image by numpy, both by FISTA on every column",
        *(f"  {engine:20} {difference:.2e}" for engine, difference in by_numpy.items()),
    )
    if not same_bits:
        raise VerificationError(
            f"{name}: the C core does not reproduce the bits of the golden image; build the model"
            " again with this version"
        )
    if not within:
        raise VerificationError(
            f"{name}: images of the golden frame differ by more than {NUMPY_BOUND:g} of the peak;"
            " report this"
        )
    return 0


def _differences_to_numpy(model: Model, blob: bytes) -> dict[str, float]:
    """Return the difference between the C core's image of the golden frame, in either width, and
    the oracle's, relative to the image's peak."""
    images = {}
    for engine in ENGINES:
        one = Reconstructor(model, engine=engine, blob=blob)
        one.set_options(solver="fista")
        one.tare(model.golden.reference_v)
        images[engine] = one.reconstruct(model.golden.frame_v, touches=False).solver_image
    peak = float(np.abs(images["numpy"]).max()) or 1.0
    return {
        name: float(np.abs(images[engine] - images["numpy"]).max()) / peak
        for engine, name in (("c", "C float32"), ("c64", "C float64"))
    }


def run_upload(options: argparse.Namespace) -> int:
    """Send the model, with a progress bar on stderr if that is a terminal."""
    _, blob = load_model(options.model)
    with open_device(options.device) as device:
        with tqdm(
            total=len(blob),
            desc="upload",
            unit="B",
            unit_scale=True,
            leave=False,
            disable=not sys.stderr.isatty(),
        ) as bar:

            def show(done: int, total: int) -> None:
                bar.update(done - bar.n)

            info = device.upload_model(blob, show)
        url = device.transport.url
    facts = {"device": url, "model": str(options.model), "bytes": len(blob)}
    return answer(
        options,
        facts | {"model_crc": f"{info.model_crc:08x}", "bank": info.bank},
        f"{url}: {options.model} is in bank {info.bank}, {len(blob)} bytes, checksum"
        f" {info.model_crc:08x}; tare again",
    )
