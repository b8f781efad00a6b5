"""The catalogue's group Frames."""

from __future__ import annotations

from hard_case import Case

ROWS, ELECTRODES, DRIFT = (
    f"hard_cases/test_{name}.py" for name in ("rows", "electrodes", "reference_drift")
)

CASES: tuple[Case, ...] = (
    Case(
        "frames/clean",
        "Nothing wrong",
        "Random scenes at 60 dB with contact impedances that differ by a fifth.",
        "Whatever looks for faults must leave healthy frames alone.",
        "Nothing is found but, in a few scenes, that touches are hard to count; no row is left out;"
        " the image has the bits that it has without looking.",
        (f"{ROWS}::test_clean_frames_are_left_alone",),
    ),
    Case(
        "frames/zero-and-denormal",
        "Zeros and denormal numbers",
        "A frame of zeros, of denormal numbers, or with one row that fell to a denormal number.",
        "Every electrode looks open; ratios to the reference vanish, and logarithms of them do not"
        " exist.",
        "All zero is refused as a dead front end, not as sixteen open electrodes; the image is"
        " zero. All denormal shows no touch. One denormal row is a glitch: left out and counted.",
        (f"{ROWS}::test_zero_and_denormal", f"{ROWS}::test_one_denormal_row"),
    ),
    Case(
        "frames/not-finite",
        "NaN and infinities",
        "One, ten or forty rows are no finite numbers, or more than half of all.",
        "One NaN makes every pixel NaN if it comes through.",
        "Such rows are left out and counted; beyond max_masked the frame is refused, the image is"
        " zero, and the next good frame gives the bits that it always gave.",
        (f"{ROWS}::test_not_finite",),
    ),
    Case(
        "frames/glitch",
        "A glitch",
        "One row of a frame is off by 5 % of rms(V0) to five times that.",
        "The image has four to five times its peak, somewhere else.",
        "A full scan tells by the row's reciprocal and, which of the two is wrong, by the other"
        " rows: it is left out and counted, and at most 0.02 of the MIoU are lost. A half scan has"
        " no reciprocals: only what the other rows contradict is left out, and the mean loss is at"
        " most half of what it would be.",
        (f"{ROWS}::test_glitch", f"{ROWS}::test_glitch_in_half_scans"),
    ),
    Case(
        "frames/glitch-while-taring",
        "A glitch while taring",
        "One reading of one of 16 quiet frames is off by half of rms(V0).",
        "It moves the reference by a thirtieth and raises lambda_noise until light presses are"
        " gated.",
        "The reading is left out and counted; lambda_noise changes by at most 30 %, and at most"
        " 0.02 of the MIoU are lost.",
        (f"{ROWS}::test_glitch_while_taring",),
    ),
    Case(
        "frames/saturation",
        "Saturation",
        "Rows at the converter's limit: in the touched frame, in the quiet ones, in both.",
        "A clipped voltage is a finite number like any other; the image has up to nine times its"
        " peak.",
        "In a touched frame such rows are left out and counted apart; in a quiet one the reference"
        " is refused until the rows are masked.",
        (f"{ROWS}::test_saturation_in_touch", f"{ROWS}::test_saturation_in_baseline"),
    ),
    Case(
        "frames/detached",
        "A detached electrode",
        "An electrode comes off between two frames: its 52 rows read noise.",
        "Rows of zero are a huge change: the image shows it in place of the touches.",
        "The electrode is named in the very frame, and exactly its rows are left out.",
        (f"{ELECTRODES}::test_detached",),
    ),
    Case(
        "frames/bridged",
        "Bridged electrodes",
        "A drop of gel joins two electrodes by 10 ohm, neighbours or others.",
        "Between neighbours only the rows across them die; between others none does.",
        "Neighbours are named in the very frame and left out. A bridge between others is a misfit,"
        " by name.",
        (f"{ELECTRODES}::test_bridged",),
    ),
    Case(
        "frames/swapped",
        "Swapped electrodes",
        "Two wires are exchanged between two frames, of neighbours or others.",
        "Every row is a good measurement of something else, reciprocity included.",
        "A misfit, by name: voltages of a sheet do not turn their sign.",
        (f"{ELECTRODES}::test_swapped",),
    ),
    Case(
        "frames/noisy",
        "A noisy electrode",
        "A contact rubs: each reading that uses it is off by a fifth at random.",
        "26 folds are wrong at once, each like a glitch.",
        "The electrode is named in the very frame, and exactly its rows are left out.",
        (f"{ELECTRODES}::test_noisy",),
    ),
    Case(
        "frames/polarity",
        "A channel's polarity flips",
        "All 13 rows of one pair of electrodes come with the other sign.",
        "The change is twice the voltage.",
        "Its two electrodes are named, the 13 rows are left out, their reciprocals stand for them:"
        " at most 0.02 of the MIoU are lost.",
        (f"{ELECTRODES}::test_polarity_flip",),
    ),
    Case(
        "frames/rotated",
        "Rotated channels",
        "A frame's rows are shifted by 1, 3, 13 or 65 places.",
        "Each number is a plausible voltage.",
        "A misfit, by name: reciprocals disagree all over.",
        (f"{ELECTRODES}::test_rotated",),
    ),
    Case(
        "frames/gain-drift",
        "Gain drift",
        "The current or the amplifier drifts by 1 to 20 % after the tare.",
        "5 % of every voltage is more than most touches make.",
        "The peak follows the gain; up to 5 % it loses at most 2 % of itself, up to 20 % at most 5"
        " %; at most 0.02 of the MIoU are lost.",
        (f"{DRIFT}::test_gain_drift",),
    ),
    Case(
        "frames/drying",
        "A gel that dries",
        "The baseline moves for an hour after the tare.",
        "The sheet's conductivity falls by a sixth; without the drift's direction ignored, that is"
        " all there is to see.",
        "Touches stay: at most one lost or too many, at most 0.03 of the MIoU lost.",
        (f"{DRIFT}::test_drying",),
    ),
    Case(
        "frames/common-mode",
        "A common-mode jump",
        "A constant of 1 or 5 % of rms(V0) is added to all rows.",
        "It is no drift of the gain, and nearly such as a sheet could give.",
        "No row is left out for it. 1 % costs at most 0.1 of the MIoU. 5 % spoils the image; at"
        " least half of such frames are named.",
        (f"{DRIFT}::test_common_mode_jump",),
    ),
    Case(
        "frames/touch-during-tare",
        "A touch during the tare",
        "The skin is tared while it is touched; then the touch goes.",
        "The reference is wrong, and nothing about it is odd.",
        "Nothing can be known then; once the touch has gone, every frame says that the reference is"
        " stale.",
        (f"{DRIFT}::test_touch_during_tare",),
    ),
    Case(
        "frames/lift-off",
        "Lift-off ghosts",
        "A touch is held for ten warm-started frames and lifted.",
        "A warm start that is not undone keeps a ghost at half of the peak for seconds.",
        "From the first frame on at most 2 % of the peak is left anywhere.",
        (f"{DRIFT}::test_lift_off",),
    ),
)
