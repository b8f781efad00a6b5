/* Slots: timer 1 interrupts when a burst has ended. */
#include "mps2.h"

#include <stdlib.h>

enum { IRQ_TIMER1 = 9, LEAD_US = 40 };
#define NVIC_ISER REG32(0xE000E100u)

static struct {
    void (*done)(void *user, const fw_burst *burst);
    void *user;
    fw_capture_setup setup;
    uint32_t burst_us, first_us, start_us;
    uint32_t buffer;
    volatile bool running;
} capture;
static uint16_t buffers[2][FW_MAX_SAMPLES];

static fw_status configure(void *ctx, const fw_capture_setup *setup,
                           void (*done)(void *user, const fw_burst *burst), void *user)
{
    (void)ctx;
    if (capture.running || done == NULL)
        return FW_E_ARGUMENT;
    if (setup->sample_rate_hz == 0 || setup->sample_rate_hz > 2000000u || setup->samples == 0 ||
        setup->samples > FW_MAX_SAMPLES)
        return FW_E_RANGE;
    if (setup->samples * 1000000u % setup->sample_rate_hz != 0)
        return FW_E_RANGE;
    const uint32_t burst_us = setup->samples * 1000000u / setup->sample_rate_hz;
    if (setup->slot_us <= burst_us || setup->slot_us > 65536u)
        return FW_E_RANGE;
    capture.done = done;
    capture.user = user;
    capture.setup = *setup;
    capture.burst_us = burst_us;
    return FW_OK;
}

/* Set the timer to the end of the next burst. */
static void await_burst(void)
{
    const int32_t wait_us = (int32_t)(capture.start_us + capture.burst_us - mps2_time_us(NULL));
    mps2_start_slot_timer(wait_us > 0 ? (uint32_t)wait_us * MPS2_TICKS_A_US : 1u);
}

static fw_status start(void *ctx)
{
    if (capture.done == NULL || capture.running)
        return FW_E_ARGUMENT;
    capture.running = true;
    capture.first_us = capture.start_us = mps2_time_us(ctx) + LEAD_US;
    TIMER_INTCLEAR(TIMER_SLOT) = 1;
    TIMER_RELOAD(TIMER_SLOT) = 0xFFFFFFFFu;
    await_burst();
    NVIC_ISER = 1u << IRQ_TIMER1;
    return FW_OK;
}

static void stop(void *ctx)
{
    (void)ctx;
    capture.running = false;
    TIMER_CTRL(TIMER_SLOT) = 0;
    TIMER_INTCLEAR(TIMER_SLOT) = 1;
}

static void next_burst(bool lost)
{
    const fw_burst burst = {.samples = buffers[capture.buffer],
                            .start_us = capture.start_us,
                            .entered_us = mps2_time_us(NULL),
                            .lost = lost};
    if (!lost) {
        mps2_hold_time();
        mps2_skin_burst(buffers[capture.buffer], capture.setup.samples,
                        capture.setup.sample_rate_hz, burst.start_us,
                        burst.start_us - capture.first_us);
        mps2_release_time();
    }
    capture.start_us += capture.setup.slot_us;
    capture.buffer ^= 1u;
    capture.done(capture.user, &burst);
}

void mps2_slot_irq(void)
{
    TIMER_CTRL(TIMER_SLOT) = 0;
    TIMER_INTCLEAR(TIMER_SLOT) = 1;
    mps2_wake();
    while (capture.running && (int32_t)(mps2_time_us(NULL) - capture.start_us - capture.burst_us -
                                        capture.setup.slot_us) >= 0)
        next_burst(true); /* this interrupt came after the next burst had ended */
    if (capture.running)
        next_burst(false);
    /* after the last frame of the skin the application may finish */
    if (capture.running && !mps2_link_ended(NULL))
        await_burst();
}

const fw_capture_ops mps2_capture_ops = {configure, start, stop};
