/* Slots and bursts, timed by hardware alone:
 *
 *   TIM5 (1 MHz, the board's clock) --compare--> starts TIM3 at an exact microsecond
 *   TIM3 (1 MHz, wraps every slot)  --OC1REF---> is high from a slot's start for as long as its
 * burst lasts TIM2 (108 MHz) counts while OC1REF is high --update--> ADC1 converts --> DMA2 stream
 * 0, two buffers in turn
 *
 * Sample k of a slot is taken k + 1/2 sample periods after the slot's start (and a constant few
 * timer clocks): TIM2 stands in the middle of its period between bursts, so that no edge of the
 * gate meets an edge of the sample clock. All timers and the converter's clock divide the same 216
 * MHz, so the sampling instants do not move against the slots.
 */
#include "nucleo.h"

enum {
    ADC_CYCLES = 18, /* a 12-bit conversion: 3 to sample, 12 to convert, 3 to spare */
    LEAD_US = 40,    /* from a call of start to the first slot */
    LONGEST_SLOT_US = 65536,
    STREAM = 0,
    TRIGGER_ITR2 = 2, /* TIM2's is TIM3, TIM3's is TIM5 (RM0410 table 176) */
    SLAVE_GATED = 5,
    SLAVE_TRIGGER = 6,
    MASTER_UPDATE = 2,
    MASTER_OC1REF = 4,
    OC1_INACTIVE = 4,
    OC1_PWM = 6,
    ADC_EXTSEL_TIM2_TRGO = 11, /* RM0410 table 99; not as on the F4 */
};
#define STREAM_FLAGS \
    (DMA_LISR_FEIF0 | DMA_LISR_DMEIF0 | DMA_LISR_TEIF0 | DMA_LISR_HTIF0 | DMA_LISR_TCIF0)

static struct {
    void (*done)(void *user, const fw_burst *burst);
    void *user;
    uint32_t samples, sample_ticks, burst_us, slot_us;
    uint32_t start_us; /* of the slot whose burst ends next */
    uint32_t buffer;   /* that it goes to */
    volatile bool running;
} capture;

NUCLEO_DTCM static uint16_t buffers[2][FW_MAX_SAMPLES];

void nucleo_capture_start(void)
{
    nucleo_pin(GPIOA_BASE, 3, PIN_ANALOG, 0, 0, 0);
    ADC_CCR = 1u << ADC_CCR_ADCPRE_POS;              /* APB2 / 4 = 27 MHz, of 36 at most */
    ADC_SMPR2(ADC1_BASE) = 0u << ADC_SMPR2_SMP3_POS; /* 3 cycles */
    ADC_SQR1(ADC1_BASE) = 0;                         /* one conversion, */
    ADC_SQR3(ADC1_BASE) = 3u << ADC_SQR3_SQ1_POS;    /* of channel 3 */
    ADC_CR1(ADC1_BASE) = ADC_CR1_OVRIE;
    TIM_PSC(TIM3_BASE) = NUCLEO_TIMER_HZ / 1000000u - 1u;
    TIM_CR2(TIM3_BASE) = (uint32_t)MASTER_OC1REF << TIM_CR2_MMS_POS;
    TIM_CR2(TIM2_BASE) = (uint32_t)MASTER_UPDATE << TIM_CR2_MMS_POS;
    /* The trigger is chosen while no mode uses it (RM0410 26.4.3). */
    TIM_SMCR(TIM2_BASE) = (uint32_t)TRIGGER_ITR2 << TIM_SMCR_TS_POS;
    TIM_SMCR(TIM2_BASE) |= (uint32_t)SLAVE_GATED << TIM_SMCR_SMS_POS;
    TIM_SMCR(TIM3_BASE) = (uint32_t)TRIGGER_ITR2 << TIM_SMCR_TS_POS;
    nucleo_interrupt(IRQ_DMA2_STREAM0, NUCLEO_URGENCY_CAPTURE);
    nucleo_interrupt(IRQ_ADC, NUCLEO_URGENCY_CAPTURE);
}

