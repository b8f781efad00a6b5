/* FISTA with non-negative, non-positive or signed shrinkage; see solve.h for the problem and its source. */
#include "eitskin/solve.h"

#include "eitskin/frame.h"
#include "kernels.h"
#include "stages.h"
#include "vec.h"

enum { MAX_STEP_HALVINGS = 8 };

/* residual = y - Q sx; y is projected already, so the difference is projected whole. */
static uint64_t take_residual(eits_context *ctx, const eits_real *sx)
{
    const size_t stride = EITS_STRIDE(ctx->model->rank);
    for (size_t i = 0; i < stride; ++i)
        ctx->residual[i] = ctx->y[i] - sx[i];
    return eits_project(ctx, ctx->residual);
}

static uint64_t apply_t(const eits_context *ctx, const eits_real *v, eits_real *out)
{
    eits_apply_t(ctx, v, out);
    return (uint64_t)ctx->model->n_pixels * ctx->model->rank;
}

typedef struct certificate {
    eits_real gap;
    eits_real objective;
    eits_real residual_squared;
} certificate;

/* Objective and duality gap at ctx->x. With r = y - S x, c = S' r and s = min(1, lambda / max c), the dual point s r gives
 *     gap = (1 - s)^2 |r|^2 / 2 + sum_j (lambda |x_j| - s x_j c_j),
 * a sum of terms that are not negative, so that nothing cancels (from Kim et al., IEEE J. Sel. Top. Signal Process. 1 (2007)
 * 606, doi 10.1109/JSTSP.2007.910971, with |y|^2 / 2 - |y - s r|^2 / 2 written out). Leaves c in ctx->gradient. */
static certificate certify(eits_context *ctx, eits_real lambda)
{
    const uint32_t n = ctx->model->n_pixels;
    ctx->info.macs += take_residual(ctx, ctx->sx);
    ctx->info.macs += apply_t(ctx, ctx->residual, ctx->gradient);
    const eits_real largest = eits_greatest(ctx->gradient, n, ctx->options.sign);
    const eits_real s = largest > lambda ? lambda / largest : 1;
    eits_real lane[8] = {0}, lane_l1[8] = {0};
    for (uint32_t j = 0; j < n; ++j) {
        const eits_real weight = lambda * eits_fabs(ctx->x[j]);
        const eits_real slack = eits_fma(-s * ctx->x[j], ctx->gradient[j], weight);
        lane[j % 8] += slack > 0 ? slack : 0; /* below zero by rounding only */
        lane_l1[j % 8] += weight;
    }
    certificate c;
    c.residual_squared = eits_dot(ctx, ctx->residual, ctx->residual, ctx->model->rank);
    c.gap = eits_fma(R(0.5) * (1 - s) * (1 - s), c.residual_squared, eits_tree8(lane));
    c.objective = eits_fma(R(0.5), c.residual_squared, eits_tree8(lane_l1));
    return c;
}

static void start_from_zero(eits_context *ctx)
{
    eits_zero(ctx->x, ctx->model->n_pixels);
    eits_zero(ctx->sx, EITS_STRIDE(ctx->model->rank));
}

/* The extrapolated point starts at x, momentum forgotten. */
static void restart_momentum(eits_context *ctx)
{
    eits_copy(ctx->z, ctx->x, ctx->model->n_pixels);
    eits_copy(ctx->sz, ctx->sx, EITS_STRIDE(ctx->model->rank));
}

static void swap(eits_real **a, eits_real **b)
{
    eits_real *kept = *a;
    *a = *b;
    *b = kept;
}

/* One iteration from z with the given step; returns the next momentum number. `known` says that gradient holds S'(y - S z). */
static eits_real iterate(eits_context *ctx, eits_real lambda, eits_real step, eits_real t, int known)
{
    if (!known) {
        ctx->info.macs += take_residual(ctx, ctx->sz);
        ctx->info.macs += apply_t(ctx, ctx->residual, ctx->gradient);
    }
    const eits_real t_next = R(0.5) * (1 + eits_sqrt(eits_fma(4 * t, t, 1)));
    const eits_real beta = (t - 1) / t_next;
    const eits_prox how = {.step = step, .threshold = step * lambda, .beta = beta, .sign = ctx->options.sign};
    ctx->kernels->prox(&how, ctx->model->n_pixels, ctx->gradient, ctx->x, ctx->x_next, ctx->z);
    ctx->info.nonzeros = eits_apply(ctx, ctx->x_next, ctx->sx_next);
    ctx->info.macs += (uint64_t)ctx->info.nonzeros * ctx->model->rank;
    const size_t stride = EITS_STRIDE(ctx->model->rank);
    for (size_t i = 0; i < stride; ++i)
        ctx->sz[i] = eits_fma(beta, ctx->sx_next[i] - ctx->sx[i], ctx->sx_next[i]);
    swap(&ctx->x, &ctx->x_next);
    swap(&ctx->sx, &ctx->sx_next);
    return t_next;
}

