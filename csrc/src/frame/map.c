/* How F (observed.h) is applied, whatever it is. */
#include "base/vec.h"
#include "frame/projection.h"
#include "frame/triangle.h"
#include "frame/whitening.h"
#include "kernels/kernels.h"

/* out = D v. */
static void weigh(const eits_context *ctx, const eits_real *v, eits_real *out)
{
    const eits_real *weight = map_of(ctx);
    for (size_t i = 0; i < EITS_STRIDE(ctx->model->rank); ++i)
        out[i] = weight[i] * v[i];
}

uint64_t eits_map(const eits_context *ctx, eits_real *v)
{
    if (ctx->rewhitened == EITS_BY_ROW)
        weigh(ctx, v, v);
    for (uint32_t i = 0; ctx->rewhitened == EITS_BY_TRIANGLE && i < ctx->model->rank; ++i)
        v[i] = dot_of_row(ctx, i, row_of(ctx, map_of(ctx), i), v);
    return eits_adjoint_macs(ctx);
}

uint64_t eits_residual(const eits_context *ctx, const eits_real *sx, eits_real *out)
{
    const size_t stride = EITS_STRIDE(ctx->model->rank);
    if (ctx->rewhitened == EITS_BY_TRIANGLE) {
        eits_copy(out, sx, stride);
        const uint64_t macs = eits_forward(ctx, out);
        for (size_t i = 0; i < stride; ++i)
            out[i] = ctx->y[i] - out[i];
        return macs;
    }
    if (ctx->rewhitened == EITS_BY_ROW) {
        const eits_real *weight = map_of(ctx);
        for (size_t i = 0; i < stride; ++i)
            out[i] = eits_fma(-weight[i], sx[i], ctx->y[i]);
        return ctx->model->rank + eits_project(ctx, out);
    }
    eits_copy(out, ctx->y, stride);
    eits_axpy(ctx, out, -1, sx, stride);
    return eits_project(ctx, out);
}

uint64_t eits_forward(const eits_context *ctx, eits_real *v)
{
    const uint64_t macs = eits_map(ctx, v);
    return macs + eits_project(ctx, v);
}

uint64_t eits_forward_macs(const eits_context *ctx)
{
    return eits_adjoint_macs(ctx) + 2u * (uint64_t)ctx->basis_count * ctx->model->rank;
}

const eits_real *eits_adjoint(const eits_context *ctx, const eits_real *v, eits_real *room)
{
    if (!ctx->rewhitened)
        return v;
    if (ctx->rewhitened == EITS_BY_ROW) {
        weigh(ctx, v, room);
        return room;
    }
    eits_zero(room, EITS_STRIDE(ctx->model->rank));
    for (uint32_t i = 0; i < ctx->model->rank; ++i)
        add_row(ctx, i, room, v[i], row_of(ctx, map_of(ctx), i));
    return room;
}

uint64_t eits_adjoint_macs(const eits_context *ctx)
{
    return ctx->rewhitened == EITS_BY_TRIANGLE ? triangle_macs(ctx)
           : ctx->rewhitened == EITS_BY_ROW    ? ctx->model->rank
                                               : 0;
}