/* No slot begins, nothing converts, and no flag is set afterwards. */
static void halt(void)
{
    TIM_SMCR(TIM3_BASE) &=
        ~(7u << TIM_SMCR_SMS_POS); /* otherwise TIM5's next match would start it */
    TIM_CR1(TIM3_BASE) = 0;
    TIM_CR1(TIM2_BASE) = 0;
    ADC_CR2(ADC1_BASE) = 0; /* aborts a conversion that is under way */
    DMA_CR(DMA2_BASE, STREAM) &= ~DMA_CR_EN;
    while ((DMA_CR(DMA2_BASE, STREAM) & DMA_CR_EN) != 0)
        ; /* until the transfer under way is over, some bus cycles (RM0410 8.3.18) */
    DMA_LIFCR(DMA2_BASE) = STREAM_FLAGS;
    ADC_SR(ADC1_BASE) = 0;
}

/* After halt: prepare everything for a first slot at `start_us`, which must still be in the future
 * when TIM5's compare is written. */
static void arm(uint32_t start_us)
{
    capture.start_us = start_us;
    capture.buffer = 0;

    DMA_PAR(DMA2_BASE, STREAM) = (uint32_t)&ADC_DR(ADC1_BASE);
    DMA_M0AR(DMA2_BASE, STREAM) = (uint32_t)buffers[0];
    DMA_M1AR(DMA2_BASE, STREAM) = (uint32_t)buffers[1];
    DMA_NDTR(DMA2_BASE, STREAM) = capture.samples;
    /* direct: each sample is in memory when its request has ended */
    DMA_FCR(DMA2_BASE, STREAM) = 0;
    DMA_CR(DMA2_BASE, STREAM) = (0u << DMA_CR_CHSEL_POS) | DMA_CR_DBM | (3u << DMA_CR_PL_POS) |
                                (1u << DMA_CR_MSIZE_POS) | (1u << DMA_CR_PSIZE_POS) | DMA_CR_MINC |
                                DMA_CR_CIRC | DMA_CR_TCIE | DMA_CR_TEIE | DMA_CR_DMEIE;
    DMA_CR(DMA2_BASE, STREAM) |= DMA_CR_EN;
    /* It needs 3 us to settle; the first slot starts later. */
    ADC_CR2(ADC1_BASE) = ADC_CR2_ADON | ADC_CR2_DMA | ADC_CR2_DDS | (1u << ADC_CR2_EXTEN_POS) |
                         ((uint32_t)ADC_EXTSEL_TIM2_TRGO << ADC_CR2_EXTSEL_POS);

    TIM_CCMR1(TIM3_BASE) = (uint32_t)OC1_INACTIVE << TIM_CCMR1_OC1M_POS;
    TIM_ARR(TIM3_BASE) = capture.slot_us - 1u;
    TIM_CCR1(TIM3_BASE) = capture.burst_us;
    TIM_EGR(TIM3_BASE) = TIM_EGR_UG; /* the prescaler starts from 0; */
    /* a microsecond after its start TIM3 wraps: the first slot. */
    TIM_CNT(TIM3_BASE) = capture.slot_us - 1u;
    /* high while it is below burst_us */
    TIM_CCMR1(TIM3_BASE) = (uint32_t)OC1_PWM << TIM_CCMR1_OC1M_POS;
    TIM_ARR(TIM2_BASE) = capture.sample_ticks - 1u;
    TIM_CNT(TIM2_BASE) = capture.sample_ticks / 2u;
    TIM_CR1(TIM2_BASE) = TIM_CR1_CEN;
    TIM_SMCR(TIM3_BASE) |= (uint32_t)SLAVE_TRIGGER << TIM_SMCR_SMS_POS;
    TIM_CCR1(TIM5_BASE) = start_us - 1u;
}

static fw_status configure(void *ctx, const fw_capture_setup *setup,
                           void (*done)(void *user, const fw_burst *burst), void *user)
{
    (void)ctx;
    const uint32_t rate = setup->sample_rate_hz, samples = setup->samples;
    if (capture.running || done == NULL)
        return FW_E_ARGUMENT;
    /* The converter's clock divides into samples, and a burst into microseconds, without a rest: or
     * instants would shift. */
    if (rate == 0 || NUCLEO_ADC_HZ % rate != 0 || NUCLEO_ADC_HZ / rate < ADC_CYCLES)
        return FW_E_RANGE;
    if (samples == 0 || samples > FW_MAX_SAMPLES || samples * 1000000u % rate != 0)
        return FW_E_RANGE;
    const uint32_t burst_us = samples * 1000000u / rate;
    if (setup->slot_us <= burst_us || setup->slot_us > LONGEST_SLOT_US)
        return FW_E_RANGE;
    capture.done = done;
    capture.user = user;
    capture.samples = samples;
    capture.sample_ticks = NUCLEO_TIMER_HZ / rate;
    capture.burst_us = burst_us;
    capture.slot_us = setup->slot_us;
    return FW_OK;
}

