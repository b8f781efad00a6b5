/* Amplitude and phase of the excitation in a burst of converter codes.
 *
 * A burst holds a whole number of excitation periods. So neither the bias nor the image frequency
 * adds to its sums with a cosine and a sine. The generator's frequency is the nearest one that it
 * can make, and not exactly the nominal one. Within a burst the difference is negligible; from
 * burst to burst it turns the phase. The demodulator therefore adds up the generator's phase from
 * burst to burst, in wrapping arithmetic, and subtracts it. */
#ifndef FW_DEMODULATE_H
#define FW_DEMODULATE_H

#include "app/acquire/frame.h"
#include "hal/hal.h"

typedef struct fw_demodulator {
    uint32_t samples;
    uint32_t full_scale_code;
    uint64_t turn_per_us, turn; /* of the generator, in 2^-64 turns; `turn` at: */
    uint32_t at_us;             /* the last burst */
    float scale;                /* volts at the electrodes per unit of the sums */
    /* contribution of a constant at mid-scale to the sums; 0 for even numbers of samples */
    int64_t bias[2];
    int16_t cosine[FW_MAX_SAMPLES], sine[FW_MAX_SAMPLES]; /* times 32767 */
} fw_demodulator;

/* Returns whether `samples` at `rate_hz` hold a whole number of periods of an excitation. */
bool fw_whole_periods(uint32_t excitation_millihz, uint32_t rate_hz, uint32_t samples);

/* The number of samples nearest to `samples` that holds a whole number of periods, at least one. It
 * may exceed FW_MAX_SAMPLES. */
uint32_t fw_nearest_integer(uint32_t excitation_millihz, uint32_t rate_hz, uint32_t samples);

/* Returns one step of the converter as a voltage at the electrodes, in nanovolts, rounded. */
uint32_t fw_volts_per_code_nv(const fw_capture *capture);

/* Returns the rms error of an amplitude, in volts, that rounding to whole codes alone causes; the
 * arguments are as above. Without other noise every period is rounded in the same way, so that only
 * the different phases of a period average the error. */
float fw_rounding_v(uint32_t volts_per_code_nv, uint32_t excitation_millihz, uint32_t rate_hz,
                    uint32_t samples);

/* Compute tables and scale for bursts of `samples`, which must be whole periods. The phase
 * continues. Errors: FW_E_ARGUMENT. */
fw_status fw_demodulate_setup(fw_demodulator *demodulator, const fw_capture *capture,
                              uint64_t turn_per_us, uint32_t excitation_millihz, uint32_t rate_hz,
                              uint32_t samples);

/* Demodulate one burst that began at start_us, less than 2^32 us after the last one. Returns
 * whether a sample lay at either end of the converter's range. */
bool fw_demodulate(fw_demodulator *demodulator, const uint16_t *samples, uint32_t start_us,
                   fw_iq *out);

#endif
