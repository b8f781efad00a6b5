"""Two readers of one format, Python's and the C core's: what one refuses the other refuses,
whatever the bytes."""

import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from two_readers import accepts, agreed

from eitm_bytes import ENTRY_SIZE, entry_place, patched, sealed, sections_of
from eitskin.errors import EitskinError, ModelError
from eitskin.model.eitm import decode_model
from eitskin.solve.reconstructor import Reconstructor
from small_models import prebuilt, tiny_blob

WORDS = (
    0, 1, 3, 4, 255, 256, 1024, 1025, 4096, 4097, 65534, 65535, 65536, 2**31 - 1, 2**31, 2**32 - 1,
)  # fmt: skip
FLOATS = (
    0.0, -0.0, -1.0, 1.0, 2.0, 1e-45, 1e-7, 1e29, 1.1e30, 3.4e38, float("inf"), float("-inf"),
    float("nan"),
)  # fmt: skip
STORAGE = {0: "f32", 1: "f16", 2: "i16", 3: "i8"}


@pytest.mark.parametrize("storage", STORAGE.values())
def test_both_read_the_whole_one(storage):
    assert agreed(tiny_blob(storage), storage)


def test_both_refuse_every_truncation():
    blob = tiny_blob()
    for length in range(len(blob)):
        assert not agreed(blob[:length], length)


@pytest.mark.parametrize("flip", [0x01, 0x80, 0xFF])
def test_both_refuse_every_damaged_byte(flip):
    blob = bytearray(tiny_blob())
    for place in range(len(blob)):
        blob[place] ^= flip
        assert agreed(bytes(blob), place) == (place in (6, 7))
        blob[place] ^= flip


@pytest.mark.parametrize("field", range(10))
def test_whole_numbers_of_dims(field):
    """Other values that fit the sizes of the sections: larger images, more electrodes, ranks of the
    same stride, another data kind."""
    blob = tiny_blob()
    place = sections_of(blob)["DIMS"].offset + 4 * field
    own = struct.unpack_from("<I", blob, place)[0]
    read = []
    for word in (*WORDS, own + 1, own - 1):
        if agreed(patched(blob, place, "<I", word % 2**32, rehash=True), (field, word)):
            read.append(word)
    names = ["n_electrodes", "m", "k", "r", "stride", "n", "nx", "ny", "storage", "data"]
    expected = {
        "n_electrodes": {9},  # those that fit the fields' columns
        "r": {1, 3, 4},  # a sixth row of P would be zero, which no WHIT fits
        "nx": {255, 256, 1024, 1025, 4096, 7},
        "ny": {255, 256, 1024, 1025, 4096, 7},
        "data": {0, 1},
        "storage": {0},
    }
    assert set(read) - {own} == expected.get(names[field], set()) - {own}


@pytest.mark.parametrize(
    ("field", "good"),
    [
        (0, lambda v: 0 < v < np.inf),
        (1, np.isfinite),
        (2, np.isfinite),
        (3, lambda v: 0 < v < np.inf),
        (4, lambda v: 2.0**-126 <= v < np.inf),
        (5, lambda v: 0 <= v < np.inf),
    ],
)
def test_numbers_of_dims(field, good):
    blob = tiny_blob()
    place = sections_of(blob)["DIMS"].offset + 40 + 4 * field
    for value in FLOATS:
        assert agreed(patched(blob, place, "<f", value), (field, value)) == bool(good(value)), value


SHARE = {1.0, 0.0, -0.0, 1e-45, 1e-7}
SIZE = {0.0, -0.0, 1e-45, 1e-7, 1.0, 2.0, 1e29}
GOOD_DEFAULTS = {
    **dict.fromkeys((0, 3, 4, 5), SHARE),
    **dict.fromkeys((1, 2, 9, 10, 11), SIZE),
    6: {1.0, 2.0},  # least radius: above 1e-6, not above the seed's
    7: {1e29},  # greatest radius
    8: {2.0},  # seed radius
}


