/* Demodulation: amplitudes and phases against the formula, the generator's own phase across wraps
 * of the clock, ends of the range. */
#include "app/acquire/sincos.h"
#include "app/solve/phase.h"
#include "check.h"
#include "fake_board.h"

#include <math.h>
#include <string.h>

#define TURN 6.283185307179586

static fw_demodulator d;
static const fw_capture CAPTURE = {NULL, NULL, 4095, 3300000, 1000000};
static uint16_t burst[FW_MAX_SAMPLES];

/* of an AD9833 with 8 MHz */
static uint64_t turn_per_us(uint32_t tuning)
{
    return (uint64_t)tuning * 8u << 36;
}

/* As after a start: the phase is 0 at time 0. */
static fw_status set_up(const fw_capture *capture, uint64_t turn, uint32_t excitation_millihz,
                        uint32_t rate_hz, uint32_t samples)
{
    d = (fw_demodulator){0};
    return fw_demodulate_setup(&d, capture, turn, excitation_millihz, rate_hz, samples);
}

/* Codes of `amplitude_v` cos(2 pi (turns + hz t)), as a converter rounds them. */
static void make_burst(uint32_t samples, double rate_hz, double hz, double amplitude_v,
                       double turns, double lsb_v, double middle)
{
    for (uint32_t k = 0; k < samples; ++k)
        burst[k] = (uint16_t)floor(amplitude_v / lsb_v * cos(TURN * (turns + hz * k / rate_hz)) +
                                   middle + 0.5);
}

TEST(test_turns)
{
    for (uint64_t turn = 0; turn < (uint64_t)1 << 32; turn += 7654321) {
        float c, s;
        fw_sincos((uint32_t)turn, &c, &s);
        CHECK_NEAR(c, cos(TURN * (double)turn / 4294967296.0), 2e-7);
        CHECK_NEAR(s, sin(TURN * (double)turn / 4294967296.0), 2e-7);
    }
    float c, s;
    fw_sincos(0x80000000u, &c, &s);
    CHECK(c == -1 && s == 0);
    fw_sincos(0x40000000u, &c, &s);
    CHECK(c == 0 && s == 1);
}

TEST(test_whole_periods)
{
    CHECK(fw_whole_periods(50000000, 1000000, 80));
    CHECK(fw_whole_periods(50000000, 1000000, 20));
    CHECK(!fw_whole_periods(50000000, 1000000, 81));
    CHECK(!fw_whole_periods(50000012, 1000000, 80));
    CHECK(!fw_whole_periods(50000000, 0, 80));
    CHECK(!fw_whole_periods(50000000, 1000000, 0));
    CHECK_EQUAL(fw_nearest_integer(50000000, 1000000, 81), 80);
    CHECK_EQUAL(fw_nearest_integer(50000000, 1000000, 95), 100);
    CHECK_EQUAL(fw_nearest_integer(50000000, 1000000, 3), 20);
    CHECK_EQUAL(fw_nearest_integer(50000012, 1000000, 80), 250000000);
    CHECK_EQUAL(fw_nearest_integer(30000000, 1000000, 80), 100); /* 3 periods in 100 */
}

TEST(test_scale)
{
    CHECK_EQUAL(fw_volts_per_code_nv(&CAPTURE), 805664); /* 3.3 V / 4096 */
    const fw_capture gained = {NULL, NULL, 4095, 3300000, 2500000};
    CHECK_EQUAL(fw_volts_per_code_nv(&gained), 322266);
    /* 4 periods of 20 samples, 12 of 25 samples, which have only 25 different phases */
    CHECK_NEAR(fw_rounding_v(805664, 50000000, 1000000, 80), 805.664e-6 / sqrt(6 * 20), 1e-10);
    CHECK_NEAR(fw_rounding_v(805664, 40000000, 1000000, 300), 805.664e-6 / sqrt(6 * 25), 1e-10);
    CHECK_EQUAL(set_up(&gained, turn_per_us(1677722), 50000000, 1000000, 80), FW_OK);
    make_burst(80, 1e6, 50e3, 0.5, 0, 322.266e-6, 2048);
    fw_iq z;
    CHECK(!fw_demodulate(&d, burst, 0, &z));
    CHECK_NEAR(z.i, 0.5, 0.3 * 322e-6);
}

