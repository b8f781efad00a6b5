/* This file tells the application what the board has. */
#include "example.h"

enum { WORKSPACE_BYTES = 512 * 1024, SOURCE_UA_RMS = 707 };
#define SCB_AIRCR         REG32(0xE000ED0Cu) /* Armv7-M, B3.2.6 */
#define AIRCR_SYSRESETREQ 0x05FA0004u

static _Alignas(16) uint8_t workspace[WORKSPACE_BYTES];

static void nothing(void *ctx)
{
    (void)ctx;
}

static uint32_t not_measured(void *ctx)
{
    (void)ctx;
    return 0;
}

static void no_leds(void *ctx, uint32_t leds)
{
    (void)ctx;
    (void)leds;
}

static void restart(void *ctx)
{
    (void)ctx;
    SCB_AIRCR = AIRCR_SYSRESETREQ;
    for (;;)
        ;
}

static const fw_system_ops system_ops = {
    .time_us = mps2_time_us,
    .wait = mps2_wait, /* a real board sleeps here until an interrupt */
    .lock = mps2_lock,
    .unlock = mps2_unlock,
    .feed_watchdog = nothing,
    .reset = restart,
    .stack_used = not_measured,
    .set_leds = no_leds,
    .later = mps2_later,
};

int main(void)
{
    example_link_start();
    mps2_timebase_start();
    for (uint32_t bank = 0; bank < FW_BANKS; ++bank)
        (void)example_store_ops.erase(NULL, bank);
    const fw_board board = {
        .name = "example",
        .serial = "0",
        .f_cpu_hz = MPS2_CPU_HZ,
        .source_ua_rms = SOURCE_UA_RMS,
        .generator = {&example_generator_ops, NULL},
        .multiplexers = {&example_switches_ops, NULL, EXAMPLE_ELECTRODES},
        .capture = {&mps2_capture_ops, NULL, MPS2_FULL_SCALE_CODE, MPS2_REFERENCE_UV,
                    MPS2_GAIN_PPM},
        .link = {&example_link_ops, NULL},
        .store = {&example_store_ops, NULL, EXAMPLE_BANK_BYTES, 0},
        .system = &system_ops,
        .workspace = workspace,
        .workspace_bytes = sizeof workspace,
    };
    return fw_run(&board);
}
