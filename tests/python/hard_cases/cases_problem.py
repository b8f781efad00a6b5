"""The catalogue's group Problem: what is wrong with the numbers of the least-squares problem itself."""

from __future__ import annotations

from hard_case import Case

CASES = (
    Case(
        "problem/lambda-ends",
        "Lambda 0, at its maximum, and beyond",
        "The weight of sparsity is 0, or a hair below, at, or above lambda_max, the least at which zero is the optimum.",
        "At 0 the problem need not have one optimum; at lambda_max the answer flips between nothing and nearly nothing.",
        "From lambda_max on the image is exactly zero and the stop says so; below, it is finite and no worse than zero.",
        ("hard_cases/test_lambda_ends.py::test_lambda_ends",),
    ),
)