@pytest.mark.parametrize("field", range(12))
def test_numbers_of_defaults(field):
    """The field's range as documented; the tiny model's radii are 1.55, 15.5 and 4.64 mm."""
    blob = tiny_blob()
    start = sections_of(blob)["DEFS"].offset + 8
    radii = struct.unpack_from("<3f", blob, start + 24)
    assert radii == pytest.approx((1.546, 15.46, 4.639), rel=1e-3)
    place = start + 4 * field
    read = {value for value in FLOATS if agreed(patched(blob, place, "<f", value), (field, value))}
    assert read == GOOD_DEFAULTS[field]


@pytest.mark.parametrize("iterations", [0, 100_001])
def test_defaults_of_no_or_endless_iterations_are_refused(iterations):
    """A day of a board's work is not what ``eitskin model build`` makes."""
    changed = patched(tiny_blob(), sections_of(tiny_blob())["DEFS"].offset, "<I", iterations)
    assert not agreed(changed, "iterations")
    with pytest.raises(ModelError, match="a default out of range"):
        decode_model(changed, "x")


@pytest.mark.parametrize("name", ["VREF", "REDU", "SENS", "SCAL", "COLW", "GOLD"])
@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf")])
def test_numbers_that_are_not_finite(name, value):
    blob = tiny_blob("i8" if name == "SCAL" else "f32")
    place = sections_of(blob)[name]
    for at in (0, place.size - 4):
        assert not agreed(patched(blob, place.offset + at, "<f", value), (name, at))


@pytest.mark.parametrize("half", [0x7C00, 0xFC00, 0x7E01])
def test_halves_that_are_not_finite(half):
    blob = tiny_blob("f16")
    assert not agreed(patched(blob, sections_of(blob)["SENS"].offset + 10, "<H", half), half)


@pytest.mark.parametrize(
    ("row", "good"),
    [
        ((0, 1, 2, 3), True),
        ((0, 1, 2, 4), True),
        ((0, 1, 2, 8), False),
        ((4, 4, 2, 3), False),
        ((0, 1, 5, 5), False),
    ],
)
def test_a_protocol_of_pairs(row, good):
    changed = bytearray(tiny_blob())
    struct.pack_into("<4B", changed, sections_of(changed)["PROT"].offset, *row)
    assert agreed(sealed(changed, rehash=True), row) == good
    assert not agreed(sealed(changed), "another hash") or row == tuple(
        tiny_blob()[sections_of(changed)["PROT"].offset :][:4]
    )


@pytest.mark.parametrize(
    ("at", "value", "good"),
    [(0, 39, True), (0, 40, False), (2, 39, True), (2, 40, False), (2, 0xFFFF, True), (4, 1, True),
    (4, 0xFFFF, True),
     (4, 0, False), (4, 2, False), (6, 77, True)],
)  # fmt: skip
def test_a_fold_of_rows(at, value, good):
    """40 rows; the sign is 1 or -1; the last number of an entry is not looked at."""
    blob = tiny_blob()
    changed = patched(blob, sections_of(blob)["FOLD"].offset + at, "<H", value)
    assert agreed(changed, (at, value)) == good