/* The errors of amplitude and phase come from rounding to whole codes alone: at most 4 / pi times
 * half a step, and less if the samples of a burst have many different phases. */
TEST(test_amplitudes)
{
    const struct {
        const char *name;
        uint32_t millihertz, rate, samples;
        double steps;
    } cases[] = {{"as after a start", 50000000, 1000000, 80, 0.45},
                 {"one period", 50000000, 1000000, 20, 0.45},
                 {"3 periods of 33.3 samples", 30000000, 1000000, 100, 0.3},
                 {"4 samples per period", 250000000, 1000000, 64, 0.64},
                 {"the longest burst", 125000000, 2000000, 1024, 0.5},
                 {"an odd number of samples", 1000000, 27000, 27, 0.3}};
    const double lsb_v = 3.3 / 4096;
    for (size_t n = 0; IN_TABLE(n, cases); ++n) {
        CASE(cases[n].name);
        const uint32_t tuning = fw_ad9833_tuning(8000000, cases[n].millihertz);
        CHECK_EQUAL(set_up(&CAPTURE, turn_per_us(tuning), cases[n].millihertz, cases[n].rate,
                           cases[n].samples),
                    FW_OK);
        for (int k = 0; k < 40; ++k) {
            const double amplitude = k == 0 ? 0 : 1.6 / k, turns = 0.31 * k, middle = 2048 + k % 3;
            fw_iq z;
            make_burst(cases[n].samples, cases[n].rate, cases[n].millihertz * 1e-3, amplitude,
                       turns, lsb_v, middle);
            CHECK(!fw_demodulate(&d, burst, 0, &z));
            CHECK_NEAR(z.i, amplitude * cos(TURN * turns), cases[n].steps * lsb_v);
            CHECK_NEAR(z.q, amplitude * sin(TURN * turns), cases[n].steps * lsb_v);
        }
    }
}

/* The generator's frequency differs slightly from the nominal one. The measured phase stays
 * constant over hours and wraps of the clock. */
TEST(test_phase_is_constant)
{
    const uint32_t tuning = fw_ad9833_tuning(8000000, 50000000);
    const double turns_per_us = tuning * 8.0 / 268435456.0;
    CHECK_EQUAL(set_up(&CAPTURE, turn_per_us(tuning), 50000000, 1000000, 80), FW_OK);
    const uint64_t when[] = {0,
                             100,
                             20800,
                             999900,
                             3600000000u,
                             4294967200u,
                             4294967296u + 100u,
                             5 * 4294967296u + 12345u};
    for (size_t k = 0; IN_TABLE(k, when); ++k) {
        const double turns =
            (double)((unsigned __int128)when[k] * tuning * 8u % 268435456u) / 268435456.0;
        fw_iq z;
        make_burst(80, 1e6, turns_per_us * 1e6, 1, turns + 0.2, 3.3 / 4096, 2048);
        CHECK(!fw_demodulate(&d, burst, (uint32_t)when[k], &z));
        CHECK_NEAR(z.i, cos(TURN * 0.2), 0.3 * 3.3 / 4096);
        CHECK_NEAR(z.q, sin(TURN * 0.2), 0.3 * 3.3 / 4096);
    }
}

/* A generator that makes exactly 50 kHz, a twentieth of a turn in each microsecond, which no number
 * of bits holds. Its phase at multiples of 20 us is the same when the board's clock wraps. */
