/* Angles are fractions of a turn in 32 bits: 2^32 is a turn, so that overflow wraps them. */
#ifndef FW_SINCOS_H
#define FW_SINCOS_H

#include <stdint.h>

/* Cosine and sine, each within 2e-7. Only products and sums are used, so that every target gives
 * the same bits. */
void fw_sincos(uint32_t turn, float *cosine, float *sine);

#endif
