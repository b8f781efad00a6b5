"""Healthy frames from the closed form, seeded, and the faults that tests inject into them."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from eitskin.frames.frames import Frames
from eitskin.frames.homogeneous import homogeneous, touch_transfer, voltages_of
from eitskin.frames.orders import match_rows, source_table, swap_map
from eitskin.skin.protocol import Protocol, adjacent
from eitskin.skin.skin import Skin, paper_skin

FloatArray = NDArray[np.float64]

UNTOUCHED = 12
GAIN = 0.02
SNR_DB = 60.0
TOUCHES_MM = ((30.0, 40.0), (-50.0, 10.0))


def healthy_frames(
    seed: int,
    protocol: Protocol | None = None,
    skin: Skin | None = None,
    *,
    gain: float = GAIN,
    snr_db: float = SNR_DB,
    touches_mm: tuple[tuple[float, float], ...] = TOUCHES_MM,
    transfer_ohm: FloatArray | None = None,
    untouched: int = UNTOUCHED,
) -> Frames:
    """Untouched frames and one frame with touches that change its voltages by at most 5 %.

    Every row has a gain of its own (standard deviation ``gain``) and noise at ``snr_db``.
    """
    rng = np.random.default_rng(seed)
    protocol = adjacent(16) if protocol is None else protocol
    skin = paper_skin() if skin is None else skin
    rows = protocol.drive_measure.astype(np.int64)
    if transfer_ohm is None:
        transfer_ohm = homogeneous(skin, protocol.n_electrodes).transfer_ohm
    clean = voltages_of(transfer_ohm, rows) * protocol.current_a
    centres, radii = np.array(touches_mm), np.full(len(touches_mm), 8.0)
    signs = np.ones(len(touches_mm), dtype=np.int8)
    change = voltages_of(touch_transfer(skin, centres, radii, signs), rows)
    change *= 0.05 / np.abs(change[clean != 0] / clean[clean != 0]).max()
    gains = 1 + gain * rng.normal(size=len(rows))
    sigma = float(np.sqrt(np.mean(clean**2))) * 10 ** (-snr_db / 20)
    return Frames(
        protocol=protocol,
        voltage_v=(gains * (clean + change) + sigma * rng.normal(size=len(rows)))[None],
        reference_voltage_v=gains * clean + sigma * rng.normal(size=(untouched, len(rows))),
        touch_frame=np.zeros(len(centres), dtype=np.int64),
        touch_xy_mm=centres,
        touch_radius_mm=radii,
        touch_sign=signs,
    )


def changed(frames: Frames, reference: FloatArray, voltage: FloatArray) -> Frames:
    """The same frames with other voltages."""
    return replace(
        frames,
        reference_voltage_v=reference,
        voltage_v=voltage,
        frame_name=(),
        allow_nonfinite=True,
    )


def permuted(
    frames: Frames, index: NDArray[np.int64], sign: NDArray[np.int64] | None = None
) -> Frames:
    """Row r replaced by row ``index[r]`` times ``sign[r]``, labels left as they are."""
    factor = 1.0 if sign is None else sign
    return changed(
        frames, frames.reference_voltage_v[:, index] * factor, frames.voltage_v[:, index] * factor
    )


def times(frames: Frames, gains: FloatArray) -> Frames:
    """Every row r times ``gains[r]``."""
    return changed(frames, frames.reference_voltage_v * gains, frames.voltage_v * gains)


def as_if_electrodes(
    frames: Frames, electrodes: NDArray[np.int64], skin: Skin | None = None, seed: int = 0
) -> Frames:
    """Return the frames that are measured if wire e is connected to electrode ``electrodes[e]``."""
    skin = paper_skin() if skin is None else skin
    rows = frames.protocol.drive_measure.astype(np.int64)
    moved = Protocol(frames.protocol.n_electrodes, electrodes[rows], frames.protocol.current_a)
    assert frames.touch_xy_mm is not None
    touches = tuple((float(x), float(y)) for x, y in frames.touch_xy_mm)
    physical = healthy_frames(seed, moved, skin, touches_mm=touches)
    return changed(frames, physical.reference_voltage_v, physical.voltage_v)


def untouched_only(frames: Frames) -> Frames:
    """The same voltages without any known touch."""
    volts, untouched = frames.voltage_v, frames.reference_voltage_v
    return Frames(frames.protocol, volts, untouched, allow_nonfinite=True)


def rotating(frames: Frames) -> Frames:
    """The same in rotating order."""
    given = source_table("rotating", frames.protocol)
    return permuted(frames, match_rows(frames.protocol.drive_measure, given).index)


def reversed_sign(frames: Frames) -> Frames:
    return times(frames, np.float64(-1))


def dead(frames: Frames, *electrodes: int) -> Frames:
    gone = np.isin(frames.protocol.drive_measure, electrodes).any(axis=1)
    return times(frames, np.where(gone, 1e-3, 1.0))


def rows_off(frames: Frames, rows: list[int], gain: float) -> Frames:
    gains = np.ones(frames.protocol.n_rows)
    gains[rows] = gain
    return times(frames, gains)


def pair_off(frames: Frames, columns: slice, gain: float) -> Frames:
    """All rows that drive (columns 0, 1) or measure (2, 3) with the electrodes 3 and 4."""
    of_pair = (frames.protocol.drive_measure[:, columns] == [3, 4]).all(axis=1)
    return times(frames, np.where(of_pair, gain, 1.0))


def wired(seed: int, *pairs: tuple[int, int]) -> Frames:
    """With the wires of these electrodes exchanged."""
    return as_if_electrodes(healthy_frames(seed), swap_map(16, pairs), seed=seed)
