"""The scenes of ``eitskin bench limit``: exact frames of a round skin, with the slopes that the
bound needs. A folder keeps what was solved."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from eitskin.fileio import write_beside
from eitskin.progress import Progress, silent
from eitskin.scene.streams import stream
from eitskin.skin.skin import Skin
from eitskin_studies.benchmarks.limit_bound import AMPLITUDE_SD, ExactScene, exact_scene
from eitskin_studies.worlds.simulate import draw_touches
from eitskin_studies.worlds.worlds import EIGHT, FINGERS, TouchKinds

CONTACT_SPREAD = 0.2


@dataclass(frozen=True)
class LimitSet:
    """A set of scenes.

    Attributes:
        text: what the set holds.
        touches: how its touches are drawn.
        snr_db: the levels of noise at which it is measured; the first one stands for the set.
        sign: the changes that the core looks for; None keeps its option.
        amplitude_sd: the prior of the amplitude in the bound, as wide as the set draws it.
        part: the set's share of the scenes that are asked for; a smooth profile takes 30 times as
            long to solve as a disc.
    """

    text: str
    touches: TouchKinds
    snr_db: tuple[float, ...] = (60.0,)
    sign: str | None = None
    amplitude_sd: float = AMPLITUDE_SD
    part: float = 1.0


SETS: dict[str, LimitSet] = {
    "discs": LimitSet(
        "1 to 3 discs, radius 6 to 12 mm, contrast 3 to 10",
        TouchKinds(),
        (60.0, 40.0, 50.0, 70.0, 80.0),
    ),
    "light": LimitSet(
        "1 to 3 discs, radius 6 to 12 mm, contrast 1.15 to 2", TouchKinds(contrast=(1.15, 2.0))
    ),
    "insulating": LimitSet(
        "1 to 3 discs, radius 6 to 12 mm, contrast .1 to .5; both signs are looked for",
        TouchKinds(contrast=(0.1, 0.5)),
        sign="both",
        amplitude_sd=0.28,
    ),
    "ellipses": LimitSet(
        "1 to 3 ellipses, long over short axis 1.4 to 2.2",
        TouchKinds(aspect=(1.4, 2.2), shape="ellipse"),
    ),
    "fingers": LimitSet(
        "1 to 3 such ellipses with Hertz profile; a third of the scenes", FINGERS, part=1 / 3
    ),
    "eight": LimitSet(
        "8 discs of radius 9 mm and contrast 5, at least 36 mm apart", EIGHT, (80.0,)
    ),
}


def exact_scenes(
    skin: Skin,
    name: str,
    count: int,
    seed: int,
    folder: Path | None = None,
    progress: Progress = silent,
) -> list[ExactScene]:
    """Return the scenes of the set ``name``: ``count`` times its ``part``. Scene k depends on the
    seed, the name and k alone. ``folder``, if given, keeps each of them.

    Raises:
        GeometryError: the skin is not round, or the touches do not fit on it.
        FileError: the folder cannot be written.
    """
    numbers = range(max(1, round(count * SETS[name].part)))
    return [_kept(skin, name, k, seed, folder) for k in progress(numbers, f"scenes of {name}")]


def _kept(skin: Skin, name: str, k: int, seed: int, folder: Path | None) -> ExactScene:
    kinds = SETS[name].touches
    touches = draw_touches(skin, kinds, stream(seed, f"limit {name} touches", k))
    spread = stream(seed, f"limit {name} contact", k).uniform(-1, 1, skin.electrodes.count)
    contact = skin.electrodes.contact_impedance_ohm_m2 * (1 + CONTACT_SPREAD * spread)
    if folder is None:
        return exact_scene(skin, touches, contact)
    digest = hashlib.sha256(repr((skin, touches, contact.tolist())).encode()).hexdigest()[:16]
    path = folder / f"limit-{name}-{k}-{digest}.npz"
    arrays: Sequence[str] = [field.name for field in fields(ExactScene)][1:]
    if path.is_file():
        with np.load(path, allow_pickle=False) as kept:
            return ExactScene(touches, *(kept[one] for one in arrays))
    scene = exact_scene(skin, touches, contact)
    folder.mkdir(parents=True, exist_ok=True)
    with write_beside(path) as temporary:
        np.savez(
            temporary,
            untouched_v=scene.untouched_v,
            touched_v=scene.touched_v,
            slopes_v=scene.slopes_v,
            contact_slopes_v=scene.contact_slopes_v,
        )
    return scene
