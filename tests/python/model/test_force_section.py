"""The section LOAD is written, read by both readers, optional, and refused if it is out of
range."""

import struct
from dataclasses import replace

import numpy as np
import pytest

from eitskin.core.engine import CoreEngine
from eitskin.errors import ModelError
from eitskin.model.eitm import HEADER, decode_model, encode_model, encode_tested
from eitskin.model.force_law import HEAD, ForceLaw, decode_force_law, encode_force_law, terms_of
from eitskin.solve.reconstructor import ENGINES, Reconstructor
from small_models import prebuilt, session


def law(order: int = 2) -> ForceLaw:
    strength = np.array([0.0, 1.0, 2.5, 4.0], dtype=np.float32)
    force = np.array([0.0, 0.4, 1.2, 2.6], dtype=np.float32)
    gain = np.resize(np.float32([1.0, 0.05, -0.1, 0.2, 0.03, 0.15]), len(terms_of(order)))
    return ForceLaw(strength, force, gain, order, 97.0, 0.9, 0.03)


def test_without_it_nothing_changes():
    model, blob = prebuilt()
    assert model.force_law is None
    assert encode_tested(model) == blob
    assert b"LOAD" not in blob[:512]


@pytest.mark.parametrize("order", range(5))
def test_it_is_read_as_written(order):
    blob = encode_model(replace(prebuilt()[0], force_law=law(order)))
    assert HEADER.unpack_from(blob)[1:3] == (1, 11)
    read = decode_model(blob, "made").force_law
    assert read is not None and encode_force_law(read) == encode_force_law(law(order))
    CoreEngine(blob, "float32")  # opens


@pytest.mark.parametrize("engine", ENGINES)
def test_touches_carry_the_force_of_strength_and_place(engine):
    model = replace(prebuilt()[0], force_law=law())
    skin, bare = Reconstructor(model, engine=engine), Reconstructor(prebuilt()[0], engine=engine)
    seen = 0
    for one in (skin, bare):
        one.tare(session().untouched_v)
    for frame in session().frames_v[:6]:
        touches, without = skin.reconstruct(frame).touches, bare.reconstruct(frame).touches
        forces = [touch.force_n for touch in touches]
        assert touches == tuple(
            replace(touch, force_n=force) for touch, force in zip(without, forces, strict=True)
        )  # nothing else differs
        for touch in touches:
            place, strength = [(touch.x_mm, touch.y_mm)], [touch.strength_s_per_m_mm2]
            (expected,) = law().forces_at(np.array(place), np.array(strength))
            assert touch.force_n == pytest.approx(expected, rel=1e-5) and touch.force_n > 0
            seen += 1
        assert all(touch.force_n == 0 for touch in without)
    assert seen >= 6


def test_forces_are_interpolated_and_go_on_by_the_last_slope_to_twice_the_table():
    """The table ends at a strength of 4 and 2.6 N, with a slope of 1.4 N / 1.5."""
    strengths = {0.0: 0.0, 0.5: 0.2, 1.0: 0.4, -1.0: 0.4, 2.0: 0.4 + 0.8 / 1.5, 5.5: 4.0, 90.0: 5.2}
    middle = np.zeros((len(strengths), 2))
    found = law(order=0).forces_at(middle, np.array(list(strengths)))
    assert found == pytest.approx(list(strengths.values()), rel=1e-6)


PLACES = {  # u, v: the gain of 1 + 0.05 u - 0.1 v + 0.2 u^2 + 0.03 u v + 0.15 v^2
    "the middle": ((0.0, 0.0), 1.0),
    "half to the right": ((0.5, 0.0), 1 + 0.025 + 0.05),
    "up and right": ((0.5, 0.5), 1 + 0.025 - 0.05 + 0.05 + 0.0075 + 0.0375),
    "beyond the reach of 0.9, as there": ((3.0, 0.0), 1 + 0.045 + 0.162),
}


@pytest.mark.parametrize(("place", "gain"), PLACES.values(), ids=PLACES)
def test_the_gain_of_a_place_is_the_polynomial(place, gain):
    assert law().gains_at(97.0 * np.array([place])) == pytest.approx([gain], rel=1e-6)


@pytest.mark.parametrize(("constant", "gain"), [(9.0, 4.0), (0.1, 0.25), (-2.0, 0.25)])
def test_gains_stay_within_a_quarter_and_four(constant, gain):
    constant_law = replace(law(order=0), gain=np.float32([constant]))
    assert constant_law.gains_at(np.zeros((1, 2))) == pytest.approx([gain])


WHOLE = encode_force_law(law())


def changed(at: int, layout: str, value: float) -> bytes:
    number = struct.pack(layout, value)
    return WHOLE[:at] + number + WHOLE[at + len(number) :]


WRONG = {
    "cut": WHOLE[:-4], "longer": WHOLE + bytes(4), "nearly nothing": bytes(8),
    "too few points": changed(0, "<I", 1), "too many points": changed(0, "<I", 65),
    "order 5": changed(4, "<I", 5), "no radius": changed(8, "<f", 0.0),
    "reach of NaN": changed(12, "<f", float("nan")),
    "less than no uncertainty": changed(16, "<f", -1.0),
    "a table that falls": changed(HEAD.size + 8, "<f", 0.5),
    "a table from above 0": changed(HEAD.size, "<f", 0.5),
    "a load of infinity": changed(HEAD.size + 28, "<f", float("inf")),
    "a gain of NaN": changed(len(WHOLE) - 4, "<f", float("nan")),
}  # fmt: skip


@pytest.mark.parametrize("content", WRONG.values(), ids=WRONG)
def test_both_readers_refuse_what_is_out_of_range(content, monkeypatch):
    said = r"calibration \(section 'LOAD'\) that is out of range; calibrate again"
    with pytest.raises(ModelError, match=said):
        decode_force_law(content, "made")
    monkeypatch.setattr("eitskin.model.eitm_sections.encode_force_law", lambda _: content)
    blob = encode_model(replace(prebuilt()[0], force_law=law()))
    for read in (lambda: decode_model(blob, "made"), lambda: CoreEngine(blob, "float32")):
        with pytest.raises(ModelError):
            read()


def test_what_no_reader_takes_is_not_written():
    with pytest.raises(ModelError):
        encode_force_law(replace(law(), radius_mm=-1.0))
