"""Frames in which something is wrong, given to numpy, scikit-learn, pyEIT and this project's C
core.

All get the same frames of random scenes, and the same Jacobian but for pyEIT, which makes its own.
Each method's threshold of MIoU, and its parameter, are the best on the clean frames. Spoilt frames
then count as

    right        the mean MIoU is within ``LOST`` of the clean frames'
    worse        it is lower, and nothing was said
    named        the core's diagnostics say what is wrong; the MIoU stands beside it
    not finite   an image has NaN or infinity
    refused      an exception says so
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np

from eitskin.arrays import BoolArray, FloatArray
from eitskin.errors import EitskinError
from eitskin.model.build import BuildSettings, make_model
from eitskin.scene.random_touches import random_touches
from eitskin.scene.simulate import Simulated, simulate
from eitskin.scoring.metrics import ImageScorer, judge_for
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin.solve.reconstructor import Reconstructor
from eitskin_studies.compare import baselines
from eitskin_studies.compare.families import Setup, setup_for
from eitskin_studies.compare.methods import STRENGTHS
from eitskin_studies.compare.pyeit_method import pyeit_method
from eitskin_studies.compare.run import truth_masks
from eitskin_studies.harness.sections import Filling, Tabular, text_table
from eitskin_studies.harness.thresholds import miou_curves

LOST = 0.02
ELECTRODE = 5
LASSO_RATIOS = (1e-4, 1e-3, 1e-2)
HEAD_OF_CASES = "what is wrong"

Images = Callable[[FloatArray, FloatArray], FloatArray]
"""Images (k, n) of reference frames (q, m) and frames (k, m), in V; may raise."""


@dataclass(frozen=True)
class Spoilt:
    """A case: what is wrong, and how reference (q, m) and frames (k, m) become so."""

    what: str
    spoil: Callable[[FloatArray, FloatArray, np.random.Generator], tuple[FloatArray, FloatArray]]


@dataclass(frozen=True)
class Peers:
    """The answers of each method, (cases) texts by its name, and the conditions."""

    scenes: int
    seed: int
    cases: tuple[str, ...]
    answers: dict[str, tuple[str, ...]]

    def as_dict(self) -> dict[str, Any]:
        """Return JSON values."""
        rows = {name: list(texts) for name, texts in self.answers.items()}
        return {"scenes": self.scenes, "seed": self.seed, "cases": list(self.cases), **rows}


def _frames(change: Callable[[FloatArray], None]) -> Callable[..., tuple[FloatArray, FloatArray]]:
    """Return a case that changes a copy of the frames in place."""

    def spoil(
        untouched: FloatArray, frames: FloatArray, _: np.random.Generator
    ) -> tuple[FloatArray, FloatArray]:
        changed = frames.copy()
        change(changed)
        return untouched, changed

    return spoil


def _set(rows: Any, value: float) -> Callable[[FloatArray], None]:
    def change(frames: FloatArray) -> None:
        frames[:, rows] = value

    return change


def _scaled(rows: Any, factor: float) -> Callable[[FloatArray], None]:
    def change(frames: FloatArray) -> None:
        frames[:, rows] *= factor

    return change


def _units(factor: float) -> Callable[..., tuple[FloatArray, FloatArray]]:
    return lambda untouched, frames, _: (factor * untouched, factor * frames)


def _detached(
    untouched: FloatArray, frames: FloatArray, random: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    rows = (adjacent(16).drive_measure == ELECTRODE).any(axis=1)
    changed = frames.copy()
    noise_v = 1e-3 * float(np.sqrt(np.mean(untouched**2)))
    changed[:, rows] = noise_v * random.standard_normal((len(frames), int(rows.sum())))
    return untouched, changed


CASES = (
    Spoilt("one row is NaN", _frames(_set(70, np.nan))),
    Spoilt("40 rows are NaN", _frames(_set(slice(0, 200, 5), np.nan))),
    Spoilt("one row is five times too large", _frames(_scaled(70, 5.0))),
    Spoilt("one row changes its sign", _frames(_scaled(70, -1.0))),
    Spoilt("an electrode comes off (52 rows)", _detached),
    Spoilt("the gain drifts by 5 %", _frames(_scaled(slice(None), 1.05))),
    Spoilt("the frame is all zero", _frames(_set(slice(None), 0.0))),
    Spoilt("frames are in nV", _units(1e9)),
    Spoilt("frames are in units of 1e30 V", _units(1e-30)),
    Spoilt("a frame lacks its last row", lambda u, f, _: (u, f[:, :-1])),
    Spoilt("the reference is all zero", lambda u, f, _: (0 * u, f)),
)


def run(scenes: int, seed: int, progress: Callable[..., Any] = iter) -> Peers:
    """Let every method meet every case.

    Raises:
        EitskinError: scenes cannot be drawn or simulated.
    """
    skin, protocol = paper_skin(), adjacent(16)
    setup = setup_for(skin, protocol, elements=6000)
    simulated = simulate(skin, protocol, random_touches(skin.outline, seed, scenes, "test"))
    scorer = judge_for(skin.outline, setup.grid)
    truths = truth_masks(simulated.touches, scorer.raster.points_mm)
    judge = _Judge(scorer, truths, simulated, seed)
    chosen: dict[str, list[Images]] = {
        "numpy, one Gauss-Newton step": [
            _linear(baselines.gauss_newton(setup.jacobian, one)) for one in STRENGTHS
        ]
    }
    if find_spec("sklearn"):
        chosen["scikit-learn, Lasso"] = [_lasso(setup, one) for one in LASSO_RATIOS]
    if find_spec("pyeit"):
        family = pyeit_method(setup)
        chosen["pyEIT, JAC"] = [_linear(family.make(one)) for one in family.values]
    chosen["eitskin"] = [_Core(setup)]
    answers = {name: judge.answers(tried) for name, tried in progress(list(chosen.items()))}
    return Peers(scenes, seed, tuple(case.what for case in CASES), answers)


class _Judge:
    """The same scenes and the same rule for every method."""

    def __init__(
        self, scorer: ImageScorer, truths: BoolArray, simulated: Simulated, seed: int
    ) -> None:
        self._scorer, self._truths, self._seed = scorer, truths, seed
        self._untouched, self._frames = simulated.untouched_v, simulated.frames_v

    def answers(self, tried: Sequence[Images]) -> tuple[str, ...]:
        """Return the answer to each case of the method that is best on the clean frames."""
        clean = [self._curve(images(self._untouched, self._frames)) for images in tried]
        best = int(np.argmax([curve.max() for curve in clean]))
        at = int(np.argmax(clean[best]))
        return tuple(self._answer(tried[best], case, at, clean[best][at]) for case in CASES)

    def _curve(self, images: FloatArray) -> FloatArray:
        return np.asarray(miou_curves(self._scorer, images, self._truths).mean(axis=0))

    def _answer(self, images: Images, case: Spoilt, at: int, clean: float) -> str:
        untouched, frames = case.spoil(
            self._untouched, self._frames, np.random.default_rng(self._seed)
        )
        try:
            got = images(untouched, frames)
        except EitskinError as error:
            return f"refused: {str(error).split(';')[0].split(', so ')[0]}"
        except Exception as error:  # whatever another program raises
            return f"exception: {type(error).__name__}"
        said = getattr(images, "said", "")
        if not np.isfinite(got).all():
            return "not finite"
        miou = float(self._curve(got)[at])
        if said:
            return f"named ({said}), MIoU {miou:.2f}"
        verdict = "right" if miou >= clean - LOST else "worse"
        return f"{verdict}, MIoU {miou:.2f} (clean {clean:.2f})"


def _linear(method: Any) -> Images:
    """The product with the matrix of a linear method, as one writes it in a script: without this
    project's checks of frames."""
    matrix: FloatArray = method.matrix
    return lambda untouched, frames: np.asarray((frames - untouched.mean(axis=0)) @ matrix.T)


