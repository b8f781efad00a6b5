/* Model of the generator for boards without hardware: the registers of an AD9833 after the words
 * that were written to it (data sheet, Rev. G, tables 6 to 9). Frequency register 1, phase register
 * 1 and writes of single halves are not modelled. */
#ifndef AD9833_MODEL_H
#define AD9833_MODEL_H

#include <stdbool.h>
#include <stdint.h>

enum {
    AD9833_MODEL_B28 = 0x2000,     /* frequency registers are loaded by two words, low half first */
    AD9833_MODEL_FSELECT = 0x0800, /* frequency register 1 */
    AD9833_MODEL_RESET = 0x0100    /* the phase is held at 0 */
};

typedef struct ad9833_model {
    uint16_t control, phase; /* phase: of 4096 in a turn */
    uint32_t tuning;         /* of 2^28 */
    uint32_t low_half;
    bool low_written;
} ad9833_model;

/* Whether the output has the frequency of `tuning`. */
static inline bool ad9833_model_runs(const ad9833_model *part)
{
    return (part->control & AD9833_MODEL_B28) != 0 && (part->control & AD9833_MODEL_RESET) == 0;
}

/* Take a word. Returns whether the phase begins with it. */
static inline bool ad9833_model_write(ad9833_model *part, uint16_t word)
{
    const bool ran = ad9833_model_runs(part);
    const uint32_t half = word & 0x3FFFu;
    switch (word >> 14) {
    case 0:
        part->control = word;
        part->low_written = false;
        return !ran && ad9833_model_runs(part);
    case 1:
        if ((part->control & AD9833_MODEL_B28) == 0)
            break;
        if (part->low_written)
            part->tuning = half << 14 | part->low_half;
        else
            part->low_half = half;
        part->low_written = !part->low_written;
        break;
    case 3:
        part->phase = word & 0xFFFu;
        break;
    default:
        break;
    }
    return false;
}

#endif
