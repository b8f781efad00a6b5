"""The fast path on the emulated Cortex-M7: the host's bits, and what a drive costs."""

import numpy as np
import pytest

from eitskin.core.engine import CoreEngine
from eitskin.core.fast import FastCore, FastTouch
from eitskin.model.options import default_options
from eitskin.model.prebuilt import load_prebuilt
from eitskin_emulator.core_on_qemu import PROGRAM, EmulatedRun, run_steps
from eitskin_emulator.core_steps import Choose, Drives, Load, TareStep
from scans_in_time import ROW_S, STEP, order

# no finger, one, two at once, light ones that stay uncertain for long, up to six
SCENES = {
    "quiet": (0, 0),
    "one": (0, 1, 1, 1, 0, 0),
    "two": (0, 2, 2, 2),
    "light": (0, 2, 2, 2),
    "hand": (0, 2, 4, 5, 6, 6, 3),
}
MOST = dict.fromkeys(SCENES, 280_000) | {"quiet": 6_000}
PLACES = ((30.0, -40.0), (-35.0, 20.0), (45.0, 30.0), (-45.0, -45.0), (0.0, 70.0), (0.0, -5.0))
ONE_TOUCH = 40_000


def scans_of(name: str, v0: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Scans (k, m) V: touches as the model's fields answer to them, no less than in rows."""
    fast = FastCore(CoreEngine(load_prebuilt()[1], "float64"))
    model = load_prebuilt()[0]
    table, fields = model.protocol.drive_measure, model.fields
    assert fields is not None
    electrodes = model.protocol.n_electrodes
    x, y = fields.columns[:, :electrodes], fields.columns[:, electrodes : 2 * electrodes]
    touches, size = [], 0.05 if name == "light" else 1.0
    for place in PLACES:
        near = np.hypot(*(model.grid.centres_mm() - place).T) < 9
        drive, measure = (
            (x[near][:, table[:, k]] - x[near][:, table[:, k + 1]],
             y[near][:, table[:, k]] - y[near][:, table[:, k + 1]])
            for k in (0, 2)
        )  # fmt: skip
        product = np.mean(drive[0] * measure[0] + drive[1] * measure[1], axis=0)
        touches.append(-fields.volts * 3.0 * size * product)
    whole = np.array([v0 + sum(touches[:count]) for count in SCENES[name]])
    late = np.concatenate([fast.rows[n] for n in order(fast)])[40:]
    for k in range(len(whole) - 1, 0, -1):  # the change comes within a scan
        early = np.setdiff1d(np.arange(len(v0)), late)
        whole[k, early] = whole[k - 1, early]
    sigma = 1e-3 * float(np.sqrt(np.mean(v0**2)))
    return np.asarray(whole + sigma * rng.standard_normal(whole.shape))


def printed(touches: list[FastTouch]) -> str:
    words = [str(len(touches))]
    for one in touches:
        reals = np.array(
            [one.x_mm, one.y_mm, one.vx_mm_per_s, one.vy_mm_per_s, one.strength_s_per_m_mm2],
            dtype=np.float32,
        )
        bits = ":".join(f"{word:08x}" for word in reals.view(np.uint32))
        words.append(f"{one.id}:{int(one.confirmed)}:{bits}")
    return " ".join(words)


@pytest.mark.parametrize("name", SCENES)
def test_a_drive_has_the_hosts_bits_and_a_bounded_cost(cortex_m7, tmp_path, name):
    model, blob = load_prebuilt()
    rng = np.random.default_rng(9)
    v0 = model.golden.reference_v.astype(np.float64)
    sigma = 1e-3 * float(np.sqrt(np.mean(v0**2)))
    untouched = (v0 + sigma * rng.standard_normal((16, len(v0)))).astype(np.float32)
    scans = scans_of(name, v0, rng).astype(np.float32)
    board: EmulatedRun = run_steps(
        cortex_m7 / PROGRAM,
        tmp_path,
        (Load(blob), Choose(default_options(model)), TareStep(untouched), Drives(scans, STEP)),
    )
    engine = CoreEngine(blob)
    engine.set_options(default_options(model))
    engine.set_reference(untouched.astype(np.float64))
    fast = FastCore(engine)
    fast.begin()
    assert fast.bytes >= board.fast_bytes > 16_000  # pointers are smaller there
    reported = iter(board.drives)
    drive_s = ROW_S * len(v0) / len(fast.rows)
    for k, (scan, seen) in enumerate(zip(scans, board.scans, strict=True)):
        for n, number in enumerate(order(fast)):
            here = fast.drive(number, scan[fast.rows[number]], (k * len(fast.rows) + n) * drive_s)
            there = next(reported)
            assert (there.drive, there.status) == (number, 0)
            assert there.touches == printed(here)
        aligned = fast.aligned(scan)
        assert seen.state == aligned.explained + 2 * aligned.trusted
        if aligned.trusted:
            fast.confirm(engine.reconstruct(aligned.volts).touches)
    counts = [drive.instructions for drive in board.drives]
    print(f"{name}: median {np.median(counts):.0f}, most {max(counts)} instructions a drive")
    assert max(counts) <= MOST[name]
    assert max(drive.stack_bytes for drive in board.drives) < 5000
    followed = [one.instructions for one in board.drives if one.touches.startswith("1 ")]
    assert name != "one" or np.median(followed) < ONE_TOUCH
    reported_of = any(drive.touches[0] != "0" for drive in board.drives)
    assert name == "light" or reported_of == (name != "quiet")
