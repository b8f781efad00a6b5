"""Numbers and words of the rooms that read and examine frames, on fixed inputs."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from injected import (
    as_if_electrodes,
    changed,
    channels_off,
    dead,
    healthy_frames,
    pair_off,
    quiet_only,
    reversed_sign,
    rotating,
    times,
    wired,
)

from eitskin.frames import front_end, orders, repair
from eitskin.frames import homogeneous as ideal
from eitskin.frames.doctor import examine, subject_from_frames
from eitskin.frames.frames import Frames
from eitskin.frames.pairs import kind_of, paired, to_complex
from eitskin.frames.tables import chosen
from eitskin.skin.protocol import Protocol, adjacent, opposite, skip
from eitskin.skin.skin import paper_skin
from same_results import check_same
from small_models import small

STORE = Path(__file__).with_suffix(".json")
PAPER = paper_skin()
RING: dict[str, Protocol] = {"adjacent": adjacent(16), "opposite": opposite(8), "skip": skip(12, 2)}


def spoilt(seed: int, spoil: Callable[[Any, np.random.Generator], Any]) -> Frames:
    frames, draw = healthy_frames(seed), np.random.default_rng(seed)
    return changed(
        frames, spoil(frames.reference_voltage_v.copy(), draw), spoil(frames.voltage_v.copy(), draw)
    )


def put(values: Any, where: Any, what: Any) -> Any:
    values[where] = what
    return values


def limited(share: float) -> Frames:
    return spoilt(31, lambda v, _: np.clip(v, -share * np.abs(v).max(), share * np.abs(v).max()))


SPOILT: dict[str, Callable[[], Frames]] = {
    "healthy": lambda: healthy_frames(1),
    "quiet only": lambda: quiet_only(healthy_frames(2)),
    "reversed": lambda: reversed_sign(healthy_frames(3)),
    "rotating": lambda: rotating(healthy_frames(4)),
    "magnitudes": lambda: spoilt(5, lambda v, _: np.abs(v)),
    "too large": lambda: times(healthy_frames(6), np.float64(4000)),
    "swapped": lambda: wired(7, (2, 7)),
    "swapped twice": lambda: wired(8, (3, 9), (1, 14)),
    "one dead": lambda: dead(healthy_frames(9), 11),
    "three dead": lambda: dead(healthy_frames(10), 2, 3, 9),
    "a channel": lambda: channels_off(healthy_frames(11), [40], 1.5),
    "two flipped": lambda: channels_off(healthy_frames(12), [17, 90], -1.0),
    "a drive": lambda: pair_off(healthy_frames(13), slice(0, 2), 0.7),
    "own gains": lambda: times(
        healthy_frames(14), np.random.default_rng(14).uniform(0.7, 1.3, 208)
    ),
    "noisy": lambda: healthy_frames(15, snr_db=18),
    "all but noiseless": lambda: healthy_frames(16, gain=0, snr_db=200),
    "noisy channel": lambda: spoilt(
        17, lambda v, draw: put(v, (slice(None), 5), v[:, 5] * draw.normal(1, 0.2, len(v)))
    ),
    "drifting": lambda: spoilt(18, lambda v, _: v * np.linspace(1, 1.2, len(v))[:, None]),
    "cut off": lambda: limited(0.3),
    "hardly cut off": lambda: limited(0.9),
    "nothing": lambda: spoilt(19, lambda v, _: 0 * v),
    "some not finite": lambda: spoilt(20, lambda v, _: put(v, (0, slice(3, 9)), np.nan)),
    "a channel not finite": lambda: spoilt(21, lambda v, _: put(v, (slice(None), 30), np.inf)),
    "constant channels": lambda: spoilt(22, lambda v, _: put(v, (slice(None), [4, 60]), 1e-4)),
    "random": lambda: spoilt(23, lambda v, draw: draw.normal(size=v.shape)),
    "opposite": lambda: healthy_frames(24, opposite(16)),
    "few channels": lambda: times(healthy_frames(26), (np.arange(208) % 50 == 0) * 1.0),
    "turned": lambda: as_if_electrodes(
        healthy_frames(25), orders.electrode_map(16, 5, True), seed=25
    ),
}


@pytest.mark.parametrize("name", SPOILT)
@pytest.mark.parametrize("skin", [PAPER, None], ids=["skin", "no skin"])
def test_same_results_of_the_doctor(name, skin):
    def examined() -> Any:
        report = examine(subject_from_frames(SPOILT[name](), skin))
        return [report.as_table(), len("\n".join(report.lines()))]

    check_same(STORE, f"doctor, {name}, {'skin' if skin else 'no skin'}", examined)


def of_protocol(protocol: Protocol) -> dict[str, Callable[[], Any]]:
    """Calls that take a protocol."""
    n, rows = protocol.n_electrodes, protocol.drive_measure.astype(np.int64)
    transfer = ideal.homogeneous(None, n).transfer_ohm
    pairs = np.array([[0, 1], [2, 5]])
    ends = np.linspace(0.5, 2, len(rows)), np.linspace(1, 1.5, len(rows))
    asked = [front_end.demand_of(transfer * ohm, protocol) for ohm in (1.0, 30.0, 1e3, 1e5)]
    return {
        "joined": lambda: ideal.shorted(transfer, 2, n - 1),
        "joined pairs": lambda: ideal.shorted_frames(transfer, pairs, rows),
        "front end": lambda: [[demand, front_end.advice(demand)] for demand in asked],
        "partners": lambda: np.array([(i, *j) for i, j in repair.partners(rows, n).items()]),
        "equalising gains": lambda: repair.equalising_gains(*ends),
        "orders": lambda: [
            orders.match_rows(orders.source_table(order, protocol), rows) for order in orders.ORDERS
        ],
    }


def columns(*names: str) -> Any:
    values = np.arange(4.0 * len(names)).reshape(4, -1)
    found = paired(names, values, None, "--columns")
    return [found, to_complex(values, found)]


CALLS: dict[str, Callable[[], Any]] = {
    "a ring of resistors": lambda: ideal.resistor_ring(9, 33.0).voltages(
        skip(9, 1).drive_measure.astype(np.int64), 0.01
    ),
    "paper's skin": lambda: ideal.homogeneous(PAPER, 16),
    "another number of electrodes": lambda: ideal.homogeneous(PAPER, 8),
    "a touch on the paper's skin": lambda: ideal.touch_transfer(
        PAPER, np.array([[20.0, -30.0]]), np.array([9.0]), np.array([1], dtype=np.int8)
    ),
    "another outline": lambda: ideal.homogeneous(small("l").skin, 16),
    **{
        f"{name}, {kind}": call
        for kind, protocol in RING.items()
        for name, call in of_protocol(protocol).items()
    },
    "resistors": lambda: [front_end.resistor_from(ohm) for ohm in (1, 1.05, 99, 101, 912, 4.7e4)],
    "swaps": lambda: orders.swap_map(8, [(0, 3), (2, 7)]),
    "a swap of nothing": lambda: orders.swap_map(8, [(0, 8)]),
    "turned": lambda: [orders.electrode_map(7, k, mirror) for k in (0, 3) for mirror in (0, 1)],
    "names of columns": lambda: [
        kind_of(name)
        for name in ("Re", "im(Z)", "|V|", "phase [deg]", "V_mag", "angle", "real", "time", "")
    ],
    "real and imaginary": lambda: columns("v1 re", "v1 im", "v2 re", "v2 im"),
    "magnitude and phase": lambda: columns("mag 1", "phase 1 [deg]", "mag 2", "phase 2 [deg]"),
    "half a pair": lambda: columns("v1 re", "v2 re"),
    **{
        f"columns {spec!r}": lambda spec=spec: chosen(spec, 9, ["t", *"abcdefgh"], "--channels")
        for spec in ("2-4", "0,2:", "a-c", "-1", ":", "9", "c", "3-1", "x", "1,1", "")
    },
}


@pytest.mark.parametrize("name", CALLS)
def test_same_results_of_frames(name):
    check_same(STORE, name, CALLS[name])
