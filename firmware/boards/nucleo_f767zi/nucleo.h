/* Shared by the files of this board. Memory and pins: docs/guide/hardware.md. */
#ifndef NUCLEO_H
#define NUCLEO_H

#include "hal/hal.h"
#include "stm32f767.h"

#include <stdint.h>

#define NUCLEO_SYSCLK_HZ 216000000u
#define NUCLEO_APB1_HZ   54000000u
#define NUCLEO_TIMER_HZ  108000000u /* of TIM2 to TIM5: twice APB1 (RM0410 5.2) */
#define NUCLEO_ADC_HZ    27000000u
#define NUCLEO_MCLK_HZ   8000000u

#define NUCLEO_STACK_PAINT       0x57AC57ACu
#define NUCLEO_STACK_GUARD_BYTES 256u

/* For all that DMA reads or writes: memory that DMA reaches and that is not cached; zero at start.
 */
#define NUCLEO_DTCM   __attribute__((section(".dtcm")))
/* Not touched by the start-up code. */
#define NUCLEO_NOINIT __attribute__((section(".noinit")))

#define DSB() __asm volatile("dsb" ::: "memory")
#define ISB() __asm volatile("isb" ::: "memory")

/* From the linker script. */
extern uint32_t stack_bottom[], stack_top[];
extern uint8_t workspace_start[], workspace_end[];
extern const uint8_t image_start[], image_end[]; /* of the program, in flash */

/* Urgency of interrupts: upper four bits; less is more urgent. */
enum { NUCLEO_URGENCY_CAPTURE = 0x10, NUCLEO_URGENCY_LINK = 0x40, NUCLEO_URGENCY_TICK = 0xF0 };
#define NUCLEO_URGENCY_LATER NUCLEO_URGENCY_TICK

bool nucleo_clock_start(void); /* false: no 8 MHz from the ST-LINK */
void nucleo_cache_start(void);
/* of read-only memory that was written without the cache */
void nucleo_cache_forget(const void *start, size_t size);
void nucleo_interrupt(uint32_t irq, uint32_t urgency);

/* A pin's function; speeds and pulls are 2-bit fields of RM0410 6.4. */
typedef enum nucleo_pin_mode {
    PIN_INPUT = 0,
    PIN_OUTPUT = 1,
    PIN_ALTERNATE = 2,
    PIN_ANALOG = 3
} nucleo_pin_mode;
void nucleo_pin(uint32_t port, uint32_t pin, nucleo_pin_mode mode, uint32_t alternate,
                uint32_t speed, uint32_t pull);

uint32_t nucleo_time_us(void *ctx);
uint32_t nucleo_lock(void *ctx);
void nucleo_unlock(void *ctx, uint32_t state);
void nucleo_feed_watchdog(void *ctx);
void nucleo_wake(void); /* each interrupt calls it, so that `wait` returns */

void nucleo_system_start(void);
const char *nucleo_serial(void);
fw_last_reset nucleo_last_reset(void);
void nucleo_generator_start(void);
void nucleo_multiplexers_start(void);
uint32_t nucleo_electrodes(void);   /* that the fitted multiplexers reach; after the start */
void nucleo_multiplexers_off(void); /* no current reaches the skin; from any interrupt */
/* The same; they stay off until the main loop is alive. */
void nucleo_multiplexers_bar(bool barred);
void nucleo_sense_start(void);
uint32_t nucleo_measure_ua_rms(void *ctx);
/* Between these two the processor may stand still for seconds; otherwise for half a second. */
void nucleo_watchdog_patient(bool patient);
__attribute__((noreturn)) void nucleo_restart(void *ctx);
void nucleo_capture_start(void);
void nucleo_link_start(void);

extern const fw_system_ops nucleo_system_ops;
extern const fw_spi_ops nucleo_generator_ops;
extern const fw_lines_ops nucleo_multiplexers_ops;
extern const fw_capture_ops nucleo_capture_ops;
extern const fw_link_ops nucleo_link_ops;
extern const fw_store_ops nucleo_store_ops;
#define NUCLEO_BANK_BYTES (512u * 1024u)
#define NUCLEO_PAGE_BYTES (256u * 1024u) /* of settings */

/* Interrupt handlers, for the vector table. */
void nucleo_fault_irq(void);
void nucleo_clock_irq(void);
void nucleo_supply_irq(void);
void nucleo_tick_irq(void);
void nucleo_later_irq(void);
void nucleo_dma2_stream0_irq(void);
void nucleo_adc_irq(void);
void nucleo_dma1_stream1_irq(void);
void nucleo_dma1_stream3_irq(void);
void nucleo_usart3_irq(void);

int main(void);

#endif
