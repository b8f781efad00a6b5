/* Q v = v - sum_k b_k (b_k'v) over the ignored directions b_k, in place; 2 rank
 * multiply-accumulates each. Q is a projection, so applying it to y once and to F S x in every
 * residual makes the problem that of the other directions alone, exactly, without a change of P or
 * S. */
#include "context/projection.h"

#include "base/vec.h"
#include "kernels/kernels.h"

uint64_t eits_project(const eits_context *ctx, eits_real *v)
{
    const uint32_t rank = ctx->model->rank;
    const size_t stride = EITS_STRIDE(rank);
    /* One direction after another, not all products first: in float32 the directions are orthogonal
     * to rounding only, and so what one leaves of the next is seen. */
    for (uint32_t k = 0; k < ctx->projection.count; ++k) {
        const eits_real *direction = ctx->projection.basis + stride * k;
        eits_axpy(ctx->kernels, v, -eits_dot(ctx->kernels, direction, v, rank), direction, rank);
    }
    return (uint64_t)ctx->projection.count * 2u * rank;
}
