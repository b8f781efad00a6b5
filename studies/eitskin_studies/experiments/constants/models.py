"""Judging scenes of other models than the prebuilt one: calibrated, with steps that are too long,
taught, and one whose instrument is far from it."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.errors import UsageError
from eitskin.model.build import BuildSettings, build_model
from eitskin.model.eitm import decode_model, encode_model
from eitskin.model.force_law import ForceLaw
from eitskin.model.model import Model
from eitskin.scene.random_touches import TouchScene, TrueTouch
from eitskin.teaching.presses import Presses, load_presses
from eitskin.teaching.teach import teach
from eitskin_studies.experiments.constants.judged import FrameScene
from eitskin_studies.experiments.constants.scenes import SceneMaker
from eitskin_studies.experiments.teaching import FILE, SKIN
from eitskin_studies.experiments.teaching.untaught import START_ANGLE_DEG

TAUGHT = 100  # presses
ALONE, STREAM, PAIRS, UNTAUGHT = 40, 50, 20, 40
PRESS_MM = 8.0
SAMPLES = 24  # of the errors of the untaught model: a quick build


def of_other_models(maker: SceneMaker, worlds: Sequence[FrameScene]) -> Iterator[FrameScene]:
    """Scenes of ``worlds`` by models that differ in one thing from the prebuilt one."""
    some = [one for one in worlds if one.kind == "discs_1_to_3"][:4]
    # a gain that reaches 1 + 8 at the rim, where it is kept within MAX_GAIN
    law = ForceLaw(
        strength=np.array([0, 10], dtype=np.float32), force_n=np.array([0, 5], dtype=np.float32),
        gain=np.array([1, 0, 0, 8, 0, 8], dtype=np.float32), order=2, radius_mm=80.0, reach=1.0,
        uncertainty=0.1,
    )  # fmt: skip
    calibrated = encode_model(replace(maker.model, force_law=law))
    for one in some:
        yield replace(one, kind="forces", blob=calibrated)
    for part in (0.5, 0.1, 1e-3):
        wrong = encode_model(replace(maker.model, lipschitz=part * maker.model.lipschitz))
        for one in some[:2]:
            for solver in ("fista", "working-set"):
                yield replace(
                    one, kind="steps too long", name=f"{one.name}, {solver}, {part:g}", blob=wrong,
                    options={**one.options, "solver": solver},
                )  # fmt: skip


def of_presses(maker: SceneMaker) -> Iterator[FrameScene]:
    """Presses of a measured skin, which are not part of the project.

    Raises:
        UsageError: they are not there.
    """
    folder = maker.workspace.settings.data
    if folder is None or not (folder / FILE).is_file():
        raise UsageError(
            f"study constants: needs --data DIR with {FILE}, presses that are not part of the"
            " project; docs/results/teaching.md says which"
        )
    presses = load_presses(folder / FILE)
    taught = _kept(maker, "taught", lambda: teach(presses.take(np.arange(TAUGHT)), SKIN).model)
    last = len(presses)
    for k in range(last - ALONE, last):
        yield FrameScene(
            "taught, presses", f"press {k}", taught, presses.untouched[k][None],
            presses.pressed[k][None], (_press(presses, k),),
        )  # fmt: skip
    draw = np.random.default_rng(maker.seed)
    for _ in range(PAIRS):
        i, j = draw.choice(np.arange(last - 100, last), 2, replace=False)
        both = TouchScene("two", _press(presses, i).touches + _press(presses, j).touches)
        yield FrameScene(
            "taught, two presses", f"presses {i} and {j}", taught, presses.untouched[i][None],
            (presses.pressed[i] + presses.difference[j])[None], (both,),
        )  # fmt: skip
    yield _one_tare(presses, taught, {}, "as the model has it")
    yield _one_tare(presses, taught, {"reference_frames": 1}, "1 frame")
    yield from _untaught(maker, presses)


def _kept(maker: SceneMaker, name: str, make: Callable[[], Model]) -> bytes:
    def stored() -> dict[str, FloatArray]:
        return {"blob": np.frombuffer(encode_model(make()), dtype=np.uint8)}

    kept = maker.workspace.kept_arrays({"study": "constants", "model": name}, stored)
    return kept["blob"].tobytes()


def _press(presses: Presses, k: int) -> TouchScene:
    x, y = presses.place_mm[k]
    return TouchScene(f"press {k}", (TrueTouch(float(x), float(y), PRESS_MM, 0.5),))


def _one_tare(presses: Presses, blob: bytes, options: dict[str, int], name: str) -> FrameScene:
    """Untouched and pressed frames by turns, after one tare before all of them."""
    several = range(TAUGHT, TAUGHT + STREAM)
    frames = [row for k in several for row in (presses.untouched[k], presses.pressed[k])]
    nothing = TouchScene("nothing", ())
    truth = [scene for k in several for scene in (nothing, _press(presses, k))]
    return FrameScene(
        "taught, one tare", f"one tare, {name}", blob, presses.untouched[TAUGHT - 8 : TAUGHT],
        np.array(frames), truth, stream=True, options=options,
    )  # fmt: skip


def _untaught(maker: SceneMaker, presses: Presses) -> Iterator[FrameScene]:
    """By a model from physics, which the instrument is far from."""
    turned = replace(SKIN, electrodes=replace(SKIN.electrodes, start_angle_deg=START_ANGLE_DEG))
    blob = _kept(
        maker,
        "untaught",
        lambda: build_model(turned, presses.protocol, BuildSettings(samples=SAMPLES)),
    )
    sign = np.sign(decode_model(blob, "constants").golden.reference_v)
    for k in range(0, len(presses), len(presses) // UNTAUGHT):
        yield FrameScene(
            "untaught, presses", f"press {k}", blob, (sign * presses.untouched[k])[None],
            (sign * presses.pressed[k])[None], (_press(presses, k),),
            options={"sign": "decrease"},
        )  # fmt: skip
