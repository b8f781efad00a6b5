/* From reset to main: vectors, the painted stack, FPU, .data and .bss. */
#include "nucleo.h"

extern uint32_t data_start[], data_end[], data_load[], bss_start[], bss_end[], dtcm_start[],
    dtcm_end[], itcm_start[], itcm_end[], itcm_load[], itcm_vectors[];

void nucleo_reset(void);
void nucleo_start(void);

/* RM0410 table 46. An interrupt that is not used counts as a fault, because it is a bug. */
#define CORE_VECTORS 16
__attribute__((section(".vectors"),
               used)) static void (*const vectors[CORE_VECTORS + IRQ_COUNT])(void) = {
    (void (*)(void))stack_top,
    nucleo_reset,
    [2] = nucleo_clock_irq,       /* NMI: the clock security system */
    [3 ... 6] = nucleo_fault_irq, /* hard, memory, bus and usage fault */
    [11 ... 12] = nucleo_fault_irq,
    [14] = nucleo_later_irq, /* PendSV */
    [15] = nucleo_tick_irq,
    [CORE_VECTORS] = nucleo_fault_irq,
    [CORE_VECTORS + IRQ_PVD] = nucleo_supply_irq,
    [CORE_VECTORS + IRQ_PVD + 1 ... CORE_VECTORS + IRQ_DMA1_STREAM1 - 1] = nucleo_fault_irq,
    [CORE_VECTORS + IRQ_DMA1_STREAM1] = nucleo_dma1_stream1_irq,
    [CORE_VECTORS + IRQ_DMA1_STREAM1 + 1] = nucleo_fault_irq,
    [CORE_VECTORS + IRQ_DMA1_STREAM3] = nucleo_dma1_stream3_irq,
    [CORE_VECTORS + IRQ_DMA1_STREAM3 + 1 ... CORE_VECTORS + IRQ_ADC - 1] = nucleo_fault_irq,
    [CORE_VECTORS + IRQ_ADC] = nucleo_adc_irq,
    [CORE_VECTORS + IRQ_ADC + 1 ... CORE_VECTORS + IRQ_USART3 - 1] = nucleo_fault_irq,
    [CORE_VECTORS + IRQ_USART3] = nucleo_usart3_irq,
    [CORE_VECTORS + IRQ_USART3 + 1 ... CORE_VECTORS + IRQ_DMA2_STREAM0 - 1] = nucleo_fault_irq,
    [CORE_VECTORS + IRQ_DMA2_STREAM0] = nucleo_dma2_stream0_irq,
    [CORE_VECTORS + IRQ_DMA2_STREAM0 + 1 ... CORE_VECTORS + IRQ_COUNT - 1] = nucleo_fault_irq,
};

/* The whole stack is painted before a word of it is used; stack_used counts what is still painted.
 */
__attribute__((naked)) void nucleo_reset(void)
{
    __asm volatile("ldr r0, =stack_bottom\n"
                   "ldr r1, =stack_top\n"
                   "mov sp, r1\n"
                   "ldr r2, =%c0\n"
                   "0: str r2, [r0], #4\n"
                   "cmp r0, r1\n"
                   "blo 0b\n"
                   "b nucleo_start\n" ::"i"(NUCLEO_STACK_PAINT));
}

static void copy(uint32_t *to, const uint32_t *end, const uint32_t *from)
{
    while (to < end)
        *to++ = *from++;
}

static void clear(uint32_t *word, const uint32_t *end)
{
    while (word < end)
        *word++ = 0;
}

__attribute__((used, noreturn)) void nucleo_start(void)
{
    SCB_CPACR |= 0xFu << 20; /* full access to CP10 and CP11, the FPU (PM0253 4.6.1) */
    DSB();
    ISB();
    /* on after a reset, but a debugger may have changed it */
    RCC_AHB1ENR |= RCC_AHB1ENR_DTCMRAMEN;
    copy(itcm_start, itcm_end, itcm_load);
    copy(itcm_vectors, itcm_vectors + CORE_VECTORS + IRQ_COUNT, (const uint32_t *)vectors);
    SCB_VTOR = (uint32_t)itcm_vectors; /* an interrupt does not wait for the flash */
    copy(data_start, data_end, data_load);
    DSB();
    ISB();
    clear(bss_start, bss_end);
    clear(dtcm_start, dtcm_end);
    (void)main();
    SCB_AIRCR = SCB_AIRCR_SYSRESETREQ;
    for (;;)
        ;
}
