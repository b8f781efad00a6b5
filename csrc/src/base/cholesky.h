/* Cholesky's factor of a small symmetric matrix A = L L', L a lower triangle, and solves with it.
 *
 * Triangles are packed by rows: row i has i + 1 numbers and follows row i - 1, so n rows take
 * EITS_LOWER_SIZE(n) numbers. Each sum is one chain of fused multiply-adds by ascending column:
 * with the few rows that there are here, lanes of eight would be padding for the most part. The
 * large triangles, of as many rows as the model has directions, are in context/triangle.h. */
#ifndef EITSKIN_CHOLESKY_H
#define EITSKIN_CHOLESKY_H

#include "base/vec.h"

/* Numbers in a packed triangle of n rows. */
#define EITS_LOWER_SIZE(n) ((size_t)(n) * ((n) + 1u) / 2u)

static inline eits_real *eits_lower_row(eits_real *lower, uint32_t i)
{
    return lower + EITS_LOWER_SIZE(i);
}

/* The next row of the factor. Rows before row i are L's already, row i is still A's. Makes L_ij of
 * each j < i and returns the pivot, that is A_ii less the squares of these. The caller decides what
 * to do with a pivot that is too small, and then stores its square root as L_ii: what "too small"
 * means depends on what the matrix is. */
eits_real eits_cholesky_row(eits_real *lower, uint32_t i);

/* v = L^-1 v, then v = L'^-1 v, of n rows: after both, v is A^-1 v. */
void eits_lower_solve(eits_real *lower, uint32_t n, eits_real *v);
void eits_lower_solve_transposed(eits_real *lower, uint32_t n, eits_real *v);

#endif
