#include "stages.h"

#include "kernels.h"
#include "vec.h"

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

eits_real eits_greatest(const eits_real *g, uint32_t count, eits_sign sign)
{
    eits_real high = 0, low = 0;
    if (sign != EITS_SIGN_DECREASE) {
        for (uint32_t j = 0; j < count; ++j)
            high = g[j] > high ? g[j] : high;
    }
    if (sign != EITS_SIGN_INCREASE) {
        for (uint32_t j = 0; j < count; ++j)
            low = g[j] < low ? g[j] : low;
    }
    return high > -low ? high : -low;
}

int eits_all_finite(const eits_real *values, size_t count)
{
    for (size_t i = 0; i < count; ++i) {
        if (!eits_is_finite(values[i]))
            return 0;
    }
    return 1;
}
