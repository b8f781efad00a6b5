"""The faults of a frame, each with the name that its diagnostic should have."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.core.results import Info
from eitskin.scene.streams import stream
from eitskin_studies.benchmarks.diagnostics_scenes import PROTOCOL, ROLE, ROWS, SceneCase

Spoil = Callable[[SceneCase, FloatArray], FloatArray]
CROWDED = "crowded"


def _same(case: SceneCase, values: FloatArray) -> FloatArray:
    return values


@dataclass(frozen=True)
class InjectedFault:
    """One row of the table.

    ``volts`` makes the exact voltages from those of the touched frame; ``readings`` spoils what
    noise and converter made of them. ``named`` is whether a frame was called by its name,
    electrodes and all; None if it has none. ``half``: a scan of one row of each reciprocal pair.
    ``gain``: what the peak is to be multiplied by. ``lifted``: the touch was there during the tare,
    and no image is judged."""

    name: str
    named: Callable[[SceneCase, Info], bool] | None
    volts: Spoil = _same
    readings: Spoil = _same
    half: bool = False
    gain: float | None = None
    lifted: bool = False


def _solved(name: str) -> Spoil:
    return lambda case, _: case.volts[name]


def _says(*names: str) -> Callable[[SceneCase, Info], bool]:
    return lambda _, info: any(name in info.diagnostics_by_name for name in names)


def _pair(case: SceneCase) -> tuple[int, ...]:
    return tuple(sorted((case.electrode, case.neighbour())))


def _open(case: SceneCase, info: Info) -> bool:
    return info.open_electrodes == (case.electrode,) and not info.bridged_electrodes


def _bridged(case: SceneCase, info: Info) -> bool:
    return info.bridged_electrodes == _pair(case) and not info.open_electrodes


def _noisy(case: SceneCase, info: Info) -> bool:
    return info.noisy_electrodes == (case.electrode,)


def _channel(case: SceneCase, info: Info) -> bool:
    return info.noisy_electrodes == _pair(case)


def _rubs(case: SceneCase, values: FloatArray) -> FloatArray:
    own = np.isin(ROWS, case.electrode).any(axis=1)
    by = 1 + 0.2 * stream(case.seed, f"{ROLE} rubs", case.number).standard_normal(len(values))
    return np.asarray(np.where(own, values * by, values))


def _channel_times(gain: float) -> Spoil:
    """Return a fault: a wrong gain of the channel that measures from the electrode to its
    neighbour."""
    return lambda case, values: np.asarray(
        np.where(ROWS[:, 2] == case.electrode, gain * values, values)
    )


def _shifted(by: int) -> Spoil:
    return lambda _, values: np.roll(values, by)


def _outlier(size: float, rows: IntArray) -> Spoil:
    """One reading of ``rows`` off, up or down; the same row for each size."""

    def spoil(case: SceneCase, values: FloatArray) -> FloatArray:
        generator, spoilt = stream(case.seed, f"{ROLE} outlier", case.number), values.copy()
        spoilt[generator.choice(rows)] += size * case.rms_v * generator.choice((-1, 1))
        return spoilt

    return spoil


def _jump(size: float) -> Spoil:
    return lambda case, values: values + size * case.rms_v


def _times(gain: float) -> Spoil:
    return lambda _, values: gain * values


EVERY, MEASURED = (
    np.arange(len(ROWS)),
    PROTOCOL.reciprocal_pairs().first,
)  # rows of a full and of a half scan
OUTLIERS = (0.05, 0.1, 0.15, 0.3, 5.0)  # of rms(V0)
JUMPS = (-0.05, -0.01, 0.01, 0.05)
GAINS = (0.8, 0.95, 0.99, 1.01, 1.05, 1.2)
NONE, DETACHED, OUTLIER = "none", "an electrode detached", "one row off by {:g} rms(V0)"
HALF = ", half scan"

FAULTS: tuple[InjectedFault, ...] = (
    InjectedFault(NONE, None),
    InjectedFault("none" + HALF, None, half=True),
    InjectedFault(DETACHED, _open, _solved("detached")),
    InjectedFault("neighbours bridged by 10 ohm", _bridged, _solved("bridged")),
    InjectedFault(
        "electrodes 3 apart bridged by 10 ohm", _says("model mismatch"), _solved("bridged apart")
    ),
    InjectedFault("neighbours swapped", _says("model mismatch"), _solved("swapped")),
    InjectedFault("electrodes 5 apart swapped", _says("model mismatch"), _solved("swapped apart")),
    *(
        InjectedFault(
            f"frame shifted by {n} row{'s' * (n > 1)}",
            _says("model mismatch"),
            readings=_shifted(n),
        )
        for n in (1, 13)
    ),
    InjectedFault(
        "frame shifted by 13 rows" + HALF, _says("model mismatch"), readings=_shifted(13), half=True
    ),
    InjectedFault("a channel's polarity flipped", _channel, _channel_times(-1.0)),
    InjectedFault(
        "a channel's polarity flipped" + HALF,
        _says("model mismatch"),
        _channel_times(-1.0),
        half=True,
    ),
    InjectedFault("a channel's gain off by 10 %", _channel, _channel_times(1.1)),
    InjectedFault("an electrode's readings off by 20 % at random", _noisy, _rubs),
    *(
        InjectedFault(OUTLIER.format(size), _says("outlier"), readings=_outlier(size, EVERY))
        for size in OUTLIERS
    ),
    *(
        InjectedFault(
            OUTLIER.format(size) + HALF,
            _says("outlier"),
            readings=_outlier(size, MEASURED),
            half=True,
        )
        for size in OUTLIERS
    ),
    InjectedFault(
        "touch during the tare, then lifted",
        _says("stale reference"),
        lambda case, _: case.volts["quiet"],
        lifted=True,
    ),
    *(
        InjectedFault(
            f"common mode of {100 * size:+g} % of rms(V0)",
            _says(CROWDED, "stale reference"),
            _jump(size),
        )
        for size in JUMPS
    ),
    *(
        InjectedFault(f"gain off by {100 * (gain - 1):+.0f} %", None, _times(gain), gain=gain)
        for gain in GAINS
    ),
)
