"""Skins whose Jacobian is ill-conditioned, from mesh to touches."""

from dataclasses import replace

import numpy as np
import pytest
from hard_skins import SKINS, HardSkin, hard_skin
from soundness import U, check_sound, judged

from eitskin.core.options_table import SOLVERS
from eitskin.core.results import Options
from eitskin.model.options import default_options
from eitskin_emulator.core_steps import Choose, Load, Play, Step, TareStep
from everywhere import Host, as_float32, on_host

CASE = "problem/ill-conditioned-skins"
FRAMES = 2


def steps_for(h: HardSkin, options: Options) -> list[Step]:
    return [Load(h.blob), Choose(options), TareStep(h.untouched_v(8)), Play(h.frames_v(FRAMES))]


def data_of(h: HardSkin, options: Options, width: str) -> list[np.ndarray]:
    """y of each frame, (r,), in float64."""
    host = Host(h.blob, width)
    taken = [host.status_of(s) for s in (Choose(options), TareStep(as_float32(h.untouched_v(8))))]
    assert taken == [0, 0]
    data = []
    for frame in as_float32(h.frames_v(FRAMES)):
        host.solve_frame(frame)
        data.append(host.reduced_data()[: h.model.rank].astype(np.float64))
    return data


def rounding_of_data(h: HardSkin) -> float:
    """|P| times what a row's datum may be off: 8 roundings of the mean of 8 untouched frames, 4 of
    difference, gain and product, and k of a row of P: (12 + k) u |v| over k folded rows."""
    k = len(h.model.v_ref_v)
    norm = float(np.linalg.norm(h.model.projection.astype(np.float64), 2))
    return (12 + k) * U * norm * float(np.linalg.norm(h.model.v_ref_v.astype(np.float64)))


def compare_widths(within, name, h, narrow, wide, y, y64) -> None:
    """S x of the optimum changes by at most the change of y, and by the same amount again because
    lambda follows y. Each gap g adds sqrt(2 g)."""
    size, moved = float(np.linalg.norm(y64)), float(np.linalg.norm(y - y64))
    within(f"y, float32 from float64, {name}", moved / size, rounding_of_data(h) / size, "|y|")
    s = h.model.sensitivity
    one, other = judged(s, y, "increase", narrow), judged(s, y64, "increase", wide)
    room = 2 * moved + np.sqrt(2 * one.gap) + np.sqrt(2 * (other.gap + U * size**2))
    apart = float(np.linalg.norm(s @ (one.x - other.x)))
    within(f"S x, float32 from float64, {name}", apart / size, room / size, "|y|")


@pytest.mark.parametrize("name", SKINS)
def test_ill_conditioned_skins(same_everywhere, margins, name):
    """The default settings give finite images and touches; each solver, without projection so that
    S is the whole problem, a sound result; and to a small gap, float32 what float64 gives."""
    h = hard_skin(name)
    usual = default_options(h.model)
    sound = replace(usual, project_reference=False, detection_factor=0.0)
    precise = replace(sound, solver="active-set", iterations=300, gap_rel=1e-5)
    chosen = [usual, *(replace(sound, solver=solver) for solver in SOLVERS), precise]
    _, outcomes = same_everywhere.steps(
        [step for options in chosen for step in steps_for(h, options)]
    )
    by_options = [outcomes[k * FRAMES : (k + 1) * FRAMES] for k in range(len(chosen))]
    for one in by_options[0]:
        assert one.status == 0 and one.finite() and len(one.touches) <= usual.max_touches
        assert one.info.stop in ("iterations", "below-threshold")
    data = data_of(h, sound, same_everywhere.width)
    for of_solver in by_options[1:]:
        for y, one in zip(data, of_solver, strict=True):
            check_sound(margins, CASE, judged(h.model.sensitivity, y, "increase", one), one)
    if same_everywhere.width == "float64":
        return
    _, wide = on_host(steps_for(h, precise), "float64")
    for k, y64 in enumerate(data_of(h, precise, "float64")):
        compare_widths(margins.of(CASE), name, h, by_options[-1][k], wide[k], data[k], y64)
