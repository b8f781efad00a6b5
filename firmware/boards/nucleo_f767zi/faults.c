/* A processor fault or an unexpected interrupt: its record survives the reset, and is reported
 * after it. */
#include "nucleo.h"

#define CRASH_MAGIC 0xC0A57ED5u

typedef struct crash_record {
    uint32_t magic;
    /* pc, lr, cfsr, hfsr, address; of an unexpected interrupt: cfsr 0 and its exception number
     * as address */
    uint32_t words[5];
    uint32_t check; /* sum of the words: memory after power-up is random */
    uint32_t cause; /* of reset_cause */
} crash_record;

NUCLEO_NOINIT static crash_record crash;

enum reset_cause { CAUSE_CRASH, CAUSE_CLOCK, CAUSE_SUPPLY };

static uint32_t sum_of_words(void)
{
    uint32_t sum = CRASH_MAGIC + crash.cause;
    for (int k = 0; k < 5; ++k)
        sum += crash.words[k];
    return sum;
}

__attribute__((noreturn)) static void restart_for(enum reset_cause cause)
{
    crash.cause = cause;
    crash.check = sum_of_words();
    crash.magic = CRASH_MAGIC;
    nucleo_restart(NULL);
}

__attribute__((used, noreturn)) void nucleo_crash(const uint32_t *frame);

/* The stack itself may have failed: take its address, and begin a new one. */
__attribute__((naked)) void nucleo_fault_irq(void)
{
    __asm volatile("mov r0, sp\n"
                   "ldr r1, =stack_top\n"
                   "mov sp, r1\n"
                   "b nucleo_crash\n");
}

void nucleo_crash(const uint32_t *frame)
{
    nucleo_multiplexers_off(); /* first, for whoever touches the skin */
    const uint32_t cfsr = SCB_CFSR;
    /* Nothing was stacked, or nothing can be read, if stacking failed; r0 to r3, r12, lr, pc, xpsr
     * otherwise. */
    const uint32_t lowest = (uint32_t)stack_bottom + NUCLEO_STACK_GUARD_BYTES,
                   highest = (uint32_t)stack_top - 32u;
    const bool inside = (uint32_t)frame >= lowest && (uint32_t)frame <= highest;
    const bool stacked = inside && (cfsr & (SCB_CFSR_MSTKERR | SCB_CFSR_STKERR)) == 0;
    crash.words[0] = stacked ? frame[6] : 0;
    crash.words[1] = stacked ? frame[5] : 0;
    crash.words[2] = cfsr;
    crash.words[3] = SCB_HFSR;
    if ((cfsr & SCB_CFSR_MMARVALID) != 0)
        crash.words[4] = SCB_MMFAR;
    else if ((cfsr & SCB_CFSR_BFARVALID) != 0)
        crash.words[4] = SCB_BFAR;
    else
        crash.words[4] = cfsr == 0 ? SCB_ICSR & 0x1FFu : 0;
    restart_for(CAUSE_CRASH);
}

/* The 8 MHz have failed: the generator has stopped, and the processor runs from 16 MHz. After the
 * restart the board waits for the 8 MHz. */
void nucleo_clock_irq(void)
{
    nucleo_multiplexers_off();
    RCC_CIR |= RCC_CIR_CSSC;
    for (int k = 0; k < 5; ++k)
        crash.words[k] = 0;
    restart_for(CAUSE_CLOCK);
}

/* The supply falls below 2.9 V: current off at once; the board restarts when the supply is back. */
void nucleo_supply_irq(void)
{
    nucleo_multiplexers_off();
    for (int k = 0; k < 5; ++k)
        crash.words[k] = 0;
    while ((PWR_CSR1 & PWR_CSR1_PVDO) != 0)
        nucleo_feed_watchdog(NULL);
    restart_for(CAUSE_SUPPLY);
}

fw_last_reset nucleo_last_reset(void)
{
    fw_last_reset found = {0};
    if (crash.magic == CRASH_MAGIC && crash.check == sum_of_words()) {
        found.crash = crash.cause == CAUSE_CRASH;
        found.clock = crash.cause == CAUSE_CLOCK;
        found.supply = crash.cause == CAUSE_SUPPLY;
        for (int k = 0; k < 5; ++k)
            found.words[k] = crash.words[k];
    }
    crash.magic = 0;
    found.watchdog = (RCC_CSR & RCC_CSR_WDGRSTF) != 0;
    RCC_CSR |= RCC_CSR_RMVF;
    return found;
}
