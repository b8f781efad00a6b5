#include "app/acquire/demodulate.h"

#include "app/acquire/sincos.h"

#include <math.h>

static uint64_t greatest_divisor(uint64_t a, uint64_t b)
{
    while (b != 0) {
        const uint64_t rest = a % b;
        a = b;
        b = rest;
    }
    return a;
}

bool fw_whole_periods(uint32_t excitation_millihz, uint32_t rate_hz, uint32_t samples)
{
    const uint64_t rate_millihz = (uint64_t)rate_hz * 1000u;
    return rate_hz > 0 && samples > 0 && (uint64_t)excitation_millihz * samples % rate_millihz == 0;
}

uint32_t fw_nearest_integer(uint32_t excitation_millihz, uint32_t rate_hz, uint32_t samples)
{
    const uint64_t rate_millihz = (uint64_t)rate_hz * 1000u;
    const uint64_t unit = rate_millihz / greatest_divisor(rate_millihz, excitation_millihz);
    const uint64_t count = (samples + unit / 2) / unit, nearest = unit * (count > 0 ? count : 1);
    return nearest > INT32_MAX ? INT32_MAX : (uint32_t)nearest;
}

uint32_t fw_volts_per_code_nv(const fw_capture *capture)
{
    const uint64_t steps = (uint64_t)capture->full_scale_code + 1u,
                   gain = capture->front_end_gain_ppm;
    return (uint32_t)(((uint64_t)capture->reference_uv * 1000000000u + steps * gain / 2) /
                      (steps * gain));
}

float fw_rounding_v(uint32_t volts_per_code_nv, uint32_t excitation_millihz, uint32_t rate_hz,
                    uint32_t samples)
{
    const uint64_t periods = (uint64_t)excitation_millihz * samples / ((uint64_t)rate_hz * 1000u);
    const float step_nv = (float)volts_per_code_nv,
                phases = (float)(uint32_t)(samples / greatest_divisor(samples, periods));
    /* the variance of a code is step^2 / 12; that of an amplitude is 2 / phases times as large */
    return sqrtf(step_nv * step_nv / (6.0f * phases)) * 1e-9f;
}

static int16_t to_q15(float value)
{
    return (int16_t)(32767.0f * value + (value < 0 ? -0.5f : 0.5f));
}

fw_status fw_demodulate_setup(fw_demodulator *d, const fw_capture *capture, uint64_t turn_per_us,
                              uint32_t excitation_millihz, uint32_t rate_hz, uint32_t samples)
{
    if (samples > FW_MAX_SAMPLES || !fw_whole_periods(excitation_millihz, rate_hz, samples) ||
        capture->front_end_gain_ppm == 0 || capture->full_scale_code == 0 ||
        capture->full_scale_code > UINT16_MAX)
        return FW_E_ARGUMENT;
    const uint32_t periods =
        (uint32_t)((uint64_t)excitation_millihz * samples / ((uint64_t)rate_hz * 1000u));
    const uint32_t steps = capture->full_scale_code + 1u;
    int64_t sum[2] = {0, 0};
    for (uint32_t k = 0; k < samples; ++k) {
        float c, s;
        fw_sincos((uint32_t)(((uint64_t)k * periods % samples << 32) / samples), &c, &s);
        d->cosine[k] = to_q15(c);
        d->sine[k] = to_q15(s);
        sum[0] += d->cosine[k];
        sum[1] += d->sine[k];
    }
    const float code_v =
        (float)capture->reference_uv / ((float)steps * (float)capture->front_end_gain_ppm);
    d->samples = samples;
    d->full_scale_code = capture->full_scale_code;
    d->turn_per_us = turn_per_us;
    d->scale = code_v * 2.0f / ((float)samples * 32767.0f);
    d->bias[0] = sum[0] * (int64_t)(steps / 2);
    d->bias[1] = sum[1] * (int64_t)(steps / 2);
    return FW_OK;
}

bool fw_demodulate(fw_demodulator *d, const uint16_t *samples, uint32_t start_us, fw_iq *out)
{
    const uint32_t inside =
        d->full_scale_code - 1u; /* number of codes that are not at an end of the range */
    int64_t in_phase = -d->bias[0], quadrature = -d->bias[1];
    uint32_t ends = 0;
    for (uint32_t k = 0; k < d->samples; ++k) {
        const int32_t code = samples[k];
        ends |= (uint32_t)((uint32_t)code - 1u >= inside);
        in_phase += (int64_t)code * d->cosine[k];
        quadrature += (int64_t)code * d->sine[k];
    }
    /* with code = A cos(phase + 2 pi k periods / samples): in_phase ~ A cos(phase), quadrature ~ -A
     * sin(phase) */
    const float i = d->scale * (float)in_phase, q = -d->scale * (float)quadrature;
    float c, s;
    d->turn += d->turn_per_us * (start_us - d->at_us);
    d->at_us = start_us;
    fw_sincos((uint32_t)(d->turn >> 32), &c, &s);
    out->i = i * c + q * s;
    out->q = q * c - i * s;
    return ends != 0;
}
