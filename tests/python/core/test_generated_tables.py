"""The generated tables are up to date, the core's table of options is Python's, and everything that
the headers declare is available in Python."""

import importlib
import re
import shlex
import subprocess
import sys
from dataclasses import asdict, fields

import pytest
from build_tools import CSRC, ROOT

from eitskin.config import load_toml
from eitskin.core.engine import load_core
from eitskin.core.options_table import CHOICES, OF_MODEL, RANGES, OptionFields
from eitskin.model.eitm import encode_model
from eitskin.model.options import default_options
from small_models import prebuilt

WIDTHS = ("float32", "float64")
CONSTANTS = load_toml(ROOT / "tables" / "constants.toml", "table")["module"]


def test_what_is_written_from_the_tables_is_up_to_date():
    command = [sys.executable, str(ROOT / "tables" / "make_tables.py"), "--check"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"run  python tables/make_tables.py\n{done.stdout}{done.stderr}"


@pytest.mark.parametrize("module", CONSTANTS, ids=[module["name"] for module in CONSTANTS])
def test_a_constant_is_used_in_its_module(module):
    header = ROOT / module.get("header", f"csrc/src/{module['name']}/constants.h")
    others = [path for path in header.parent.glob("*.[ch]") if path != header]
    text = "\n".join(path.read_text(encoding="ascii") for path in others)
    for name, *_, last in (row for group in module["group"] for row in group["rows"]):
        written_out = last in ("left * left * left", "ratio sqrt(sqrt(ratio))")
        macro = f"{module.get('prefix', 'EITS_')}{name}"
        assert re.search(rf"\b{macro}\b", text) or written_out, name


def test_constants_have_one_name_and_a_check_that_exists():
    groups = [group for module in CONSTANTS for group in module["group"]]
    names = [row[0] for group in groups for row in group["rows"]]
    assert len(set(names)) == len(names) > 100
    tests = [f"{path.stem[5:]}_f32" for path in (ROOT / "tests" / "c").glob("test_*.c")]
    tests += [f"fw_{path.stem[5:]}" for path in (ROOT / "tests" / "firmware").glob("test_*.c")]
    for group in groups:
        words = shlex.split(group["check"])
        if words[0] == "ctest":
            assert words[1:4] == ["--preset", "host", "-R"]
            assert any(re.search(words[4], name) for name in tests), words
        elif words[0] == "eitskin":  # studies/tests/test_commands.py
            assert words[1] in ("study", "bench"), words
        else:
            assert words[0] == "scripts/test", words
            assert (ROOT / words[1]).exists(), words


@pytest.mark.parametrize("width", WIDTHS)
def test_the_cores_options_are_pythons(width):
    """Names in order, places, sizes and ranges."""
    module = load_core(width)
    ffi, count = module.ffi, module.ffi.new("uint32_t *")
    table = module.lib.eits_option_table(count)
    places = dict(ffi.typeof("eits_options").fields)
    named = [ffi.string(table[k].name).decode() for k in range(count[0])]
    assert named == list(places)
    assert sorted(named) == sorted(one.name for one in fields(OptionFields))
    for k, name in enumerate(named):
        one = table[k]
        assert one.offset == places[name].offset
        assert one.size == ffi.sizeof(places[name].type)
        if name in RANGES:
            assert (one.least, one.greatest) == pytest.approx(RANGES[name], rel=1e-7)
        else:
            numbers = CHOICES.get(name, {"off": 0, "on": 1}).values()
            assert (one.least, one.greatest) == (0, max(numbers))


@pytest.mark.parametrize("width", WIDTHS)
def test_a_models_options_are_the_same_in_both(width):
    module, model = load_core(width), prebuilt()[0]
    blob = encode_model(model)
    memory = module.ffi.new("uint64_t[]", len(blob) // 8 + 2)
    start = int(module.ffi.cast("uintptr_t", memory)) % 16
    aligned = module.ffi.cast("uint8_t *", memory) + (16 - start) % 16
    module.ffi.memmove(aligned, blob, len(blob))
    opened, options = module.ffi.new("eits_model *"), module.ffi.new("eits_options *")
    assert module.lib.eits_model_open(opened, aligned, len(blob)) == 0
    assert module.lib.eits_options_default(opened, options) == 0
    for name, value in asdict(default_options(model)).items():
        stated = CHOICES[name][value] if name in CHOICES else value
        assert getattr(options, name) == pytest.approx(float(stated), rel=1e-7)
    assert {one.name for one in fields(model.defaults)} >= set(OF_MODEL)


@pytest.mark.parametrize("name", ["_core_f32", "_core_f64"])
def test_python_sees_all_that_the_headers_declare(name):
    module = importlib.import_module(f"eitskin.core.{name}")
    text = "\n".join(path.read_text() for path in (CSRC / "include" / "eitskin").glob("*.h"))
    bare = re.sub(r"/\*.*?\*/", " ", text, flags=re.S)
    declared = set(re.findall(r"\b(eits_\w+)\([^()]*\);", bare))
    types = set(re.findall(r"\} (eits_\w+);", bare))
    assert len(declared) > 20
    assert len(types) > 20
    assert declared <= set(dir(module.lib))
    assert types <= set(module.ffi.list_types()[0])
