"""Skins whose electrodes see little, or much of the same; each model is built once, on a coarse
mesh."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from eitskin.model.build import BuildSettings, Linearisation, linearise, make_model
from eitskin.model.eitm import decode_model, encode_model
from eitskin.model.model import Model
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import disk, polygon
from eitskin.skin.protocol import Protocol, adjacent
from eitskin.skin.skin import Skin


def of_disk(name: str, electrodes: Electrodes) -> Skin:
    """100 mm wide."""
    return Skin(name, disk(100.0), electrodes, 0.02, 5.0)


def strip() -> Skin:
    """A strip of 240 x 20 mm with 16 electrodes: its ends are far from everything."""
    outline = polygon([(-120, -10), (120, -10), (120, 10), (-120, 10)])
    return Skin("strip", outline, Electrodes(16, 3.0), 0.02, 1.0)


# bunched: on a quarter of the rim, 3 mm wide, 5 mm apart, of 314 mm
BUNCHED = Electrodes(16, 3.0, positions_mm=tuple(2.5 + 5.0 * k for k in range(16)))
SKINS = {
    "bunched": lambda: of_disk("bunched", BUNCHED),
    "strip": strip,
    "32 electrodes": lambda: of_disk("32 electrodes", Electrodes(32, 2.0)),
    "64 electrodes": lambda: of_disk("64 electrodes", Electrodes(64, 2.0)),
}


@dataclass(frozen=True, eq=False)
class HardSkin:
    """A skin's linear answer, model and bytes."""

    skin: Skin
    protocol: Protocol
    linear: Linearisation
    model: Model
    blob: bytes

    def untouched_v(self, count: int, noise: float = 1e-3) -> np.ndarray:
        """Return untouched frames (count, m), in V, with white noise of ``noise`` times rms(V0)."""
        return self._noisy(np.tile(self.linear.v0_v, (count, 1)), 1, noise)

    def frames_v(self, count: int, noise: float = 1e-3) -> np.ndarray:
        """Return frames (count, m), in V, each with two discs at random places, by the linear
        answer."""
        rng, centres = np.random.default_rng(2), self.linear.grid.centres_mm()
        size = np.ptp(centres, axis=0).min()
        frames = []
        for _ in range(count):
            change = np.zeros(len(centres))
            for _ in range(2):
                away = np.linalg.norm(centres - centres[rng.integers(len(centres))], axis=1)
                change[away <= 0.12 * size] = 2 * self.skin.conductivity_s_per_m
            frames.append(self.linear.v0_v + self.linear.jacobian @ change)
        return self._noisy(np.array(frames), 3, noise)

    def _noisy(self, clean: np.ndarray, seed: int, noise: float) -> np.ndarray:
        sigma = noise * float(np.sqrt(np.mean(self.linear.v0_v**2)))
        return np.asarray(clean + sigma * np.random.default_rng(seed).normal(size=clean.shape))


@cache
def hard_skin(name: str, storage: str = "f32") -> HardSkin:
    """By its name in ``SKINS``; the usual rank, coarse pixels."""
    skin = SKINS[name]()
    protocol = adjacent(skin.electrodes.count)
    linear = linearise(skin, protocol, pixels_across=48 if name == "strip" else 16, elements=1500)
    blob = encode_model(make_model(skin, protocol, linear, BuildSettings(storage=storage)))
    return HardSkin(skin, protocol, linear, decode_model(blob, name), blob)
