"""The experiments by name; each is imported when it is run."""

import importlib
from typing import cast

from eitskin.config import nearest
from eitskin.errors import UsageError
from eitskin_studies.experiments.experiment import Experiment

EXPERIMENTS = {
    "algorithms": (
        "single, double and triple touch by every method, at fixed parameters and at each one's"
        " best (Figs. 7, 8)"
    ),
    "force": "weights at four radii, calibration, the smallest one detected (Figs. 9 to 11)",
    "multitouch": (
        "two to twelve touches: counts, positions, and when the core says that it cannot tell (Fig."
        " 12, Table 1)"
    ),
    "homogeneous": (
        "the 208-value waveform of an untouched skin, and what the doctor reads from it (Fig. 4b)"
    ),
    "electrodes": "16, 32 and 64 electrodes and skip patterns, at equal noise and at equal time",
    "patterns": (
        "drive patterns on 16 electrodes, where noise comes in volts, from the converter, or both,"
        " with one gain or a gain per row"
    ),
    "models": (
        "weights in fewer bits, 8 and 32 electrodes, a rectangle, a model taught from presses: each"
        " with its own numbers"
    ),
    "shapes": "a rounded rectangle, a forearm and a hand outline",
    "tank": "measured frames of water tanks, every method, plain and normalised difference",
    "other-worlds": (
        "touches counted where the model is wrong: other shapes, uneven sheets, drift, misplaced"
        " electrodes; what fails first"
    ),
    "belief": (
        "how sure the core is of each touch and of its place, and when it says that the count is"
        " uncertain: how often that is true"
    ),
    "teaching": (
        "a model taught from presses at known places on a measured skin, with every baseline on the"
        " same splits"
    ),
    "taught-sessions": (
        "measured presses streamed one after another to a taught model: ids, false touches, delay"
    ),
    "deformation": (
        "a skin stretched and bent, by the flat one's model, before and after a fresh tare"
    ),
    "surfaces": (
        "touches on a cylinder, a cone, a hemisphere, a saddle, a fingertip and a forearm, and on a"
        " forearm that flexes"
    ),
    "paper": "weights placed one after another from the most sensitive place (Fig. 12)",
    "fast-path": (
        "touches after each drive, while they land, move and lift: false ones, delay, error"
    ),
    "hands": (
        "hands in time before a simulated board: false touches, delay, error and diagnostics while"
        " one to five fingers land, slide and lift"
    ),
    "constants": (
        "each constant of the core halved and doubled: which judging scenes change, and by how much"
    ),
    "levers": (
        "what was tried to do better, each for itself: what helps for its MACs, and what does not"
    ),
}


def load(name: str) -> Experiment:
    """The experiment ``name``.

    Raises:
        UsageError: there is none.
    """
    if name not in EXPERIMENTS:
        raise UsageError(f"study: no experiment is named {name!r}; {nearest(name, EXPERIMENTS)}")
    module = f"eitskin_studies.experiments.{name.replace('-', '_')}"
    return cast(Experiment, importlib.import_module(module))
