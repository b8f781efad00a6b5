"""Any bytes as an .eitm model: Python and C both read them or both refuse them with one line. A
model that is read can be used."""

import numpy as np
from bytes_damage import any_bytes, bounded, read_or_refuse, written
from hypothesis import given
from hypothesis import strategies as st

from eitm_bytes import sealed
from eitskin.core.engine import CoreEngine
from eitskin.errors import EitskinError
from eitskin.model.eitm import encode_model, load_model
from eitskin.solve.reconstructor import Reconstructor
from small_models import tiny_blob

ENOUGH_WORK = 10_000


def whole_models() -> list[bytes]:
    return [tiny_blob(storage) for storage in ("f32", "f16", "i16", "i8")]


def damaged_models() -> st.SearchStrategy[bytes]:
    return any_bytes(whole_models())


def resealed(content: bytes) -> bytes:
    """``content`` with a right checksum and hash where there is a header to put them in."""
    try:
        return sealed(content, rehash=True)
    except Exception:
        return content


@given(content=st.deferred(damaged_models))
@bounded(150)
def test_a_damaged_model_is_refused_in_a_line(tmp_path, content):
    path = written(tmp_path, "x.eitm", content)
    if read_or_refuse(load_model, path) is None:
        assert read_or_refuse(CoreEngine, content, prepared=False) is None


@given(content=st.deferred(damaged_models).map(resealed))
@bounded(250)
def test_a_damaged_model_with_a_right_checksum_is_refused_or_used(tmp_path, content):
    path = written(tmp_path, "x.eitm", content)
    loaded = read_or_refuse(load_model, path)
    if loaded is None:
        return
    model, blob = loaded
    assert encode_model(model)
    if model.defaults.iterations > ENOUGH_WORK:
        return
    core = Reconstructor(model, blob=blob)
    golden = model.golden
    try:
        core.tare(golden.reference_v)
        result = core.reconstruct(golden.frame_v)
    except EitskinError as error:
        assert "\n" not in str(error)
        return
    assert np.isfinite(result.image).all()
    assert all(
        np.isfinite([t.x_mm, t.y_mm, t.radius_mm, t.strength_s_per_m_mm2]).all()
        for t in result.touches
    )
