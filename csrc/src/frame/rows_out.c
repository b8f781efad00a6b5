/* Rows left out of a taught model are filled in, and F accounts for the reduced information of the
 * rest.
 *
 * A taught model's P = U'W whitens noise of covariance C, and its section PREC has R = C^-1 over
 * what makes P R^-1 P' = I. The rows m that are left out get their expected values given the
 * others, o: d_m = -R_mm^-1 R_mo d_o. With Q = P_m R_mm^-1 P_m' the residual in the metric of the
 * remaining rows, (C_oo)^-1, is
 *
 *     |F'^-1 P d - F S x|^2,   F'F = I - Q,   F an upper triangle
 *
 * because Schur's complement of R_mm in R is the inverse of C_oo. Without one electrode of sixteen
 * the error then grows by a tenth. Projecting P's columns out of the data would double it, because
 * there are nearly as many of them as P has rows. */
#include "frame/whitening.h"

#include "base/cholesky.h"
#include "base/vec.h"
#include "context/triangle.h"
#include "frame/constants.h"
#include "kernels/column.h"

/* R is symmetric; only its lower triangle is stored. */
static eits_real precision(const eits_context *ctx, uint32_t i, uint32_t j)
{
    const size_t high = i > j ? i : j, low = i > j ? j : i;
    return (eits_real)ctx->model->precision[high * (high + 1u) / 2u + low];
}

/* Compute L of R_mm = L L', packed, in the metric's place. It fits: there are at most as many rows
 * as directions. A pivot that rounding has made negative gives a NaN, which the check of the whole
 * triangle F finds; the stored whitening is used then. */
static uint64_t factor_left_out(eits_context *ctx, const uint32_t *out, uint32_t count)
{
    eits_real *lower = ctx->whitening.metric;
    for (uint32_t i = 0; i < count; ++i) {
        eits_real *row = eits_lower_row(lower, i);
        for (uint32_t j = 0; j <= i; ++j)
            row[j] = precision(ctx, out[i], out[j]);
        row[i] = eits_sqrt(eits_cholesky_row(lower, i));
    }
    return (uint64_t)count * count * count / 6u;
}

/* List the rows that are left out, in order; returns their number. */
static uint32_t list_left_out(const eits_context *ctx, uint32_t *out)
{
    uint32_t count = 0;
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        /* always written, but counted only if the row is left out: no branch */
        out[count] = k;
        count += ctx->frame.sides[k] == 0;
    }
    return count;
}

uint64_t eits_fill_build(eits_context *ctx, const eits_scratch *scratch)
{
    const uint32_t rank = ctx->model->rank, count = list_left_out(ctx, scratch->index);
    const size_t stride = EITS_STRIDE(rank);
    eits_real *f = ctx->whitening.map;
    uint64_t macs = factor_left_out(ctx, scratch->index, count);
    eits_zero(f, EITS_PADDED_TRIANGLE(rank));
    for (uint32_t i = 0; i < rank; ++i)
        row_of(ctx, f, i)[i] = 1;
    /* Z = L^-1 P_m' has a row for each row that is left out; I - Z'Z is summed row by row. */
    for (uint32_t a = 0; a < count; ++a) {
        eits_real *z = scratch->square + a * stride;
        const eits_real *row = eits_lower_row(ctx->whitening.metric, a);
        eits_zero(z, stride);
        eits_copy(z, eits_column(&ctx->model->reduction, scratch->index[a], scratch->row[3]), rank);
        for (uint32_t b = 0; b < a; ++b)
            eits_axpy(ctx->kernels, z, -row[b], scratch->square + b * stride, stride);
        for (uint32_t i = 0; i < rank; ++i)
            z[i] /= row[a];
        for (uint32_t i = 0; i < rank; ++i)
            add_row(ctx, i, row_of(ctx, f, i), -z[i], z);
        macs += (uint64_t)a * rank + triangle_macs(ctx);
    }
    macs += eits_triangle_factor(ctx, EITS_LOST * EITS_LOST, f);
    ctx->whitening.form = eits_all_finite(f, EITS_PADDED_TRIANGLE(rank)) ? EITS_WHITENING_TRIANGLE
                                                                         : EITS_WHITENING_STORED;
    return macs;
}

uint64_t eits_fill_rows(eits_context *ctx, const eits_scratch *scratch, uint32_t given,
                        eits_real *y)
{
    eits_real *lower = ctx->whitening.metric, *x = scratch->square;
    const float *p = ctx->model->reduction.data;
    uint32_t count = 0;
    if (ctx->model->precision == NULL || ctx->whitening.form != EITS_WHITENING_TRIANGLE)
        return 0;
    /* x = R_mm^-1 R_mo d_o. The factor serves every frame until other rows are left out. */
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        if (ctx->frame.sides[k] != 0)
            continue;
        eits_real sum = 0;
        for (uint32_t t = 0; t < given; ++t)
            sum = eits_fma(precision(ctx, k, scratch->index[t]), scratch->value[t], sum);
        x[count++] = sum;
    }
    eits_lower_solve(lower, count, x);
    eits_lower_solve_transposed(lower, count, x);
    /* Add the expected data of the rows left out to y, each by its column of P. */
    uint32_t a = 0;
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        if (ctx->frame.sides[k] != 0)
            continue;
        const float *column = p + (size_t)k * ctx->model->reduction.stride;
        for (uint32_t i = 0; i < ctx->model->rank; ++i)
            y[i] = eits_fma(-x[a], (eits_real)column[i], y[i]);
        ++a;
    }
    return (uint64_t)count * (given + count + ctx->model->rank);
}
