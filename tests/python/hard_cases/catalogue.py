"""All hard cases, as ``cases.toml`` has them."""

import ast
from dataclasses import dataclass, field
from pathlib import Path

from eitskin.config import load_toml

HERE = Path(__file__).resolve().parent
TESTS = HERE.parent
ROOT = TESTS.parents[1]


@dataclass(frozen=True)
class Case:
    """A case that makes an EIT skin's numbers go wrong; ``cases.toml`` explains the fields."""

    id: str
    what: str
    promise: str
    tried: str
    tests: list[str]
    picture: str | None = None
    peers: list[str] = field(default_factory=list)

    @property
    def group(self) -> str:
        return self.id.split("/")[0]


def file_of(test: str) -> str:
    """Return the path of a test's file from the root."""
    return f"tests/python/{test.split('::')[0]}" if "::" in test else test


def _read(path: Path) -> tuple[Case, ...]:
    groups = load_toml(path, "catalogue of hard cases")
    return tuple(
        Case(f"{group}/{name}", **one)
        for group, cases in groups.items()
        for name, one in cases.items()
    )


CASES = _read(HERE / "cases.toml")
GROUPS = tuple(dict.fromkeys(case.group for case in CASES))


def tests_in(path: Path) -> list[str]:
    """The names of the test functions at the top of a module, and in its classes."""
    nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    functions = [node.name for node in nodes if isinstance(node, ast.FunctionDef)]
    return [name for name in functions if name.startswith("test_")]


def exists(test: str) -> bool:
    path = ROOT / file_of(test)
    return path.is_file() and ("::" not in test or test.split("::")[1] in tests_in(path))


def hard_tests() -> set[str]:
    """Every test of this folder, but those of the catalogue itself."""
    return {
        f"{path.parent.name}/{path.name}::{name}"
        for path in HERE.glob("test_*.py")
        for name in tests_in(path)
        if path.name != "test_catalogue.py"
    }
