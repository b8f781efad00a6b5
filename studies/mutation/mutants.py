"""Small mistakes made from the syntax of a C source: an operator for another, a constant off by
one, a condition negated, a statement left out.

A mutant is known by its file, its function and the text of its lines before and after, not by line
numbers, so that a judgement of it (``survivors.toml``) holds while other lines change.
"""

import hashlib
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]

SWAPPED_IN_C = {
    "<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "==", "+": "-", "-": "+",
    "*": "/", "/": "*", "%": "*", "&&": "||", "||": "&&", "&": "|", "|": "&", "^": "|",
    "<<": ">>", ">>": "<<", "+=": "-=", "-=": "+=", "*=": "/=", "/=": "*=", "|=": "&=", "&=": "|=",
    "++": "--", "--": "++",
}  # fmt: skip
ASSIGNED = {"=", "+=", "-=", "*=", "/=", "|=", "&=", "^=", "<<=", ">>="}
TOKEN = re.compile(
    r"(?P<blank>\s+|/\*.*?\*/|//[^\n]*|^[ \t]*#(?:[^\n]*\\\n)*[^\n]*)"
    r"|(?P<text>\"(?:[^\"\\\n]|\\.)*\"|'(?:[^'\\\n]|\\.)*')"
    r"|(?P<number>0[xX][0-9a-fA-F]+[uUlL]*|(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?[uUlLfF]*)"
    r"|(?P<word>[A-Za-z_]\w*)"
    r"|(?P<mark><<=|>>=|->|\+\+|--|<<|>>|<=|>=|==|!=|&&|\|\||[-+*/%&|^]=|.)",
    re.DOTALL | re.MULTILINE,
)
CASES = {"case", "default"}
KEYWORDS = {"return", "else", "do", "case", "sizeof", "goto", "if", "while", "for", "switch"}


@dataclass(frozen=True)
class Mutant:
    """``source[start:end]`` of a file becomes ``replacement``; ``before`` and ``after`` are the
    whole lines."""

    file: str
    function: str
    start: int
    end: int
    replacement: str
    before: str
    after: str

    @property
    def key(self) -> tuple[str, str, str, str]:
        """The words by which survivors.toml names this mutant."""
        return self.file, self.function, self.before, self.after

    @property
    def place(self) -> str:
        """A number that depends on nothing but the key: the order in which samples are drawn."""
        return hashlib.sha256("\0".join(self.key).encode()).hexdigest()

    def applied(self, source: str) -> str:
        """The source with the mistake in it."""
        return source[: self.start] + self.replacement + source[self.end :]

    def __str__(self) -> str:
        return f"{self.file}, {self.function}: {self.before}  =>  {self.after}"


class Token(NamedTuple):
    """A word of C and where it stands."""

    kind: str
    text: str
    start: int
    end: int


Change = tuple[str, int, int, str]  # function, start, end, replacement


def _mutant(file: str, source: str, change: Change) -> Mutant:
    function, start, end, replacement = change
    first = source.rfind("\n", 0, start) + 1
    last = source.find("\n", end)
    last = len(source) if last < 0 else last
    after = source[first:start] + replacement + source[end:last]
    before = " ".join(source[first:last].split())
    return Mutant(file, function, start, end, replacement, before, " ".join(after.split()))


def mutants_of(file: str) -> list[Mutant]:
    """All mutants of a C source below the project's root, in the order of its text."""
    source = (ROOT / file).read_text()
    mutants = [_mutant(file, source, change) for change in sorted(_c_changes(source))]
    return list({m.key: m for m in mutants if m.before != m.after}.values())


def _tokens(source: str) -> list[Token]:
    return [
        Token(str(match.lastgroup), match[0], match.start(), match.end())
        for match in TOKEN.finditer(source)
        if match.lastgroup != "blank"
    ]


def _closing(tokens: Sequence[Token], at: int) -> int:
    """The index of the parenthesis that closes the one at ``at``."""
    depth = 0
    for k in range(at, len(tokens)):
        depth += (tokens[k].text == "(") - (tokens[k].text == ")")
        if depth == 0:
            return k
    return len(tokens) - 1


def _c_changes(source: str) -> Iterator[Change]:
    tokens = _tokens(source)
    for function, first, last in _c_functions(tokens):
        for k in range(first, last):
            yield from ((function, *change) for change in _at_token(source, tokens, k))
        for start, end in _c_statements(tokens, first, last):
            text = [token.text for token in tokens[start:end]]
            if text[0] == "return" and len(text) > 1 and text[1:] != ["0"]:
                yield function, tokens[start].start, tokens[end].start, "return 0"
            elif _may_be_left_out(tokens[start:end]):
                yield function, tokens[start].start, tokens[end].start, ""


def _c_functions(tokens: Sequence[Token]) -> Iterator[tuple[str, int, int]]:
    """The name, first and last token of each body."""
    depth = opened = 0
    name = ""
    for k, token in enumerate(tokens):
        if token.text == "{":
            if depth == 0 and tokens[k - 1].text == ")":
                back, open_ = k - 1, 0
                while back > 0:
                    open_ += (tokens[back].text == ")") - (tokens[back].text == "(")
                    if open_ == 0:
                        break
                    back -= 1
                name, opened = tokens[back - 1].text, k
            depth += 1
        elif token.text == "}":
            depth -= 1
            if depth == 0 and name:
                yield name, opened + 1, k
                name = ""


def _at_token(source: str, tokens: Sequence[Token], k: int) -> Iterator[tuple[int, int, str]]:
    token, before = tokens[k], tokens[k - 1]
    binary = (before.kind in ("word", "number") and before.text not in KEYWORDS) or before.text in (
        ")",
        "]",
    )
    if token.kind == "number":
        if re.fullmatch(r"(0[xX][0-9a-fA-F]+|\d+)[uUlL]*", token.text):
            yield token.start, token.end, "0" if token.text == "1" else f"({token.text} + 1)"
        else:
            yield token.start, token.end, f"{token.text} * 2"
    elif token.kind == "mark" and token.text in SWAPPED_IN_C:
        if binary or token.text in ("++", "--"):
            yield token.start, token.end, SWAPPED_IN_C[token.text]
        elif token.text == "-":
            yield token.start, token.end, ""
    elif token.text == "!":
        yield token.start, token.end, ""
    elif token.text in ("if", "while") and tokens[k + 1].text == "(":
        start, end = tokens[k + 1].start, tokens[_closing(tokens, k + 1)].end
        yield start, end, f"(!{source[start:end]})"


def _c_statements(tokens: Sequence[Token], first: int, last: int) -> Iterator[tuple[int, int]]:
    """First token and semicolon of each simple statement."""
    k = start = first
    while k < last:
        text = tokens[k].text
        if text in ("if", "while", "for", "switch") and tokens[k + 1].text == "(":
            k = start = _closing(tokens, k + 1) + 1
            continue
        if text in ("{", "}", "else", "do") or (text == ":" and tokens[start].text in CASES):
            start = k + 1
        elif text == ";":
            if k > start:
                yield start, k
            start = k + 1
        k += 1


def _may_be_left_out(statement: Sequence[Token]) -> bool:
    words = [token.text for token in statement]
    if words in (["break"], ["continue"], ["return"]):
        return True
    if len(words) > 1 and statement[0].kind == statement[1].kind == "word":
        return False  # a declaration
    if len(words) > 3 and words[1] == "*" and statement[2].kind == "word" and words[3] == "=":
        return False  # a declaration of a pointer
    call = len(words) > 2 and statement[0].kind == "word" and words[1] == "("
    return call or any(word in ASSIGNED for word in words)