def test_pixels_are_ordered_and_inside():
    blob = tiny_blob()
    place = sections_of(blob)["GRID"]
    pixels = np.frombuffer(blob, "<u2", place.size // 2, place.offset).reshape(-1, 2)
    swapped, repeated, outside = pixels.copy(), pixels.copy(), pixels.copy()
    swapped[[3, 4]] = swapped[[4, 3]]
    repeated[5] = repeated[4]
    outside[-1, 1] = 6
    for wrong in (swapped, repeated, outside):
        changed = bytearray(blob)
        changed[place.offset : place.offset + place.size] = wrong.tobytes()
        assert not agreed(sealed(changed), "pixels")


@pytest.mark.parametrize("count", [0, 1, 10, 11, 13, 257, 2**20, 2**32 - 1])
def test_numbers_of_sections(count):
    """Sections beyond the table are read from other sections' bytes, and one too few lacks nothing
    that is required."""
    assert agreed(sealed(tiny_blob(), count=count), count) == (count in (10, 11, 12, 13))


@pytest.mark.parametrize("size", [0, 16, 48, 64, 80, None])
def test_sizes_that_no_model_has(size):
    """The last size is not a multiple of sixteen."""
    blob = tiny_blob() + bytes(8)
    assert not agreed(sealed(blob, total=len(blob) if size is None else size), size)


def test_misplaced_sections():
    blob = tiny_blob()
    for name, place in sections_of(blob).items():
        for offset in (0, 48, 64, place.offset + 4, len(blob), len(blob) + 16, 2**32 - 16):
            changed = patched(blob, entry_place(blob, name) + 4, "<I", offset)
            assert not agreed(changed, (name, offset)), (name, offset)


@given(st.data())
@settings(max_examples=400, deadline=None)
def test_agreement_on_anything(data):
    """Bytes changed anywhere but in META, which boards ignore, and sealed again; what both read
    also runs."""
    blob = bytearray(tiny_blob(data.draw(st.sampled_from(list(STORAGE.values())))))
    places = {name: place for name, place in sections_of(blob).items() if name != "META"}
    name = data.draw(st.sampled_from(["table", *places]))
    if name == "table":
        start, size = entry_place(blob, data.draw(st.sampled_from(list(places)))), ENTRY_SIZE
    else:
        start, size, _ = places[name]
    for _ in range(data.draw(st.integers(1, 4))):
        at = start + data.draw(st.integers(0, size - 1))
        values = [0, 1, 0x7F, 0x80, 0xFF, blob[at] ^ 1, blob[at] ^ 0x80, (blob[at] + 1) % 256]
        blob[at] = data.draw(st.sampled_from(values))
    whole = sealed(blob, rehash=name == "PROT")
    if agreed(whole, name) and name not in ("DIMS", "table"):
        runs(whole)


@pytest.mark.parametrize("change", ["below zero", "off by 1.5 per mille"])
def test_strengths_that_no_model_has(change):
    """A weak row's strength below zero would be a root of it in the core; both readers have one
    tolerance for a strong one's."""
    blob = bytearray(prebuilt()[1])
    place = sections_of(blob)["WHIT"]
    first = place.offset + 16 + (place.size - 16) // 4
    strength = np.frombuffer(blob, "<f4", 64, first).copy()
    if change == "below zero":
        at, value = int(strength.argmin()), -float(strength.min())
    else:
        at, value = int(strength.argmax()), float(strength.max()) + 1.5e-3
    assert not agreed(patched(bytes(blob), first + 4 * at, "<f", value), change)


def runs(blob: bytes) -> None:
    """Every engine gives finite images and touches for the golden frame, or says in one line why
    not."""
    model = decode_model(blob, "x")
    for engine in ("c", "c64"):
        try:
            reconstructor = Reconstructor(model, engine=engine, blob=blob)
            reconstructor.set_options(iterations=20)
            reconstructor.tare(model.golden.reference_v)
            result = reconstructor.reconstruct(model.golden.frame_v)
            assert np.isfinite(result.image).all()
        except EitskinError as error:
            assert "\n" not in str(error)


def test_what_boards_ignore():
    """If META is not JSON, Python rejects the model, and a board accepts it."""
    blob = bytearray(tiny_blob())
    place = sections_of(blob)["META"]
    blob[place.offset] = ord("}")
    assert accepts(sealed(blob)) == (False, True)


def test_both_take_a_file_of_format_1_0_as_fista():
    """It has zero where 1.1 names the solver; a number that neither knows is refused by both."""
    blob = bytearray(tiny_blob())
    place = sections_of(blob)["DEFS"].offset + 56
    assert decode_model(bytes(blob), "x").defaults.solver == "working-set" and blob[place] == 1
    blob[6] = blob[place] = 0
    old = sealed(blob)
    model = decode_model(old, "x")
    assert agreed(old, "1.0") and model.defaults.solver == "fista"
    macs = {}
    for solver in (None, "fista", "working-set"):
        reconstructor = Reconstructor(model, blob=old)
        reconstructor.set_options(**({} if solver is None else {"solver": solver}))
        reconstructor.tare(model.golden.reference_v)
        macs[solver] = reconstructor.reconstruct(model.golden.frame_v).info.macs
    assert macs[None] == macs["fista"] > macs["working-set"]
    for number in (2, 4):
        blob[place] = number
        assert not agreed(sealed(blob), f"solver {number}")
    blob[place] = 2
    with pytest.raises(ModelError, match="coordinate descent, which eitskin no longer has"):
        decode_model(sealed(blob), "x")
