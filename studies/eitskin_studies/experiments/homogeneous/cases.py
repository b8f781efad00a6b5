"""Untouched skins, each with one cause of unevenness, and the doctor's findings."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from eitskin.frames.doctor import examine, subject_from_frames
from eitskin.frames.frames import Frames
from eitskin.scene.compiler import compile_scene
from eitskin.scene.description import Scene
from eitskin.scene.runner import run as run_scene
from eitskin.scene.session import MeshCache
from eitskin.skin.protocol import Protocol, adjacent, table
from eitskin.skin.skin import Skin

UNTOUCHED_FRAMES, SNR_DB, BITS, HEADROOM = 32, 60.0, 12, 1.25
ELECTRODES = 16
CONTACTS: dict[str, Any] = {"contact_impedance": {"spread": 0.2}}
MEASURED: dict[str, Any] = {
    "noise": {"snr_db": SNR_DB},
    "adc": {"bits": BITS, "headroom": HEADROOM},
}
USUAL = CONTACTS | MEASURED
MEASURED_TANK, SIMULATED_TANK = "measured: water tank", "simulated: the same tank, nothing else"
IDEAL, INSTRUMENT = "nothing (mesh only)", f"contacts ±20 %, {SNR_DB:g} dB, {BITS} bits"


@dataclass(frozen=True)
class TankCase:
    """Something that makes a skin's frame uneven.

    Attributes:
        name: in tables.
        effects: of the scene; ``at`` names those in which the failing electrode and ``step``
            further ones are put in.
        swap: by how much further the electrode is whose wire is exchanged with the failing one's;
            0: none.
        fault: whether something is broken, which the doctor ought to name.
    """

    name: str
    effects: Mapping[str, Any]
    at: Mapping[str, int] = field(default_factory=dict)
    swap: int = 0
    fault: bool = False

    def effects_at(self, electrode: int) -> dict[str, Any]:
        """With the failing electrode filled in."""
        filled = {
            name: {"electrodes": [(electrode + k) % ELECTRODES for k in range(1 + step)]}
            for name, step in self.at.items()
        }
        return {
            **self.effects,
            **{name: {**self.effects[name], **one} for name, one in filled.items()},
        }

    def scan(self, electrode: int) -> Protocol:
        """Return the protocol that is really scanned while the adjacent one is assumed."""
        scan = adjacent(ELECTRODES)
        if not self.swap:
            return scan
        other, rows = (electrode + self.swap) % ELECTRODES, scan.drive_measure.astype(np.int64)
        turned = rows.copy()
        turned[rows == electrode], turned[rows == other] = other, electrode
        return table(ELECTRODES, turned)


CASES = (
    TankCase(IDEAL, {}),
    TankCase(INSTRUMENT, USUAL),
    *(
        TankCase(f"contacts ±{100 * s:g} %", USUAL | {"contact_impedance": {"spread": s}})
        for s in (0.5, 0.95)
    ),
    *(
        TankCase(
            f"electrodes up to {s:g} mm off their places",
            USUAL | {"misplacement": {"spread_mm": s}},
        )
        for s in (0.5, 1.0, 2.0)
    ),
    *(
        TankCase(f"channel gains ±{100 * s:g} %", USUAL | {"channel_gain": {"spread": s}})
        for s in (0.01, 0.05)
    ),
    *(
        TankCase(f"gel uneven by {100 * s:g} % (sd)", USUAL | {"background": {"spread": s}})
        for s in (0.05, 0.2)
    ),
    TankCase("crosstalk of -40 dB", USUAL | {"crosstalk": {"coupling_db": -40.0}}),
    TankCase("common-mode rejection of 40 dB", USUAL | {"common_mode": {"cmrr_db": 40.0}}),
    TankCase("an electrode off", USUAL | {"detached": {}}, {"detached": 0}, fault=True),
    TankCase(
        "two neighbours bridged by 10 ohm",
        USUAL | {"bridged": {"resistance_ohm": 10.0}},
        {"bridged": 1},
        fault=True,
    ),
    TankCase("wires of two neighbours exchanged", USUAL, swap=1, fault=True),
)


def examined(
    case: TankCase, skin: Skin, seed: int, electrode: int, elements: int, mesh_cache: MeshCache
) -> dict[str, Any]:
    """A session of the untouched ``skin``: its mean untouched frame "reference_v", and what the
    doctor finds, in JSON values.

    Raises:
        ConfigError, GeometryError, MissingExtraError: from the scene.
    """
    scene = Scene(
        name=case.name,
        skin=skin,
        protocol=case.scan(electrode),
        effects=case.effects_at(electrode),
        seed=seed,
        quiet_frames=UNTOUCHED_FRAMES if case.effects else 1,
        elements=elements,
        where="study homogeneous",
    )
    made = run_scene(compile_scene(scene, mesh_cache=mesh_cache))
    frames = Frames(adjacent(ELECTRODES), made.voltage_v, made.reference_voltage_v)
    return {
        "reference_v": frames.reference_voltage_v.mean(axis=0).tolist(),
        **doctored(frames, skin),
    }


def doctored(frames: Frames, skin: Skin) -> dict[str, Any]:
    """Return what ``eitskin doctor`` finds in ``frames``: "findings" [name, severity, text],
    "measured" and "untold"."""
    report = examine(subject_from_frames(frames, skin)).as_table()
    findings = [[one["name"], one["severity"], one["text"]] for one in report["findings"]]
    return {"findings": findings, "measured": report["measured"], "untold": report["untold"]}
