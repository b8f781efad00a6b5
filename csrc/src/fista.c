/* FISTA with non-negative, non-positive or signed shrinkage; solve.h has the problem and its source. */
#include "fista.h"

#include "kernels.h"
#include "stages.h"
#include "vec.h"

enum { MAX_STEP_HALVINGS = 8 };

uint64_t eits_take_residual(eits_context *ctx, const eits_real *sx)
{
    const size_t stride = EITS_STRIDE(ctx->model->rank);
    eits_copy(ctx->residual, ctx->y, stride);
    eits_axpy(ctx, ctx->residual, -1, sx, stride);
    return eits_project(ctx, ctx->residual);
}

static int by_working_set(const eits_context *ctx)
{
    return ctx->options.solver == EITS_SOLVER_WORKING_SET;
}

/* How many coefficients x, x_next and z hold. */
static uint32_t held(const eits_context *ctx)
{
    return by_working_set(ctx) ? ctx->working_count : ctx->model->n_pixels;
}

/* gradient = S'(y - sx), of every column. */
static void take_gradient(eits_context *ctx, const eits_real *sx)
{
    ctx->info.macs += eits_take_residual(ctx, sx);
    eits_apply_t(ctx, ctx->residual, ctx->gradient);
    ctx->info.macs += (uint64_t)ctx->model->n_pixels * ctx->model->rank;
}

static void take_working_gradient(eits_context *ctx, const eits_real *sx)
{
    ctx->info.macs += eits_take_residual(ctx, sx);
    eits_apply_t_working(ctx, ctx->residual, ctx->gradient);
    ctx->info.macs += (uint64_t)ctx->working_count * ctx->model->rank;
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
    take_gradient(ctx, ctx->sx);
    const eits_real largest = eits_greatest(ctx->gradient, ctx->model->n_pixels, ctx->options.sign);
    const eits_real s = largest > lambda ? lambda / largest : 1;
    const uint32_t count = held(ctx);
    eits_real lane[8] = {0}, lane_l1[8] = {0};
    for (uint32_t k = 0; k < count; ++k) { /* columns that are not held add zero to their lanes */
        const uint32_t j = by_working_set(ctx) ? ctx->working[k] : k;
        const eits_real weight = lambda * eits_fabs(ctx->x[k]);
        const eits_real slack = eits_fma(-s * ctx->x[k], ctx->gradient[j], weight);
        lane[j % 8] += slack > 0 ? slack : 0; /* below zero by rounding only */
        lane_l1[j % 8] += weight;
    }
    certificate c;
    c.residual_squared = eits_dot(ctx, ctx->residual, ctx->residual, ctx->model->rank);
    c.gap = eits_fma(R(0.5) * (1 - s) * (1 - s), c.residual_squared, eits_tree8(lane));
    c.objective = eits_fma(R(0.5), c.residual_squared, eits_tree8(lane_l1));
    return c;
}

/* The extrapolated point starts at x, momentum forgotten. */
static void restart_momentum(eits_context *ctx)
{
    eits_copy(ctx->z, ctx->x, held(ctx));
    eits_copy(ctx->sz, ctx->sx, EITS_STRIDE(ctx->model->rank));
}

static void start_over_from_zero(eits_context *ctx)
{
    ctx->working_count = 0;
    eits_zero(ctx->x, ctx->model->n_pixels);
    eits_zero(ctx->sx, EITS_STRIDE(ctx->model->rank));
    restart_momentum(ctx);
}

static void swap(eits_real **a, eits_real **b)
{
    eits_real *kept = *a;
    *a = *b;
    *b = kept;
}

/* One iteration from z with the given step, ctx->gradient being that at z; returns the next momentum number. */
static eits_real iterate(eits_context *ctx, eits_real lambda, eits_real step, eits_real t)
{
    const eits_real t_next = R(0.5) * (1 + eits_sqrt(eits_fma(4 * t, t, 1)));
    const eits_real beta = (t - 1) / t_next;
    const eits_prox how = {.step = step, .threshold = step * lambda, .beta = beta, .sign = ctx->options.sign};
    ctx->kernels->prox(&how, held(ctx), ctx->gradient, ctx->x, ctx->x_next, ctx->z);
    ctx->info.nonzeros = by_working_set(ctx) ? eits_apply_working(ctx, ctx->x_next, ctx->sx_next)
                                             : eits_apply(ctx, ctx->x_next, ctx->sx_next);
    ctx->info.macs += (uint64_t)ctx->info.nonzeros * ctx->model->rank;
    const size_t stride = EITS_STRIDE(ctx->model->rank);
    for (size_t i = 0; i < stride; ++i)
        ctx->sz[i] = eits_fma(beta, ctx->sx_next[i] - ctx->sx[i], ctx->sx_next[i]);
    swap(&ctx->x, &ctx->x_next);
    swap(&ctx->sx, &ctx->sx_next);
    return t_next;
}

/* When the working set is looked after: a look at every column after gap_every iterations, then after LOOK_GROWTH times as many,
 * and so on: early looks matter, later ones change little; where a gap is to be reached, always after gap_every. In between,
 * columns at rest are left out every few iterations. */
typedef struct schedule {
    uint32_t next_look, interval;
} schedule;

enum { PRUNE_EVERY = 5, LOOK_GROWTH = 6 };

/* The gradient at z for iteration k (from 1): of every column, or of the working set as it is then. */
static void prepare_gradient(eits_context *ctx, eits_real lambda, uint32_t k, schedule *s, int known)
{
    if (!by_working_set(ctx)) {
        if (!known)
            take_gradient(ctx, ctx->sz);
        return;
    }
    if (k >= s->next_look) {
        if (!known)
            take_gradient(ctx, ctx->sz);
        eits_working_set_choose(ctx, lambda);
        s->next_look = k + s->interval;
        s->interval = ctx->options.gap_rel > 0 || s->interval > UINT32_MAX / LOOK_GROWTH / 2 ? s->interval : LOOK_GROWTH * s->interval;
        return;
    }
    take_working_gradient(ctx, ctx->sz);
    if (k % PRUNE_EVERY == 1)
        eits_working_set_prune(ctx, lambda);
}

static void iterate_to_the_end(eits_context *ctx, eits_real lambda, int gradient_known)
{
    const eits_options *o = &ctx->options;
    const eits_real scale = R(0.5) * ctx->info.data_norm * ctx->info.data_norm;
    const eits_real ceiling = scale * (1 + R(1e-3)); /* at x = 0; above it nothing was won */
    eits_real step = 1 / (eits_real)ctx->model->lipschitz, t = 1;
    certificate c = {0};
    schedule looks = {.next_look = 1, .interval = o->gap_every};
    restart_momentum(ctx);
    ctx->info.stop = EITS_STOP_ITERATIONS;
    for (uint32_t k = 1; k <= o->iterations; ++k) {
        prepare_gradient(ctx, lambda, k, &looks, gradient_known && k == 1);
        t = iterate(ctx, lambda, step, t);
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
            start_over_from_zero(ctx);
            looks = (schedule){.next_look = k + 1, .interval = o->gap_every};
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

void eits_run_fista(eits_context *ctx, eits_real lambda, int gradient_known)
{
    ctx->working_count = 0;
    if (by_working_set(ctx) && !gradient_known) /* a warm start */
        eits_working_set_begin(ctx);
    iterate_to_the_end(ctx, lambda, gradient_known);
    if (by_working_set(ctx))
        eits_working_set_end(ctx);
}
