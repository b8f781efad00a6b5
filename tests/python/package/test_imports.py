"""Rules of imports: modules form no circle, each package imports only those from which its data
come, and the installed packages import nothing that only a checkout has."""

import ast
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
FOLDERS = {  # where each package stands
    "eitskin": ROOT / "python",
    "eitskin_emulator": ROOT / "firmware" / "emulator",
    "eitskin_hardware": ROOT / "hardware",
    "eitskin_studies": ROOT / "studies",
}
CHECKOUT = ("eitskin_emulator", "eitskin_hardware", "eitskin_studies")  # not in the wheel

# Each imports from its own line and those above it alone.
ORDER = (
    {"errors", "arrays", "process", "progress"},
    {"fileio", "threads"},
    {"config"},
    {"core", "skin", "firmware", "surface", "kinematics"},
    {"fem"},
    {"model"},
    {"frames"},
    {"scene"},
    {"oracle"},
    {"solve"},
    {"calibration"},
    {"device"},
    {"teaching", "tuning", "robot"},
    {"session"},
    {"bringup"},
    {"scoring"},
    {"truth", "demo"},
    {"view"},
    {"sinks"},
    {"page"},
    {"public"},
    {"reconstruct"},
    {"cli"},
    {"__main__"},
)


def modules(package: str) -> dict[str, Path]:
    found = {}
    folder = FOLDERS[package]
    for path in (folder / package).rglob("*.py"):
        parts = path.relative_to(folder).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@cache
def import_statements(path: Path) -> list[ast.Import | ast.ImportFrom]:
    """The file's statements that import, wherever they stand."""
    nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    return [node for node in nodes if isinstance(node, ast.Import | ast.ImportFrom)]


def imported(path: Path, known: Iterable[str]) -> set[str]:
    """The modules among ``known`` that the file imports."""
    names = set()
    for node in import_statements(path):
        if isinstance(node, ast.ImportFrom) and node.module:
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            names |= {name if name in known else node.module for name in inner}
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
    return names & set(known)


def circles(imports: dict[str, set[str]]) -> list[list[str]]:
    """Modules that reach themselves, together with those on the way."""

    def reached(start: str) -> set[str]:
        seen: set[str] = set()
        left = [start]
        while left:
            new = imports[left.pop()] - seen
            seen |= new
            left += new
        return seen

    reach = {name: reached(name) for name in imports}
    groups = {
        tuple(sorted(other for other in reach[name] if name in reach[other]))
        for name in imports
        if name in reach[name]
    }
    return [list(group) for group in sorted(groups)]


def graph(package: str) -> dict[str, set[str]]:
    found = modules(package)
    found.pop(package)  # which names lazily what is public, from every module
    imports = {name: imported(path, found) - {name} for name, path in found.items()}
    if package == "eitskin_studies":
        return imports  # a study's run imports its pictures, which import the study's package
    return {name: others | entered(name, others) & set(found) for name, others in imports.items()}


def entered(name: str, others: set[str]) -> set[str]:
    """Return the packages whose ``__init__`` Python runs on the way to ``others``, except those
    that contain ``name``."""
    parents = {other.rpartition(".")[0] for other in others}
    return {parent for parent in parents if not f"{name}.".startswith(f"{parent}.")}


@pytest.mark.parametrize("package", ["eitskin", *CHECKOUT])
def test_no_module_imports_itself_by_way_of_others(package):
    assert circles(graph(package)) == []


def test_imports_follow_the_data():
    def level(name: str) -> int:
        inner = name.removeprefix("eitskin.")
        return next(k for k, modules in enumerate(ORDER) if inner.partition(".")[0] in modules)

    against = {
        f"{name} imports {other}"
        for name, others in graph("eitskin").items()
        for other in others
        if "." in name and "." in other and level(other) > level(name)
    }
    assert against == set()


def test_the_installed_package_imports_one_thing_that_only_a_checkout_has():
    others = {name for package in CHECKOUT for name in modules(package)}
    found = {name: imported(path, others) for name, path in modules("eitskin").items()}
    assert {name: names for name, names in found.items() if names} == {
        "eitskin.device.open": {"eitskin_emulator.transport"},
    }


def packages_imported(folder: Path) -> dict[str, set[str]]:
    """Return for each file in ``folder`` the packages and single modules that it imports."""
    found = {}
    for path in folder.rglob("*.py"):
        names = set()
        for node in import_statements(path):
            if isinstance(node, ast.ImportFrom) and node.module:
                names.add(node.module.partition(".")[0])
            elif isinstance(node, ast.Import):
                names |= {alias.name.partition(".")[0] for alias in node.names}
        found[path.relative_to(ROOT).as_posix()] = names
    return found


@pytest.mark.parametrize("folder", ["python", "firmware", "hardware", "tests", "tables"])
def test_the_product_and_its_tests_import_nothing_of_the_studies(folder):
    files = packages_imported(ROOT / folder)
    assert files and [name for name, used in files.items() if "eitskin_studies" in used] == []


def test_the_studies_import_nothing_of_the_products_tests():
    ours = {path.stem for path in (ROOT / "tests").rglob("*.py")}
    ours -= {path.stem for path in (ROOT / "studies" / "tests").glob("*.py")}
    assert {name: used & ours for name, used in packages_imported(ROOT / "studies").items()
            if used & ours} == {}  # fmt: skip


def test_the_package_imports_nothing_that_only_unix_has():
    """Locks, terminals and ports are those of filelock, pyserial and the portable library."""
    unix = {"fcntl", "termios", "tty", "pty", "select", "resource", "grp", "pwd", "syslog"}
    found = packages_imported(ROOT / "python") | packages_imported(ROOT / "firmware")
    assert found and [name for name, used in found.items() if used & unix] == []
