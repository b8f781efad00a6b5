/* The active set's columns as they are added and dropped, and their factor K. With G the matrix of
 * the columns' products, K G K' = 1, so that G^-1 = K'K without a chain of divisions. Any
 * reflection of K's rows keeps this. To drop a column, one reflects it into the last row and drops
 * that row. */
#ifndef EITSKIN_ACTIVE_COLUMNS_H
#define EITSKIN_ACTIVE_COLUMNS_H

#include "solve/violations.h"

typedef struct eits_active {
    eits_real lambda;
    eits_real tolerance; /* a correlation may exceed lambda by this much through rounding */
    uint32_t max;        /* the most columns that can be independent */
    /* per active column: its correlation less lambda times its sign; zero at the optimum */
    eits_real *pull;
    /* per active column: the sign of its coefficient, or of the correlation when it was added */
    eits_real *sign;
    eits_real *work;
    eits_real *step;
    eits_real *reach;  /* per active column: the fraction of the step that it can go */
    eits_real *column; /* the new column, whitened and projected */
    eits_nearby near;  /* columns beside those that are or were active */
    int limited;       /* 1: mac_limit does not allow the next step */
    int loose;         /* 1: a column is active that the factor lacks */
    int broken;        /* 1: the factor gives numbers that are not finite */
    int moved;         /* 1: x has changed since the last columns were added */
} eits_active;

/* w = K b, d = K'w = G^-1 b, of the first `count` columns. All have room for EITS_STRIDE(count);
 * `d` may be `b`, and b is padded with zeros. */
void eits_factor_solve(const eits_context *ctx, uint32_t count, eits_real *b, eits_real *w,
                       eits_real *d);

/* Multiply-accumulates of a solve with the factor, and of dropping a column. */
static inline uint64_t eits_factor_macs(uint32_t count)
{
    return 2u * (uint64_t)count * count;
}

/* Multiply-accumulates of S x with `count` columns and the gap, at the end of a solve. */
uint64_t eits_macs_to_finish(const eits_context *ctx, uint32_t count);

/* Return 1 if mac_limit allows `macs`, S x with one more column, and the gap after it. If it does
 * not, a->limited is set, and all later calls return 0. */
int eits_active_affords(const eits_context *ctx, eits_active *a, uint64_t macs);

/* Drop the active column at `place`; the last one takes its place. Uses a->work and a->step. */
void eits_active_drop(eits_context *ctx, eits_active *a, uint32_t place);

/* Add column j with the coefficient zero; solver.gradient[j] is its correlation. A column that is
 * only rounding is not added. Sets a->limited, a->loose and a->moved if they become true. */
void eits_active_add(eits_context *ctx, eits_active *a, uint32_t j);

/* Make the columns of a warm start's coefficients, in solver.x (n_pixels), active, except those
 * that depend on others. Returns 0 if mac_limit does not allow it; nothing is then changed. */
int eits_active_begin_warm(eits_context *ctx, eits_active *a);

#endif
