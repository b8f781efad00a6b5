/* Start of a Cortex-M7 under QEMU's mps2-an500: vectors, FPU on, zeroed memory, semihosting, main.
 * A program that does not use an interrupt omits its handler. */
#include <stdint.h>
#include <stdlib.h>

extern uint32_t bss_start, bss_end, stack_top;
extern void initialise_monitor_handles(void);
extern int main(void);

#define CPACR        (*(volatile uint32_t *)0xE000ED88u)
#define CORE_VECTORS 16
#define IRQ_TIMER1   9 /* Arm DAI 0500, table 3-9 */

void reset(void);
static void fault(void);
__attribute__((weak)) void mps2_slot_irq(void);
__attribute__((weak)) void mps2_later_irq(void);

__attribute__((section(".vectors"),
               used)) static const void *const vectors[CORE_VECTORS + IRQ_TIMER1 + 1] = {
    [0] = &stack_top,
    [1] = (const void *)reset,
    [2] = (const void *)fault,
    [3] = (const void *)fault,
    [4] = (const void *)fault,
    [5] = (const void *)fault,
    [6] = (const void *)fault,
    [14] = (const void *)mps2_later_irq,
    [CORE_VECTORS + IRQ_TIMER1] = (const void *)mps2_slot_irq};

void reset(void)
{
    CPACR |= 0xFu << 20; /* full access to CP10 and CP11 */
    __asm volatile("dsb\n isb");
    for (uint32_t *word = &bss_start; word < &bss_end; ++word)
        *word = 0;
    initialise_monitor_handles();
    exit(main());
}

static void fault(void)
{
    _Exit(70);
}

/* newlib's exit needs these if no start files are linked */
void _init(void);
void _fini(void);
void _init(void)
{
}
void _fini(void)
{
}
