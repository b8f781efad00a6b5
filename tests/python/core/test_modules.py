"""The modules of csrc/src and firmware: which may include which, and which part of a context each
writes."""

import re
from collections import Counter
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest
from build_tools import CSRC, ROOT

# from the ground up: a module includes those before it, and itself
MODULES = (
    "base",
    "kernels",
    "model",
    "context",
    "frame",
    "diagnostics",
    "solve",
    "multipole",
    "touch",
    "evidence",
    "joint",
    "api",
)
# of no stage of a frame; the first two know nothing of contexts
APART = {
    "link": ("base", "link"),
    "gesture": ("base", "gesture"),
    "fast": ("base", "context", "fast", "search"),
    "search": ("base", "fast", "search"),
}
# which modules write the fields of each part of a context; api lays out, and starts and ends stages
OWNERS = {
    "reference": {"frame"},
    "rows": {"diagnostics"},
    "frame": {"frame"},
    "projection": {"frame"},
    "whitening": {"frame"},
    "range": {"diagnostics"},
    "solver": {"solve"},
    "touch": {"touch"},
    "evidence": {"evidence"},
    "multipole": {"multipole"},
    "joint": {"joint"},
    "columns": {"context"},
    "options": set(),
}
# the firmware's folders, and those that each may include; `app` itself wires its modules
BELOW = {"hal", "drivers", "app/clock.h"}
FIRMWARE = {
    "hal": set(),
    "drivers": {"hal", "drivers"},
    "app/safety": BELOW | {"app/safety"},
    "app/acquire": BELOW | {"app/safety", "app/acquire"},
    "app/solve": BELOW | {"app/safety", "app/acquire", "app/solve"},
    "app/link": BELOW | {"app/safety", "app/acquire", "app/solve", "app/link"},
}
MOST_FILES = 13
SOURCES = sorted((CSRC / "src").rglob("*.[ch]"))


def module_of(path: Path) -> str:
    return path.relative_to(CSRC / "src").parts[0]


def includes(text: str) -> list[str]:
    """List the included files of the core, such as "frame/fold.h", without public headers
    ("eitskin/..."), which belong to no module."""
    names = re.findall(r'^\s*#\s*include\s*"([^"]+)"', text, re.M)
    return [name for name in names if not name.startswith("eitskin/")]


def allowed(module: str) -> tuple[str, ...]:
    return APART.get(module) or MODULES[: MODULES.index(module) + 1]


def strangers(text: str, module: str) -> list[str]:
    """Parts of the context that ``text`` assigns to although they belong to another module."""
    bare = re.sub(r"/\*.*?\*/", "", text, flags=re.S)
    written = re.findall(
        r"\bctx->(\w+)(?:\.\w+|->\w+|\[[^]]*\])+\s*(?:[-+*/|&^]|<<|>>)?=(?!=)", bare
    )
    written += re.findall(r"(?:\+\+|--)ctx->(\w+)\.", bare)
    return sorted({part for part in written if module not in OWNERS.get(part, {module})})


def test_a_file_keeps_to_its_module():
    for path in SOURCES:
        text, module = path.read_text(encoding="ascii"), module_of(path)
        assert {name.split("/")[0] for name in includes(text)} <= set(allowed(module)), path
        if module != "api":
            assert strangers(text, module) == [], path
            # memory that nobody owns is handed down, not fetched
            assert not re.search(r"\bctx->scratch\b", text), path


@pytest.mark.parametrize(
    ("folder", "read"),
    [
        (CSRC / "src", ("frame/fold", "context/context")),
        (ROOT / "firmware", ("app/instrument", "app/link/stream")),
    ],
    ids=["core", "firmware"],
)
def test_no_circle_of_files(folder, read):
    """A source and its header are one file here. ``read``: one that includes another."""
    edges: dict[str, set[str]] = {}
    for path in sorted(folder.rglob("*.[ch]")):
        name = str(path.relative_to(folder).with_suffix(""))
        others = {other.removesuffix(".h") for other in includes(path.read_text(encoding="ascii"))}
        edges.setdefault(name, set()).update(others - {name})
    TopologicalSorter(edges).prepare()  # which raises CycleError, with the circle
    assert read[1] in edges[read[0]]


def uses(texts: dict[str, str]) -> dict[str, set[str]]:
    """Return for each source the other sources whose functions it names; a header belongs to
    none."""
    bare = {name: re.sub(r"/\*.*?\*/", "", text, flags=re.S) for name, text in texts.items()}
    defined = re.compile(r"^(?!static|typedef)\w[\w *]*?\b(\w+)\([^;{}]*\)\s*\{", re.M)
    owner = {one: name for name, text in bare.items() for one in defined.findall(text)}
    return {
        name: {owner[word] for word in re.findall(r"\w+", text) if word in owner} - {name}
        for name, text in bare.items()
    }


def sources(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): path.read_text(encoding="ascii")
        for path in sorted(folder.rglob("*.c"))
        if "kernels" not in path.parts  # the same functions once for each processor
    }


def test_no_circle_of_calls():
    """Files could call each other in a circle although their includes form none, because one header
    may declare the functions of several files."""
    edges = uses(sources(CSRC / "src"))
    TopologicalSorter(edges).prepare()
    assert "frame/rows_out.c" in edges["frame/whitening.c"]
    assert "gesture/one_finger.c" in edges["gesture/gesture.c"]


def test_a_circle_of_calls_is_found():
    edges = uses(
        {"a.c": "void one(void)\n{\n    two();\n}\n", "b.c": "int two(int x)\n{\n    one();\n}\n"}
    )
    with pytest.raises(CycleError):
        TopologicalSorter(edges).prepare()


@pytest.mark.parametrize(("folder", "below"), FIRMWARE.items())
def test_the_firmwares_folders_include_only_those_below(folder, below):
    paths = sorted((ROOT / "firmware" / folder).rglob("*.[ch]"))
    assert paths
    for path in paths:
        for name in includes(path.read_text(encoding="ascii")):
            assert {name, name.rpartition("/")[0]} & below, f"{path.name}: {name}"


def test_the_firmwares_modules_hide_their_state():
    """The fields of a module are defined in its state.h. Other modules do not include it, so that
    the compiler lets them only call functions."""
    app = ROOT / "firmware" / "app"
    modules = [folder.removeprefix("app/") for folder in FIRMWARE if folder.startswith("app/")]
    assert {path.name for path in app.iterdir() if path.is_dir()} == set(modules)
    for path in sorted(app.rglob("*.[ch]")):
        shown = {name for name in includes(path.read_text(encoding="ascii")) if "state.h" in name}
        if path.name == "instrument.h":
            assert shown == {f"app/{module}/state.h" for module in modules}
        else:
            assert shown <= {f"app/{path.parent.name}/state.h"}, path.name
    for module in modules:
        state = (app / module / "state.h").read_text(encoding="ascii")
        assert len(re.findall(r"^struct fw_\w+ {", state, re.M)) == 1


def test_modules_are_small():
    counts = Counter(path.parent for path in SOURCES)
    assert {path.name for path in counts} == {*MODULES, *APART}
    assert max(counts.values()) <= MOST_FILES
