/* The switches: one register for each of I+, I-, V+ and V-, which takes the number of an electrode,
 * or OFF. On a real board a write to a port or a bus stands here. */
#include "example.h"

enum { OFF = 0xFF, SWITCHES = 4, BREAK_NS = 200, LOOP_NS = 15 /* three instructions of 5 ns */ };

static uint8_t registers[SWITCHES] = {OFF, OFF, OFF, OFF};

static fw_status all_off(void *ctx)
{
    (void)ctx;
    for (uint32_t k = 0; k < SWITCHES; ++k)
        registers[k] = OFF;
    return FW_OK;
}

static fw_status join(void *ctx, uint32_t electrodes)
{
    (void)all_off(ctx); /* break before make */
    for (uint32_t k = 0; k < BREAK_NS / LOOP_NS + 1u; ++k)
        __asm volatile("nop");
    for (uint32_t k = 0; k < SWITCHES; ++k)
        registers[k] = (uint8_t)(electrodes >> 8 * k);
    return FW_OK;
}

const fw_multiplexers_ops example_switches_ops = {join, all_off};

bool example_switches_joined(uint8_t electrodes[4])
{
    bool all = true;
    for (uint32_t k = 0; k < SWITCHES; ++k) {
        electrodes[k] = registers[k];
        all = all && registers[k] != OFF;
    }
    return all;
}
