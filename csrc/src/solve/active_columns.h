/* The active set's columns as they come and go, and their factor: rows K that make them
 * orthonormal, K G K' = 1, G their products: G^-1 = K'K without a chain of divisions. A reflection
 * of the rows keeps that, so a column goes by the one that leaves it to the last row alone. */
#ifndef EITSKIN_ACTIVE_COLUMNS_H
#define EITSKIN_ACTIVE_COLUMNS_H

#include "solve/violations.h"

typedef struct eits_active {
    eits_real lambda;
    eits_real tolerance; /* a correlation beyond lambda by no more than this is rounding */
    uint32_t max;        /* columns that can be independent */
    /* of each active column: its correlation less lambda times its sign; zero at the optimum */
    eits_real *pull;
    /* of each active column: that of its coefficient, or of the correlation that brought it in */
    eits_real *sign;
    eits_real *work;
    eits_real *step;
    eits_real *reach;  /* of each active column: what fraction of the step it can go */
    eits_real *column; /* the new column's part that counts */
    eits_nearby near;  /* columns beside the active ones, now or before */
    int limited;       /* the limit of MACs leaves no room for the next step */
    int loose;         /* a column is active that the factor does not have */
    int broken;        /* the factor is of no use */
    int moved;         /* x is not as it was before the last columns were taken in */
} eits_active;

/* w = K b, d = K'w = G^-1 b, of the first `count` columns. All have room for EITS_STRIDE(count);
 * `d` may be `b`, and b is padded with zeros. */
void eits_factor_solve(const eits_context *ctx, uint32_t count, eits_real *b, eits_real *w,
                       eits_real *d);

/* Multiply-accumulates of a solve, and of a drop. */
static inline uint64_t eits_factor_macs(uint32_t count)
{
    return 2u * (uint64_t)count * count;
}

/* Multiply-accumulates of the gap at the end, with S x of `count` columns. */
uint64_t eits_macs_to_finish(const eits_context *ctx, uint32_t count);

/* Whether the limit leaves room for `macs`, S x of one more column, and the gap after it; if not,
 * a->limited is set and it never does again. */
int eits_active_affords(const eits_context *ctx, eits_active *a, uint64_t macs);

/* Take the active column at `place` out; the last one takes its place. Uses a->work and a->step. */
void eits_active_drop(eits_context *ctx, eits_active *a, uint32_t place);

/* Take column j in at zero, solver.gradient[j] being its correlation; one that is but rounding
 * stays out. Sets a->limited, a->loose and a->moved where they come true. */
void eits_active_add(eits_context *ctx, eits_active *a, uint32_t j);

/* Make a warm start's coefficients in solver.x (n_pixels) the active columns, without those that
 * depend on others. Returns 0, nothing changed, where the limit of MACs leaves no room for that. */
int eits_active_begin_warm(eits_context *ctx, eits_active *a);

#endif
