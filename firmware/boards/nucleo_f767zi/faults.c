/* A processor fault, or an interrupt that nobody asked for: what is known is kept over a reset, and
 * reported after it. */
#include "nucleo.h"

#define CRASH_MAGIC 0xC0A57ED5u

typedef struct crash_record {
    uint32_t magic;
    /* pc, lr, cfsr, hfsr, address; of an unexpected interrupt: cfsr 0 and its exception number
     * as address */
    uint32_t words[5];
    uint32_t check; /* sum of the words: memory after power-up is random */
} crash_record;

NUCLEO_NOINIT static crash_record crash;

static uint32_t sum_of_words(void)
{
    uint32_t sum = CRASH_MAGIC;
    for (int k = 0; k < 5; ++k)
        sum += crash.words[k];
    return sum;
}

__attribute__((used, noreturn)) void nucleo_crash(const uint32_t *frame);

/* The stack may be what failed: take its address, and begin a new one. */
__attribute__((naked)) void nucleo_fault_irq(void)
{
    __asm volatile("mov r0, sp\n"
                   "ldr r1, =stack_top\n"
                   "mov sp, r1\n"
                   "b nucleo_crash\n");
}

void nucleo_crash(const uint32_t *frame)
{
    nucleo_multiplexers_off(); /* first: whoever touches the skin has no part in this */
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
    crash.check = sum_of_words();
    crash.magic = CRASH_MAGIC;
    DSB();
    SCB_AIRCR = SCB_AIRCR_SYSRESETREQ;
    for (;;)
        ;
}

fw_last_reset nucleo_last_reset(void)
{
    fw_last_reset found = {0};
    if (crash.magic == CRASH_MAGIC && crash.check == sum_of_words()) {
        found.crash = 1;
        for (int k = 0; k < 5; ++k)
            found.words[k] = crash.words[k];
    }
    crash.magic = 0;
    found.watchdog = (RCC_CSR & RCC_CSR_WDGRSTF) != 0;
    RCC_CSR |= RCC_CSR_RMVF;
    return found;
}
