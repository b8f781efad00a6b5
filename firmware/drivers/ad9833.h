/* AD9833 direct digital synthesiser: register words, and the sequence that starts it.
 *
 * Words and sequence after the AD9833 data sheet (Rev. G), "Control register", "Writing to a
 * frequency register", "Reset function", and its application note AN-1070, whose worked example the
 * tests repeat. */
#ifndef FW_AD9833_H
#define FW_AD9833_H

#include "hal/hal.h"

#define FW_AD9833_RESET_WORD                                             \
    0x2100u /* B28 and RESET: accumulator held at 0, output at mid-scale \
             */
#define FW_AD9833_WORDS 5u

typedef enum fw_waveform {
    FW_SINE,
    FW_TRIANGLE,
    FW_SQUARE,
    FW_SQUARE_HALF /* at half the frequency */
} fw_waveform;

/* The 28-bit tuning word nearest to a frequency: round(millihertz 2^28 / (1000 mclk_hz)). 0 if
 * mclk_hz is 0 or above 64 MHz (the part allows 25 MHz), or if the frequency is above half of it.
 */
uint32_t fw_ad9833_tuning(uint32_t mclk_hz, uint64_t millihertz);

/* The frequency of a tuning word, rounded to a millihertz; 0 if mclk_hz is above 64 MHz. */
uint64_t fw_ad9833_millihertz(uint32_t mclk_hz, uint32_t tuning);

/* The 12-bit phase word nearest to an angle in thousandths of a degree, modulo a turn. */
uint16_t fw_ad9833_phase(uint32_t millidegrees);

/* The words that start the generator: reset, frequency (low 14 bits, then high), phase, release of
 * the reset. */
void fw_ad9833_words(uint32_t tuning, uint16_t phase, fw_waveform waveform,
                     uint16_t words[FW_AD9833_WORDS]);

typedef struct fw_ad9833 {
    fw_spi spi;
    uint32_t mclk_hz;
} fw_ad9833;

/* The part behind this bus, with this clock, as the application's generator. mclk_hz is a multiple
 * of 1 MHz, so that the phase advances by whole units in each microsecond. `part` must live as long
 * as the board. */
fw_generator fw_ad9833_generator(fw_ad9833 *part, fw_spi spi, uint32_t mclk_hz);

/* Start (or restart) with this tuning word and phase. After an error the part is reset
 * again, if the bus still works. Errors: FW_E_ARGUMENT (more than 28 or 12 bits), those of the
 * bus. */
fw_status fw_ad9833_start(fw_ad9833 *part, uint32_t tuning, uint16_t phase, fw_waveform waveform);

/* Reset the part: its output stands at mid-scale. Errors: those of the bus. */
fw_status fw_ad9833_stop(fw_ad9833 *part);

#endif
