/* The ADG1206: lines 0 to 15 (addresses) on PE0 to PE15, 16 to 19 (enables) on PF12 to PF15, and
 * 20 to 23 (enables of electrodes 16 to 31, where they are fitted) on PF8 to PF11. A wire from PF7
 * to GND says that the second four multiplexers are fitted. */
#include "nucleo.h"

enum { ENABLE_PIN = 12, MORE_ENABLE_PIN = 8, MORE_FITTED_PIN = 7, ADDRESS_LINES = 16 };
#define ADDRESSES   0x0000FFFFu
#define ENABLES     0x00FF0000u
#define ENABLE_PINS 0xFF00u

void nucleo_multiplexers_off(void)
{
    GPIO_BSRR(GPIOF_BASE) = ENABLE_PINS << 16;
}

/* The enables among these lines, as pins of port F. */
static uint32_t pins_of(uint32_t lines)
{
    const uint32_t enables = lines >> ADDRESS_LINES;
    return (enables & 0xFu) << ENABLE_PIN | (enables >> 4 & 0xFu) << MORE_ENABLE_PIN;
}

static volatile bool is_barred;

void nucleo_multiplexers_bar(bool barred)
{
    is_barred = barred; /* before they open, because a burst's interrupt may come in between */
    if (barred)
        nucleo_multiplexers_off();
}

void nucleo_multiplexers_start(void)
{
    nucleo_multiplexers_off(); /* before they are outputs */
    for (uint32_t line = 0; line < 4; ++line)
        nucleo_pin(GPIOF_BASE, ENABLE_PIN + line, PIN_OUTPUT, 0, 1, 0);
    for (uint32_t line = 0; line < 4; ++line)
        nucleo_pin(GPIOF_BASE, MORE_ENABLE_PIN + line, PIN_OUTPUT, 0, 1, 0);
    nucleo_pin(GPIOF_BASE, MORE_FITTED_PIN, PIN_INPUT, 0, 0, 1);
    for (uint32_t line = 0; line < ADDRESS_LINES; ++line)
        nucleo_pin(GPIOE_BASE, line, PIN_OUTPUT, 0, 1, 0);
}

uint32_t nucleo_electrodes(void)
{
    return (GPIO_IDR(GPIOF_BASE) >> MORE_FITTED_PIN & 1u) == 0 ? 32u : 16u;
}

static fw_status write_lines(void *ctx, uint32_t mask, uint32_t levels)
{
    (void)ctx;
    if ((mask & ~(ADDRESSES | ENABLES)) != 0)
        return FW_E_ARGUMENT;
    if (is_barred && (levels & mask & ENABLES) != 0)
        return FW_E_BUS;
    /* One store a port: the upper half of BSRR clears, the lower sets (RM0410 6.4.7). */
    const uint32_t high = mask & levels, low = mask & ~levels;
    if ((mask & ADDRESSES) != 0)
        GPIO_BSRR(GPIOE_BASE) = (high & ADDRESSES) | (low & ADDRESSES) << 16;
    if ((mask & ENABLES) != 0)
        GPIO_BSRR(GPIOF_BASE) = pins_of(high) | pins_of(low) << 16;
    return FW_OK;
}

static void wait_ns(void *ctx, uint32_t ns)
{
    (void)ctx;
    const uint32_t per_us = NUCLEO_SYSCLK_HZ / 1000000u;
    const uint32_t start = DWT_CYCCNT,
                   cycles = ns / 1000u * per_us + (ns % 1000u * per_us + 999u) / 1000u;
    while (DWT_CYCCNT - start < cycles)
        ;
}

const fw_lines_ops nucleo_multiplexers_ops = {write_lines, wait_ns};
