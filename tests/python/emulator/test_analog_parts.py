"""The simulated analog parts: generator, multiplexers, skin, settling, converter."""

import numpy as np
import pytest
from thumb import flat_skin

from eitskin.skin.protocol import adjacent, table
from eitskin_emulator.analog.ad9833 import FULL_TURN, Ad9833
from eitskin_emulator.analog.adg1206 import OFF_TICKS, Multiplexers
from eitskin_emulator.analog.converter import CODE_V, STEP_V, codes
from eitskin_emulator.analog.front_end import TAU_TICKS, FrontEnd
from eitskin_emulator.analog.skin import AnalogSkin
from eitskin_emulator.clocktime import TICKS_PER_S, TICKS_PER_US
from eitskin_emulator.peripherals.spi import SpiFrame

MCLK_HZ, MCLK_TICKS = 8_000_000, 54
STEP = round(50_000 * FULL_TURN / MCLK_HZ)


def started(*words: int, at: int = 0) -> Ad9833:
    """A generator that has got ``words``, the last of them at ``at``."""
    generator = Ad9833()
    generator.set_mclk(0, MCLK_HZ)
    for word in words:
        generator.fsync(at, 0)
        generator.shifted(SpiFrame(word, 16, 1, 0, at, at))
        generator.fsync(at, 1)
    return generator


def starting(step: int, *, control: int = 0x2000, phase: int = 0) -> tuple[int, ...]:
    return (0x2100, 0x4000 | step & 0x3FFF, 0x4000 | step >> 14, 0xC000 | phase, control)


def test_the_data_sheet_s_words_make_400_hz():
    """AN-1070: 400 Hz at 25 MHz is 0x10C7."""
    generator = started(0x2100, 0x50C7, 0x4000, 0xC000, 0x2000)
    assert generator.frequency_hz == pytest.approx(0x10C7 * MCLK_HZ / FULL_TURN)
    assert pytest.approx(400, abs=0.05) == 0x10C7 * 25e6 / FULL_TURN


def test_the_output_follows_the_accumulator():
    generator = started(*starting(STEP), at=1000)
    times = 1000 + np.arange(0, 40 * TICKS_PER_US, 97)
    cycles = (times - 1000) // MCLK_TICKS
    exact = np.sin(2 * np.pi * (STEP * cycles % FULL_TURN) / FULL_TURN)
    assert np.abs(generator.output(times) - exact).max() < 1e-9
    assert abs(generator.output(times)[0]) < 1e-9


def test_phase_register_waveforms_and_reset():
    at = np.array([10])
    assert started(*starting(STEP)).output(at)[0] == pytest.approx(0, abs=2e-3)
    assert started(*starting(0, phase=1024)).output(at)[0] == pytest.approx(1, abs=2e-3)
    assert started(*starting(0, phase=1024, control=0x2002)).output(at)[0] == pytest.approx(
        0, abs=4e-3
    )  # triangle
    assert started(*starting(STEP, control=0x2100)).output(at + 999)[0] == 0
    assert started(*starting(STEP, control=0x2100)).frequency_hz == 0
    held = started(*starting(STEP, control=0x2080))  # the clock stopped: a constant
    assert len(set(held.output(np.arange(0, 10_000, 50)))) == 1
    other = started(*starting(STEP), 0x8000, 0x8100, 0x2800)  # the second frequency register
    assert other.frequency_hz == pytest.approx((0x100 << 14) / FULL_TURN * MCLK_HZ)


def test_halves_of_a_frequency_need_b28_or_hlb():
    assert started(0x2100, 0x4001, 0x4001, 0x2000).frequency_hz == pytest.approx(
        (1 << 14 | 1) / FULL_TURN * MCLK_HZ
    )
    lower = started(0x2100, 0x4000, 0x4000, 0x0000, 0x4123)
    assert lower.frequency_hz == pytest.approx(0x123 / FULL_TURN * MCLK_HZ)
    upper = started(0x2100, 0x4000, 0x4000, 0x1000, 0x4001)
    assert upper.frequency_hz == pytest.approx((1 << 14) / FULL_TURN * MCLK_HZ)
    half = started(0x2100, 0x5000, 0x2000)  # one half only: nothing is taken over
    assert half.frequency_hz == pytest.approx(1000, rel=1e-3)


def test_the_phase_goes_on_when_the_frequency_changes():
    generator = started(*starting(STEP))
    at = 777 * MCLK_TICKS
    before = generator.phases(np.array([at]), generator.courses[-1])[0]
    for word in (0x4000 | 2 * STEP & 0x3FFF, 0x4000 | 2 * STEP >> 14):
        generator.fsync(at, 0)
        generator.shifted(SpiFrame(word, 16, 1, 0, at, at))
        generator.fsync(at, 1)
    assert generator.courses[-1].phase == before
    assert generator.frequency_hz == pytest.approx(100_000, abs=0.1)


def test_multiplexers_decode_their_lines():
    muxes = Multiplexers()
    muxes.set_addresses(0, 0x3A51)
    assert muxes.joined == (None, None, None, None)
    muxes.set_enables(10, 0xF)
    assert muxes.joined == (1, 5, 10, 3)
    muxes.set_enables(20, 0x5)
    assert muxes.joined == (1, None, 10, None)
    assert [one.at for one in muxes.log] == [10, 20]
    assert muxes.violations == []


