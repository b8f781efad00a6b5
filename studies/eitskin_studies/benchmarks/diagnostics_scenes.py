"""Scenes of random touches on the paper's skin with something wrong at one electrode, solved
without noise; and their frames.

Scene k has the contacts of its own session, +-20 %, and its fault at electrode k mod 16: all are
used alike.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.scene.compiler import compile_scene
from eitskin.scene.description import scene_from_table
from eitskin.scene.random_touches import TouchScene, random_touches
from eitskin.scene.runner import simulate_frames
from eitskin.scene.session import MeshCache
from eitskin.scene.simulate import measure
from eitskin.skin.protocol import Protocol, adjacent, table
from eitskin.skin.skin import paper_skin
from eitskin_studies.harness.sessions import converter_for

ROLE = "findings"  # keys the seeds of recorded results
ELECTRODES, UNTOUCHED_FRAMES, RATE_HZ, BRIDGE_OHM = 16, 16, 20.0, 10.0
PROTOCOL = adjacent(ELECTRODES)
ROWS = PROTOCOL.drive_measure.astype(np.int64)
CONTACTS: dict[str, Any] = {"contact_impedance": {"spread": 0.2}}

# effects that no diagnostic is about, one at a time, beside contacts, noise of 60 dB
IMPERFECT: dict[str, dict[str, Any]] = {
    "converter of 12 bits": {"adc": {"bits": 12, "headroom": 1.25}},
    "channel gains of 1 %": {"channel_gain": {"spread": 0.01}},
    "channel gains of 5 %": {"channel_gain": {"spread": 0.05}},
    "crosstalk of -60 dB": {"crosstalk": {"coupling_db": -60.0}},
    "crosstalk of -40 dB": {"crosstalk": {"coupling_db": -40.0}},
    "common-mode rejection of 60 dB": {"common_mode": {"cmrr_db": 60.0}},
    "common-mode rejection of 40 dB": {"common_mode": {"cmrr_db": 40.0}},
    "multiplexers": {"mux": {}},
    "jitter": {"jitter": {}},
    "source's impedance": {"source_impedance": {}},
    "amplitude's drift": {"amplitude_drift": {}},
    "temperature": {"temperature": {}},
    "phase": {"phase": {}},
    "charge injection": {"charge_injection": {}},
    "misplaced electrodes": {"misplacement": {}},
}


@dataclass(frozen=True, eq=False)
class SceneCase:
    """Scene ``number`` of ``seed``; ``volts`` (m,) by name, without noise: "quiet", "touched", and
    the touched frame with what is wrong with contacts and wires: "detached", "bridged", "bridged
    apart", "swapped", "swapped apart".
    """

    seed: int
    number: int
    scene: TouchScene
    volts: Mapping[str, FloatArray]

    @property
    def electrode(self) -> int:
        """That which fails."""
        return self.number % ELECTRODES

    def neighbour(self, step: int = 1) -> int:
        """So many electrodes on."""
        return (self.electrode + step) % ELECTRODES

    @property
    def rms_v(self) -> float:
        """The rms of V0, the untouched skin's frame."""
        return float(np.sqrt(np.mean(self.volts["quiet"] ** 2)))

    def measured(self, exact_v: FloatArray, snr_db: float, what: str) -> FloatArray:
        """Frames (k, m) with white noise of rms(V0) 10^(-snr_db / 20) and the converter of
        ``eitskin tradeoff``; the noise depends on scene and ``what`` only, so that what two faults
        cost is a paired difference."""
        how, top = converter_for(snr_db), float(np.abs(self.volts["quiet"]).max())
        span_v = how.adc_headroom * top
        assert how.adc_bits is not None
        noise_v = self.rms_v * 10 ** (-snr_db / 20)
        return measure(
            exact_v,
            noise_v,
            2 * span_v / 2**how.adc_bits,
            span_v,
            self.seed,
            f"{ROLE} {self.number} {what}",
        )[0]


class CaseMaker:
    """Makes cases; meshes are kept."""

    def __init__(self, seed: int) -> None:
        self.seed, self._bench = seed, MeshCache()

    def cases(self, numbers: Iterable[int], scenes: tuple[TouchScene, ...]) -> Iterator[SceneCase]:
        """Each scene, with every fault that has to be solved for."""
        for k in numbers:
            at, one, three, five = (int((k + step) % ELECTRODES) for step in (0, 1, 3, 5))
            frames = self.frames(
                k, scenes[k], {"detached": {"electrodes": [at], "from_s": 0.5 / RATE_HZ}}, 2
            )
            volts = {"quiet": frames[0], "touched": frames[1], "detached": frames[2]}
            for name, other in (("bridged", one), ("bridged apart", three)):
                bridge = {"electrodes": [at, other], "resistance_ohm": BRIDGE_OHM}
                volts[name] = self.frames(k, scenes[k], {"bridged": bridge})[-1]
            for name, other in (("swapped", one), ("swapped apart", five)):
                volts[name] = self.frames(k, scenes[k], {}, protocol=swapped(at, other))[-1]
            yield SceneCase(self.seed, k, scenes[k], volts)

    def plain(self, number: int, scene: TouchScene) -> SceneCase:
        """A scene that nothing is wrong with."""
        untouched, touched = self.frames(number, scene, {})
        return SceneCase(self.seed, number, scene, {"quiet": untouched, "touched": touched})

    def frames(
        self,
        number: int,
        scene: TouchScene,
        effects: Mapping[str, Any],
        frames: int = 1,
        quiet_frames: int = 1,
        protocol: Protocol | None = None,
    ) -> FloatArray:
        """Untouched and touched frames (quiet_frames + frames, m) V under contacts and
        ``effects``."""
        touches = [
            {"radius_mm": t.radius_mm, "x_mm": t.x_mm, "y_mm": t.y_mm, "contrast": t.contrast}
            for t in scene.touches
        ]
        session = {
            "name": ROLE, "skin": "paper", "seed": 1000 * self.seed + number, "frames": frames,
            "rate_hz": RATE_HZ,
            "quiet_frames": quiet_frames,
        }  # fmt: skip
        made = scene_from_table(
            {"scene": session, "touch": touches, "effects": CONTACTS | dict(effects)}, ROLE, Path()
        )
        if protocol is not None:
            made = replace(made, protocol=protocol)
        return simulate_frames(compile_scene(made, mesh_cache=self._bench)).voltage_v


def drawn(seed: int, count: int) -> tuple[TouchScene, ...]:
    """One to three touches each, as ``eitskin compare`` draws them."""
    return random_touches(paper_skin().outline, seed, count, ROLE).scenes


@lru_cache(maxsize=2 * ELECTRODES)
def swapped(i: int, j: int) -> Protocol:
    """The scan with two electrodes' wires exchanged."""
    rows = ROWS.copy()
    rows[i == ROWS], rows[j == ROWS] = j, i
    return table(ELECTRODES, rows)
