"""The catalogue's group Problem: what is wrong with the numbers of the least-squares problem
itself."""

from __future__ import annotations

from hard_case import Case

CASES = (
    Case(
        "problem/lambda-ends",
        "Lambda 0, at its maximum, and beyond",
        "The weight of sparsity is 0, or a hair below, at, or above lambda_max, the least at which"
        " zero is the optimum.",
        "At 0 the problem need not have one optimum; at lambda_max the answer flips between nothing"
        " and nearly nothing.",
        "From lambda_max on the image is exactly zero and the stop says so; below, it is finite and"
        " no worse than zero.",
        ("hard_cases/test_lambda_ends.py::test_lambda_ends",),
    ),
    Case(
        "problem/any",
        "Any problem at all",
        "Hypothesis makes 150 problems of every solver, sign and storage, and spoils their"
        " matrices.",
        "Nobody thinks of every way in which a matrix can be bad, or in which two such ways meet.",
        "Every result is finite; objective, residual and duality gap are no worse than at zero; and"
        " what is reported is what float64 arithmetic finds at the same coefficients, all to the"
        " rounding of the sums.",
        ("hard_cases/test_random.py::test_any_problem",),
    ),
    Case(
        "problem/iterations",
        "From iteration to iteration",
        "A solve is cut after 1, 2, 3 and up to 100 iterations.",
        "FISTA is no descent method, and momentum carries rounding along.",
        "Coordinate descent and active set never raise the objective but by rounding; FISTA and its"
        " working set may ripple, but stay within FISTA's rate for inexact gradients.",
        ("hard_cases/test_iterations.py::test_iterations",),
    ),
    Case(
        "problem/float32-against-float64",
        "Float32 beside float64",
        "The same source is run in both widths, to the same gap.",
        "The narrow one's rounding may be multiplied by the problem's condition.",
        "Both reach the gap; S x agrees within what two gaps allow by strong convexity, and the"
        " coefficients within that over the least singular value of the columns in use.",
        ("hard_cases/test_iterations.py::test_float32_against_float64",),
    ),
    Case(
        "problem/units",
        "Units of model and data",
        "Model and reduced data are scaled by 1e-30 to 1e30, each alone, both together, and against"
        " each other.",
        "Squares leave float32 at 1e-19 and 1e19; denormal numbers lose their digits and cost"
        " time.",
        "Data of 4.4e-16 to 9e18 give the same image in other units. Smaller ones give zero, which"
        " the stop says; larger ones are refused with status NOT_FINITE; a model whose Lipschitz"
        " constant is no normal float32 is refused in one line.",
        (
            "hard_cases/test_units.py::test_units_of_model_and_data",
            "hard_cases/test_units.py::test_a_model_that_float32_cannot_hold_is_refused_in_one_line",
        ),
    ),
    Case(
        "problem/units-of-frames",
        "Units of the frames",
        "Frames and quiet frames come in units from 1e-38 to 1e37 volts.",
        "A front end's numbers may be counts, microvolts or anything; the squares of the noise"
        " leave float32 first.",
        "The gain brings them to the model's volts: the same data, image and touches to rounding,"
        " with the noise in the frames' own units.",
        (
            "hard_cases/test_units.py::test_units_of_frames",
            "hard_cases/test_units.py::test_the_noise_has_the_units_of_the_frames",
        ),
    ),
    Case(
        "problem/duplicate-columns",
        "Duplicate and opposite columns",
        "Pixels that are seen alike: equal columns, opposite ones, and ones that differ by 1e-7.",
        "Weight may be shared among them in any way; a factor of their products is singular.",
        "Sound results from every solver; the active set holds no more columns than there are"
        " directions.",
        ("hard_cases/test_columns.py::test_columns",),
    ),
    Case(
        "problem/zero-columns",
        "Zero columns",
        "Pixels that no electrode sees, some or all.",
        "Coordinate descent divides by a column's square.",
        "Their coefficients stay exactly zero; a skin that sees nothing gives zero.",
        ("hard_cases/test_columns.py::test_columns",),
    ),
    Case(
        "problem/low-rank",
        "Low ranks",
        "A matrix of 20 rows and 64 columns within 1, 2 or 7 directions, or whose singular values"
        " fall by half each.",
        "Many supports explain the data equally well.",
        "Sound results from every solver; the active set holds no more columns than there are"
        " directions.",
        ("hard_cases/test_columns.py::test_columns",),
    ),
    Case(
        "problem/whitened",
        "Whitened matrices",
        "All eigenvalues of S S' are 1, as the reduction aims at.",
        "Noise in weak directions is as loud as the signal; too long a step diverges fastest here.",
        "Sound results from every solver.",
        ("hard_cases/test_columns.py::test_columns",),
    ),
    Case(
        "problem/steep-columns",
        "Columns from 1e-6 to 1e6 in length",
        "Sensitivity falls by twelve orders from the rim to the middle.",
        "Sums of float32 lose the small ones beside the large.",
        "Sound results from every solver.",
        ("hard_cases/test_columns.py::test_columns",),
    ),
    Case(
        "problem/step-too-long",
        "A Lipschitz constant understated",
        "The model states a constant too small by 2 to 1e20, or too large by 10.",
        "FISTA's step is its inverse: the iterates grow without bound, or are all thrown to zero by"
        " the sign rule.",
        "The step is halved, up to 2^8 times, and the solve started over: of 300 iterations enough"
        " are left to lose 99 % of what can be lost. Where that does not do, or there is no time,"
        ' the image is zero and the stop is "diverged": never a wrong image, never a blank one'
        " without a word.",
        ("hard_cases/test_step.py::test_step_too_long",),
    ),
    Case(
        "problem/ill-conditioned-skins",
        "Ill-conditioned skins",
        "16 electrodes on a quarter of the rim; a strip of 240 x 20 mm; 32 and 64 electrodes.",
        "Much of the skin is seen by nobody, or much the same by many; the mesher meets bare arcs"
        " longer than half of the rim.",
        "A model is built; images and touches are finite; each solver's result is sound; float32"
        " gives what float64 gives.",
        ("hard_cases/test_ill_skins.py::test_ill_conditioned_skins",),
    ),
    Case(
        "problem/quantised",
        "Quantised storage at its limits",
        "S as f16, i16 and i8: columns of four orders within, of four orders among them, at f16's"
        " end and in its denormals.",
        "A step is a share of a column's greatest number: what is small beside it is lost.",
        "Objective and S x differ from those of f32 by no more than follows from the step; what"
        " does not fit is refused in one line.",
        (
            "hard_cases/test_quantised.py::test_quantised",
            "hard_cases/test_quantised.py::test_what_does_not_fit_is_refused",
        ),
    ),
    Case(
        "problem/symmetry",
        "Renamed, turned, mirrored, scaled",
        "Electrodes under other numbers, channels in another order with their protocol, the disk"
        " turned by a quarter or mirrored, wires swapped, data scaled by a power of two or turned.",
        "A mistake in an index, a sign or a fold is an image in the wrong place.",
        "The same image, renamed likewise: bit for bit where no number is rounded anew, else to the"
        " rounding of the model's numbers.",
        (
            "hard_cases/test_symmetry.py::test_powers_of_two_and_turned_signs",
            "hard_cases/test_symmetry.py::test_polarity",
            "hard_cases/test_symmetry.py::test_electrodes_relabelled",
            "hard_cases/test_symmetry.py::test_channels_permuted_with_the_protocol",
            "hard_cases/test_symmetry.py::test_the_disk_turned_and_mirrored",
        ),
    ),
    Case(
        "problem/graceful-loss",
        "Noise, lost rows, coarse numbers",
        "Noise of 1e-4 to 1e-2 rms(V0), 4 to 64 of 208 rows left out, converters of 24 to 8 bits;"
        " quiet frames suffer alike.",
        "A solver near an edge may fall over it: a little more noise, and the image is another.",
        "The image changes in proportion to the damage, at most twice; at the worst level three"
        " quarters of it are left.",
        ("hard_cases/test_graceful.py::test_graceful_loss",),
        "hard-losses.png",
    ),
)