TEST(test_decimal_frequency)
{
    CHECK_EQUAL(set_up(&CAPTURE, UINT64_MAX / 20u, 50000000, 1000000, 80), FW_OK);
    make_burst(80, 1e6, 50e3, 1, 0.2, 3.3 / 4096, 2048);
    for (uint64_t at_us = 0; at_us < (uint64_t)3 << 32; at_us += 3600000020u) {
        fw_iq z;
        CHECK(!fw_demodulate(&d, burst, (uint32_t)at_us, &z));
        CHECK_NEAR(z.i, cos(TURN * 0.2), 0.3 * 3.3 / 4096);
        CHECK_NEAR(z.q, sin(TURN * 0.2), 0.3 * 3.3 / 4096);
    }
}

TEST(test_ends_of_range)
{
    fw_iq z;
    CHECK_EQUAL(set_up(&CAPTURE, turn_per_us(1677722), 50000000, 1000000, 80), FW_OK);
    for (int k = 0; k < 80; ++k)
        burst[k] = k % 2 ? 1 : 4094;
    CHECK(!fw_demodulate(&d, burst, 0, &z));
    burst[79] = 4095;
    CHECK(fw_demodulate(&d, burst, 0, &z));
    burst[79] = 4094;
    burst[0] = 0;
    CHECK(fw_demodulate(&d, burst, 0, &z));
    CHECK_EQUAL(set_up(&CAPTURE, turn_per_us(1677722), 50000000, 1000000, 81), FW_E_ARGUMENT);
    CHECK_EQUAL(set_up(&CAPTURE, turn_per_us(1677722), 50000000, 1000000, 2000), FW_E_ARGUMENT);
}

/* The largest sum of 16-bit codes over the longest burst does not overflow. */
TEST(test_wide_converter)
{
    const fw_capture wide = {NULL, NULL, 65535, 3300000, 1000000};
    CHECK_EQUAL(set_up(&wide, turn_per_us(8388608), 250000000, 1000000, 1024), FW_OK);
    for (int k = 0; k < 1024; ++k)
        burst[k] = (uint16_t)(k % 4 == 0 ? 65534 : (k % 4 == 2 ? 1 : 32768));
    fw_iq z;
    CHECK(!fw_demodulate(&d, burst, 0, &z));
    CHECK_NEAR(z.i, 1.65, 1e-4);
    CHECK_NEAR(z.q, 0, 1e-4);
}

/* Two pairs of the model, also inverted, half a turn from the expected phase. The phase is learned
 * from whichever row of each pair can be used. */
TEST(test_phase_from_either_row)
{
    static const eits_fold FOLD[2] = {{.first = 0, .second = 1, .sign = 1},
                                      {.first = 2, .second = 3, .sign = -1}};
    static const float V_REF[2] = {2, -1};
    static const float volts[4] = {2, 2, -1, 1};
    const struct {
        const char *name;
        uint8_t quality[4];
    } cases[] = {{"first rows are lost", {1, 0, 1, 0}},
                 {"second rows are lost", {0, 1, 0, 1}},
                 {"no row is lost", {0}}};
    for (size_t k = 0; IN_TABLE(k, cases); ++k) {
        CASE(cases[k].name);
        for (int turn = 0; turn < 16; ++turn) {
            const double angle = TURN * (turn + 0.25) / 16;
            fw_iq z[4];
            uint8_t quality[4];
            memcpy(quality, cases[k].quality, sizeof quality);
            for (int i = 0; i < 4; ++i)
                z[i] = (fw_iq){(float)(volts[i] * cos(angle)), (float)(volts[i] * sin(angle))};
            fw_engine engine = {.model = {.n_rows = 4, .n_folded = 2, .fold = FOLD, .v_ref = V_REF},
                                .cosine = 1};
            const fw_frame frame = {.z = z, .quality = quality};
            fw_phase_learn(&engine, &frame);
            CHECK_NEAR(engine.cosine, cos(angle), 1e-5);
            CHECK_NEAR(engine.sine, sin(angle), 1e-5);
        }
    }
}

RUN_TESTS("demodulate")
