/* One frame's solve: lambda, detection threshold, start, image; the solvers iterate. */
#include "eitskin/solve.h"

#include "base/vec.h"
#include "diagnostics/diagnostics.h"
#include "eitskin/frame.h"
#include "frame/projection.h"
#include "frame/whitening.h"
#include "kernels/kernels.h"
#include "solve/duality_gap.h"
#include "solve/solvers.h"

static void start_from_zero(eits_context *ctx)
{
    eits_zero(ctx->x, ctx->model->n_pixels);
    eits_zero(ctx->sx, EITS_STRIDE(ctx->model->rank));
}

static eits_real choose_lambda(const eits_context *ctx)
{
    const eits_options *o = &ctx->options;
    if (o->lambda_abs > 0)
        return o->lambda_abs;
    const eits_real by_data = o->lambda_rel * ctx->info.lambda_max;
    const eits_real by_noise = o->lambda_noise_factor * eits_lambda_noise(ctx);
    return by_data > by_noise ? by_data : by_noise;
}

/* x = 0 is the answer: for the reason given. */
static void answer_zero(eits_context *ctx, eits_stop why)
{
    start_from_zero(ctx);
    eits_zero(ctx->image, ctx->model->n_pixels);
    ctx->warm = 0;
    ctx->info.stop = why;
    ctx->info.nonzeros = 0;
    ctx->info.gap = ctx->info.gap_rel = 0;
    ctx->info.residual = ctx->info.data_norm;
}

static void make_image(eits_context *ctx)
{
    for (uint32_t j = 0; j < ctx->model->n_pixels; ++j)
        ctx->image[j] = ctx->x[j] * (eits_real)ctx->model->column_weight[j];
}

/* Take up the last frame's coefficients, unless zero is the better start for this one. The sum S x
 * belongs to an earlier frame's numbers too, but is taken anew: it costs little, and rounding
 * cannot gather over a million frames. */
static int warm_start(eits_context *ctx)
{
    uint32_t count = 0;
    for (uint32_t j = 0; j < ctx->model->n_pixels; ++j)
        count += ctx->x[j] != 0;
    if (!eits_affords(ctx, 2u * (uint64_t)count * ctx->model->rank + 2u * eits_gradient_macs(ctx)))
        return 0;
    ctx->info.nonzeros = eits_apply(ctx, ctx->x, ctx->sx);
    ctx->info.macs += (uint64_t)count * ctx->model->rank + eits_take_residual(ctx, ctx->sx);
    eits_real l1 = 0;
    for (uint32_t j = 0; j < ctx->model->n_pixels; ++j)
        l1 += eits_fabs(ctx->x[j]);
    const eits_real twice = eits_fma(2 * ctx->info.lambda, l1,
                                     eits_dot(ctx, ctx->residual, ctx->residual, ctx->model->rank));
    return twice < ctx->info.data_norm * ctx->info.data_norm;
}

static void run(eits_context *ctx, int gradient_known)
{
    const eits_real lambda = ctx->info.lambda;
    switch (ctx->options.solver) {
    case EITS_SOLVER_FISTA:
    case EITS_SOLVER_WORKING_SET:
        eits_run_fista(ctx, lambda, gradient_known);
        break;
    case EITS_SOLVER_COORDINATE:
        eits_run_coordinate(ctx, lambda, gradient_known);
        break;
    case EITS_SOLVER_ACTIVE_SET:
        eits_run_active_set(ctx, lambda, gradient_known);
        break;
    }
}

/* Data whose square is hardly a number any more: objective and gap would be rounding. */
static const eits_real MIN_SQUARE = (eits_real)(sizeof(eits_real) == 4 ? 0x1p-102 : 0x1p-969);

/* ctx->info holds what the frame stage counted, and zeros; `from_last`: start from the last
 * coefficients. */
