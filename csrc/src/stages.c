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

/* Eight at a time: which of them is the greatest does not depend on the order. */
static eits_real most_of(const eits_real *g, uint32_t count)
{
    eits_real lane[8] = {0};
    uint32_t j = 0;
    for (; j + 8 <= count; j += 8) {
        for (uint32_t l = 0; l < 8; ++l)
            lane[l] = g[j + l] > lane[l] ? g[j + l] : lane[l];
    }
    for (; j < count; ++j)
        lane[0] = g[j] > lane[0] ? g[j] : lane[0];
    for (uint32_t l = 1; l < 8; ++l)
        lane[0] = lane[l] > lane[0] ? lane[l] : lane[0];
    return lane[0];
}

static eits_real least_of(const eits_real *g, uint32_t count)
{
    eits_real lane[8] = {0};
    uint32_t j = 0;
    for (; j + 8 <= count; j += 8) {
        for (uint32_t l = 0; l < 8; ++l)
            lane[l] = g[j + l] < lane[l] ? g[j + l] : lane[l];
    }
    for (; j < count; ++j)
        lane[0] = g[j] < lane[0] ? g[j] : lane[0];
    for (uint32_t l = 1; l < 8; ++l)
        lane[0] = lane[l] < lane[0] ? lane[l] : lane[0];
    return lane[0];
}

eits_real eits_greatest(const eits_real *g, uint32_t count, eits_sign sign)
{
    const eits_real high = sign != EITS_SIGN_DECREASE ? most_of(g, count) : 0;
    const eits_real low = sign != EITS_SIGN_INCREASE ? least_of(g, count) : 0;
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
