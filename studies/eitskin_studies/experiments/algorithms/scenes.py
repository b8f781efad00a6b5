"""The scenes of this experiment: random touches, a set for each number of them, and one scene for
each that is drawn by hand."""

from eitskin.scene.random_touches import TouchRules, TouchScene, TouchSet, TrueTouch, random_touches
from eitskin.skin.outline import Outline

NUMBERS = {1: "single", 2: "double", 3: "triple"}
SHOWN = "shown"
_SHOWN = {
    "single": (TrueTouch(32.0, 28.0, 10.0, 6.0),),
    "double": (TrueTouch(-42.0, 18.0, 9.0, 6.0), TrueTouch(30.0, -22.0, 11.0, 4.0)),
    "triple": (
        TrueTouch(-48.0, -22.0, 10.0, 5.0),
        TrueTouch(2.0, 44.0, 8.0, 8.0),
        TrueTouch(36.0, -20.0, 11.0, 4.0),
    ),
}


def touch_set(outline: Outline, number: int, seed: int, count: int) -> TouchSet:
    """``count`` scenes of ``number`` touches each, drawn by the rules of ``eitskin compare``."""
    return random_touches(outline, seed, count, NUMBERS[number], TouchRules(count=(number, number)))


def shown_set(seed: int) -> TouchSet:
    """The scenes of the pictures: places, sizes and contrasts are the same for every seed, contacts
    and noise are not."""
    return TouchSet(
        SHOWN, seed, tuple(TouchScene(f"{name} touch", touches) for name, touches in _SHOWN.items())
    )
