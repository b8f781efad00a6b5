"""Metamorphic: what only renames, turns or scales gives the same image renamed, turned or
scaled."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from made_models import made_blob
from random_problems import gaussian
from soundness import U, judged

from eitskin.core.options_table import SIGNS, SOLVERS
from eitskin.core.results import Options
from eitskin.fem.grid import Grid
from eitskin.model.build import BuildSettings, Linearisation, linearise, make_model
from eitskin.model.eitm import encode_model
from eitskin.model.model import Model
from eitskin.model.options import default_options
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.protocol import Protocol, adjacent, table
from eitskin.skin.skin import Skin
from eitskin_emulator.core_steps import Choose, Load, Play, Solve, Step, TareStep
from everywhere import Host, SameEverywhere, as_float32
from margins import Margins
from small_models import DATA_KINDS, ELEMENTS, PIXELS, small, small_blob, small_model

CASE = "problem/symmetry"
COUNT = 16
RANK = 37  # as small_model has it


@pytest.mark.parametrize("solver", SOLVERS)
def test_powers_of_two_and_turned_signs(same_everywhere, margins, solver):
    """Data and lambda times 2^k: coefficients times 2^k. Data turned, the other sign: coefficients
    turned. Both bit for bit."""
    problem = gaussian(51)
    steps: list[Step] = [Load(made_blob(problem.s))]
    scales, within = (1.0, 2.0**-40, 2.0**-7, 2.0**5, 2.0**40), margins.of(CASE)
    for sign, scale in product(SIGNS, scales):
        lam = {"lambda_abs": scale * 0.05 * problem.lambda_max(sign), "lambda_rel": 0.0}
        options = problem.options(solver=solver, sign=sign, iterations=40, **lam)
        steps += [Choose(options), Solve(scale * problem.y[None])]
    for sign, turn in (("increase", 1), ("decrease", -1), ("both", 1), ("both", -1)):
        options = problem.options(solver=solver, sign=sign, iterations=40)
        steps += [Choose(options), Solve(turn * problem.y[None])]
    _, outcomes = same_everywhere.steps(steps)
    scaled, turned = outcomes[: len(SIGNS) * len(scales)], outcomes[len(SIGNS) * len(scales) :]
    for k, one in enumerate(scaled):
        base, scale = scaled[k - k % len(scales)], scales[k % len(scales)]
        unlike = np.count_nonzero(one.coefficients != np.float32(scale) * base.coefficients)
        within("coefficients unlike, data times a power of two", unlike, 0, "pixels")
    for one, other in (turned[:2], turned[2:]):
        unlike = np.count_nonzero(one.coefficients != -other.coefficients)
        within("coefficients unlike, data turned", unlike, 0, "pixels")
        assert one.image.any()


@pytest.mark.parametrize("data_kind", DATA_KINDS)
def test_polarity(same_everywhere, margins, data_kind):
    """Wires swapped at current or voltage turn every sign, in untouched frames too: the same
    bits."""
    s, blob = small(), small_blob("f32", data_kind)
    options = default_options(small_model("f32", data_kind))
    untouched, frames = s.untouched(61, 8), s.frames(60, 3)
    steps = [
        step
        for turn in (1, -1)
        for step in (Load(blob), Choose(options), TareStep(turn * untouched), Play(turn * frames))
    ]
    _, outcomes = same_everywhere.steps(steps)
    for one, other in zip(outcomes[:3], outcomes[3:], strict=True):
        unlike = np.count_nonzero(one.image != other.image)
        margins.everywhere(CASE, "pixels unlike, polarity turned", unlike, 0, "pixels")
        assert one.touches == other.touches and one.image.any()


def model_of(
    skin: Skin, protocol: Protocol, linear: Linearisation, data_kind: str = "difference"
) -> Model:
    return make_model(skin, protocol, linear, BuildSettings(rank=RANK, data_kind=data_kind))


def steps_for(
    model: Model, options: Options, untouched: np.ndarray, frames: np.ndarray
) -> list[Step]:
    return [Load(encode_model(model)), Choose(options), TareStep(untouched), Play(frames)]


def data_of(
    model: Model, options: Options, untouched: np.ndarray, frame: np.ndarray, width: str
) -> np.ndarray:
    """y (r,) as the solver sees it."""
    host = Host(encode_model(model), width)
    found = [host.status_of(step) for step in (Choose(options), TareStep(as_float32(untouched)))]
    assert found == [0, 0]
    host.solve_frame(as_float32(frame))
    return host.reduced_data()[: model.rank].astype(np.float64)


def check_alike(
    same_everywhere: SameEverywhere,
    margins: Margins,
    what: str,
    models: tuple[Model, Model],
    frames: tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]],
    pixels: np.ndarray,
) -> None:
    """Coefficients of the second model, taken at ``pixels``, are the first's. Both models are the
    same but for the rounding of P and S to float32: that moves y by (12 + k) u |P| |v|
    (test_ill_skins.rounding_of_data) and S x by u |S|_F |x|, each in both models; the optimum
    follows data and lambda as a projection does; and each gap g adds sqrt(2 g).
    """
    options = replace(
        default_options(models[0]), solver="active-set", iterations=500, gap_rel=1e-5,
        project_reference=False, detection_factor=0.0,
        lambda_noise_factor=0.0,
    )  # fmt: skip
    both = zip(models, frames, strict=True)
    steps = [
        step
        for model, (untouched, given) in both
        for step in steps_for(model, options, untouched, given)
    ]
    _, outcomes = same_everywhere.steps(steps)
    count = len(frames[0][1])
    s, width = models[0].sensitivity, same_everywhere.width
    for k in range(count):
        one, other = outcomes[k], outcomes[count + k]
        points = [
            judged(m.sensitivity, data_of(m, options, untouched, given[k], width), "increase", o)
            for m, (untouched, given), o in zip(models, frames, (one, other), strict=True)
        ]
        size = float(np.linalg.norm(points[0].y))
        norm = float(np.linalg.norm(models[0].projection.astype(np.float64), 2))
        v = float(np.linalg.norm(models[0].v_ref_v.astype(np.float64)))
        room = 4 * (12 + len(models[0].v_ref_v)) * U * norm * v
        room += 4 * U * float(np.linalg.norm(s)) * float(np.linalg.norm(points[0].x))
        room += sum(np.sqrt(2 * (p.gap + p.gap_rounding)) for p in points)
        apart = float(np.linalg.norm(s @ (points[1].x[pixels] - points[0].x)))
        margins.everywhere(CASE, f"S x, {what}", apart / size, room / size, "|y|")
        assert one.image.any()


@pytest.mark.parametrize("what", ["rotation by one electrode", "numbered the other way round"])
def test_electrodes_relabelled(same_everywhere, margins, what):
    """The same electrodes under other numbers, and the protocol's table in those numbers: the same
    rows, from mesh to image."""
    s = small()
    turned = what.startswith("rotation")
    turn = {"start_angle_deg": 90.0 - 360 / COUNT} if turned else {"clockwise": True}
    numbers = (np.arange(COUNT) + 1 if turned else -np.arange(COUNT)) % COUNT
    skin = Skin("relabelled", s.skin.outline, Electrodes(COUNT, 3.0, **turn), 0.02, 5.0)
    protocol = table(COUNT, numbers[s.protocol.drive_measure.astype(int)])
    linear = linearise(skin, protocol, pixels_across=PIXELS, elements=ELEMENTS)
    assert np.abs(linear.v0_v - s.linear.v0_v).max() < 1e-9 * np.abs(s.linear.v0_v).max()
    models = model_of(s.skin, s.protocol, s.linear), model_of(skin, protocol, linear)
    given = s.untouched(71, 8), s.frames(70, 2)
    same = np.arange(models[0].grid.n_pixels)
    check_alike(same_everywhere, margins, what, models, (given, given), same)


def test_channels_permuted_with_the_protocol(same_everywhere, margins):
    s = small()
    order = np.random.default_rng(5).permutation(s.protocol.n_rows)
    protocol = table(COUNT, s.protocol.drive_measure[order].astype(int))
    linear = replace(s.linear, jacobian=s.linear.jacobian[order], v0_v=s.linear.v0_v[order])
    models = model_of(s.skin, s.protocol, s.linear), model_of(s.skin, protocol, linear)
    untouched, frames = s.untouched(73, 8), s.frames(72, 2)
    given = (untouched, frames), (untouched[:, order], frames[:, order])
    same = np.arange(models[0].grid.n_pixels)
    check_alike(same_everywhere, margins, "channels permuted", models, given, same)


def quarter_turn(grid: Grid) -> np.ndarray:
    """Return where each pixel goes if the disk is turned by 90 degrees, counterclockwise."""
    ix, iy = grid.index[:, 0], grid.index[:, 1]
    return np.asarray(grid.number[ix, grid.nx - 1 - iy])


def mirrored(grid: Grid) -> np.ndarray:
    """Return where each pixel goes if the disk is mirrored at the y axis."""
    return np.asarray(grid.number[grid.index[:, 1], grid.nx - 1 - grid.index[:, 0]])


def rows_moved(protocol: Protocol, electrode: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the new place and the sign of each row if electrode e becomes ``electrode[e]``."""
    place = {tuple(row): k for k, row in enumerate(protocol.drive_measure.tolist())}
    to, sign = [], []
    for a, b, c, d in electrode[protocol.drive_measure.astype(int)].tolist():
        turns = {(a, b, c, d): 1, (b, a, c, d): -1, (a, b, d, c): -1, (b, a, d, c): 1}
        (key,) = turns.keys() & place.keys()
        to.append(place[key])
        sign.append(turns[key])
    return np.array(to), np.array(sign)


