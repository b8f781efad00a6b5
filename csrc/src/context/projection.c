/* Q v = v - sum_k b_k (b_k'v) over the ignored directions b_k, in place; 2 rank
 * multiply-accumulates each. Q is a projection, so applying it to y once and to F S x in every
 * residual makes the problem that of the other directions alone, exactly, without a change of P or
 * S. */
#include "context/projection.h"

#include "base/vec.h"
#include "kernels/kernels.h"

uint64_t eits_take_out(const eits_context *ctx, const eits_real *directions, uint32_t count,
                       eits_real *v)
{
    const uint32_t rank = ctx->model->rank;
    const size_t stride = EITS_STRIDE(rank);
    /* The directions are taken out one after another. In float32 they are orthogonal only up to
     * rounding, and this order also removes what the step before has left. */
    for (uint32_t k = 0; k < count; ++k) {
        const eits_real *direction = directions + stride * k;
        eits_axpy(ctx->kernels, v, -eits_dot(ctx->kernels, direction, v, rank), direction, rank);
    }
    return (uint64_t)count * 2u * rank;
}

int eits_add_direction(const eits_context *ctx, eits_real *directions, uint32_t count,
                       eits_real least, uint64_t *macs)
{
    const uint32_t rank = ctx->model->rank;
    eits_real *one = directions + EITS_STRIDE(rank) * (size_t)count;
    const eits_real before = eits_dot(ctx->kernels, one, one, rank);
    *macs += eits_take_out(ctx, directions, count, one);
    const eits_real after = eits_dot(ctx->kernels, one, one, rank), scale = 1 / eits_sqrt(after);
    if (!(after > least * before))
        return 0;
    for (uint32_t i = 0; i < rank; ++i)
        one[i] *= scale;
    return 1;
}

uint64_t eits_project(const eits_context *ctx, eits_real *v)
{
    return eits_take_out(ctx, ctx->projection.basis, ctx->projection.count, v);
}
