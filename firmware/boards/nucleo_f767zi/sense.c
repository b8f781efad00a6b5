/* The current through the skin: the voltage over 1 kOhm between the multiplexer of I- and ground,
 * by ADC2 on PC0, beside the scan (docs/guide/hardware.md). */
#include "nucleo.h"

/* 300 us: a period of the lowest excitation that is allowed, fifteen of 50 kHz */
enum { CHANNEL = 10, WINDOW_US = 300, READY_US = 5, MAX_CONVERSION_US = 10 };
enum { SENSE_OHM = 1000, SENSE_UV = 3300000, SENSE_CODES = 4096 };

void nucleo_sense_start(void)
{
    nucleo_pin(GPIOC_BASE, 0, PIN_ANALOG, 0, 0, 0);
    ADC_SMPR1(ADC2_BASE) = 0; /* 3 cycles */
    ADC_SQR1(ADC2_BASE) = 0;  /* one conversion */
    ADC_SQR3(ADC2_BASE) = CHANNEL;
}

/* The root, rounded down, one bit after the other. */
static uint32_t root(uint64_t square)
{
    uint64_t found = 0;
    for (uint64_t bit = (uint64_t)1 << 31; bit > 0; bit >>= 1) {
        if ((found + bit) * (found + bit) <= square)
            found += bit;
    }
    return (uint32_t)found;
}

static bool convert(uint32_t *code)
{
    const uint32_t start = nucleo_time_us(NULL);
    ADC_CR2(ADC2_BASE) |= ADC_CR2_SWSTART;
    while ((ADC_SR(ADC2_BASE) & ADC_SR_EOC) == 0) {
        if (nucleo_time_us(NULL) - start > MAX_CONVERSION_US)
            return false;
    }
    *code = ADC_DR(ADC2_BASE);
    return true;
}

/* The rms about the mean of all samples in the window, because the bias is not known exactly. If
 * the converter does not answer, this returns a current so large that the limit trips. */
uint32_t nucleo_measure_ua_rms(void *ctx)
{
    uint64_t sum = 0, squares = 0, count = 0;
    ADC_CR2(ADC2_BASE) = ADC_CR2_ADON;
    const uint32_t start = nucleo_time_us(ctx);
    while (nucleo_time_us(ctx) - start < READY_US)
        ;
    while (nucleo_time_us(ctx) - start < READY_US + WINDOW_US) {
        uint32_t code;
        if (!convert(&code))
            return UINT32_MAX >> 1;
        sum += code;
        squares += (uint64_t)code * code;
        ++count;
    }
    ADC_CR2(ADC2_BASE) = 0;
    if (count == 0)
        return UINT32_MAX >> 1;
    /* thousandths of a step: a whole step is 0.8 uA */
    const uint64_t variance = (count * squares - sum * sum) * 1000000u / (count * count);
    return (uint32_t)((uint64_t)root(variance) * SENSE_UV / SENSE_CODES / SENSE_OHM / 1000u);
}
