/* Start: vectors, FPU on, zeroed memory, main. Variables with initial values are loaded in place by
 * the emulator; on a real board they are copied from flash. */
#include "example.h"

extern uint32_t bss_start, bss_end, stack_top;
extern int main(void);

#define CPACR REG32(0xE000ED88u)
enum { CORE_VECTORS = 16, IRQ_UART0_RX = 0, IRQ_TIMER1 = 9 /* Arm DAI 0386, table 3-9 */ };

void reset(void);

static void fault(void)
{
    for (;;)
        ;
}

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
    [CORE_VECTORS + IRQ_UART0_RX] = (const void *)example_link_irq,
    [CORE_VECTORS + IRQ_TIMER1] = (const void *)mps2_slot_irq};

void reset(void)
{
    CPACR |= 0xFu << 20; /* full access to CP10 and CP11 */
    __asm volatile("dsb\n isb");
    for (uint32_t *word = &bss_start; word < &bss_end; ++word)
        *word = 0;
    (void)main();
    fault();
}
