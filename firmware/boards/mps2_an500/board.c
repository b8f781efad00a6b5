/* The emulated board as the application sees it; its files are in the folder where QEMU runs. */
#include "mps2.h"

#include <stdlib.h>
#include <string.h>

enum { STACK_BYTES = 64 * 1024, WORKSPACE_BYTES = 512 * 1024, LEAVE_FREE = 256, EXIT_RESET = 3 };
#define STACK_PAINT 0x57AC57ACu

extern uint32_t stack_top;
static _Alignas(16) uint8_t workspace[WORKSPACE_BYTES];
static volatile bool woken;
static uint32_t last_ticks, rest_ticks, now_us;

uint32_t mps2_lock(void *ctx)
{
    (void)ctx;
    uint32_t state;
    __asm volatile("mrs %0, primask\n cpsid i" : "=r"(state)::"memory");
    return state;
}

void mps2_unlock(void *ctx, uint32_t state)
{
    (void)ctx;
    __asm volatile("msr primask, %0" ::"r"(state) : "memory");
}

/* The timer wraps every 13 s of board time; the application looks more often. */
uint32_t mps2_time_us(void *ctx)
{
    const uint32_t state = mps2_lock(ctx), ticks = TIMER_VALUE(TIMER_TIME);
    rest_ticks += last_ticks - ticks;
    last_ticks = ticks;
    now_us += rest_ticks / MPS2_TICKS_A_US;
    rest_ticks %= MPS2_TICKS_A_US;
    const uint32_t us = now_us;
    mps2_unlock(ctx, state);
    return us;
}

static uint32_t slot_timer_was, held;

void mps2_hold_time(void)
{
    const uint32_t state = mps2_lock(NULL);
    if (held++ == 0) {
        TIMER_CTRL(TIMER_TIME) = 0;
        slot_timer_was = TIMER_CTRL(TIMER_SLOT);
        TIMER_CTRL(TIMER_SLOT) = slot_timer_was & ~TIMER_ENABLE;
    }
    mps2_unlock(NULL, state);
}

void mps2_release_time(void)
{
    const uint32_t state = mps2_lock(NULL);
    if (--held == 0) {
        TIMER_CTRL(TIMER_SLOT) = slot_timer_was;
        TIMER_CTRL(TIMER_TIME) = TIMER_ENABLE;
    }
    mps2_unlock(NULL, state);
}

size_t mps2_load(const char *name, void *bytes, size_t room)
{
    FILE *const file = fopen(name, "rb");
    if (file == NULL)
        return 0;
    const size_t size = fread(bytes, 1, room, file);
    if (fgetc(file) != EOF)
        mps2_fail(name);
    fclose(file);
    return size;
}

void mps2_fail(const char *what)
{
    printf("mps2_an500: %s\n", what);
    exit(1);
}

void mps2_wake(void)
{
    woken = true;
}

/* Not WFI: QEMU lets its clock run with the host's while the processor sleeps, and runs would
 * differ. */
static void spin_until_interrupt(void *ctx)
{
    const uint32_t start = mps2_time_us(ctx);
    while (!woken && mps2_time_us(ctx) - start < 1000u)
        ;
    woken = false;
}

static void feed_watchdog(void *ctx)
{
    (void)ctx;
}

/* There is nothing to come back to: what the run wrote is in the files. */
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

static const fw_system_ops system_ops = {
    mps2_time_us, spin_until_interrupt, mps2_lock, mps2_unlock, feed_watchdog,
    restart,      stack_used,           set_leds};

int main(void)
{
    const uint32_t *const here =
        (const uint32_t *)__builtin_frame_address(0) - LEAVE_FREE / sizeof *here;
    for (uint32_t *word = stack_bottom(); word < here; ++word)
        *(volatile uint32_t *)word = STACK_PAINT;
    mps2_store_start();
    mps2_skin_start();
    mps2_link_start();
    TIMER_RELOAD(TIMER_TIME) = 0xFFFFFFFFu;
    TIMER_VALUE(TIMER_TIME) = last_ticks = 0xFFFFFFFFu;
    TIMER_CTRL(TIMER_TIME) = TIMER_ENABLE;
    const fw_board board = {
        .name = "mps2_an500",
        .serial = "0",
        .f_cpu_hz = MPS2_CPU_HZ,
        .mclk_hz = MPS2_MCLK_HZ,
        .stack_bytes = STACK_BYTES,
        .generator = {&mps2_generator_ops, NULL},
        .multiplexers = {&mps2_multiplexers_ops, NULL},
        .capture = {&mps2_capture_ops, NULL, MPS2_FULL_SCALE_CODE, MPS2_REFERENCE_UV,
                    MPS2_GAIN_PPM},
        .link = {&mps2_link_ops, NULL},
        .store = {&mps2_store_ops, NULL, MPS2_BANK_BYTES},
        .system = &system_ops,
        .workspace = workspace,
        .workspace_bytes = sizeof workspace,
    };
    const int status = fw_run(&board);
    (void)mps2_lock(NULL); /* a slot's interrupt during exit would find the board gone */
    return status;
}
