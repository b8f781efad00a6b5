"""The catalogue's group Time: what goes on for long, and what changes while it does."""

from __future__ import annotations

from hard_case import Case

CASES = (
    Case(
        "time/iterations",
        "A hundred thousand iterations",
        "Each solver is run for 100 to 100,000 iterations.",
        "Rounding may gather, momentum may grow, a counter may be too short.",
        "The objective is no higher than after a tenth of the iterations, but for the rounding of"
        " one sum each.",
        ("hard_cases/test_long_runs.py::test_a_hundred_thousand_iterations",),
    ),
    Case(
        "time/warm-frames",
        "Thousands of warm frames",
        "A touch is held for 3,000 frames, each of which starts where the last one ended, then"
        " lifted; a hand moves, presses and lifts for a million (scripts/soak).",
        "Rounding may gather from frame to frame; plain FISTA keeps a ghost of 0.6 of its peak for"
        " 50 frames.",
        "No frame's gap is above a cold one's; the image comes to rest; the first frame after"
        " lift-off is empty.",
        ("hard_cases/test_long_runs.py::test_warm_frames", "tests/soak/soak.c"),
    ),
    Case(
        "time/counters-wrap",
        "Counters that wrap",
        "Sequence numbers, generations of models and the board's clock pass their greatest value.",
        "A comparison that does not wrap takes what is new for old.",
        "Gaps are counted across it, late and double packets refused, the newer model wins, and"
        " slots keep their time.",
        (
            "device/test_sequence.py::test_gaps_are_counted_across_the_wrap",
            "device/test_sequence.py::test_duplicates_across_the_wrap",
            "device/test_upload.py::test_generations_wrap",
        ),
    ),
    Case(
        "time/model-swapped",
        "Model swapped in mid-stream",
        "Another model, of other storage, data kind, rank or skin, takes the first one's place; on"
        " a board, by an upload that may be cut at any byte.",
        "Coefficients, directions and columns held unpacked belong to the old one.",
        "Until it has a reference of its own every frame is refused with a zero image; then each"
        " frame is bit for bit as in a fresh context. A board keeps the old model until the new one"
        " is whole.",
        (
            "hard_cases/test_midstream.py::test_model_swapped",
            "device/test_upload.py::test_cut_at_any_byte_the_old_model_stays_and_the_next_upload_ends_it",
            "device/test_upload.py::test_the_scan_waits_while_a_model_comes",
        ),
    ),
    Case(
        "time/options-changed",
        "Options changed in mid-stream",
        "Solver, sign, lambda, projection, limits and gate change between two frames.",
        "What was prepared for the old ones, or is left over from them, may be used on.",
        "A cold frame is bit for bit as in a fresh context; a warm one has no coefficient of a sign"
        " no longer wanted.",
        ("hard_cases/test_midstream.py::test_options_changed",),
    ),
    Case(
        "time/tare-in-midstream",
        "Tare in mid-stream",
        "A new reference is taken at rest, after a drift of 10 %, and under a held touch; one tare"
        " is refused.",
        "Gain, noise, directions and warm start all belong to the old one.",
        "What follows is bit for bit as in a fresh context; after a tare that is refused, frames"
        " are refused until the next.",
        ("hard_cases/test_midstream.py::test_tare_in_midstream",),
    ),
    Case(
        "time/tracked-flicker",
        "Noise that flickers",
        "Frames of an untouched skin under a gate that is half as high as it should be.",
        "Each frame's noise has a peak somewhere, and single frames cannot tell it from a faint"
        " touch.",
        "Followed in time, a doubtful touch is told of only once it was found twice at one place.",
        ("hard_cases/test_tracked.py::test_noise_that_flickers",),
    ),
    Case(
        "time/tracked-lift",
        "Lift-off while touches are held",
        "A finger presses clearly, lifts, and presses again five frames later, then again after one"
        " frame without it.",
        "What holds a touch through missed frames may show a ghost after every lift.",
        "A clear touch is told no more from the first frame without it; the next one has a new id,"
        " but not after a single frame.",
        ("hard_cases/test_tracked.py::test_a_finger_that_lifts",),
    ),
    Case(
        "time/tracked-missing",
        "Frames missing under a moving finger",
        "Three frames are refused by the core, or never come, while a finger moves.",
        "A filter that expects the finger a frame's way further may lose it, or diverge.",
        "The finger keeps its id and is told where it is.",
        ("hard_cases/test_tracked.py::test_frames_that_are_missing",),
    ),
)
