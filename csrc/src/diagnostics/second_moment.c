/* Check that a matrix of section UNCE is a covariance, that is, positive semidefinite up to
 * rounding.
 *
 * The matrix is scaled to a diagonal of ones, and rows are eliminated, the one with the greatest
 * pivot first. A covariance leaves only zeros in the end. A matrix with a negative direction leaves
 * a negative pivot, or other numbers beside pivots of zero. The cost is rank^3 / 2
 * multiply-accumulates, once for each matrix of a model. */
#include "diagnostics/diagnostics.h"

#include "base/vec.h"
#include "kernels/kernels.h"

/* Compute C, the scaled A. Returns 0 if A cannot be a matrix of second moments, because an element
 * is greater than the diagonal elements of its row and column allow. `scale` gets 1 / sqrt(A_ii),
 * or 0 for a row of zeros. */
static int scaled(const float *triangle, uint32_t rank, eits_real *square, eits_real *scale)
{
    const uint32_t stride = EITS_STRIDE(rank);
    eits_zero(square, stride * rank);
    for (uint32_t i = 0; i < rank; ++i) {
        const float *row = triangle + (size_t)i * (i + 1u) / 2u;
        const eits_real own = (eits_real)row[i];
        scale[i] = own > 0 ? 1 / eits_sqrt(own) : 0;
        for (uint32_t j = 0; j < i; ++j) {
            const eits_real c = (eits_real)row[j] * scale[i] * scale[j];
            if (eits_fabs(c) > 1 + EITS_SECOND_MOMENT_ROUNDING ||
                ((scale[i] == 0 || scale[j] == 0) && row[j] != 0))
                return 0;
            square[(size_t)i * stride + j] = square[(size_t)j * stride + i] = c;
        }
        square[(size_t)i * stride + i] = own > 0 ? 1 : 0;
    }
    return 1;
}

int eits_is_covariance(const eits_context *ctx, const eits_scratch *scratch, const float *triangle)
{
    const uint32_t rank = ctx->model->rank, stride = EITS_STRIDE(rank);
    eits_real *square = scratch->square,
              *left = scratch->row[5]; /* 1: the row is not eliminated yet */
    if (!scaled(triangle, rank, square, left))
        return 0;
    for (uint32_t i = 0; i < rank; ++i)
        left[i] = 1;
    for (uint32_t step = 0; step < rank; ++step) {
        uint32_t p = rank;
        eits_real pivot = EITS_SECOND_MOMENT_ROUNDING;
        for (uint32_t i = 0; i < rank; ++i) {
            const eits_real own = square[(size_t)i * stride + i];
            if (left[i] > 0 && own > pivot)
                p = i, pivot = own;
        }
        if (p == rank)
            break;
        left[p] = 0;
        const eits_real *row = square + (size_t)p * stride;
        for (uint32_t i = 0; i < rank; ++i) {
            if (left[i] > 0)
                eits_axpy(ctx->kernels, square + (size_t)i * stride, -row[i] / pivot, row, stride);
        }
    }
    for (uint32_t i = 0; i < rank; ++i) {
        for (uint32_t j = 0; j < rank; ++j) {
            if (left[i] > 0 && left[j] > 0 &&
                eits_fabs(square[(size_t)i * stride + j]) > 2 * EITS_SECOND_MOMENT_ROUNDING)
                return 0;
        }
    }
    return 1;
}
