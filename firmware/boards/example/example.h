/* The board of docs/guide/your-board.md: another generator, other switches and another link than
 * the project's instrument. It runs on QEMU's mps2-an386 (Cortex-M4F) and mps2-an500 (Cortex-M7).
 * In place of a skin it has a ring of resistors, one between each pair of neighbouring electrodes.
 * Clock and sampling are those of boards/mps2_an500. */
#ifndef EXAMPLE_H
#define EXAMPLE_H

#include "boards/mps2_an500/mps2.h"

#define EXAMPLE_ELECTRODES 24u
#define EXAMPLE_BANK_BYTES (512u * 1024u)

extern const fw_generator_ops example_generator_ops;
extern const fw_multiplexers_ops example_switches_ops;
extern const fw_link_ops example_link_ops;
extern const fw_store_ops example_store_ops;

void example_link_start(void);
void example_link_irq(void);

/* For the ring: the generator's period, 0 while it is off, and since when it runs; which electrodes
 * are joined to I+, I-, V+ and V-, false: not all four. */
uint32_t example_generator_period_us(uint32_t *since_us);
bool example_switches_joined(uint8_t electrodes[4]);

#endif
