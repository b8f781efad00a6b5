/* Cholesky's factor of a small symmetric matrix A = L L', L a lower triangle, and solves with it.
 *
 * Triangles are packed by rows: row i has i + 1 numbers and follows row i - 1, so n rows take
 * EITS_LOWER_SIZE(n) numbers. Each sum is one chain of fused multiply-adds by ascending column:
 * these matrices have few rows, so lanes of eight would mostly be padding. The large triangles,
 * with one row per direction of the model, are in context/triangle.h. */
#ifndef EITSKIN_CHOLESKY_H
#define EITSKIN_CHOLESKY_H

#include "base/vec.h"

/* Numbers in a packed triangle of n rows. */
#define EITS_LOWER_SIZE(n) ((size_t)(n) * ((n) + 1u) / 2u)

static inline eits_real *eits_lower_row(eits_real *lower, uint32_t i)
{
    return lower + EITS_LOWER_SIZE(i);
}

/* Compute the next row of the factor. The rows before row i are L's already; row i is still A's.
 * Computes L_ij for each j < i and returns the pivot, that is A_ii minus the squares of these. The
 * caller decides whether the pivot is too small, which depends on the matrix, and then stores its
 * square root as L_ii. */
eits_real eits_cholesky_row(eits_real *lower, uint32_t i);

/* The first function sets v = L^-1 v, the second v = L'^-1 v, with n rows: after both, v is A^-1 v.
 */
void eits_lower_solve(eits_real *lower, uint32_t n, eits_real *v);
void eits_lower_solve_transposed(eits_real *lower, uint32_t n, eits_real *v);

/* Compute rows first ... last - 1 of column `last` - 1 of A^-1, in v[first] ... v[last - 1]; v has
 * room for n numbers. The bits are those of both solves with a unit vector. */
void eits_lower_inverse(eits_real *lower, uint32_t n, uint32_t first, uint32_t last, eits_real *v);

#endif
