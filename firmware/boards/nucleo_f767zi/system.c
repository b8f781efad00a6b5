/* Time, sleep, interrupts, the watchdog, lights, and the processor's serial number. */
#include "boards/parts/later.h"
#include "nucleo.h"

enum { LED_GREEN = 0, LED_BLUE = 7, LED_RED = 14 }; /* of port B: LD1, LD2, LD3 (UM1974 6.5) */

/* If the main loop makes no turn for STALLED_MS, the multiplexers open; after HUNG_MS the board
 * restarts. */
enum { STALLED_MS = 900, HUNG_MS = 8000, BUTTON = 13, SUPPLY_GOOD = 11 };
/* Reload values at 32 kHz (17 to 47 by the data sheet): 0.5 s (at most 0.94) by a divider of 4, 8 s
 * by 64, more than the longest erase of a sector (4 s), during which the program stands still. */
enum { WATCHDOG_RELOAD = 4000, DIVIDER_4 = 0, DIVIDER_64 = 4 };

static volatile bool woken;
static volatile uint32_t stalled_ms;
static char serial[25];

void nucleo_interrupt(uint32_t irq, uint32_t urgency)
{
    NVIC_IPR(irq) = (uint8_t)urgency;
    NVIC_ICPR(irq / 32u) = 1u << (irq % 32u);
    NVIC_ISER(irq / 32u) = 1u << (irq % 32u);
}

/* Set the brown-out reset to its highest level (0 in BOR_LEV: below 2.7 V at the latest) if it is
 * not. Then the processor is in reset, and drives nothing, even if the supply falls faster than the
 * detector's interrupt runs. This happens once in a board's life, and not while the supply is low;
 * the other option bytes stay. */
static void set_brown_out(void)
{
    const uint32_t options = FLASH_OPTCR, level = 3u << FLASH_OPTCR_BOR_POS;
    if ((options & level) == 0 || (PWR_CSR1 & PWR_CSR1_PVDO) != 0)
        return;
    FLASH_OPTKEYR = FLASH_OPTKEY1;
    FLASH_OPTKEYR = FLASH_OPTKEY2;
    FLASH_OPTCR = options & ~(level | FLASH_OPTCR_OPTLOCK);
    FLASH_OPTCR |= FLASH_OPTCR_OPTSTRT;
    DSB();
    while ((FLASH_SR & FLASH_SR_BSY) != 0)
        ;
    FLASH_OPTCR |= FLASH_OPTCR_OPTLOCK;
}

void nucleo_system_start(void)
{
    SCB_SHCSR |= SCB_SHCSR_MEMFAULTENA | SCB_SHCSR_BUSFAULTENA | SCB_SHCSR_USGFAULTENA;
    SCB_CCR |= SCB_CCR_DIV_0_TRP;

    /* TIM5 counts microseconds; its compare pulse starts the slots (capture.c). */
    TIM_PSC(TIM5_BASE) = NUCLEO_TIMER_HZ / 1000000u - 1u;
    TIM_ARR(TIM5_BASE) = 0xFFFFFFFFu;
    TIM_EGR(TIM5_BASE) = TIM_EGR_UG; /* loads the prescaler */
    TIM_CR2(TIM5_BASE) = 3u << TIM_CR2_MMS_POS;
    TIM_CR1(TIM5_BASE) = TIM_CR1_CEN;

    DCB_DEMCR |= DCB_DEMCR_TRCENA; /* the cycle counter, for waits below a microsecond */
    DWT_LAR = 0xC5ACCE55u;
    DWT_CYCCNT = 0;
    DWT_CTRL |= DWT_CTRL_CYCCNTENA;

    STK_LOAD = NUCLEO_SYSCLK_HZ / 1000u - 1u;
    STK_VAL = 0;
    SCB_SHPR3 = (SCB_SHPR3 & 0x0000FFFFu) | ((uint32_t)NUCLEO_URGENCY_TICK << 24) |
                ((uint32_t)NUCLEO_URGENCY_LATER << 16);
    STK_CTRL = STK_CTRL_CLKSOURCE | STK_CTRL_TICKINT | STK_CTRL_ENABLE;

    nucleo_pin(GPIOB_BASE, LED_GREEN, PIN_OUTPUT, 0, 0, 0);
    nucleo_pin(GPIOB_BASE, LED_BLUE, PIN_OUTPUT, 0, 0, 0);
    nucleo_pin(GPIOB_BASE, LED_RED, PIN_OUTPUT, 0, 0, 0);

    nucleo_pin(GPIOC_BASE, BUTTON, PIN_INPUT, 0, 0, 0); /* B1 has its own resistor */
    nucleo_pin(GPIOC_BASE, SUPPLY_GOOD, PIN_INPUT, 0, 0, 1);

    /* The supply's detector at 2.9 V. */
    PWR_CR1 |= 7u << PWR_CR1_PLS_POS | PWR_CR1_PVDE;
    EXTI_RTSR |= EXTI_IMR_MR16;
    EXTI_IMR |= EXTI_IMR_MR16;
    nucleo_interrupt(IRQ_PVD, 0);
    set_brown_out(); /* before the watchdog: it takes as long as the erase of a sector */

    /* While a debugger halts the processor the watchdog stands still: it would reset what is looked
     * at. The current continues to flow then, as docs/guide/board.md warns. */
    DBGMCU_APB1FZ |= DBGMCU_APB1FZ_IWDG_STOP;
    IWDG_KR = 0xCCCCu;
    IWDG_KR = 0x5555u;
    IWDG_RLR = WATCHDOG_RELOAD - 1u;
    nucleo_watchdog_patient(false);

    for (uint32_t digit = 0; digit < 24; ++digit)
        serial[digit] = "0123456789ABCDEF"[UID(digit / 8u) >> (28u - 4u * (digit % 8u)) & 0xFu];
}

