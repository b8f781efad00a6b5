"""Mutants of the core and of the firmware's application and drivers, tried by the C tests.

The tests are built once (preset mutation): what is changed lies in shared libraries, and of a
mutant one object and its library are made, in a folder that the loader searches first. That one
object is under the address and undefined-behaviour sanitizers, so that an index beyond an array is
noticed where the numbers happen to stay right. A test may take so much of the processor's time, not
so much time.
"""

import functools
import json
import os
import re
import shlex
import signal
import subprocess
import threading
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from subprocess import DEVNULL

from mutants import ROOT, Mutant

BUILD = ROOT / "build" / "mutation"
TESTS = {"eitskin_f32": "tests/c", "eitskin_f64": "tests/c", "fw_app": "tests/firmware"}
FUZZ = ROOT / "tests" / "fuzz"
CORPORA = {  # what came of the fuzzer's kept inputs is a test, too
    "eitskin_f32": ("link_f32", "model_f32", "frame_f32", "skin_f32"),
    "eitskin_f64": ("model_f64", "frame_f64", "skin_f64"),
    "fw_app": ("board_f32",),
}
LIBRARIES = {
    "csrc/src": ("eitskin_f32", "eitskin_f64"),
    "firmware/app": ("fw_app",),
    "firmware/drivers": ("fw_app",),
}
MIN_CPU_SECONDS = 3
SLOWDOWN = 8
SANITIZED = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")


@dataclass
class Library:
    """A shared library: the command that compiles each source, and the seconds that each of its
    test programs takes. ``kills``: how many mutants of a source each test noticed; ``sound``: tests
    that pass on the sources as they are."""

    name: str
    commands: dict[str, list[str]]
    tests: dict[str, float] = field(default_factory=dict)
    kills: dict[str, Counter[str]] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
    sound: set[str] = field(default_factory=set)

    @property
    def file(self) -> Path:
        return next(BUILD.rglob(f"lib{self.name}.so"))

    def ordered_tests(self, file: str) -> list[str]:
        """Those that noticed mutants of the file before first, then those that name its functions
        most, quick ones before slow ones."""
        names = set(re.findall(r"^[a-z].*?\b(\w+)\(", (ROOT / file).read_text(), re.MULTILINE))
        kills = self.kills.setdefault(file, Counter())

        def rank(test: str) -> tuple[float, ...]:
            words = re.findall(r"\w+", self.texts[test])
            mentions = sum(word in names for word in words)
            slow = self.tests[test] > 0.5
            return (-kills[test], slow, -mentions, self.tests[test])

        return sorted(self.tests, key=rank)


def _after(command: Sequence[str], flag: str) -> str:
    return command[command.index(flag) + 1]


def read_libraries() -> dict[str, Library]:
    """Configure, read what is compiled how, build."""
    subprocess.run(["cmake", "--preset", "mutation"], cwd=ROOT, check=True, stdout=DEVNULL)
    libraries = {name: Library(name, {}) for name in TESTS}
    for entry in json.loads((BUILD / "compile_commands.json").read_text()):
        target = re.search(r"CMakeFiles/(\w+)\.dir/", entry["command"])
        if target and target[1] in libraries:
            file = Path(entry["file"]).relative_to(ROOT).as_posix()
            libraries[target[1]].commands[file] = shlex.split(entry["command"])
    build = ["cmake", "--build", "--preset", "mutation", "--", "--quiet"]
    subprocess.run(build, cwd=ROOT, check=True)
    return libraries


def read_costs() -> dict[str, float]:
    """Return how long each test took, as ctest found."""
    costs = BUILD / "Testing" / "Temporary" / "CTestCostData.txt"
    lines = map(str.split, costs.read_text().splitlines() if costs.is_file() else ())
    return {words[0]: float(words[2]) for words in lines if len(words) == 3}


def list_tests(library: Library) -> None:
    """Its test programs, and how long each takes; ctest runs them where one was never run."""
    start, ending = "", library.name.removeprefix("eitskin")
    if library.name == "fw_app":
        start, ending = "fw_", ""
    sources = sorted((ROOT / TESTS[library.name]).glob("test_*.c"))
    names = {f"{start}{source.stem[5:]}{ending}": source for source in sources}
    if not names.keys() <= read_costs().keys():
        subprocess.run(["ctest", "--preset", "mutation", "--quiet"], cwd=ROOT, check=True)
    seconds = read_costs()
    for name, source in names.items():
        library.tests[f"test_{name}"] = seconds[name]
        library.texts[f"test_{name}"] = source.read_text()
    for name in CORPORA[library.name]:
        library.tests[f"replay_{name}"] = seconds[f"corpus_{name}"]
        library.texts[f"replay_{name}"] = ""


