"""Pairs of columns: the header is used if it says what they are, otherwise the user is asked; a
phase is never taken for a voltage."""

from pathlib import Path

import numpy as np
import pytest
from injected import healthy_frames

from eitskin.errors import UsageError
from eitskin.frames.import_options import ImportOptions
from eitskin.frames.importer import import_frames
from eitskin.frames.pairs import kind_of
from eitskin.frames.source import SourceOptions
from eitskin.skin.protocol import adjacent

FRAMES = healthy_frames(21)
VOLTS = np.vstack([FRAMES.reference_voltage_v[:4], FRAMES.voltage_v])
Z = np.abs(VOLTS) * np.exp(1j * np.where(VOLTS < 0, np.pi - 0.3, 0.3))
DEGREES = "mag {0} (mV),phase {0} (deg)"


def pair_table(
    path: Path, first: np.ndarray, second: np.ndarray, head: str | None, *, blocks: bool = False
) -> Path:
    """Frames in rows; first and second by turns, or all first ones before all second ones."""
    k = np.arange(first.shape[1])
    columns = np.stack([first, second], axis=2).reshape(len(first), -1)
    names = [] if head is None else [head.format(i) for i in k]
    if blocks:
        columns = np.hstack([first, second])
        halves = [name.split(",") for name in names]
        names = [half[0] for half in halves] + [half[1] for half in halves]
    header = ",".join(names)
    np.savetxt(path, columns, delimiter=",", fmt="%.17g", header=header, comments="")
    return path


def read(path: Path, **options: object) -> np.ndarray:
    source = SourceOptions(reference_frames="0:4", scale=1.0, **options)
    frames = import_frames(path, ImportOptions(source=source), adjacent(16), None)
    return np.vstack([frames.reference_voltage_v, frames.voltage_v])


@pytest.mark.parametrize("blocks", (False, True), ids=("by-turns", "blocks"))
@pytest.mark.parametrize(
    ("head", "unit"),
    [(DEGREES, 180 / np.pi), ("|Z| magnitude {0},Phase_{0} [rad]", 1.0)],
    ids=("degrees", "radians"),
)
def test_headers_that_say_magnitude_and_phase(tmp_path, head, unit, blocks):
    path = pair_table(tmp_path / "p.csv", np.abs(Z), unit * np.angle(Z), head, blocks=blocks)
    assert np.allclose(read(path, complex_part="abs"), np.abs(Z), rtol=1e-12)
    assert np.allclose(read(path, complex_part="real"), Z.real, rtol=1e-9)
    assert np.allclose(np.abs(read(path, complex_part="in-phase")), np.abs(VOLTS), rtol=1e-9)
    with pytest.raises(UsageError, match="--pairs real-imag: the header says magnitude-"):
        read(path, complex_part="abs", pairs="real-imag")


def test_headers_that_say_real_and_imaginary(tmp_path):
    path = pair_table(tmp_path / "p.csv", Z.real, Z.imag, "re{0},im{0}", blocks=True)
    assert np.allclose(read(path, complex_part="abs"), np.abs(Z), rtol=1e-12)


def test_without_a_header_it_must_be_said_unless_only_one_can_be(tmp_path):
    polar = pair_table(tmp_path / "p.csv", np.abs(Z), np.angle(Z), None)
    with pytest.raises(UsageError, match=r"nothing says whether .* say --pairs real-imag \|"):
        read(polar, complex_part="abs")
    got = read(polar, complex_part="abs", pairs="magnitude-radians")
    assert np.allclose(got, np.abs(Z), rtol=1e-12)
    signed = pair_table(tmp_path / "s.csv", -np.abs(Z.real), Z.imag, None)
    assert np.allclose(read(signed, complex_part="real"), -np.abs(Z.real))
    with pytest.raises(UsageError, match="a magnitude is below 0"):
        read(signed, complex_part="abs", pairs="magnitude-degrees")
    wide = pair_table(tmp_path / "w.csv", np.abs(Z), np.rad2deg(np.angle(Z)), None)
    with pytest.raises(UsageError, match=r"a phase of 1\d\d.* cannot be in radians"):
        read(wide, complex_part="abs", pairs="magnitude-radians")


def test_a_header_that_says_half_is_asked_for_the_rest(tmp_path):
    no_unit = pair_table(tmp_path / "p.csv", np.abs(Z), np.angle(Z), "mag{0},phase{0}")
    with pytest.raises(UsageError, match="not the phase's unit; say --pairs magnitude-degrees"):
        read(no_unit, complex_part="abs")
    assert np.allclose(
        read(no_unit, complex_part="real", pairs="magnitude-radians"), Z.real, rtol=1e-9
    )
    half = pair_table(tmp_path / "h.csv", np.abs(Z), np.angle(Z), "R{0},theta{0}")
    with pytest.raises(UsageError, match="the header does not state the meaning of every column"):
        read(half, complex_part="abs")


def test_a_phase_is_never_taken_for_a_voltage(tmp_path):
    path = pair_table(tmp_path / "p.csv", np.abs(Z), np.angle(Z), DEGREES)
    with pytest.raises(UsageError, match=r"column 'phase 0 \(deg\)' is a phase, not a voltage"):
        read(path)
    source = SourceOptions(columns="0:416:2", reference_frames="0:4", scale=1.0)
    options = ImportOptions(source=source, sign="magnitude")
    frames = import_frames(path, options, adjacent(16), None)
    assert np.allclose(np.abs(frames.voltage_v), np.abs(Z[4:]), rtol=1e-12)
    assert frames.meta["notes"] == [
        "the header calls the columns magnitudes; --sign magnitude gives them signs"
    ]


def test_a_part_of_real_numbers_is_refused(tmp_path):
    np.savez(tmp_path / "r.npz", v=np.abs(VOLTS))
    source = SourceOptions(voltage="v", reference_frames="0:4", complex_part="abs")
    with pytest.raises(UsageError, match="the numbers are real; leave it out"):
        import_frames(tmp_path / "r.npz", ImportOptions(source=source), adjacent(16), None)


def test_names_of_columns():
    said = {name: kind_of(name) for name in ("V_mag", "Phase (°)", "Im{Z}", "re_17", "time", "V3")}
    assert list(said.values()) == ["magnitude", "phase", "imag", "real", None, None]