const char *nucleo_serial(void)
{
    return serial;
}

void nucleo_wake(void)
{
    woken = true;
}

/* The tick feeds the watchdog while the main loop is alive. So the watchdog can be quick, for a
 * processor that no longer takes interrupts. */
void nucleo_tick_irq(void)
{
    nucleo_wake();
    const uint32_t ms = ++stalled_ms;
    if (ms >= STALLED_MS)
        nucleo_multiplexers_bar(true);
    if (ms < HUNG_MS)
        IWDG_KR = 0xAAAAu;
}

void nucleo_watchdog_patient(bool patient)
{
    while (IWDG_SR != 0)
        ;
    IWDG_KR = 0x5555u;
    IWDG_PR = patient ? DIVIDER_64 : DIVIDER_4;
    while (IWDG_SR != 0)
        ;
    IWDG_KR = 0xAAAAu;
}

uint32_t nucleo_time_us(void *ctx)
{
    (void)ctx;
    return TIM_CNT(TIM5_BASE);
}

/* A pending interrupt ends WFI even while interrupts are off. So none is missed between the test
 * and the sleep. */
static void sleep_until_interrupt(void *ctx)
{
    (void)ctx;
    __asm volatile("cpsid i" ::: "memory");
    if (!woken)
        __asm volatile("dsb\n wfi" ::: "memory");
    __asm volatile("cpsie i\n isb" ::: "memory");
    woken = false;
}

uint32_t nucleo_lock(void *ctx)
{
    (void)ctx;
    uint32_t state;
    __asm volatile("mrs %0, primask\n cpsid i" : "=r"(state)::"memory");
    return state;
}

void nucleo_unlock(void *ctx, uint32_t state)
{
    (void)ctx;
    __asm volatile("msr primask, %0" ::"r"(state) : "memory");
}

void nucleo_feed_watchdog(void *ctx)
{
    (void)ctx;
    IWDG_KR = 0xAAAAu;
    if (stalled_ms >= STALLED_MS)
        nucleo_multiplexers_bar(false);
    stalled_ms = 0;
}

static bool button(void *ctx)
{
    (void)ctx;
    return (GPIO_IDR(GPIOC_BASE) >> BUTTON & 1u) != 0;
}

/* A board without the supply-good circuit leaves the pin open: the pull-up says that all is well.
 */
static bool analog_supply(void *ctx)
{
    (void)ctx;
    return (GPIO_IDR(GPIOC_BASE) >> SUPPLY_GOOD & 1u) != 0;
}

void nucleo_restart(void *ctx)
{
    (void)ctx;
    DSB();
    SCB_AIRCR = SCB_AIRCR_SYSRESETREQ;
    for (;;)
        ;
}

static uint32_t stack_used(void *ctx)
{
    (void)ctx;
    /* reading below it is a fault */
    const uint32_t *word = stack_bottom + NUCLEO_STACK_GUARD_BYTES / sizeof *word;
    while (word < stack_top && *word == NUCLEO_STACK_PAINT)
        ++word;
    return (uint32_t)(stack_top - word) * (uint32_t)sizeof *word;
}

static void set_leds(void *ctx, uint32_t leds)
{
    (void)ctx;
    const uint32_t on =
        (leds & 1u) << LED_GREEN | (leds >> 1 & 1u) << LED_BLUE | (leds >> 2 & 1u) << LED_RED;
    const uint32_t all = 1u << LED_GREEN | 1u << LED_BLUE | 1u << LED_RED;
    GPIO_BSRR(GPIOB_BASE) = on | (all & ~on) << 16;
}

static later waiting;

static void run_later(void *ctx, void (*work)(void *user), void *user)
{
    (void)ctx;
    later_wait(&waiting, work, user);
}

void nucleo_later_irq(void)
{
    waiting.work(waiting.user);
    nucleo_wake();
}

const fw_system_ops nucleo_system_ops = {nucleo_time_us,
                                         sleep_until_interrupt,
                                         nucleo_lock,
                                         nucleo_unlock,
                                         nucleo_feed_watchdog,
                                         nucleo_restart,
                                         stack_used,
                                         set_leds,
                                         button,
                                         run_later,
                                         analog_supply};