@functools.cache
def sanitizer() -> str:
    """Return the library that the loader must take first: the compiler's run-time library."""
    asked = ["cc", "-print-file-name=libasan.so"]
    return subprocess.run(asked, check=True, capture_output=True, text=True).stdout.strip()


def run_test(library: Library, test: str, folder: Path, most_cpu_seconds: float) -> str:
    """How it fails with the libraries in ``folder``, before the sound ones; empty if it passes."""
    program = [str(BUILD / TESTS[library.name] / test)]
    if test.startswith("replay_"):
        name = test.removeprefix("replay_")
        corpus = FUZZ / "corpus" / f"{name.split('_')[0]}.zip"
        program = [str(BUILD / "tests" / "fuzz" / test), str(corpus), str(FUZZ / "sums.txt"), name]
    paths = [folder, BUILD, BUILD / "firmware"]
    limited = f'ulimit -t {max(1, round(most_cpu_seconds))}; exec "$0" "$@"'
    environment = {
        **os.environ,
        "LD_LIBRARY_PATH": ":".join(map(str, paths)),
        "LD_PRELOAD": sanitizer(),
        "ASAN_OPTIONS": "detect_leaks=0",
    }
    done = subprocess.run(
        ["sh", "-c", limited, *program], capture_output=True, check=False, env=environment
    )
    if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return "does not end"
    if done.returncode < 0:
        return "crashes"
    return "fails" if done.returncode else ""


class Workshop:
    """Tries mutants one at a time; each thread has its own."""

    lock = threading.Lock()

    def __init__(self, libraries: dict[str, Library], folder: Path) -> None:
        self.libraries, self.folder = libraries, folder
        folder.mkdir(parents=True)

    def compile(
        self, command: Sequence[str], file: str, text: str, flags: Sequence[str] = ()
    ) -> bytes:
        """The object of a source with this text; empty if the compiler refuses."""
        changed, made = self.folder / Path(file).name, self.folder / "mutant.o"
        changed.write_text(text)
        words = list(command)
        words[words.index("-o") + 1] = str(made)
        words[words.index("-c") + 1] = str(changed)
        words[1:1] = ["-w", "-iquote", str((ROOT / file).parent)]
        words = [word for word in words if not word.startswith("-W")] + [*flags]
        done = subprocess.run(words, cwd=BUILD, capture_output=True, check=False)
        return b"" if done.returncode else made.read_bytes()

    def is_same(self, library: Library, mutant: Mutant, source: str) -> bool:
        """Return whether the compiler makes the same of it."""
        command = library.commands[mutant.file]
        original, changed = (
            self.compile(command, mutant.file, text) for text in (source, mutant.applied(source))
        )
        return original == changed

    def try_mutant(self, mutant: Mutant) -> str:
        """Return the test that noticed; "same" or "refused" by the compiler; empty if none did."""
        source = (ROOT / mutant.file).read_text()
        for name in next(n for at, n in LIBRARIES.items() if mutant.file.startswith(at)):
            library = self.libraries[name]
            with Workshop.lock:
                if not library.tests:
                    list_tests(library)
            command = library.commands[mutant.file]
            if not self.compile(command, mutant.file, mutant.applied(source), SANITIZED):
                return "refused"
            self.link(library, mutant.file)
            for test in library.ordered_tests(mutant.file):
                most = max(MIN_CPU_SECONDS, SLOWDOWN * library.tests[test])
                failure = run_test(library, test, self.folder, most)
                if failure and test not in library.sound:
                    if without := run_test(library, test, BUILD, most):
                        raise SystemExit(f"{test} {without} on the sources as they are")
                    library.sound.add(test)
                if failure:
                    library.kills[mutant.file][test] += 1
                    return f"{test} {failure}"
            if self.is_same(library, mutant, source):
                return "same"
        return ""

    def link(self, library: Library, file: str) -> None:
        """The library with this worker's object of ``file``."""
        objects = {name: _after(words, "-o") for name, words in library.commands.items()}
        objects[file] = str(self.folder / "mutant.o")
        compiler = library.commands[file][0]
        command = [compiler, "-shared", *SANITIZED, "-o", str(self.folder / library.file.name)]
        subprocess.run([*command, *objects.values(), "-lm"], cwd=BUILD, check=True)


def sources() -> list[str]:
    """Return the sources that are changed: those that are compiled on a host."""
    build = (ROOT / folder for folder in LIBRARIES)
    files = (file.relative_to(ROOT).as_posix() for folder in build for file in folder.rglob("*.c"))
    return sorted(file for file in files if not file.endswith("/m7.c"))
