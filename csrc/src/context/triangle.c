#include "context/triangle.h"

#include "base/vec.h"

/* The factor is computed by rows: each row is subtracted from all rows below it. The inner loop is
 * axpy over a padded row, which is fast on every processor here and needs no gathering. */
uint64_t eits_triangle_factor(const eits_context *ctx, eits_real min_pivot, eits_real *n)
{
    const uint32_t rank = ctx->model->rank;
    uint64_t macs = 0;
    for (uint32_t i = 0; i < rank; ++i) {
        eits_real *r = row_of(ctx, n, i);
        const eits_real left = r[i] > min_pivot ? r[i] : min_pivot, pivot = eits_sqrt(left),
                        fraction = 1 / pivot;
        eits_zero(r + first_of(i), i - first_of(i));
        r[i] = pivot;
        for (uint32_t j = i + 1; j < rank; ++j)
            r[j] *= fraction;
        for (uint32_t j = i + 1; j < rank; ++j) {
            add_row(ctx, j, row_of(ctx, n, j), -r[j], r);
            macs += rank - j;
        }
    }
    return macs;
}

void eits_triangle_solve(const eits_context *ctx, eits_real *triangle, eits_real *v)
{
    for (uint32_t i = ctx->model->rank; i-- > 0;) {
        const eits_real *row = row_of(ctx, triangle, i), before = v[i];
        /* zero while its row is summed, because the dot product includes the diagonal */
        v[i] = 0;
        v[i] = (before - dot_of_row(ctx, i, row, v)) / row[i];
    }
}

void eits_triangle_solve_transposed(const eits_context *ctx, eits_real *triangle, eits_real *v)
{
    for (uint32_t i = 0; i < ctx->model->rank; ++i) {
        const eits_real *row = row_of(ctx, triangle, i), after = v[i] / row[i];
        add_row(ctx, i, v, -after, row);
        v[i] = after;
    }
}