static fw_status start(void *ctx)
{
    if (capture.done == NULL || capture.running)
        return FW_E_ARGUMENT;
    halt();
    /* arming takes a few microseconds; with an interrupt it could take longer than the lead */
    const uint32_t state = nucleo_lock(ctx);
    capture.running = true;
    arm(nucleo_time_us(ctx) + LEAD_US);
    nucleo_unlock(ctx, state);
    return FW_OK;
}

static void stop(void *ctx)
{
    const uint32_t state = nucleo_lock(ctx);
    capture.running = false;
    halt();
    nucleo_unlock(ctx, state);
}

static void report_burst(uint32_t start_us, uint32_t buffer, uint32_t now_us, bool lost)
{
    const fw_burst burst = {
        .samples = buffers[buffer], .start_us = start_us, .entered_us = now_us, .lost = lost};
    capture.done(capture.user, &burst);
}

/* Report the burst that was due; the next one is due then. */
static void next_burst(uint32_t now_us, bool lost)
{
    const uint32_t start_us = capture.start_us, buffer = capture.buffer;
    capture.start_us += capture.slot_us;
    capture.buffer ^= 1u;
    report_burst(start_us, buffer, now_us, lost);
}

/* DMA now fills the buffer `filling`, so the last burst that has ended is in the other one. If this
 * interrupt is late by a slot or more, the bursts in between have been overwritten, or soon will
 * be. The clock says how many; near the edge of a slot the buffer's parity decides. */
static void bursts_ended(uint32_t filling)
{
    const uint32_t now_us = nucleo_time_us(NULL),
                   late_us = now_us - capture.start_us - capture.burst_us;
    uint32_t missed = (int32_t)late_us < 0 ? 0 : late_us / capture.slot_us;
    if (((capture.buffer + missed) & 1u) == filling)
        missed +=
            missed == 0 || late_us % capture.slot_us > capture.slot_us / 2u ? 1u : (uint32_t)-1;
    for (; missed > 0 && capture.running; --missed)
        next_burst(now_us, true);
    if (capture.running)
        next_burst(now_us, false);
}

/* Stop, and continue in the first slot of the same grid that can be reached. */
static void burst_failed(void)
{
    const uint32_t lost_us = capture.start_us;
    halt();
    const uint32_t now = nucleo_time_us(NULL),
                   slots = (now + LEAD_US - lost_us) / capture.slot_us + 1u;
    arm(lost_us + slots * capture.slot_us);
    report_burst(lost_us, 0, now, true);
}

void nucleo_dma2_stream0_irq(void)
{
    uint32_t flags = 0, filling;
    /* read again if a burst ends meanwhile, so that `filling` belongs to the cleared flags */
    do {
        flags |= DMA_LISR(DMA2_BASE);
        DMA_LIFCR(DMA2_BASE) = STREAM_FLAGS;
        filling = (DMA_CR(DMA2_BASE, STREAM) & DMA_CR_CT) != 0 ? 1u : 0u;
    } while ((DMA_LISR(DMA2_BASE) & DMA_LISR_TCIF0) != 0);
    nucleo_wake();
    if (!capture.running)
        return;
    if ((flags & (DMA_LISR_TEIF0 | DMA_LISR_DMEIF0)) != 0)
        burst_failed();
    else if ((flags & DMA_LISR_TCIF0) != 0)
        bursts_ended(filling);
}

/* Overrun: DMA did not fetch a sample in time, and has stopped (RM0410 15.9.1). */
void nucleo_adc_irq(void)
{
    const bool overrun = (ADC_SR(ADC1_BASE) & ADC_SR_OVR) != 0;
    ADC_SR(ADC1_BASE) = 0;
    nucleo_wake();
    if (overrun && capture.running)
        burst_failed();
}

const fw_capture_ops nucleo_capture_ops = {configure, start, stop};