def test_a_second_four_share_the_address_lines():
    muxes = Multiplexers()
    muxes.set_addresses(0, 0xF031)
    muxes.set_enables(10, 0x96)
    assert muxes.joined == (17, 3, 0, 31)
    assert muxes.violations == []
    muxes.set_enables(20, 0x97)
    assert muxes.violations == ["0.046 us: I+ is on two electrodes"]
    muxes.set_addresses(30, 0x0031)
    assert muxes.violations[1:] == ["0.069 us: V- changed its address while enabled"]


def test_making_before_breaking_is_told():
    muxes = Multiplexers()
    muxes.set_enables(0, 0xF)
    muxes.set_addresses(10, 0x0010)
    assert muxes.violations == ["0.023 us: I- changed its address while enabled"]
    muxes.set_enables(20, 0)
    muxes.set_addresses(20 + OFF_TICKS - 1, 0)
    assert muxes.violations[1:] == ["0.183 us: I- changed its address before it was open"]
    muxes.set_enables(1000, 0xF)
    muxes.set_enables(2000, 0)
    muxes.set_addresses(2000 + OFF_TICKS, 0xFFFF)
    assert len(muxes.violations) == 2


def test_rows_their_reciprocals_and_turned_pairs():
    skin = flat_skin()
    a, b, c, d = (int(k) for k in skin.protocol.drive_measure[17])
    row, fold = 17, skin.protocol.reciprocal_pairs()
    assert skin.amplitude_v(0, (a, b, c, d)) == pytest.approx(18e-3)
    assert skin.amplitude_v(0, (b, a, c, d)) == pytest.approx(-18e-3)
    assert skin.amplitude_v(0, (b, a, d, c)) == pytest.approx(18e-3)
    assert skin.amplitude_v(0, (a, b, c, None)) == 0
    assert skin.amplitude_v(0, (0, 5, 3, 9)) == 0
    assert dict(skin.unknown_rows) == {(0, 5, 3, 9): 1}
    one_way = AnalogSkin(table(16, [[0, 1, 4, 5]]), np.array([[0.5]]), np.array([[0.5]]), 20.0)
    assert one_way.amplitude_v(0, (4, 5, 0, 1)) == 0.5
    assert one_way.amplitude_v(0, (5, 4, 0, 1)) == -0.5
    assert len(fold.first) == 104
    assert row in fold.first or row in fold.second


def test_frames_are_chosen_when_a_scan_begins():
    protocol = adjacent(16)
    untouched = np.arange(3)[:, None] * 1.0 + np.zeros((3, protocol.n_rows))
    frames = 100 + np.arange(5)[:, None] + np.zeros((5, protocol.n_rows))
    skin = AnalogSkin(protocol, untouched, frames, 10.0)
    rows = [tuple(int(k) for k in row) for row in protocol.drive_measure]

    def scan(begin: float, end: float) -> set[float]:
        times = np.linspace(begin, end, len(rows)) * TICKS_PER_S
        return {skin.amplitude_v(round(at), row) for at, row in zip(times, rows, strict=True)}

    assert [scan(k / 50, k / 50 + 0.02) for k in range(5)] == [{0.0}, {1.0}, {2.0}, {0.0}, {1.0}]
    skin.begin(TICKS_PER_S)
    assert scan(0.9, 1.1) == {2.0}  # began before the scene
    assert scan(1.15, 1.25) == {101.0}
    assert scan(1.31, 1.42) == {103.0}
    assert scan(9.0, 9.1) == {104.0}
    assert not skin.over(round(1.4 * TICKS_PER_S))
    assert skin.over(round(1.51 * TICKS_PER_S))


def test_settling_is_first_order():
    skin = flat_skin()
    generator = started(*starting(0, phase=1024))  # a constant 1
    front_end = FrontEnd(generator, Multiplexers(), skin)
    first, second = (skin.protocol.drive_measure[k] for k in (10, 200))

    def address(row: np.ndarray) -> int:
        return sum(int(electrode) << 4 * k for k, electrode in enumerate(row))

    muxes = front_end.multiplexers
    muxes.set_addresses(0, address(first))
    muxes.set_enables(100, 0xF)
    at = 100 + np.array([0, 0.5, 1, 2, 20]) * TAU_TICKS
    expected = 2048 + 11e-3 / STEP_V * (1 - np.exp(-np.array([0, 0.5, 1, 2, 20])))
    assert np.abs(front_end.sample(at.astype(np.int64), 3) - expected).max() <= 0.55
    settled = 100 + round(30 * TAU_TICKS)
    muxes.set_enables(settled, 0)
    muxes.set_addresses(settled + OFF_TICKS, address(second))
    muxes.set_enables(settled + OFF_TICKS, 0xF)
    left = 11e-3 * np.exp(-OFF_TICKS / TAU_TICKS)
    at = settled + OFF_TICKS + np.array([-OFF_TICKS - 5, 0, TAU_TICKS])
    expected = 2048 + np.array([11e-3, left, 201e-3 + (left - 201e-3) * np.exp(-1)]) / STEP_V
    assert np.abs(front_end.sample(at.astype(np.int64), 3) - expected).max() <= 0.55
    assert np.array_equal(front_end.sample(at.astype(np.int64), 4), [0, 0, 0])


def test_codes():
    found = codes(np.array([0.0, CODE_V, -CODE_V, 0.49 * CODE_V, 1.8, -1.8])).tolist()
    assert found == [2048, 2049, 2047, 2048, 4095, 0]
    assert pytest.approx(3.3 / 4096 / 1.5) == STEP_V
