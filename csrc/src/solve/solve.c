/* One frame's solve: lambda, detection threshold, start, image; the solvers iterate.
 *
 * The problem is the lasso in reduced data: minimise |y - Q F S x|^2 / 2 + lambda |x|_1, with x >=
 * 0, x <= 0 or free as options.sign says (S, Q, F: docs/reference/eitm-format.md and
 * frame/whitening.h). This file does what does not depend on the solver, in this order; each step
 * may end the frame:
 *
 *   1. S'y, n_pixels x rank multiply-accumulates. Its maximum, lambda_max, is the least lambda at
 *      which x = 0 is optimal.
 *   2. lambda = the greater of lambda_rel lambda_max and lambda_noise_factor lambda_noise. The
 *      first scales with the touch, so that the image's shape does not depend on its strength;
 *      the second keeps the noise out where the touch is faint.
 *   3. Below the detection threshold nothing is solved: an untouched skin costs one product.
 *   4. Start: zero, or the last frame's coefficients where those are better already.
 *   5. The solver, then image_j = weight_j x_j. The columns were scaled by these weights when the
 *      model was built, so that lambda treats pixels alike which are seen unequally well.
 *
 * In: frame.y (whitened, projected), options, the reference's noise. Out: solver.x, solver.image,
 * info. A solve that ends early is no error: info.stop says how it ended. */
#include "solve/solve.h"
#include "base/vec.h"
#include "context/products.h"
#include "diagnostics/diagnostics.h"
#include "frame/whitening.h"
#include "kernels/kernels.h"
#include "solve/constants.h"