def symmetric(linear: Linearisation, protocol: Protocol) -> Linearisation:
    """The mean of the Jacobian over quarter turns and mirrors: a mesh's own asymmetry is not what
    is looked at."""
    jacobian, v0 = linear.jacobian, linear.v0_v
    turn, mirror = 4, -np.arange(COUNT) % COUNT  # electrode 0 is on top: a mirror keeps it
    for electrode, pixel, order in (
        ((np.arange(COUNT) + turn) % COUNT, quarter_turn(linear.grid), 4),
        (mirror, mirrored(linear.grid), 2),
    ):
        to, sign = rows_moved(protocol, electrode)
        total, total_v, moved, moved_v = jacobian, v0, jacobian, v0
        for _ in range(order - 1):
            following, following_v = np.empty_like(moved), np.empty_like(moved_v)
            following[np.ix_(to, pixel)] = sign[:, None] * moved
            following_v[to] = sign * moved_v
            moved, moved_v = following, following_v
            total, total_v = total + moved, total_v + moved_v
        jacobian, v0 = total / order, total_v / order
    return replace(linear, jacobian=jacobian, v0_v=v0)


@pytest.mark.parametrize("what", ["a quarter turn of the disk", "the disk in a mirror"])
def test_the_disk_turned_and_mirrored(same_everywhere, margins, what):
    """A touch elsewhere by symmetry is the same touch: its frame is the rows' permutation, its
    image the pixels'."""
    s, protocol = small(), adjacent(COUNT)
    linear = symmetric(s.linear, protocol)
    model = model_of(s.skin, protocol, linear)
    if what.startswith("a quarter"):
        electrode, pixel = (np.arange(COUNT) + 4) % COUNT, quarter_turn(linear.grid)
    else:
        electrode, pixel = -np.arange(COUNT) % COUNT, mirrored(linear.grid)
    to, sign = rows_moved(protocol, electrode)
    again = np.empty_like(linear.jacobian)
    again[np.ix_(to, pixel)] = sign[:, None] * linear.jacobian
    assert np.abs(again - linear.jacobian).max() < 1e-12 * np.abs(linear.jacobian).max()
    clean = replace(s, linear=linear)
    untouched, frames = clean.untouched(75, 8), clean.frames(74, 2)
    moved_untouched, moved_frames = np.empty_like(untouched), np.empty_like(frames)
    moved_untouched[:, to], moved_frames[:, to] = sign * untouched, sign * frames
    given = (untouched, frames), (moved_untouched, moved_frames)
    check_alike(same_everywhere, margins, what, (model, model), given, pixel)
