"""Simulate frames of touches: every scene is solved nonlinearly on a fine mesh, then measured
imperfectly.

The mesh differs from the one that images are reconstructed on; otherwise the comparison would be
unfair (an "inverse crime"). :class:`Measurement` names the imperfections. Each has its own random
stream (``eitskin.scene.streams``): turning one off does not change the samples of the others.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.errors import UsageError
from eitskin.fem.cem import ForwardModel
from eitskin.fem.mesh import Mesh, mesh_for_elements
from eitskin.frames.frames import Frames
from eitskin.progress import Progress, silent
from eitskin.scene.cover import Cover, with_touches
from eitskin.scene.random_touches import TouchScene, TouchSet, TrueTouch
from eitskin.scene.streams import stream
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin

ELEMENTS = 11_000


@dataclass(frozen=True)
class Measurement:
    """The imperfections of the measurement; None or 0 turns one off.

    Attributes:
        snr_db: 20 log10(rms(V0) / sigma) of white noise. sigma is the same for every row, and V0 is
            the noise-free frame of the untouched skin, rms over its m rows.
        adc_bits: resolution of the converter.
        adc_headroom: the converter spans +- adc_headroom max|V0|; values beyond are clipped.
        contact_spread: each electrode's contact impedance is the skin's times 1 + uniform(-s, s),
            drawn once for untouched and touched frames.
        quiet_frames: number of frames of the untouched skin; their mean is the reference, and their
            scatter shows the noise.
    """

    snr_db: float | None = 60.0
    adc_bits: int | None = 12
    adc_headroom: float = 1.25
    contact_spread: float = 0.2
    quiet_frames: int = 64

    def __post_init__(self) -> None:
        if not (self.adc_headroom > 0 and 0 <= self.contact_spread < 1 and self.quiet_frames >= 1):
            raise UsageError(
                "measurement: adc_headroom must be above 0, contact_spread within 0 to below 1,"
                " quiet_frames at least 1"
            )
        if self.adc_bits is not None and not 1 <= self.adc_bits <= 32:
            raise UsageError(
                f"measurement: adc_bits = {self.adc_bits} is out of range; use 1 to 32, or none"
            )


@dataclass(frozen=True, eq=False)
class Simulated:
    """A session: one skin with its contacts, its untouched frames, then one frame per scene; all in
    V.

    Attributes:
        skin, protocol, touches, measurement, seed: what was simulated; ``seed`` is that of contacts
            and noise.
        frames_v: (k, m) measured, one per scene.
        untouched_v: (q, m) measured without touches.
        exact_v: (k, m) the same scenes without noise and converter.
        exact_untouched_v: (m,) the untouched skin without noise and converter; rms(V0) refers to
        it.
        contact_impedance_ohm_m2: (L,) as drawn.
        noise_v: sigma of the noise, 0 without noise.
        lsb_v: a step of the converter, 0 without a converter.
        clipped: how many measured values were clipped by the converter.
        mesh_nodes, mesh_elements: size of the mesh that was solved on.
    """

    skin: Skin
    protocol: Protocol
    touches: TouchSet
    measurement: Measurement
    seed: int
    frames_v: FloatArray
    untouched_v: FloatArray
    exact_v: FloatArray
    exact_untouched_v: FloatArray
    contact_impedance_ohm_m2: FloatArray
    noise_v: float
    lsb_v: float
    clipped: int
    mesh_nodes: int
    mesh_elements: int

    @property
    def reference_v(self) -> FloatArray:
        """The mean untouched frame (m,)."""
        return np.asarray(self.untouched_v.mean(axis=0))

    def differences_v(self) -> FloatArray:
        """Return the touched frames minus the reference, (k, m)."""
        return self.frames_v - self.reference_v

    def as_frames(self) -> Frames:
        """Return the session as frames with truth, which can be saved or reconstructed like
        measured ones."""
        flat = [
            (k, touch) for k, scene in enumerate(self.touches.scenes) for touch in scene.touches
        ]
        contrast = np.array([touch.contrast for _, touch in flat])
        return Frames(
            protocol=self.protocol,
            voltage_v=self.frames_v,
            reference_voltage_v=self.untouched_v,
            frame_name=tuple(scene.name for scene in self.touches.scenes),
            touch_frame=np.array([k for k, _ in flat], dtype=np.int64),
            touch_xy_mm=np.array([(touch.x_mm, touch.y_mm) for _, touch in flat]).reshape(-1, 2),
            touch_radius_mm=np.array([touch.radius_mm for _, touch in flat]),
            touch_strength=contrast - 1.0,
            touch_sign=np.where(contrast >= 1, 1, -1).astype(np.int8),
            meta={
                "made_by": "simulated on a mesh",
                "touches": self.touches.name,
                "seed": self.seed,
                "snr_db": self.measurement.snr_db,
                "noise_v": self.noise_v,
                "lsb_v": self.lsb_v,
                "contact_spread": self.measurement.contact_spread,
                "mesh_elements": self.mesh_elements,
            },
        )


def conductivity_with(mesh: Mesh, touches: Iterable[TrueTouch], sheet_s_per_m: float) -> FloatArray:
    """Return the conductivity in S/m of a skin with touches as ``ForwardModel`` takes it: (E, 3),
    or (E,) without touches.

    Touches are assumed to lie apart; if they overlap, their changes add (at least a thousandth of
    the skin's conductivity remains).
    """
    return with_touches(np.full(mesh.n_elements, float(sheet_s_per_m)), Cover(mesh).change(touches))


def simulate(
    skin: Skin,
    protocol: Protocol,
    touches: TouchSet,
    *,
    measurement: Measurement | None = None,
    seed: int | None = None,
    mesh: Mesh | None = None,
    progress: Progress = silent,
) -> Simulated:
    """Simulate a session with ``touches``.

    Args:
        skin, protocol: what is touched and scanned.
        touches: one frame per scene.
        measurement: the imperfections; None takes the defaults.
        seed: the seed of contacts and noise; None takes that of ``touches``. Streams also depend on
            the role of ``touches``, so that training and test sessions with the same seed share
            nothing.
        mesh: the mesh to solve on; None makes one of about 11,000 elements.
        progress: wraps the scenes, to show progress.

    Raises:
        UsageError, GeometryError, ProtocolError, MissingExtraError: from meshing and the forward
            model.
    """
    how = Measurement() if measurement is None else measurement
    solved_on = mesh_for_elements(skin, ELEMENTS) if mesh is None else mesh
    own_seed = touches.seed if seed is None else seed
    role = touches.role
    drawn = stream(own_seed, f"contact {role}").uniform(-1.0, 1.0, skin.electrodes.count)
    contact = skin.electrodes.contact_impedance_ohm_m2 * (1.0 + drawn * how.contact_spread)
    forward = ForwardModel(solved_on, skin, protocol, contact)
    sheet = skin.conductivity_s_per_m
    untouched = forward.voltages(np.full(solved_on.n_elements, sheet))
    scenes: Iterable[TouchScene] = progress(touches.scenes)
    exact = np.array(
        [forward.voltages(conductivity_with(solved_on, scene.touches, sheet)) for scene in scenes]
    )

    noise_v = (
        0.0
        if how.snr_db is None
        else float(np.sqrt((untouched**2).mean()) / 10 ** (how.snr_db / 20))
    )
    span_v = how.adc_headroom * float(np.abs(untouched).max())
    lsb_v = 0.0 if how.adc_bits is None else 2 * span_v / 2**how.adc_bits
    converter = (noise_v, lsb_v, span_v, own_seed)
    untouched_v, untouched_clipped = measure(
        np.tile(untouched, (how.quiet_frames, 1)), *converter, f"quiet {role}"
    )
    frames_v, clipped = measure(exact, *converter, f"frame {role}")
    return Simulated(
        skin=skin,
        protocol=protocol,
        touches=touches,
        measurement=how,
        seed=own_seed,
        frames_v=frames_v,
        untouched_v=untouched_v,
        exact_v=exact,
        exact_untouched_v=untouched,
        contact_impedance_ohm_m2=np.asarray(contact),
        noise_v=noise_v,
        lsb_v=lsb_v,
        clipped=clipped + untouched_clipped,
        mesh_nodes=solved_on.n_nodes,
        mesh_elements=solved_on.n_elements,
    )


def measure(
    exact_v: FloatArray, noise_v: float, lsb_v: float, span_v: float, seed: int, name: str
) -> tuple[FloatArray, int]:
    """Add noise, then digitise: return the measured frames, and how many values clipped. Each frame
    has its own stream.

    Args:
        exact_v: (k, m) in V.
        noise_v, lsb_v, span_v: sigma of the noise, a step of the converter (0: none), and half its
            range, in V.
        seed, name: those of the streams.
    """
    rows = [
        stream(seed, f"noise {name}", k).standard_normal(exact_v.shape[1])
        for k in range(len(exact_v))
    ]
    noisy = exact_v + noise_v * np.array(rows)
    if not lsb_v:
        return noisy, 0
    top = span_v - lsb_v
    clipped = int(np.count_nonzero((noisy < -span_v) | (noisy > top)))
    return np.clip(np.round(noisy / lsb_v) * lsb_v, -span_v, top), clipped
