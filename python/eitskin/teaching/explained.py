"""Learn from presses by likelihood, and find out whether their places are mirrored or shifted by
some presses, and whether they explain the voltages at all."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.errors import FrameError
from eitskin.fem.grid import Grid, grid_for
from eitskin.progress import Progress
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import disk
from eitskin.skin.skin import Skin
from eitskin.teaching.checks import MIN_PRESSES
from eitskin.teaching.fit import (
    Learned,
    chosen_kernel,
    default_kernel,
    differences,
    first_amplitudes,
    learn,
)
from eitskin.teaching.kernel import Kernel, Placement, field_sensitivity
from eitskin.teaching.left_out import LeftOut, chance_share, leave_one_out, refined_places
from eitskin.teaching.presses import Presses, shifted

PIXELS_ACROSS = 32
MIRROR_GAIN = 10.0  # gain of log likelihood from which places count as mirrored
UNEXPLAINED = 0.8  # mean of chance_share and noise; 12 or more presses of a real skin have < .6
POOR = 0.3  # chance_share above which a note is added to the report
EXPLAINED = 0.5  # chance_share below which shifted places are accepted
MAX_SHIFT, ENOUGH_FOR_SHIFT = 3, 60  # presses


@dataclass(frozen=True, eq=False)
class Explained:
    """``presses`` and what was learned from them, on the ``grid`` of the skin ``seen_as``."""

    presses: Presses
    learned: Learned
    left_out: LeftOut
    grid: Grid
    seen_as: Skin
    width_mm: float
    notes: list[str]

    @property
    def chance(self) -> float:
        """The error of presses left out, as a fraction of the error by chance."""
        return chance_share(self.left_out.place_mm, self.learned.process.place_mm)

    @property
    def noise(self) -> float:
        """The noise as a fraction of a press."""
        return float(np.sqrt(np.mean(self.learned.process.left_out() ** 2)))

    @property
    def is_chance(self) -> bool:
        """Return whether the presses predict each other no better than presses at random places
        would."""
        return (self.chance + min(self.noise, 1)) / 2 > UNEXPLAINED


def untouched_progress(items: Iterable[Any], what: str) -> Iterable[Any]:
    return items


def explained(
    presses: Presses, skin: Skin | None, place_sd_mm: float, progress: Progress
) -> Explained:
    """Learn from ``presses`` by likelihood, and find out how well they predict each other."""
    notes, given = [], known_size(presses)
    kernel, width_mm = starting_kernel(presses, skin)
    if skin is None:
        notes.append(
            "no description of the skin: places that were not pressed are estimated only from"
            " nearby ones, and errors are about twice as large; give --skin"
        )
    else:
        kernel, mirrored = mirrored_or_not(kernel, presses, given, width_mm)
        if mirrored:
            notes.append(
                "the places are mirrored relative to the description; the model uses the places"
            )
    learned = learn(
        kernel, presses.place_mm, presses.difference, given, width_mm,
        progress=lambda items: progress(items, "angles"),
    )  # fmt: skip
    seen_as = seen_skin(learned, skin, presses)
    grid = grid_for(seen_as.outline, PIXELS_ACROSS)
    if place_sd_mm > 0:
        learned = refined_places(
            learned, grid, presses.place_mm, place_sd_mm, presses.difference, given, width_mm
        )
    left_out = leave_one_out(learned, grid)
    found = Explained(presses, learned, left_out, grid, seen_as, width_mm, notes)
    if found.chance > POOR:
        notes.append(
            f"the places explain the voltages badly (error of presses left out is"
            f" {100 * found.chance:.0f} % of chance): press more places, with one finger, and leave"
            " the skin untouched before each press"
        )
    return found


def shifted_or_refused(
    found: Explained, skin: Skin | None, place_sd_mm: float, progress: Progress
) -> Explained:
    """Handle ``found``, which explains nothing: shift the places by some presses, and return the
    result of the first shift that explains them.

    Raises:
        FrameError: no shift explains the voltages.
    """
    presses = found.presses
    few = presses.take(np.arange(min(len(presses), ENOUGH_FOR_SHIFT)))
    for by in shifts(presses):
        other = explained(shifted(few, by), skin, place_sd_mm, progress)
        if other.chance < EXPLAINED:
            if len(few) < len(presses):
                other = explained(shifted(presses, by), skin, place_sd_mm, progress)
            other.notes.append(shift_note(by))
            return other
    raise FrameError(
        "teach: the places do not explain the voltages, even if mirrored or shifted by up to"
        f" {MAX_SHIFT} presses: the error of presses left out is"
        f" {np.median(found.left_out.error_mm):.0f} mm, {100 * found.chance:.0f} % of chance, and"
        f" noise is {100 * found.noise:.0f} % of a press; record them again, each at its place in"
        " the plan, and check the electrodes with  eitskin doctor"
    )


def shifts(presses: Presses) -> list[int]:
    """Return the numbers of places by which presses may be shifted, likely ones first."""
    few = min(MAX_SHIFT, len(presses) - MIN_PRESSES)
    return [sign * by for by in range(1, few + 1) for sign in (1, -1)]


def shift_note(by: int) -> str:
    """Return a note that describes the shift."""
    count = abs(by)
    how = f"the first {count} were missed" if by > 0 else f"{count} more came first"
    if count == 1:
        how = "the first was missed" if by > 0 else "one more came first"
    return (
        f"the places are shifted by {'one press' if count == 1 else f'{count} presses'}, as if"
        f" {how}; the model uses each press with a {'later' if by > 0 else 'earlier'} place in the"
        " list, and leaves out the ones without a place"
    )


def known_size(presses: Presses) -> FloatArray | None:
    """Return what is known about the size of each press: the force, otherwise the depth, or
    None."""
    return presses.force_n if presses.force_n is not None else presses.depth_mm


def starting_kernel(presses: Presses, skin: Skin | None) -> tuple[Kernel, float]:
    """Return the kernel before any fit, and the width of the skin in mm."""
    if skin is None:
        kernel = default_kernel(None, presses.place_mm)
        return kernel, 4 * kernel.length_mm
    x0, y0, x1, y1 = skin.outline.bounding_box_mm
    sensitivity = field_sensitivity(skin, presses.protocol)
    return (
        default_kernel((sensitivity, skin.outline.centre_mm), presses.place_mm),
        max(x1 - x0, y1 - y0),
    )


def seen_skin(learned: Learned, skin: Skin | None, presses: Presses) -> Skin:
    """Return the skin in the coordinates of the presses; without a description, a disk around
    them."""
    if skin is not None:
        return learned.kernel.placement.skin_in_places(skin)

    reach = float(np.linalg.norm(presses.place_mm, axis=1).max())
    count = presses.protocol.n_electrodes
    return Skin("unknown", disk(2.2 * reach), Electrodes(count=count, width_mm=3.0 * reach / count))


def mirrored_or_not(
    kernel: Kernel, presses: Presses, given: FloatArray | None, width_mm: float
) -> tuple[Kernel, bool]:
    """Return ``kernel``, mirrored if that is far more likely, and whether it is."""
    few = np.linspace(0, len(presses) - 1, min(len(presses), 60)).astype(int)
    data, _ = differences(presses.difference[few])
    place = presses.place_mm[few]
    amplitude = first_amplitudes(
        place, data, None if given is None else given[few], 0.18 * width_mm
    )
    other = replace(kernel, placement=Placement(mirrored=True))
    (_, plain), (_, turned) = (
        chosen_kernel(one, place, amplitude, data, angles=32) for one in (kernel, other)
    )
    return (other, True) if turned > plain + MIRROR_GAIN else (kernel, False)
