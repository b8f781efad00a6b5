/* From a burst of converter codes to the amplitude and phase of the excitation in it.
 *
 * A burst holds a whole number of excitation periods, so that sums with a cosine and a sine see
 * neither the bias nor their own image. The generator's frequency is the nearest that its tuning
 * word gives, not quite the nominal one: within a burst that is nothing, from burst to burst it
 * turns the phase. The generator's accumulator is therefore followed here, in the same wrapping
 * arithmetic that it uses itself, and taken off. */
#ifndef FW_DEMODULATE_H
#define FW_DEMODULATE_H

#include "hal/hal.h"

/* volts at the electrodes: amplitude times cosine and sine of the phase */
typedef struct fw_iq {
    float i, q;
} fw_iq;

typedef struct fw_demodulator {
    uint32_t samples;
    uint32_t full_scale_code;
    uint32_t turn_per_us; /* of the generator, in 2^-28 turns modulo 2^28 */
    float scale;          /* volts at the electrodes for one unit of the sums below */
    /* what a constant at mid-scale adds to them: 0 but for odd numbers of samples */
    int64_t bias[2];
    int16_t cosine[FW_MAX_SAMPLES], sine[FW_MAX_SAMPLES]; /* times 32767 */
} fw_demodulator;

/* Whether `samples` at `rate_hz` hold a whole number of periods of an excitation. */
bool fw_whole_periods(uint32_t excitation_millihz, uint32_t rate_hz, uint32_t samples);

/* The number of samples nearest to `samples` that does, at least one such; it may be above
 * FW_MAX_SAMPLES. */
uint32_t fw_nearest_integer(uint32_t excitation_millihz, uint32_t rate_hz, uint32_t samples);

/* Volts at the electrodes of one step of the converter, in nanovolts, rounded. */
uint32_t fw_volts_per_code_nv(const fw_capture *capture);

/* What rounding to whole codes alone does to an amplitude (rms, volts), of samples as above.
 * Without other noise every period is rounded alike, so that only its different phases average. */
float fw_rounding_v(uint32_t volts_per_code_nv, uint32_t excitation_millihz, uint32_t rate_hz,
                    uint32_t samples);

/* Tables and scale for bursts of `samples` (whole periods). mclk_hz must be a multiple of 1 MHz.
 * Errors: FW_E_ARGUMENT. */
fw_status fw_demodulate_setup(fw_demodulator *demodulator, const fw_capture *capture,
                              uint32_t mclk_hz, uint32_t tuning, uint32_t excitation_millihz,
                              uint32_t rate_hz, uint32_t samples);

/* Demodulate one burst that began at start_us. Returns whether a sample lay at either end of the
 * converter's range. */
bool fw_demodulate(const fw_demodulator *demodulator, const uint16_t *samples, uint32_t start_us,
                   fw_iq *out);

#endif
