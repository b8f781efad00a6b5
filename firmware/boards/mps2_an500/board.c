/* The emulated board, for the application; its files are in the folder in which QEMU runs. */
#include "drivers/ad9833.h"
#include "drivers/adg1206.h"
#include "mps2.h"

#include <stdlib.h>

enum { STACK_BYTES = 64 * 1024, WORKSPACE_BYTES = 512 * 1024, LEAVE_FREE = 256, EXIT_RESET = 3 };
#define STACK_PAINT 0x57AC57ACu

extern uint32_t stack_top;
static _Alignas(16) uint8_t workspace[WORKSPACE_BYTES];
static fw_ad9833 ad9833;
static fw_adg1206 adg1206;

static void feed_watchdog(void *ctx)
{
    (void)ctx;
}

/* A reset ends the run, whose output is in the files. */
static void restart(void *ctx)
{
    (void)ctx;
    exit(EXIT_RESET);
}

static uint32_t *stack_bottom(void)
{
    return &stack_top - STACK_BYTES / sizeof stack_top;
}

static uint32_t stack_used(void *ctx)
{
    (void)ctx;
    const uint32_t *word = stack_bottom();
    while (word < &stack_top && *word == STACK_PAINT)
        ++word;
    return (uint32_t)(&stack_top - word) * (uint32_t)sizeof *word;
}

static void set_leds(void *ctx, uint32_t leds)
{
    (void)ctx;
    (void)leds;
}

static const fw_system_ops system_ops = {mps2_time_us,  mps2_wait,  mps2_lock,  mps2_unlock,
                                         feed_watchdog, restart,    stack_used, set_leds,
                                         NULL,          mps2_later, NULL};

int main(void)
{
    const uint32_t *const here =
        (const uint32_t *)__builtin_frame_address(0) - LEAVE_FREE / sizeof *here;
    for (uint32_t *word = stack_bottom(); word < here; ++word)
        *(volatile uint32_t *)word = STACK_PAINT;
    mps2_store_start();
    mps2_skin_start();
    mps2_link_start();
    mps2_timebase_start();
    const fw_board board = {
        .name = "mps2_an500",
        .serial = "0",
        .f_cpu_hz = MPS2_CPU_HZ,
        .stack_bytes = STACK_BYTES,
        .generator =
            fw_ad9833_generator(&ad9833, (fw_spi){&mps2_generator_ops, NULL}, MPS2_MCLK_HZ),
        .multiplexers = fw_adg1206_multiplexers(&adg1206, (fw_lines){&mps2_multiplexers_ops, NULL},
                                                FW_MAX_ELECTRODES),
        .capture = {&mps2_capture_ops, NULL, MPS2_FULL_SCALE_CODE, MPS2_REFERENCE_UV,
                    MPS2_GAIN_PPM},
        .link = {&mps2_link_ops, NULL},
        .store = {&mps2_store_ops, NULL, MPS2_BANK_BYTES},
        .system = &system_ops,
        .workspace = workspace,
        .workspace_bytes = sizeof workspace,
    };
    const int status = fw_run(&board);
    (void)mps2_lock(NULL); /* no slot's interrupt may come during exit */
    return status;
}
