"""Curves of the errors of float32: over the condition number of S, and over the size of the change
relative to the voltages of which it is the difference."""

from dataclasses import dataclass, replace

import numpy as np
from made_models import made_model, plain_options
from soundness import U, judged

from eitskin.model.eitm import encode_model
from eitskin.model.options import default_options
from eitskin_emulator.core_steps import Choose, Load, Solve, Step, TareStep
from everywhere import Host, Outcome, as_float32, on_host
from small_models import prebuilt

CONDITIONS = tuple(10.0**k for k in range(9))
CHANGES = tuple(2.0**-k for k in range(0, 25, 2))  # of the golden frame's own
RANK, COLUMNS = 16, 32


@dataclass(frozen=True)
class Condition:
    """The greatest difference of float32 from float64 and what the gaps allow of the data's."""

    data: float
    allowed: float
    coefficients: float


@dataclass(frozen=True)
class Change:
    """Relative errors of reduced data and image; what rounding allows of the data's."""

    data: float
    allowed: float
    image: float


def matrix(condition: float) -> np.ndarray:
    """S (r, n) of that condition, singular values evenly apart in their logarithm."""
    rng = np.random.default_rng(17)
    left = np.linalg.qr(rng.standard_normal((RANK, RANK)))[0]
    right = np.linalg.qr(rng.standard_normal((COLUMNS, RANK)))[0]
    return np.asarray((left * condition ** -np.linspace(0, 1, RANK)) @ right.T)


def condition_steps() -> list[Step]:
    """One problem a condition number: three pixels that changed."""
    steps: list[Step] = []
    for condition in CONDITIONS:
        s = matrix(condition)
        options = plain_options(
            s, solver="active-set", iterations=300, gap_rel=1e-6, lambda_rel=1e-3
        )
        data = s[:, [3, 11, 20]] @ (1.0, 0.6, 0.3)
        steps += [Load(encode_model(made_model(s))), Choose(options), Solve(data[None])]
    return steps


def by_condition(narrow: list[Outcome]) -> list[Condition]:
    """Compare the float32 outcomes of ``condition_steps`` with float64, by condition number."""
    steps = condition_steps()
    wide, found = on_host(steps, "float64")[1], []
    for k, condition in enumerate(CONDITIONS):
        s = made_model(matrix(condition)).sensitivity
        y = steps[3 * k + 2].data[0]
        one, other = (judged(s, y, "increase", outcomes[k]) for outcomes in (narrow, wide))
        size = float(np.linalg.norm(one.y))
        room = np.sqrt(2 * one.gap) + np.sqrt(2 * (other.gap + U * size**2))
        apart = one.x - other.x
        off = float(np.linalg.norm(apart) / np.linalg.norm(other.x))
        found.append(Condition(float(np.linalg.norm(s @ apart)) / size, float(room) / size, off))
    return found


def by_change() -> list[Change]:
    """The prebuilt model's golden frame, its change made smaller and smaller: float32 from the
    change itself, which float64 has before anything is rounded."""
    model, blob = prebuilt()
    options = replace(default_options(model), detection_factor=0.0, lambda_noise_factor=0.0)
    options = replace(options, project_reference=False, row_gains=False)
    reference = model.golden.reference_v.astype(np.float64)
    change = model.golden.frame_v.astype(np.float64) - reference
    hosts = [Host(blob, width) for width in ("float32", "float64")]
    for host in hosts:
        assert [host.status_of(s) for s in (Choose(options), TareStep(reference[None]))] == [0, 0]
    norm = float(np.linalg.norm(model.projection.astype(np.float64), 2))
    found = []
    for size in CHANGES:
        frame = reference + size * change
        images, data = [], []
        for host, volts in zip(hosts, (as_float32(frame), frame), strict=True):
            host.forget()
            images.append(host.outcome(volts).image.astype(np.float64))
            data.append(host.reduced_data()[: model.rank].astype(np.float64))
        off = U * np.linalg.norm(frame)
        off += (4 + len(model.v_ref_v)) * U * size * np.linalg.norm(change)
        scale = float(np.linalg.norm(data[1]))
        moved = float(np.linalg.norm(data[0] - data[1])) / scale
        of_image = float(np.linalg.norm(images[0] - images[1]) / np.linalg.norm(images[1]))
        found.append(Change(moved, norm * float(off) / scale, of_image))
    return found
