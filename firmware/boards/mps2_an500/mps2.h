/* A board on QEMU's mps2-an500: an instrument whose skin, link and flash are files
 * (docs/guide/hardware.md).
 *
 * Its clock counts instructions. With -icount shift=6 an instruction takes 64 ns of QEMU's time,
 * which are 1.6 ticks of a 25 MHz timer. It counts as 5 ns of the board's time, as at 200 MHz with
 * one instruction per cycle. Runs are reproducible to the bit. */
#ifndef MPS2_H
#define MPS2_H

#include "hal/hal.h"

#include <stdint.h>
#include <stdio.h>

#define REG32(address)        (*(volatile uint32_t *)(address))
/* CMSDK timers (Arm DDI 0479, 4.2): count down from VALUE, then from RELOAD. */
#define TIMER_TIME            0x40000000u /* timer 0: board time */
#define TIMER_SLOT            0x40001000u /* timer 1: a burst has ended */
#define TIMER_CTRL(timer)     REG32((timer) + 0x0u)
#define TIMER_VALUE(timer)    REG32((timer) + 0x4u)
#define TIMER_RELOAD(timer)   REG32((timer) + 0x8u)
#define TIMER_INTCLEAR(timer) REG32((timer) + 0xCu)
#define TIMER_ENABLE          1u
#define TIMER_INTERRUPT       8u

#define MPS2_CPU_HZ          200000000u
#define MPS2_MCLK_HZ         8000000u
#define MPS2_TICKS_A_US      320u /* 200 instructions of 1.6 */
#define MPS2_BANK_BYTES      (512u * 1024u)
#define MPS2_FULL_SCALE_CODE 4095
#define MPS2_REFERENCE_UV    3300000
#define MPS2_GAIN_PPM        1500000

uint32_t mps2_time_us(void *ctx);
uint32_t mps2_lock(void *ctx);
void mps2_unlock(void *ctx, uint32_t state);
void mps2_wake(void);
void mps2_wait(void *ctx); /* until mps2_wake, or at most 1 ms */
void mps2_timebase_start(void);
/* The work of the simulation takes no board time: between these two calls the board's timers stand
 * still. */
void mps2_hold_time(void);
void mps2_release_time(void);
/* Let timer 1 end a burst after `ticks` from now, or from the moment when time continues. */
void mps2_start_slot_timer(uint32_t ticks);

/* Read a whole file into `bytes`. Returns its length, or 0 if there is no such file. Ends the
 * program if it is longer than `room`. */
size_t mps2_load(const char *name, void *bytes, size_t room);
__attribute__((noreturn)) void mps2_fail(const char *what);

void mps2_skin_start(void);
/* Compute the codes of a burst from the skin, the multiplexers and the generator. */
void mps2_skin_burst(uint16_t *codes, uint32_t samples, uint32_t sample_rate_hz, uint32_t start_us,
                     uint32_t scanning_us);
void mps2_link_start(void);
bool mps2_link_ended(void *ctx);
void mps2_store_start(void);

extern const fw_spi_ops mps2_generator_ops;
extern const fw_lines_ops mps2_multiplexers_ops;
extern const fw_capture_ops mps2_capture_ops;
extern const fw_link_ops mps2_link_ops;
extern const fw_store_ops mps2_store_ops;

void mps2_later(void *ctx, void (*work)(void *user), void *user);

void mps2_slot_irq(void);
void mps2_later_irq(void);

#endif
