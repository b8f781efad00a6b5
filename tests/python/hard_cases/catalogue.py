"""All hard cases, group by group."""

from __future__ import annotations

import ast
from pathlib import Path

import cases_bytes
import cases_frames
import cases_physics
import cases_problem
import cases_time

HERE = Path(__file__).resolve().parent
TESTS = HERE.parent
ROOT = TESTS.parents[1]

CASES = (
    *cases_frames.CASES,
    *cases_physics.CASES,
    *cases_problem.CASES,
    *cases_time.CASES,
    *cases_bytes.CASES,
)

OF_THE_CATALOGUE = "hard_cases/test_catalogue.py"


def tests_in(path: Path) -> list[str]:
    """The names of the test functions at the top of a module, and in its classes."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return [
        node.name
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
    ]


def exists(test: str) -> bool:
    """Whether what a case calls its test is there."""
    if "::" not in test:
        return (ROOT / test).is_file()
    file, name = test.split("::")
    return (TESTS / file).is_file() and name in tests_in(TESTS / file)


def hard_tests() -> set[str]:
    """Every test of this folder, but those of the catalogue itself."""
    found = {
        f"{path.parent.name}/{path.name}::{name}"
        for path in HERE.glob("test_*.py")
        for name in tests_in(path)
    }
    return {name for name in found if not name.startswith(OF_THE_CATALOGUE)}
