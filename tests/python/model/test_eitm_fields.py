"""Section FLDS: as documented, read by both readers alike, and models without it."""

import struct
from dataclasses import replace

import numpy as np
import pytest
from two_readers import agreed

from eitm_bytes import entry_place, patched, sections_of
from eitskin.errors import ModelError
from eitskin.model.eitm import decode_model, encode_model
from eitskin.skin.mirror import rim_mirror
from small_models import prebuilt, small, small_blob, small_model, tiny_blob


def test_the_section_as_documented():
    blob, model, s = small_blob(), small_model(), small()
    place = sections_of(blob)["FLDS"]
    assert place.size == 16 + 2 * s.linear.grid.n_pixels * 40 and place.flags == 0
    volts, per_sheet = struct.unpack_from("<2f", blob, place.offset)
    half = np.frombuffer(blob, "<f2", place.size // 2 - 8, place.offset + 16)
    columns = half.reshape(-1, 40).astype(float)
    assert not columns[:, 36:].any() and np.abs(columns[:, :32]).max() == 1024
    fields = s.linear.electrode_fields.reshape(len(columns), 32)
    unit = np.abs(fields).max() / 1024
    assert volts == pytest.approx(1e-3 * 5e-3 * 1e-6 * unit**2)
    assert per_sheet == pytest.approx(1 / (2 * np.pi * 0.02))
    assert columns[:, :32] * unit == pytest.approx(fields, rel=1e-3, abs=1e-3 * unit)
    a, b = rim_mirror(s.skin.outline, s.linear.grid.centres_mm())
    mirror = np.column_stack([a.real, a.imag, b.real, b.imag])
    assert columns[:, 32:36] == pytest.approx(mirror, rel=1e-3, abs=1e-3)
    assert model.fields is not None and (model.fields.columns == columns[:, :36]).all()


@pytest.mark.parametrize("data_kind", ["normalised", "log-ratio"])
def test_only_models_of_differences_have_fields(data_kind):
    assert "FLDS" not in sections_of(small_blob(data_kind=data_kind))
    assert small_model(data_kind=data_kind).fields is None


def test_a_model_without_fields_finds_touches_each_by_itself():
    model = replace(prebuilt()[0], fields=None)
    blob = encode_model(model)
    assert agreed(blob, "no fields") and "FLDS" not in sections_of(blob)
    assert decode_model(blob, "x").fields is None


@pytest.mark.parametrize("size", [-16, -2, 2, 16])
def test_wrong_sizes(size):
    blob = tiny_blob()
    own = sections_of(blob)["FLDS"].size
    changed = patched(blob, entry_place(blob, "FLDS") + 8, "<I", own + size)
    assert not agreed(changed, size)
    with pytest.raises(ModelError, match="section"):
        decode_model(changed, "x")


@pytest.mark.parametrize("at", [0, 4])
@pytest.mark.parametrize("value", [0.0, 1.0, 9e29, -1e-9, 1.1e30, float("inf"), float("nan")])
def test_numbers_in_range(at, value):
    blob = tiny_blob()
    changed = patched(blob, sections_of(blob)["FLDS"].offset + at, "<f", value)
    assert agreed(changed, value) == (0 <= value <= 1e30)


@pytest.mark.parametrize(
    ("half", "good"), [(0x7BFF, True), (0x7C00, False), (0xFC00, False), (0x7E01, False)]
)
def test_every_half_is_finite(half, good):
    blob = tiny_blob()
    place = sections_of(blob)["FLDS"]
    # the first, the mirror's last, padding, the very last
    for at in (16, 16 + 2 * 19, 16 + 2 * 23, place.size - 2):
        assert agreed(patched(blob, place.offset + at, "<H", half), at) == good
