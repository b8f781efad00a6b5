"""Both readers accept and refuse the same models if required sections are missing, and if numbers
are at the very end of their range."""

import struct
from dataclasses import replace
from functools import cache
from itertools import combinations

import numpy as np
import pytest
from two_readers import agreed

from eitm_bytes import ENTRY_SIZE, entry_place, sealed, sections_of
from eitskin.model.eitm import encode_model
from eitskin.model.force_law import ForceLaw
from small_models import prebuilt

ENDS = [np.float32(value) for value in (1e30, 1e-6, 1e6, 1e3, 0.0, -0.0, 1e-45, -1e-45)]
ENDS += [np.nextafter(value, np.float32(np.inf)) for value in ENDS[:4]]
ENDS += [np.nextafter(value, np.float32(-np.inf)) for value in ENDS[:4]]


@cache
def whole() -> bytes:
    """The prebuilt model, with a calibration of forces."""
    numbers = np.array([0.0, 1.0, 2.0], np.float32)
    law = ForceLaw(numbers, numbers, np.array([1.0, 0.1, 0.1], np.float32), 1, 90.0, 1.0, 0.1)
    return encode_model(replace(prebuilt()[0], force_law=law))


def without(names: tuple[str, ...]) -> bytes:
    """The model whose optional sections ``names`` have tags that no reader knows."""
    blob = bytearray(whole())
    for k, name in enumerate(names):
        at = entry_place(blob, name)
        blob[at : at + 4] = b"ZZ%02d" % k
    return sealed(blob)


def optional() -> list[str]:
    places = sections_of(whole())
    return [name for name, place in places.items() if not place.flags & 1 and name != "META"]


def test_sections_that_are_missing_beside_others():
    names = optional()
    assert {"UNCE", "GEOM", "MOVE", "WHIT", "LOAD"} <= set(names)
    answers = {}
    for count in (1, 2, 3):
        for some in combinations(names, count):
            answers[some] = agreed(without(some), some)
    assert answers[("LOAD",)] and not answers[("UNCE",)] and not answers[("GEOM",)]


@pytest.mark.parametrize("name", ["GEOM", "MOVE", "ROWE", "LOAD", "PLAC"])
def test_numbers_at_the_ends_of_their_ranges(name):
    places = sections_of(whole())
    if name not in places:
        assert name == "PLAC"
        return
    place = places[name]
    assert place.offset % ENTRY_SIZE == 0
    words = place.size // 4
    for word in sorted({*range(min(words, 16)), words // 2, words - 1}):
        for value in ENDS:
            blob = bytearray(whole())
            struct.pack_into("<f", blob, place.offset + 4 * word, value)
            agreed(sealed(blob), (name, word, value))


def test_numbers_of_uncertainty_at_the_ends_of_their_ranges():
    """The rms values, and numbers of the matrices that are beyond the range in any case."""
    place = sections_of(whole())["UNCE"]
    for word in (1, 2, 3):
        for value in ENDS:
            blob = bytearray(whole())
            struct.pack_into("<f", blob, place.offset + 4 * word, value)
            agreed(sealed(blob), (word, value))
    for word in (4, 5, 6, place.size // 4 - 1):
        for value in (2e30, -2e30, np.inf, np.nan):
            blob = bytearray(whole())
            struct.pack_into("<f", blob, place.offset + 4 * word, value)
            assert not agreed(sealed(blob), (word, value))


@pytest.mark.parametrize("seed", range(6))
def test_a_matrix_that_is_no_covariance_is_refused_by_both(seed):
    """One number of a matrix is scaled, or has another sign."""
    place, rng = sections_of(whole())["UNCE"], np.random.default_rng(seed)
    answers = []
    for factor in (-1.0, 0.0, 0.5, 3.0, 30.0, 1e6):
        for word in rng.integers(4, place.size // 4, 6):
            blob = bytearray(whole())
            at = place.offset + 4 * int(word)
            (value,) = struct.unpack_from("<f", blob, at)
            struct.pack_into("<f", blob, at, factor * value)
            answers.append(agreed(sealed(blob), (int(word), factor)))
    assert set(answers) == {True, False}