/* Iterate until the count or the gap; a rise of the objective above its start halves the step and starts over. */
static void run_fista(eits_context *ctx, eits_real lambda, int gradient_known)
{
    const eits_options *o = &ctx->options;
    const eits_real scale = R(0.5) * ctx->info.data_norm * ctx->info.data_norm;
    const eits_real ceiling = scale * (1 + R(1e-3)); /* at x = 0; above it nothing was won */
    eits_real step = 1 / (eits_real)ctx->model->lipschitz, t = 1;
    certificate c = {0};
    restart_momentum(ctx);
    ctx->info.stop = EITS_STOP_ITERATIONS;
    for (uint32_t k = 1; k <= o->iterations; ++k) {
        t = iterate(ctx, lambda, step, t, gradient_known);
        gradient_known = 0;
        ctx->info.iterations = k;
        if (k != o->iterations && k % o->gap_every != 0)
            continue;
        if (k != o->iterations && !(o->gap_rel > 0) && eits_dot(ctx, ctx->sx, ctx->sx, ctx->model->rank) <= 4 * 2 * scale)
            continue; /* |Sx| <= 2 |y| wherever the objective is below its value at zero */
        c = certify(ctx, lambda);
        if (!(c.objective <= ceiling)) {
            if (ctx->info.step_halvings == MAX_STEP_HALVINGS || k == o->iterations) {
                ctx->info.stop = EITS_STOP_DIVERGED;
                break;
            }
            ++ctx->info.step_halvings;
            step *= R(0.5);
            t = 1;
            start_from_zero(ctx);
            restart_momentum(ctx);
            continue;
        }
        if (o->gap_rel > 0 && c.gap <= o->gap_rel * scale) {
            ctx->info.stop = EITS_STOP_GAP;
            break;
        }
    }
    ctx->info.gap = c.gap;
    ctx->info.gap_rel = c.gap / scale;
    ctx->info.residual = eits_sqrt(c.residual_squared);
}

static eits_real choose_lambda(const eits_context *ctx)
{
    const eits_options *o = &ctx->options;
    if (o->lambda_abs > 0)
        return o->lambda_abs;
    const eits_real by_data = o->lambda_rel * ctx->info.lambda_max;
    const eits_real by_noise = o->lambda_noise_factor * ctx->baseline.lambda_noise;
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

/* Take up the last frame's coefficients, unless zero is the better start for this one. The sum S x belongs to an earlier
 * frame's numbers too, but is taken anew: it costs little, and rounding cannot gather over a million frames. */
static int warm_start(eits_context *ctx)
{
    const uint32_t count = eits_apply(ctx, ctx->x, ctx->sx);
    ctx->info.macs += (uint64_t)count * ctx->model->rank + take_residual(ctx, ctx->sx);
    eits_real l1 = 0;
    for (uint32_t j = 0; j < ctx->model->n_pixels; ++j)
        l1 += eits_fabs(ctx->x[j]);
    const eits_real twice = eits_fma(2 * ctx->info.lambda, l1, eits_dot(ctx, ctx->residual, ctx->residual, ctx->model->rank));
    return twice < ctx->info.data_norm * ctx->info.data_norm;
}

/* ctx->info holds what the frame stage counted, and zeros. */
static eits_status solve(eits_context *ctx)
{
    const eits_options *o = &ctx->options;
    const uint32_t rank = ctx->model->rank;
    ctx->info.data_norm = eits_sqrt(eits_dot(ctx, ctx->y, ctx->y, rank));
    ctx->info.lambda_noise = ctx->baseline.lambda_noise;
    ctx->info.macs += apply_t(ctx, ctx->y, ctx->gradient);
    ctx->info.lambda_max = eits_greatest(ctx->gradient, ctx->model->n_pixels, o->sign);
    ctx->info.lambda = choose_lambda(ctx);
    if (!eits_is_finite(ctx->info.data_norm) || !eits_is_finite(ctx->info.lambda_max)) {
        ctx->info.data_norm = ctx->info.lambda_max = ctx->info.lambda = 0;
        answer_zero(ctx, EITS_STOP_DIVERGED);
        return EITS_E_NOT_FINITE;
    }
    if (o->gate_factor > 0 && ctx->info.lambda_max < o->gate_factor * ctx->info.lambda_noise) {
        answer_zero(ctx, EITS_STOP_GATE);
        return EITS_OK;
    }
    if (!(ctx->info.lambda_max > ctx->info.lambda)) {
        answer_zero(ctx, EITS_STOP_ZERO);
        return EITS_OK;
    }
    const int warm = o->warm_start && ctx->warm && warm_start(ctx);
    if (!warm)
        start_from_zero(ctx);
    run_fista(ctx, ctx->info.lambda, !warm);
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
    return solve(ctx);
}

eits_status eits_reconstruct(eits_context *ctx, const eits_real *frame, size_t length, eits_real *image, eits_info *info)
{
    if (ctx == NULL || frame == NULL)
        return EITS_E_ARGUMENT;
    ctx->info = (eits_info){0};
    eits_status status = eits_frame_stage(ctx, frame, length, &ctx->info.masked, &ctx->info.macs);
    if (status == EITS_OK)
        status = solve(ctx);
    else
        answer_zero(ctx, EITS_STOP_GATE);
    if (image != NULL)
        eits_copy(image, ctx->image, ctx->model->n_pixels);
    if (info != NULL)
        *info = ctx->info;
    return status;
}
