"""Complex numbers in pairs of columns: real and imaginary parts, or magnitudes and phases.

If the header states which, it is believed; otherwise nothing is assumed.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eitskin.arrays import AnyArray, ComplexArray
from eitskin.config import first_few
from eitskin.errors import UsageError

PAIRS = ("real-imag", "magnitude-degrees", "magnitude-radians")
WORDS = {
    "magnitude": "mag magn magnitude magnitudes abs ampl amplitude amplitudes modulus",
    "phase": "phase phases phi arg argument angle theta",
    "real": "re real",
    "imag": "im imag imaginary",
}
KIND = {word: kind for kind, words in WORDS.items() for word in words.split()}
UNITS = {"deg": "degrees", "degs": "degrees", "degree": "degrees", "degrees": "degrees"}
UNITS |= {"°": "degrees", "rad": "radians", "rads": "radians", "radian": "radians"}
UNITS["radians"] = "radians"
HALVES = {"real": "real-imag", "imag": "real-imag", "magnitude": "polar", "phase": "polar"}
SHOWN = 4
MOST_RADIANS = 12.6  # two turns
A_PART = {"imag": "an imaginary part", "phase": "a phase"}


@dataclass(frozen=True)
class Paired:
    """The columns of each pair: ``first`` (real part or magnitude) and ``second``, by their place
    among the chosen columns. ``how`` is one of PAIRS."""

    first: tuple[int, ...]
    second: tuple[int, ...]
    how: str


def kind_of(name: str) -> str | None:
    """Return what the header's ``name`` states about its column: "magnitude", "phase", "real",
    "imag" or None."""
    kinds = {KIND[word] for word in _words(name) if word in KIND}
    return kinds.pop() if len(kinds) == 1 else None


def refuse_parts(names: Sequence[str], option: str) -> None:
    """Reject columns that the header calls phases or imaginary parts, for use when no complex part
    was asked for."""
    for name in names:
        kind = kind_of(name)
        if kind in A_PART:
            raise UsageError(
                f"{option}: column {name!r} is {A_PART[kind]}, not a voltage; choose the"
                " others only, or the pairs with  --complex-part in-phase"
            )


def all_magnitudes(names: Sequence[str]) -> bool:
    """Return whether the header calls every one of ``names`` a magnitude."""
    return bool(names) and all(kind_of(name) == "magnitude" for name in names)


def paired(names: Sequence[str], values: AnyArray, how: str | None, option: str) -> Paired:
    """Return how the columns of ``values`` (rows, c) with these ``names`` (empty: no header) form
    pairs.

    Raises:
        UsageError: they do not form pairs, or the kind of the pairs is unknown or contradicts the
            header.
    """
    count = values.shape[1]
    if count % 2:
        raise UsageError(f"{option}: with --complex-part columns come in pairs; {count} are named")
    kinds = [kind_of(name) for name in names] if names else [None] * count
    forms = {HALVES[kind] for kind in kinds if kind is not None}
    if len(forms) > 1 or (forms and None in kinds):
        if how is None:
            raise UsageError(
                f"{option}: the header does not state the meaning of every column"
                f" ({first_few(names, SHOWN)}); say --pairs {' | '.join(PAIRS)}"
            )
        forms = set()
    if not forms:
        return _by_place(values, how, option)
    halves = ("real", "imag") if forms == {"real-imag"} else ("magnitude", "phase")
    first, second = (tuple(k for k, kind in enumerate(kinds) if kind == half) for half in halves)
    if len(first) != len(second):
        raise UsageError(
            f"{option}: {len(first)} columns of {halves[0]}s and {len(second)} of {halves[1]}s"
            " do not form pairs; choose as many of each"
        )
    if forms == {"real-imag"}:
        stated = "real-imag"
    else:
        stated = _polar([names[k] for k in second], how, option)
    if how is not None and how != stated:
        raise UsageError(
            f"--pairs {how}: the header says {stated} ({first_few(names, SHOWN)}); leave out"
            " --pairs, or the header with --header-rows"
        )
    return _checked(values, Paired(first, second, stated), option)


def _checked(values: AnyArray, pairs: Paired, option: str) -> Paired:
    """Return ``pairs``, or raise a UsageError if the numbers cannot be such pairs."""
    if pairs.how == "real-imag":
        return pairs
    if (values[:, list(pairs.first)] < 0).any():
        raise UsageError(
            f"{option}: a magnitude is below 0, so these are not pairs of magnitude and phase; say"
            " --pairs real-imag, or choose other columns"
        )
    largest = np.nanmax(np.abs(values[:, list(pairs.second)]), initial=0.0)
    if pairs.how == "magnitude-radians" and largest > MOST_RADIANS:
        raise UsageError(
            f"{option}: a phase of {largest:g} cannot be in radians; say --pairs magnitude-degrees"
        )
    return pairs


def shifted(values: AnyArray, pairs: Paired, offset: float) -> AnyArray:
    """Return the columns (rows, c) with ``offset`` added to what the instrument measures: to real
    and imaginary parts, or to magnitudes."""
    moved = np.array(values, dtype=np.float64)
    moved[:, list(pairs.first)] += offset
    if pairs.how == "real-imag":
        moved[:, list(pairs.second)] += offset
    return moved


def to_complex(values: AnyArray, pairs: Paired) -> ComplexArray:
    """Return the columns (rows, c) as complex numbers (rows, c / 2)."""
    first, second = values[:, list(pairs.first)], values[:, list(pairs.second)]
    if pairs.how == "real-imag":
        return np.asarray(first + 1j * second)
    angle = np.deg2rad(second) if pairs.how == "magnitude-degrees" else second
    return np.asarray(first * np.exp(1j * angle))


def _by_place(values: AnyArray, how: str | None, option: str) -> Paired:
    if how is None and (values[:, 0::2] < 0).any():
        how = "real-imag"  # a magnitude is never below 0
    if how is None:
        raise UsageError(
            f"{option}: nothing says whether the pairs are real and imaginary parts or magnitudes"
            f" and phases; say --pairs {' | '.join(PAIRS)}"
        )
    places = range(values.shape[1])
    return _checked(values, Paired(tuple(places[0::2]), tuple(places[1::2]), how), option)


def _polar(phases: Sequence[str], how: str | None, option: str) -> str:
    units = {UNITS[word] for name in phases for word in _words(name) if word in UNITS}
    if len(units) == 1:
        return f"magnitude-{units.pop()}"
    if how is not None and how != "real-imag":
        return how
    raise UsageError(
        f"{option}: the header says magnitude and phase ({first_few(phases, SHOWN)}), but not the"
        " phase's unit; say --pairs magnitude-degrees or --pairs magnitude-radians"
    )


def _words(name: str) -> list[str]:
    return re.findall(r"[a-z]+|°", name.lower())
