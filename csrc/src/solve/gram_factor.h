/* Rows K that make a growing and shrinking set of columns orthonormal, K G K' = 1, G their
 * products: G^-1 = K'K without a chain of divisions. A reflection of the rows keeps that, so a
 * column goes by the one that leaves it to the last row alone. */
#ifndef EITSKIN_FACTOR_H
#define EITSKIN_FACTOR_H

#include "context/context.h"

/* w = K b, d = K'w = G^-1 b, of the first `count` columns. All have room for EITS_STRIDE(count);
 * `d` may be `b`, and b is padded with zeros. */
void eits_factor_solve(const eits_context *ctx, uint32_t count, eits_real *b, eits_real *w,
                       eits_real *d);

/* Column number `count`: d = G^-1 (its products with the columns before), and what is left of its
 * square, above 0. */
void eits_factor_append(eits_context *ctx, uint32_t count, const eits_real *d, eits_real left);

/* Take the column at `place` out of the `count`; the last one takes its place. Both scratches have
 * room for EITS_STRIDE(count). */
void eits_factor_drop(eits_context *ctx, uint32_t count, uint32_t place, eits_real *scratch,
                      eits_real *more);

/* Multiply-accumulates of a solve, and of a drop. */
static inline uint64_t eits_factor_macs(uint32_t count)
{
    return 2u * (uint64_t)count * count;
}

#endif
