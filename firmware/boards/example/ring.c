/* The codes of a burst: a ring of equal resistors. 0.4 s after the scan's start, something
 * presses it: the resistor between electrodes 5 and 6 falls to a third.
 *
 * Electrodes lie on the ring at the sum of the resistances before them. Two that are k apart on a
 * ring of t ohm have k (t - k) / t between them, and the voltage from c to d for a current from a
 * to b is half of R(a,d) + R(b,c) - R(a,c) - R(b,d). */
#include "example.h"

#include <math.h>

enum { PRESSED = 5, PRESSED_AFTER_US = 400000 };
#define RESISTOR_OHM 1000.0f
#define CURRENT_A    1e-3f /* that models are made for */
#define TURN         6.2831853f
#define VOLTS_PER_CODE \
    ((float)MPS2_REFERENCE_UV / (float)MPS2_GAIN_PPM / (float)(MPS2_FULL_SCALE_CODE + 1))

static float resistor_ohm(uint32_t after, bool pressed)
{
    return pressed && after == PRESSED ? RESISTOR_OHM / 3 : RESISTOR_OHM;
}

static float place_ohm(uint32_t electrode, bool pressed)
{
    float sum = 0;
    for (uint32_t k = 0; k < electrode; ++k)
        sum += resistor_ohm(k, pressed);
    return sum;
}

static float between_ohm(uint32_t one, uint32_t other, bool pressed)
{
    const float all = place_ohm(EXAMPLE_ELECTRODES, pressed),
                k = fabsf(place_ohm(one, pressed) - place_ohm(other, pressed));
    return k * (all - k) / all;
}

static float amplitude_v(const uint8_t e[4], bool pressed)
{
    const float sum = between_ohm(e[0], e[3], pressed) + between_ohm(e[1], e[2], pressed) -
                      between_ohm(e[0], e[2], pressed) - between_ohm(e[1], e[3], pressed);
    return 0.5f * CURRENT_A * sum;
}

void mps2_skin_burst(uint16_t *codes, uint32_t samples, uint32_t sample_rate_hz, uint32_t start_us,
                     uint32_t scanning_us)
{
    uint8_t joined[4];
    uint32_t since_us;
    const uint32_t period_us = example_generator_period_us(&since_us);
    const bool flows = period_us != 0 && example_switches_joined(joined);
    const float steps =
        flows ? amplitude_v(joined, scanning_us >= PRESSED_AFTER_US) / VOLTS_PER_CODE : 0;
    const float a_us = flows ? TURN / (float)period_us : 0,
                turn = flows ? a_us * (float)((start_us - since_us) % period_us) : 0,
                step = a_us * 1e6f / (float)sample_rate_hz;
    const float cos_step = cosf(step), sin_step = sinf(step);
    float c = steps * cosf(turn), s = steps * sinf(turn);
    for (uint32_t k = 0; k < samples; ++k) {
        const float code = 0.5f * (float)(MPS2_FULL_SCALE_CODE + 1) + 0.5f + c;
        codes[k] = (uint16_t)fminf(fmaxf(code, 0), (float)MPS2_FULL_SCALE_CODE);
        const float next = c * cos_step - s * sin_step;
        s = s * cos_step + c * sin_step;
        c = next;
    }
}