static void start_from_zero(eits_context *ctx)
{
    eits_zero(ctx->solver.x, ctx->model->n_pixels);
    eits_zero(ctx->solver.sx, EITS_STRIDE(ctx->model->rank));
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

void eits_answer_zero(eits_context *ctx, eits_stop why)
{
    start_from_zero(ctx);
    eits_zero(ctx->solver.image, ctx->model->n_pixels);
    ctx->solver.warm = 0;
    ctx->info.stop = why;
    ctx->info.nonzeros = 0;
    ctx->info.gap = ctx->info.gap_rel = 0;
    ctx->info.residual = ctx->info.data_norm;
}

/* x stays in coefficients, for a warm start; only the image is in S/m. */
static void make_image(eits_context *ctx)
{
    for (uint32_t j = 0; j < ctx->model->n_pixels; ++j)
        ctx->solver.image[j] = ctx->solver.x[j] * (eits_real)ctx->model->column_weight[j];
}

/* Start from the last frame's coefficients, unless zero is the better start for this frame. S x is
 * computed again: this costs little, and rounding errors cannot accumulate over a million frames.
 *
 * Zero is the better start if the skin was released: the old coefficients would have to be reduced
 * in many iterations. */
static int warm_start(eits_context *ctx, const eits_scratch *scratch)
{
    uint32_t count = 0;
    for (uint32_t j = 0; j < ctx->model->n_pixels; ++j)
        count += ctx->solver.x[j] != 0;
    if (!eits_affords(ctx, 2u * (uint64_t)count * ctx->model->rank + 2u * eits_gradient_macs(ctx)))
        return 0;
    ctx->info.nonzeros = eits_apply(ctx, scratch, ctx->solver.x, ctx->solver.sx);
    ctx->info.macs += (uint64_t)count * ctx->model->rank + eits_take_residual(ctx, ctx->solver.sx);
    eits_real l1 = 0;
    for (uint32_t j = 0; j < ctx->model->n_pixels; ++j)
        l1 += eits_fabs(ctx->solver.x[j]);
    /* Compare twice the objective at the old x with twice that at zero, |y|^2. */
    const eits_real twice = eits_fma(
        2 * ctx->info.lambda, l1,
        eits_dot(ctx->kernels, ctx->solver.residual, ctx->solver.residual, ctx->model->rank));
    return twice < ctx->info.data_norm * ctx->info.data_norm;
}

static void run(eits_context *ctx, const eits_scratch *scratch, int gradient_known)
{
    const eits_real lambda = ctx->info.lambda;
    switch (ctx->options.solver) {
    case EITS_SOLVER_FISTA:
    case EITS_SOLVER_WORKING_SET:
        eits_run_fista(ctx, scratch, lambda, gradient_known);
        break;
    case EITS_SOLVER_ACTIVE_SET:
        eits_run_active_set(ctx, scratch, lambda, gradient_known);
        break;
    }
}

/* info has the frame stage's counts, and zeros. `from_last`: 1 to start from the last coefficients.
 *
 * However it ends, x, image and info agree and are finite. If there is no image, it is zero and
 * info.stop has the reason. */
eits_status eits_solve_frame(eits_context *ctx, const eits_scratch *scratch, int from_last)
{
    const eits_options *o = &ctx->options;
    const uint32_t rank = ctx->model->rank;
    const eits_real square = eits_dot(ctx->kernels, ctx->frame.y, ctx->frame.y, rank);
    ctx->info.data_norm = eits_sqrt(square);
    ctx->info.lambda_noise = eits_lambda_noise(ctx);
    ctx->info.regularisation = ctx->whitening.mu_in_force;
    if (!eits_affords(ctx, (uint64_t)ctx->model->n_pixels * rank + eits_adjoint_macs(ctx))) {
        eits_answer_zero(ctx, EITS_STOP_MACS);
        return EITS_OK;
    }
    /* S'y comes first: its maximum is lambda_max, on which all following decisions depend, and it
     * is the gradient at zero, where a cold start begins. */
    eits_apply_t(ctx, eits_adjoint(ctx, ctx->frame.y, ctx->solver.adjoint), ctx->solver.gradient);
    ctx->info.macs += (uint64_t)ctx->model->n_pixels * rank + eits_adjoint_macs(ctx);
    ctx->info.lambda_max =
        eits_greatest(ctx->kernels, ctx->solver.gradient, ctx->model->n_pixels, o->sign);
    ctx->info.lambda = choose_lambda(ctx);
    if (!eits_is_finite(ctx->info.data_norm) || !eits_is_finite(ctx->info.lambda_max)) {
        ctx->info.data_norm = ctx->info.lambda_max = ctx->info.lambda = 0;
        eits_answer_zero(ctx, EITS_STOP_DIVERGED);
        return EITS_E_NOT_FINITE;
    }
    eits_check_stale_reference(ctx, ctx->solver.gradient);
    eits_check_unlike_model(ctx);
    if (square > 0 && ctx->info.lambda_max < eits_detection_threshold(ctx)) {
        eits_answer_zero(ctx, EITS_STOP_BELOW_THRESHOLD);
        return EITS_OK;
    }
    /* If no correlation exceeds lambda, zero is the exact optimum (the KKT conditions at x = 0).
     */
    if (!(ctx->info.lambda_max > ctx->info.lambda) || square < EITS_MIN_SQUARE) {
        eits_answer_zero(ctx, EITS_STOP_ZERO);
        return EITS_OK;
    }
    /* A warm start needs its own gradient; for a cold start it is known. */
    const int warm = from_last && ctx->solver.warm && warm_start(ctx, scratch);
    if (!warm) {
        start_from_zero(ctx);
        ctx->info.nonzeros = 0;
    }
    run(ctx, scratch, !warm);
    if (ctx->info.stop == EITS_STOP_DIVERGED) {
        eits_answer_zero(ctx, EITS_STOP_DIVERGED);
        return EITS_OK;
    }
    make_image(ctx);
    /* Column weights may be of any size, so a finite x need not make a finite image. */
    if (!eits_all_finite(ctx->solver.image, ctx->model->n_pixels)) {
        eits_answer_zero(ctx, EITS_STOP_DIVERGED);
        return EITS_E_NOT_FINITE;
    }
    ctx->solver.warm = 1;
    return EITS_OK;
}
