"""Finds the places in the core's sources that refuse something, and checks what a test run did
there.

A *site* is one of these, found in the text (comments and preprocessor lines aside):

- **value**: a statement that returns, assigns or passes an ``EITS_E_...`` or ``EITS_STOP_...``: it
  must have run.
- **passed on**: ``return status;`` under an ``if`` that asks for a status: it must have run.
- **counted**: ``++...errors`` or ``++...overruns``, and ``return 0;`` of a function that returns a
  size: it must have run.
- **choice**: a statement that chooses between a status and another (``? :``): each of its branches
  must have been taken.
- **guard**: the condition of the ``if`` right above a site, and each condition that compares a
  status with ``EITS_OK``: each branch must have been taken, so that every operand of ``||`` and
  ``&&`` has been what decided.
- **flag**: the definition of a variable that a choice or guard names: likewise.
- **predicate**: each ``return`` of a function of the same file that returns ``int`` and that a
  choice, guard or flag calls: it must have run, and each of its branches must have been taken.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from gcov_counts import FileCounts

VALUE = re.compile(r"\bEITS_(?:E|STOP)_\w+")
COMPARED = re.compile(r"[=!]=\s*EITS_(?:E|STOP)_\w+")
STATUS_ASKED = re.compile(r"[=!]=\s*EITS_OK\b")
COUNTED = re.compile(r"^\+\+[\w>.-]*(?:errors|overruns)$")
PASSED_ON = re.compile(r"^return\s+status$")
LABEL = re.compile(r"^(?:case\b[^:?]*|default\s*):\s*")
HEAD = re.compile(r"^(else\s+)?(if|while|for|switch)\s*\(")
FUNCTION = re.compile(r"^((?:[\w*]+\s+\**)+)(\w+)\s*\(")
NAME = re.compile(r"\b[A-Za-z_]\w*\b")


@dataclass(frozen=True)
class Span:
    """A piece of a source: its text in one line, and the lines that it stands on."""

    text: str
    first: int
    last: int


@dataclass(frozen=True)
class Leaf:
    """A statement without its conditions; ``guard`` is the nearest of those, where it is an
    ``if``."""

    span: Span
    guard: Span | None
    function: str
    returns: str


@dataclass(frozen=True)
class Site:
    """``branches``: each branch on its lines must have been taken; else one of its lines must have
    run."""

    file: str
    kind: str
    span: Span
    branches: bool


@dataclass(frozen=True)
class Missed:
    """A site that the tests did not do justice to, and how."""

    site: Site
    line: int
    what: str

    def __str__(self) -> str:
        return f"{self.site.file}:{self.line}: {self.site.kind}: {self.what}: {self.site.span.text}"


def find_sites(file: str, source: str) -> list[Site]:
    """All sites of one source, in order, each once."""
    leaves = list(_leaves(source))
    found: dict[tuple[str, Span], Site] = {}

    def add(kind: str, span: Span, branches: bool) -> None:
        found.setdefault((kind, span), Site(file, kind, span, branches))

    asked: list[
        tuple[str, Span]
    ] = []  # conditions whose names matter, and the function that they are in
    for leaf in leaves:
        kind = _kind(leaf)
        if kind:
            add(kind, leaf.span, kind == "choice")
        if kind == "choice":
            asked.append((leaf.function, leaf.span))
        if leaf.guard and (kind or STATUS_ASKED.search(leaf.guard.text)):
            add("guard", leaf.guard, True)
            asked.append((leaf.function, leaf.guard))
    called: set[str] = set()
    while asked:
        function, span = asked.pop()
        names = set(NAME.findall(span.text))
        for leaf in leaves:
            if (
                leaf.function == function
                and _defines(leaf.span.text) in names
                and ("flag", leaf.span) not in found
            ):
                add("flag", leaf.span, True)
                asked.append((function, leaf.span))
            if (
                leaf.function in names - called
                and leaf.returns == "int"
                and leaf.span.text.startswith("return")
            ):
                add("predicate", leaf.span, False)
                add("predicate", leaf.span if not leaf.guard else leaf.guard, True)
                asked.append((leaf.function, leaf.span))
        called |= names
    for site in list(found.values()):
        if site.kind == "predicate" and not site.branches and _operands(site.span.text):
            found["predicate's branches", site.span] = replace(site, branches=True)
    return sorted(set(found.values()), key=lambda site: (site.span.first, site.kind, site.branches))


def find_missed(site: Site, counts: FileCounts) -> list[Missed]:
    """Return the lines and branches of the site that no test has reached as required."""
    lines = range(site.span.first, site.span.last + 1)
    if not any(counts.lines.get(line, 0) for line in lines):
        return [Missed(site, site.span.first, "never run")]
    if not site.branches:
        return []
    return [
        Missed(
            site,
            line,
            f"operand {k // 2 + 1} of the {(len(taken) + 1) // 2} on this line always came out the"
            " same",
        )
        for line in lines
        for taken in [counts.branches.get(line, [])]
        for k, count in enumerate(taken)
        if count == 0
    ]


def _kind(leaf: Leaf) -> str | None:
    text = leaf.span.text
    if VALUE.search(COMPARED.sub("", text)):
        return "choice" if "?" in text else "value"
    if PASSED_ON.match(text) and leaf.guard and STATUS_ASKED.search(leaf.guard.text):
        return "passed on"
    if COUNTED.match(text) or (text == "return 0" and leaf.returns == "size_t"):
        return "counted"
    return None


def _operands(text: str) -> bool:
    return "&&" in text or "||" in text or "?" in text


def _defines(text: str) -> str | None:
    """The variable that an ``int`` definition with operands gives a value."""
    match = re.match(r"^const int (\w+) = ", text)
    return match[1] if match and _operands(text) else None


def _leaves(source: str) -> Iterator[Leaf]:
    """Each statement of each function, with the nearest ``if`` around it."""
    guards: list[Span | None] = []
    function, returns = "", ""
    for span, end in _pieces(_bare(source)):
        guard, rest = guards[-1] if guards else None, span
        while rest.text:
            rest = _after(rest, LABEL)
            head = HEAD.match(rest.text)
            if head is None:
                if re.match(r"^else\b|^do\b", rest.text):
                    rest, guard = _after(rest, re.compile(r"^(?:else|do)\b\s*")), None
                    continue
                break
            condition, rest = _split_head(rest, head)
            guard = condition if head[2] == "if" else None
        if end == "{":
            declared = FUNCTION.match(span.text) if not guards else None
            if declared:
                function, returns = (
                    declared[2],
                    declared[1].replace("static", "").replace("inline", "").strip(),
                )
            guards.append(guard if not declared else None)
        elif guards and rest.text:
            yield Leaf(rest, guard, function, returns)
        if end == "}" and guards:
            guards.pop()


def _bare(source: str) -> str:
    """Without comments, preprocessor lines and what strings hold, every line where it was."""

    def blank(match: re.Match[str]) -> str:
        return re.sub(r"[^\n]", " ", match[0])

    source = re.sub(r"/\*.*?\*/", blank, source, flags=re.DOTALL)
    source = re.sub(r"^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", blank, source, flags=re.MULTILINE)
    return re.sub(
        r'"(?:[^"\\\n]|\\.)*"|\'(?:[^\'\\\n]|\\.)*\'',
        lambda match: '"' + " " * (len(match[0]) - 2) + '"',
        source,
    )


def _pieces(bare: str) -> Iterator[tuple[Span, str]]:
    """The text between each two of ``;``, ``{`` and ``}`` that stand in no parenthesis, and which
    of them ends it."""
    depth = start = 0
    for at, character in enumerate(bare):
        depth += (character == "(") - (character == ")")
        if depth == 0 and character in ";{}":
            yield _span(bare, start, at), character
            start = at + 1


def _span(bare: str, start: int, end: int) -> Span:
    raw = bare[start:end]
    lead = len(raw) - len(raw.lstrip())
    first = bare.count("\n", 0, start + lead) + 1
    return Span(raw.strip(), first, first + raw.strip().count("\n"))


def _after(span: Span, pattern: re.Pattern[str]) -> Span:
    match = pattern.match(span.text)
    return _cut(span, match.end(), len(span.text)) if match else span


def _cut(span: Span, start: int, end: int) -> Span:
    part = _span(span.text, start, end)
    return Span(part.text, span.first + part.first - 1, span.first + part.last - 1)


def _split_head(span: Span, head: re.Match[str]) -> tuple[Span, Span]:
    """The condition in the parentheses that ``head`` opens, and what follows them."""
    depth, at = 1, head.end()
    while depth and at < len(span.text):
        depth += (span.text[at] == "(") - (span.text[at] == ")")
        at += 1
    return _cut(span, head.end(), at - 1), _cut(span, at, len(span.text))


def sites_below(root: Path, folder: str) -> list[Site]:
    """Return the sites of every C source and header in ``root / folder``."""
    files = sorted([*(root / folder).rglob("*.c"), *(root / folder).rglob("*.h")])
    return [
        site
        for file in files
        for site in find_sites(file.relative_to(root).as_posix(), file.read_text())
    ]
