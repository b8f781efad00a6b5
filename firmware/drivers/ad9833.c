#include "drivers/ad9833.h"

enum {
    CONTROL_B28 = 0x2000,     /* a frequency comes in two writes and takes effect with the second */
    CONTROL_OPBITEN = 0x0020, /* the accumulator's top bit to the pin instead of the converter */
    CONTROL_DIV2 = 0x0008,    /* ... undivided */
    CONTROL_MODE = 0x0002,    /* triangle instead of sine */
    ADDRESS_FREQ0 = 0x4000,
    ADDRESS_PHASE0 = 0xC000
};

#define MAX_MCLK_HZ 64000000u /* 2^28 times this in millihertz fits 64 bits */
#define FULL_TURN   ((uint64_t)1 << 28)

uint32_t fw_ad9833_tuning(uint32_t mclk_hz, uint64_t millihertz)
{
    const uint64_t mclk_millihertz = (uint64_t)mclk_hz * 1000u;
    if (mclk_hz == 0 || mclk_hz > MAX_MCLK_HZ || millihertz > mclk_millihertz / 2)
        return 0;
    return (uint32_t)((millihertz * FULL_TURN + mclk_millihertz / 2) / mclk_millihertz);
}

uint64_t fw_ad9833_millihertz(uint32_t mclk_hz, uint32_t tuning)
{
    if (mclk_hz > MAX_MCLK_HZ)
        return 0;
    return ((uint64_t)(tuning & (FULL_TURN - 1)) * mclk_hz * 1000u + FULL_TURN / 2) / FULL_TURN;
}

uint16_t fw_ad9833_phase(uint32_t millidegrees)
{
    const uint32_t angle = millidegrees % 360000u;
    return (uint16_t)((angle * 4096u + 180000u) / 360000u & 0xFFFu);
}

static uint16_t waveform_bits(fw_waveform waveform)
{
    switch (waveform) {
    case FW_SINE:
        break;
    case FW_TRIANGLE:
        return CONTROL_MODE;
    case FW_SQUARE:
        return CONTROL_OPBITEN | CONTROL_DIV2;
    case FW_SQUARE_HALF:
        return CONTROL_OPBITEN;
    }
    return 0;
}

void fw_ad9833_words(uint32_t tuning, uint16_t phase, fw_waveform waveform,
                     uint16_t words[FW_AD9833_WORDS])
{
    words[0] = FW_AD9833_RESET_WORD;
    words[1] = (uint16_t)(ADDRESS_FREQ0 | (tuning & 0x3FFFu));
    words[2] = (uint16_t)(ADDRESS_FREQ0 | (tuning >> 14 & 0x3FFFu));
    words[3] = (uint16_t)(ADDRESS_PHASE0 | (phase & 0xFFFu));
    words[4] = (uint16_t)(CONTROL_B28 | waveform_bits(waveform));
}

fw_status fw_ad9833_stop(fw_ad9833 *part)
{
    const uint16_t word = FW_AD9833_RESET_WORD;
    return part->spi.ops->write(part->spi.ctx, &word, 1);
}

fw_status fw_ad9833_start(fw_ad9833 *part, uint32_t tuning, uint16_t phase, fw_waveform waveform)
{
    uint16_t words[FW_AD9833_WORDS];
    if (tuning >> 28 != 0 || phase >> 12 != 0)
        return FW_E_ARGUMENT;
    fw_ad9833_words(tuning, phase, waveform, words);
    /* one by one: if a write fails, all words before it have been written */
    for (size_t k = 0; k < FW_AD9833_WORDS; ++k) {
        const fw_status status = part->spi.ops->write(part->spi.ctx, &words[k], 1);
        if (status != FW_OK) {
            (void)fw_ad9833_stop(part);
            return status;
        }
    }
    return FW_OK;
}

static fw_tone nearest(const void *ctx, uint32_t millihz)
{
    const fw_ad9833 *part = ctx;
    const uint32_t tuning = fw_ad9833_tuning(part->mclk_hz, millihz);
    return (fw_tone){.millihz = (uint32_t)fw_ad9833_millihertz(part->mclk_hz, tuning),
                     .turn_per_us = (uint64_t)tuning * (part->mclk_hz / 1000000u) << 36};
}

static fw_status start(void *ctx, uint32_t millihz)
{
    fw_ad9833 *part = ctx;
    const uint32_t tuning = fw_ad9833_tuning(part->mclk_hz, millihz);
    return tuning == 0 ? FW_E_RANGE : fw_ad9833_start(part, tuning, 0, FW_SINE);
}

static fw_status stop(void *ctx)
{
    return fw_ad9833_stop(ctx);
}

fw_generator fw_ad9833_generator(fw_ad9833 *part, fw_spi spi, uint32_t mclk_hz)
{
    static const fw_generator_ops ops = {nearest, start, stop};
    *part = (fw_ad9833){spi, mclk_hz};
    return (fw_generator){&ops, part};
}
