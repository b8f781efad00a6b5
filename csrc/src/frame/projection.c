#include "frame/projection.h"

#include "base/vec.h"
#include "frame/whitening.h"
#include "kernels/kernels.h"

uint64_t eits_project(const eits_context *ctx, eits_real *v)
{
    const uint32_t rank = ctx->model->rank;
    const size_t stride = EITS_STRIDE(rank);
    for (uint32_t k = 0; k < ctx->basis_count; ++k) {
        const eits_real *direction = ctx->basis + stride * k;
        eits_axpy(ctx, v, -eits_dot(ctx, direction, v, rank), direction, rank);
    }
    return (uint64_t)ctx->basis_count * 2u * rank;
}

uint64_t eits_reduce(eits_context *ctx, uint32_t count, eits_real *out)
{
    ctx->kernels->mul(&ctx->model->reduction, ctx->list_index, ctx->list_value, count, out);
    const uint64_t macs = ctx->masked_whitening ? eits_whiten_data(ctx, out) : 0;
    return macs + (uint64_t)count * ctx->model->rank + eits_project(ctx, out);
}

int eits_all_finite(const eits_real *values, size_t count)
{
    int all = 1;
    for (size_t i = 0; i < count; ++i)
        all &= eits_is_finite(values[i]);
    return all;
}
