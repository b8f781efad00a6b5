"""The catalogue's group Physics: touches that are hard to see. Scenes are simulated at 60 dB and 12
bits on a mesh of 5,000 elements, which is not the model's; the paper's skin, the prebuilt model,
its default settings."""

from __future__ import annotations

from hard_case import Case

CASES = (
    Case(
        "physics/on-an-electrode",
        "A touch on an electrode",
        "9 mm, at the rim, over an electrode's middle or in the gap between two.",
        "It shunts the electrode's current; sensitivity is greatest there, and changes within"
        " millimetres.",
        "One touch, its centre within half of its radius, inside the skin.",
        ("hard_cases/test_hard_touches.py::test_on_an_electrode",),
        "hard-touches.png",
    ),
    Case(
        "physics/merge-and-part",
        "Touches that merge and part",
        "Two touches of 9 mm come from 80 mm apart to 18 mm, where they touch, and part again.",
        "Between two pixels' distance and none there is no telling whether it is one or two.",
        "From 30 mm on, two, each within half of its radius; nearer, one between them or two as"
        " near to their places; ids are never shared.",
        ("hard_cases/test_hard_touches.py::test_merge_and_part",),
    ),
    Case(
        "physics/centre",
        "A touch at the centre",
        "9 mm, contrast 5, in the middle of the skin.",
        "The data say least there: a tenth of what they say at the rim.",
        "One touch, within half of its radius.",
        ("hard_cases/test_hard_touches.py::test_centre",),
    ),
    Case(
        "physics/sizes",
        "Touches of 3 and of 40 mm",
        "Half of a pixel, and a fifth of the skin's width.",
        "The small one is hardly there; the large one exceeds touch_max_radius_mm.",
        "3 mm: one touch, to its diameter. 40 mm: touches only within it, though it may be more"
        " than one, and nine tenths of the image within it and a pixel around.",
        (
            "hard_cases/test_hard_touches.py::test_small",
            "hard_cases/test_hard_touches.py::test_large",
        ),
    ),
    Case(
        "physics/contrasts",
        "Contrasts from 1.01 to 1,000",
        "A touch of 9 mm conducts from a hundredth more than the sheet to a thousand times as"
        " much.",
        "The weakest lies within the noise; the strongest are far beyond where the linear model"
        " holds.",
        "From 1.5 on one touch within half of its radius, from 1.1 to its diameter; a stronger one"
        " never gets a lesser strength; 1.01 gives nothing or one.",
        ("hard_cases/test_hard_touches.py::test_contrasts",),
    ),
    Case(
        "physics/insulating",
        "Insulating touches",
        "Contrasts of 0.9 down to 0.001, looked for as decreases, as both, and wrongly as"
        " increases.",
        "An insulator seen as increases is a ring of small ones around it: ten touches and more.",
        "As decreases or both, one touch of negative strength within half of its radius. As"
        " increases, nothing of the other sign.",
        (
            "hard_cases/test_hard_touches.py::test_insulating",
            "hard_cases/test_hard_touches.py::test_insulating_under_the_other_sign",
        ),
    ),
    Case(
        "physics/light-presses",
        "Light presses at the detection limit",
        "Contrasts of 1.002 to 1.5 in 8 places, and 200 quiet frames.",
        "A lower gate sees lighter presses and more that are none.",
        "At most 2 % false alarms; a firmer press is detected in no fewer places; from twice the"
        " gate on, in all.",
        ("hard_cases/test_hard_touches.py::test_light_presses",),
    ),
    Case(
        "physics/crowds",
        "More touches than can be told apart",
        "10 to 14 touches, 5 within 30 mm, and 6 in a row a millimetre apart.",
        "There are fewer directions in the data than numbers to find; discs are fitted to what no"
        " disc made.",
        "Finite numbers, every centre within a pixel of the skin, no more touches than asked for;"
        " the finding crowded says that count and places are a guess, or each is found all the"
        " same. A group within the size of one touch is found as one.",
        ("hard_cases/test_hard_touches.py::test_more_touches_than_can_be_told_apart",),
    ),
    Case(
        "physics/entangled",
        "Touches in each other's field",
        "Two that overlap, two of opposite change side by side, three and twelve pieces of metal, a"
        " pair at the rim, one of half the skin; every part of the search by itself and all"
        " together, images refined.",
        "What dipoles tell of each other's field ends where discs touch; discs joined, parted and"
        " coupled in turn may run away.",
        "Finite numbers, every centre within a pixel of the skin, no more touches than asked for;"
        " two that overlap are one or two within their outline.",
        ("hard_cases/test_entangled.py::test_touches_in_each_others_field",),
    ),
)
