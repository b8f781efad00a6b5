/* Board time by timer 0, which stands still while the simulated world works; and waiting. */
#include "boards/parts/later.h"
#include "mps2.h"

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

/* The timer wraps every 13 s of board time; the application reads it more often. */
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

/* It begins when time goes on. A slot's interrupt may come just after time was held, and without
 * this the scan would go on while the main loop waits to send a frame, and write into that frame.
 */
void mps2_start_slot_timer(uint32_t ticks)
{
    const uint32_t state = mps2_lock(NULL), runs = TIMER_ENABLE | TIMER_INTERRUPT;
    TIMER_VALUE(TIMER_SLOT) = ticks;
    slot_timer_was = runs;
    if (held == 0)
        TIMER_CTRL(TIMER_SLOT) = runs;
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

void mps2_wake(void)
{
    woken = true;
}

/* WFI is not used: while the processor sleeps, QEMU's clock follows the host's, and runs would
 * differ. */
void mps2_wait(void *ctx)
{
    const uint32_t start = mps2_time_us(ctx);
    while (!woken && mps2_time_us(ctx) - start < 1000u)
        ;
    woken = false;
}

#define SCB_SHPR3 REG32(0xE000ED20u)

static later waiting;

void mps2_later(void *ctx, void (*work)(void *user), void *user)
{
    (void)ctx;
    later_wait(&waiting, work, user);
}

void mps2_later_irq(void)
{
    waiting.work(waiting.user);
    mps2_wake();
}

void mps2_timebase_start(void)
{
    SCB_SHPR3 = 0xFFu << 16; /* after the slots */
    TIMER_RELOAD(TIMER_TIME) = 0xFFFFFFFFu;
    TIMER_VALUE(TIMER_TIME) = last_ticks = 0xFFFFFFFFu;
    TIMER_CTRL(TIMER_TIME) = TIMER_ENABLE;
}