static eits_status solve(eits_context *ctx, int from_last)
{
    const eits_options *o = &ctx->options;
    const uint32_t rank = ctx->model->rank;
    const eits_real square = eits_dot(ctx, ctx->y, ctx->y, rank);
    ctx->info.data_norm = eits_sqrt(square);
    ctx->info.lambda_noise = eits_lambda_noise(ctx);
    ctx->info.regularisation = ctx->regularisation_in_force;
    if (!eits_affords(ctx, (uint64_t)ctx->model->n_pixels * rank + eits_adjoint_macs(ctx))) {
        answer_zero(ctx, EITS_STOP_MACS);
        return EITS_OK;
    }
    eits_apply_t(ctx, eits_adjoint(ctx, ctx->y, ctx->adjoint), ctx->gradient);
    ctx->info.macs += (uint64_t)ctx->model->n_pixels * rank + eits_adjoint_macs(ctx);
    ctx->info.lambda_max = eits_greatest(ctx, ctx->gradient, ctx->model->n_pixels, o->sign);
    ctx->info.lambda = choose_lambda(ctx);
    if (!eits_is_finite(ctx->info.data_norm) || !eits_is_finite(ctx->info.lambda_max)) {
        ctx->info.data_norm = ctx->info.lambda_max = ctx->info.lambda = 0;
        answer_zero(ctx, EITS_STOP_DIVERGED);
        return EITS_E_NOT_FINITE;
    }
    eits_check_stale_reference(ctx);
    if (o->detection_factor > 0 &&
        ctx->info.lambda_max < o->detection_factor * ctx->info.lambda_noise) {
        answer_zero(ctx, EITS_STOP_BELOW_THRESHOLD);
        return EITS_OK;
    }
    if (!(ctx->info.lambda_max > ctx->info.lambda) || square < MIN_SQUARE) {
        answer_zero(ctx, EITS_STOP_ZERO);
        return EITS_OK;
    }
    const int warm = from_last && ctx->warm && warm_start(ctx);
    if (!warm) {
        start_from_zero(ctx);
        ctx->info.nonzeros = 0;
    }
    run(ctx, !warm);
    if (ctx->info.stop == EITS_STOP_DIVERGED) {
        answer_zero(ctx, EITS_STOP_DIVERGED);
        return EITS_OK;
    }
    make_image(ctx);
    if (!eits_all_finite(ctx->image, ctx->model->n_pixels)) {
        answer_zero(ctx, EITS_STOP_DIVERGED);
        return EITS_E_NOT_FINITE;
    }
    ctx->warm = 1;
    return EITS_OK;
}

eits_status eits_solve(eits_context *ctx)
{
    if (ctx == NULL)
        return EITS_E_ARGUMENT;
    ctx->info = (eits_info){0};
    return solve(ctx, ctx->options.warm_start != 0);
}

void eits_solve_again(eits_context *ctx, const eits_real *y)
{
    const eits_info before = ctx->info;
    const size_t stride = EITS_STRIDE(ctx->model->rank);
    eits_copy(ctx->y_log, ctx->y, stride); /* of no more use for this frame */
    ctx->has_y_log = 0;
    eits_copy(ctx->y, y, stride);
    (void)solve(ctx, 0);
    if (!ctx->warm) { /* it came to nothing, or to no number */
        eits_copy(ctx->y, ctx->y_log, stride);
        (void)solve(ctx, 0);
    }
    ctx->info.iterations += before.iterations;
    ctx->info.step_halvings += before.step_halvings;
    ctx->info.diagnostics = before.diagnostics; /* judged by the frame as it came */
}

eits_status eits_reconstruct(eits_context *ctx, const eits_real *frame, size_t length,
                             eits_real *image, eits_info *info)
{
    if (ctx == NULL || frame == NULL)
        return EITS_E_ARGUMENT;
    ctx->info = (eits_info){0};
    eits_status status = eits_frame_stage(ctx, frame, length, &ctx->info.masked, &ctx->info.macs);
    if (status == EITS_OK)
        status = solve(ctx, ctx->options.warm_start != 0);
    else
        answer_zero(ctx, EITS_STOP_BELOW_THRESHOLD);
    if (image != NULL)
        eits_copy(image, ctx->image, ctx->model->n_pixels);
    if (info != NULL)
        *info = ctx->info;
    return status;
}