def _lasso(setup: Setup, ratio: float) -> Images:
    """scikit-learn's coordinate descent on the Jacobian, non-negative; lambda as a share of that
    with an empty image."""
    from sklearn.linear_model import Lasso

    def images(untouched: FloatArray, frames: FloatArray) -> FloatArray:
        found = []
        for dv in frames - untouched.mean(axis=0):
            most = float(np.max(setup.jacobian.T @ dv)) / len(dv)
            solver = Lasso(max(ratio * most, 1e-300), fit_intercept=False, positive=True)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of its convergence: a script would go on, too
                found.append(solver.fit(setup.jacobian, dv).coef_)
        return np.array(found)

    return images


class _Core:
    """The C core with its defaults; ``said`` has the diagnostics of the last frames."""

    def __init__(self, setup: Setup) -> None:
        self._model = make_model(setup.skin, setup.protocol, setup.linearisation, BuildSettings())
        self.said = ""

    def __call__(self, untouched: FloatArray, frames: FloatArray) -> FloatArray:
        """Images (k, n); frames that the core refuses raise."""
        solver, said = Reconstructor(self._model), set[str]()
        solver.tare(untouched)
        images = []
        for frame in frames:
            result = solver.reconstruct(frame)
            said.update(result.info.found)
            images.append(result.image)
        self.said = ", ".join(sorted(said))
        return np.array(images, dtype=np.float64)


def _table(result: Peers) -> Tabular:
    names = list(result.answers)
    rows = [
        (case, *(result.answers[name][k] for name in names)) for k, case in enumerate(result.cases)
    ]
    return (HEAD_OF_CASES, *names), rows


def as_text(result: Peers) -> str:
    """For a terminal."""
    return text_table(*_table(result))


def for_page(result: Peers, command: str) -> Filling:
    """The table of the page's marks, and how it was made."""
    conditions = (
        f"{result.scenes} scenes of 1 to 3 touches, seed {result.seed}, 60 dB, simulated as"
        " everywhere; parameter and threshold of each method are the best on these frames without"
        " a fault."
    )
    texts = {"conditions": conditions, "command": f"Made by `{command}`."}
    return texts, {"peers": _table(result)}
