/* Upper triangles of rank x rank, packed: those of rows left out (frame/whitening.h) and those of
 * the touch test. Triangles of a few rows are in base/cholesky.h. */
#ifndef EITSKIN_TRIANGLE_H
#define EITSKIN_TRIANGLE_H

#include "context/context.h"

/* Upper triangles are stored row after row. Return the first stored column of row i: a multiple of
 * 8; the columns before i are zero. */
static inline uint32_t first_of(uint32_t i)
{
    return i & ~7u;
}

/* Return row i such that [k] is its column k; columns before first_of(i) are not stored. */
static inline eits_real *row_of(const eits_context *ctx, eits_real *triangle, uint32_t i)
{
    const size_t stride = EITS_STRIDE(ctx->model->rank), block = i / 8u;
    return triangle + 8u * (block * stride - 4u * block * block + 4u * block) +
           i % 8u * (stride - 8u * block) - 8u * block;
}

/* a . b and out += factor * a over the columns that row i has. */
static inline eits_real dot_of_row(const eits_context *ctx, uint32_t i, const eits_real *a,
                                   const eits_real *b)
{
    return eits_dot(ctx->kernels, a + first_of(i), b + first_of(i),
                    EITS_STRIDE(ctx->model->rank) - first_of(i));
}

static inline void add_row(const eits_context *ctx, uint32_t i, eits_real *out, eits_real factor,
                           const eits_real *a)
{
    eits_axpy(ctx->kernels, out + first_of(i), factor, a + first_of(i),
              EITS_STRIDE(ctx->model->rank) - first_of(i));
}

/* N = R'R, R in N's place. A pivot below `min_pivot` is raised to it. The strong directions come
 * first, so that the rounding errors of a lost direction have little effect. Numbers in the padding
 * of N are set to zero. Returns the multiply-accumulates. */
uint64_t eits_triangle_factor(const eits_context *ctx, eits_real min_pivot, eits_real *n);

/* v = T^-1 v, and v = T'^-1 v. */
void eits_triangle_solve(const eits_context *ctx, eits_real *triangle, eits_real *v);
void eits_triangle_solve_transposed(const eits_context *ctx, eits_real *triangle, eits_real *v);

static inline uint64_t triangle_macs(const eits_context *ctx)
{
    return (uint64_t)ctx->model->rank * (ctx->model->rank + 1u) / 2u;
}

#endif
