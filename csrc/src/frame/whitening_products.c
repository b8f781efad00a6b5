/* Apply F (whitening.h) in each of its forms: not at all, as a weight per direction, or as an upper
 * triangle if rows are left out.
 *
 * The solvers do not know the form; they ask for F v, F'v, Q F v and the residual, and for the cost
 * of each, and the three forms differ only here. F is applied to the `rank` numbers S x, never to
 * S: this costs rank^2 / 2 multiply-accumulates at most, while a changed S would cost n_pixels
 * times that, and memory that a board does not have. */
#include "base/vec.h"
#include "context/projection.h"
#include "context/triangle.h"
#include "frame/whitening.h"
#include "kernels/kernels.h"

/* out = D v.
 *
 * The loop runs over the whole stride, whose padding is zero, so no remainder has to be handled. */
static void weigh(const eits_context *ctx, const eits_real *v, eits_real *out)
{
    const eits_real *weight = ctx->whitening.map;
    for (size_t i = 0; i < EITS_STRIDE(ctx->model->rank); ++i)
        out[i] = weight[i] * v[i];
}

/* F is applied in place, from the first row down: row i of an upper triangle needs v from i on. To
 * begin at a whole vector it also reads numbers before i; they meet zeros. */
uint64_t eits_whiten(const eits_context *ctx, eits_real *v)
{
    if (ctx->whitening.form == EITS_WHITENING_DIAGONAL)
        weigh(ctx, v, v);
    for (uint32_t i = 0; ctx->whitening.form == EITS_WHITENING_TRIANGLE && i < ctx->model->rank;
         ++i)
        v[i] = dot_of_row(ctx, i, row_of(ctx, ctx->whitening.map, i), v);
    return eits_adjoint_macs(ctx);
}

uint64_t eits_residual(const eits_context *ctx, const eits_real *sx, eits_real *out)
{
    const size_t stride = EITS_STRIDE(ctx->model->rank);
    /* F and Q have to be applied to S x; y has been through both. */
    if (ctx->whitening.form == EITS_WHITENING_TRIANGLE) {
        eits_copy(out, sx, stride);
        const uint64_t macs = eits_forward(ctx, out);
        for (size_t i = 0; i < stride; ++i)
            out[i] = ctx->frame.y[i] - out[i];
        return macs;
    }
    if (ctx->whitening.form == EITS_WHITENING_DIAGONAL) {
        const eits_real *weight = ctx->whitening.map;
        for (size_t i = 0; i < stride; ++i)
            out[i] = eits_fma(-weight[i], sx[i], ctx->frame.y[i]);
        return ctx->model->rank + eits_project(ctx, out);
    }
    eits_copy(out, ctx->frame.y, stride);
    eits_axpy(ctx->kernels, out, -1, sx, stride);
    return eits_project(ctx, out);
}

uint64_t eits_forward(const eits_context *ctx, eits_real *v)
{
    const uint64_t macs = eits_whiten(ctx, v);
    return macs + eits_project(ctx, v);
}

uint64_t eits_forward_macs(const eits_context *ctx)
{
    return eits_adjoint_macs(ctx) + 2u * (uint64_t)ctx->projection.count * ctx->model->rank;
}

const eits_real *eits_adjoint(const eits_context *ctx, const eits_real *v, eits_real *room)
{
    /* F is the identity, so no copy is made. */
    if (!ctx->whitening.form)
        return v;
    if (ctx->whitening.form == EITS_WHITENING_DIAGONAL) {
        weigh(ctx, v, room);
        return room;
    }
    /* F' v is the sum of F's rows times the numbers of v, so the transpose needs no gathering. */
    eits_zero(room, EITS_STRIDE(ctx->model->rank));
    for (uint32_t i = 0; i < ctx->model->rank; ++i)
        add_row(ctx, i, room, v[i], row_of(ctx, ctx->whitening.map, i));
    return room;
}

uint64_t eits_adjoint_macs(const eits_context *ctx)
{
    return ctx->whitening.form == EITS_WHITENING_TRIANGLE   ? triangle_macs(ctx)
           : ctx->whitening.form == EITS_WHITENING_DIAGONAL ? ctx->model->rank
                                                            : 0;
}
