"""Sessions of gestures as the voltages of a board that scans while fingers land, move and lift.

The forward model is solved exactly at every half frame, on another mesh than the model's. A scan
takes the whole frame: row after row is read, and each row's voltage is interpolated in time between
the two solved states around its moment.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.diagnostics_table import Touch
from eitskin.errors import FrameError
from eitskin.fem.cem import ForwardModel
from eitskin.fem.mesh import mesh_for_elements
from eitskin.fileio import write_beside
from eitskin.model.model import Model
from eitskin.model.options import default_options, tracking
from eitskin.scene.cover import Cover
from eitskin.scene.forward_steps import Update, Work
from eitskin.scene.simulate import Measurement, measure
from eitskin.scene.streams import stream
from eitskin.scene.touch_path import sample, touches_at
from eitskin.solve.reconstructor import Reconstructor
from eitskin_studies.gestures.drawn import DrawnSession
from eitskin_studies.harness.snr import noise_deviation_v

ELEMENTS = 8000
RATE_HZ = 48.0
STATES_A_FRAME = 2


@dataclass(frozen=True, eq=False)
class TouchedFrame:
    """The touches that the core found in a frame whose scan began at ``time_us``."""

    time_us: int
    touches: tuple[Touch, ...]


class Simulator:
    """Solves sessions on one mesh of ``model``'s skin; exact voltages are kept in ``cache``."""

    def __init__(self, model: Model, cache: Path | None = None) -> None:
        self.model, self._cache = model, cache
        self._mesh = mesh_for_elements(model.skin, ELEMENTS)
        self._cover = Cover(self._mesh)

    def exact_v(self, session: DrawnSession, seed: int) -> FloatArray:
        """The untouched skin's frame, then the session's, without noise: (1 + f, m) V. Contacts are
        drawn with ``seed`` and the session's name."""
        kept = None if self._cache is None else self._cache / f"gestures-{session.name}.npz"
        if kept is not None and kept.exists():
            with np.load(kept) as stored:
                return np.asarray(stored["voltage_v"], dtype=np.float64)
        volts = self._solve(session, seed)
        if kept is not None:
            kept.parent.mkdir(parents=True, exist_ok=True)
            with write_beside(kept) as beside:
                np.savez_compressed(beside, voltage_v=volts)
        return volts

    def _solve(self, session: DrawnSession, seed: int) -> FloatArray:
        skin, protocol = self.model.skin, self.model.protocol
        spread = stream(seed, f"gesture contacts {session.name}").uniform(
            -1.0, 1.0, skin.electrodes.count
        )
        contact = skin.electrodes.contact_impedance_ohm_m2 * (
            1.0 + Measurement.contact_spread * spread
        )
        forward = ForwardModel(self._mesh, skin, protocol, contact)
        system = forward.system_for(np.asarray(contact == 0))
        reach = np.unique(system.unknown[: self._mesh.n_nodes])
        reach = reach[reach < system.size]
        solver = Update(forward, None, reach, Work())
        sheet = np.full(self._mesh.n_elements, skin.conductivity_s_per_m)
        frames = int(np.ceil(session.duration_s * RATE_HZ))
        times = np.arange(frames * STATES_A_FRAME + 1) / (RATE_HZ * STATES_A_FRAME)
        samples = [sample(track, times) for track in session.tracks]
        states = np.empty((len(times), protocol.n_rows))
        for k in range(len(times)):
            change = self._cover.change(touches_at(samples, k))
            solved = solver.electrodes(sheet, change, contact)
            states[k] = forward.patterns.voltages(solved) * protocol.current_a
        untouched = forward.voltages(sheet)
        return np.vstack([untouched, _scanned(states, frames)])


def _scanned(states: FloatArray, frames: int) -> FloatArray:
    """Frames (f, m) whose rows are read one after another."""
    rows = states.shape[1]
    place = (np.arange(frames)[:, None] + np.arange(rows)[None] / rows) * STATES_A_FRAME
    before = np.minimum(place.astype(np.int64), len(states) - 2)
    part, row = place - before, np.arange(rows)[None]
    return np.asarray((1 - part) * states[before, row] + part * states[before + 1, row])


def found_touches(
    skin: Reconstructor, exact_v: FloatArray, snr_db: float, seed: int, name: str
) -> list[TouchedFrame]:
    """The frames measured with noise and a converter of 12 bits, and what the core follows in
    them, as on a board."""
    noise_v = noise_deviation_v(exact_v[0], snr_db)
    span_v = Measurement.adc_headroom * float(np.abs(exact_v[0]).max())
    converter = (noise_v, 2 * span_v / 2**12, span_v, seed)
    tare_v = np.tile(exact_v[0], (Measurement.quiet_frames, 1))
    untouched_v, _ = measure(tare_v, *converter, f"quiet gestures {name}")
    frames_v, _ = measure(exact_v[1:], *converter, f"gestures {name}")
    skin.set_options(tracking(default_options(skin.model)))
    skin.tare(untouched_v)
    skin.forget()
    reported, place = [], np.arange(frames_v.shape[1]) / frames_v.shape[1]
    for number, frame in enumerate(frames_v):
        try:
            touches = skin.follow(frame, (number + place) / RATE_HZ).touches
        except FrameError:
            continue  # a stream makes no events of a rejected frame
        reported.append(TouchedFrame(round(number * 1e6 / RATE_HZ), touches))
    return reported
