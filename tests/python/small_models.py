"""Small skins, their models and frames, each made once and shared by many tests. Nothing here is
random without a seed."""

from dataclasses import dataclass
from functools import cache
from math import cos, radians, sin
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.model.build import BuildSettings, Linearisation, linearise, make_model
from eitskin.model.eitm import decode_model, encode_model
from eitskin.model.model import Model
from eitskin.model.prebuilt import load_prebuilt
from eitskin.scene.random_touches import random_touches
from eitskin.scene.simulate import Measurement, Simulated, simulate
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import Outline, disk, polygon
from eitskin.skin.protocol import Protocol, adjacent, opposite, skip
from eitskin.skin.skin import Skin, paper_skin

DISK_MM = 100.0
ELEMENTS = 900
PIXELS = 14
STORAGES = ("f32", "f16", "i16", "i8")
DATA_KINDS = ("difference", "normalised", "log-ratio")
SIGNS = ("increase", "decrease", "both")

# a skin of 100 mm with 8 electrodes and opposite drives, as its file has it
EIGHT_OPPOSITE_TOML = """
[skin]
name = "small"
diameter_mm = 100.0
thickness_mm = 5.0
conductivity_s_per_m = 0.1
[electrodes]
count = 8
width_mm = 5.0
[protocol]
kind = "opposite"
"""


def rounded_rectangle() -> Outline:
    """120 x 60 mm with corners of 15 mm radius, given clockwise."""
    corners = [(45, 15, 0), (-45, 15, 90), (-45, -15, 180), (45, -15, 270)]
    points = [
        (x + 15 * cos(radians(turn + 18 * k)), y + 15 * sin(radians(turn + 18 * k)))
        for x, y, turn in corners
        for k in range(6)
    ]
    return polygon(points[::-1])


def l_shape() -> Outline:
    return polygon([(0, 0), (100, 0), (100, 40), (40, 40), (40, 100), (0, 100)])


OUTLINES = {"disk": lambda: disk(DISK_MM), "rounded": rounded_rectangle, "l": l_shape}
PROTOCOLS = {"adjacent": adjacent, "opposite": opposite, "skip": lambda n: skip(n, 2)}


@dataclass(frozen=True, eq=False)
class Small:
    """A small skin and its linear answer."""

    skin: Skin
    protocol: Protocol
    linear: Linearisation

    def discs(self, generator: np.random.Generator, count: int, sign: str) -> FloatArray:
        """A change of conductivity (n,), S/m: ``count`` discs of random place and size."""
        changes = {"increase": [2.0], "decrease": [-0.5], "both": [-0.5, 2.0]}[sign]
        centres = self.linear.grid.centres_mm()
        size, change = np.ptp(centres, axis=0).min(), np.zeros(len(centres))
        for _ in range(count):
            middle = centres[generator.integers(len(centres))]
            near = np.linalg.norm(centres - middle, axis=1)
            inside = near <= generator.uniform(0.05, 0.12) * size
            share = generator.choice(changes) * generator.uniform(0.5, 1)
            change[inside] = share * self.skin.conductivity_s_per_m
        return change

    def frames(
        self, seed: int, count: int, sign: str = "increase", noise: float = 1e-3
    ) -> FloatArray:
        """Frames (count, m) V of the linear answer to one to three discs, with white noise of
        ``noise`` rms(V0).

        ``sign``: conductivity rises in all discs, falls in all, or "both".
        """
        generator, v0 = np.random.default_rng(seed), self.linear.v0_v
        sigma = noise * float(np.sqrt(np.mean(v0**2)))
        clean = [
            v0 + self.linear.jacobian @ self.discs(generator, int(generator.integers(1, 4)), sign)
            for _ in range(count)
        ]
        return np.array(clean) + sigma * generator.normal(size=(count, len(v0)))

    def untouched(self, seed: int, count: int, noise: float = 1e-3) -> FloatArray:
        """Frames (count, m) V of the untouched skin with white noise of ``noise`` rms(V0)."""
        generator, v0 = np.random.default_rng(seed), self.linear.v0_v
        return v0 + noise * float(np.sqrt(np.mean(v0**2))) * generator.normal(size=(count, len(v0)))


def small_skin(name: str, outline: Outline, electrodes: int) -> Skin:
    return Skin(name, outline, Electrodes(electrodes, 3.0), 0.02, 5.0)


@cache
def small(outline: str = "disk", kind: str = "adjacent", electrodes: int = 16) -> Small:
    """A skin of some 100 mm with about 150 pixels, and its linear answer."""
    skin = small_skin(outline, OUTLINES[outline](), electrodes)
    protocol = PROTOCOLS[kind](electrodes)
    return Small(skin, protocol, linearise(skin, protocol, pixels_across=PIXELS, elements=ELEMENTS))


@cache
def small_model(*of: Any, **named: Any) -> Model:
    """A model of ``small``, of what ``small_blob`` takes, as read from its bytes."""
    return decode_model(small_blob(*of, **named), "small model")


@cache
def small_blob(
    storage: str = "f32",
    data_kind: str = "difference",
    outline: str = "disk",
    kind: str = "adjacent",
    electrodes: int = 16,
    rank: int = 37,
) -> bytes:
    """Return the bytes of a small model. Its rank is not a multiple of 8, so that rows are
    padded."""
    s = small(outline, kind, electrodes)
    settings = BuildSettings(rank=rank, storage=storage, data_kind=data_kind)
    return encode_model(make_model(s.skin, s.protocol, s.linear, settings))


@cache
def tiny() -> Small:
    """A skin with 8 electrodes and 6 pixels across, and its linear answer."""
    skin, protocol = small_skin("tiny", disk(DISK_MM), 8), adjacent(8)
    return Small(skin, protocol, linearise(skin, protocol, pixels_across=6, elements=300))


@cache
def tiny_blob(storage: str = "f32") -> bytes:
    """A model of a few kB, every byte of which can be tried: 8 electrodes, rank 5."""
    settings = BuildSettings(rank=5, storage=storage)
    return encode_model(make_model(tiny().skin, tiny().protocol, tiny().linear, settings))


@cache
def prebuilt() -> tuple[Model, bytes]:
    return load_prebuilt()


@cache
def session(role: str = "test", scenes: int = 20, seed: int = 3, snr_db: float = 60.0) -> Simulated:
    """The paper's skin, touched one to three times a scene, simulated nonlinearly on another mesh
    with 64 untouched frames."""
    skin = paper_skin()
    touches = random_touches(skin.outline, seed, scenes, role)
    return simulate(skin, adjacent(16), touches, measurement=Measurement(snr_db=snr_db))
