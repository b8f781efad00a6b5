/* Triangular factor L of a growing and shrinking set of columns' products: L L' = G. Row i starts at i (i + 1) / 2. */
#ifndef EITSKIN_FACTOR_H
#define EITSKIN_FACTOR_H

#include "eitskin/context.h"

/* w = L^-1 b, of the first `count` rows; `w` may be `b`. */
void eits_factor_forward(const eits_context *ctx, uint32_t count, const eits_real *b, eits_real *w);

/* d = L'^-1 w; `w` is changed, and may be `d`. */
void eits_factor_back(const eits_context *ctx, uint32_t count, eits_real *w, eits_real *d);

/* Row number `count`: w = L^-1 (products with the columns before), and what is left of the column's square, above 0. */
void eits_factor_append(eits_context *ctx, uint32_t count, const eits_real *w, eits_real left);

/* Take the column at `place` out of the `count`. */
void eits_factor_drop(eits_context *ctx, uint32_t count, uint32_t place);

/* Multiply-accumulates of one triangular solve, and of a drop at its worst. */
static inline uint64_t eits_factor_solve_macs(uint32_t count)
{
    return (uint64_t)count * (count + 1u) / 2u;
}

static inline uint64_t eits_factor_drop_macs(uint32_t count, uint32_t place)
{
    return 2u * (uint64_t)(count - place) * (count - place);
}

#endif
