/* FISTA (Beck and Teboulle, SIAM J. Imaging Sci. 2 (2009) 183, doi 10.1137/080716542) with
 * non-negative, non-positive or signed shrinkage; eitskin/solve.h has the problem.
 *
 *     x'   = shrink(z + S'F'(y - F S z) / L, lambda / L)
 *     t'   = (1 + sqrt(1 + 4 t^2)) / 2,  beta = (t - 1) / t'
 *     z'   = x' + beta (x' - x)
 *
 * L is the model's Lipschitz constant. It is computed once when the model is built, so that no line
 * search runs on the board. Because the model is whitened, the step 1 / L is good in every
 * direction.
 *
 * An iteration costs one product with S' (every column, or the working set) and one with S (the
 * non-zeros alone), n_pixels x rank and nonzeros x rank multiply-accumulates. S z is extrapolated
 * from S x as z is from x. F S x is subtracted from y each time: a residual that is updated instead
 * accumulates rounding errors.
 *
 * L may still be too small, in a model from another program or one whose S was rounded to few bits.
 * Then the iteration diverges. A cheap test of |S x| detects that, and the gap confirms it. The
 * solve then starts again from zero with half the step, at most eight times; after that,
 * EITS_STOP_DIVERGED reports a useless model.
 *
 * Invariants: at the start of each iteration sx = S x and sz = S z. x and x_next, and sx and
 * sx_next, swap pointers instead of contents (bring_home undoes it). With a working set, all
 * vectors by pixel are lists over it. Otherwise both modes run the same code, and they give the
 * same bits if the set is chosen in every iteration. */
#include "base/vec.h"
#include "context/products.h"
#include "frame/whitening.h"
#include "kernels/kernels.h"
#include "solve/constants.h"
#include "solve/solve.h"

static int by_working_set(const eits_context *ctx)
{
    return ctx->options.solver == EITS_SOLVER_WORKING_SET;
}

/* Return the number of coefficients in x, x_next and z. */
static uint32_t working_size(const eits_context *ctx)
{
    return by_working_set(ctx) ? ctx->solver.working_count : ctx->model->n_pixels;
}

/* Compute the gradient of the working set's columns alone; the residual is that of
 * eits_take_gradient. */
static void take_working_gradient(eits_context *ctx, const eits_real *sx)
{
    ctx->info.macs += eits_take_residual(ctx, sx);
    eits_apply_t_working(ctx, eits_adjoint(ctx, ctx->solver.residual, ctx->solver.adjoint),
                         ctx->solver.gradient);
    ctx->info.macs +=
        (uint64_t)ctx->solver.working_count * ctx->model->rank + eits_adjoint_macs(ctx);
}

/* Start the extrapolated point at x, without momentum. */
static void restart_momentum(eits_context *ctx)
{
    eits_copy(ctx->solver.z, ctx->solver.x, working_size(ctx));
    eits_copy(ctx->solver.sz, ctx->solver.sx, EITS_STRIDE(ctx->model->rank));
}

/* After a step that was too long, the last x may be any point, even infinite. Zero is the only
 * point that is known to be good. */
static void start_over_from_zero(eits_context *ctx)
{
    ctx->solver.working_count = 0;
    ctx->info.nonzeros = 0;
    eits_zero(ctx->solver.x, ctx->model->n_pixels);
    eits_zero(ctx->solver.sx, EITS_STRIDE(ctx->model->rank));
    restart_momentum(ctx);
}

static void swap(eits_real **a, eits_real **b)
{
    eits_real *kept = *a;
    *a = *b;
    *b = kept;
}

/* Return 1 if the limit of multiply-accumulates leaves room for S x_next and the gap after it. */
static int affords_product(const eits_context *ctx)
{
    if (ctx->options.mac_limit == 0)
        return 1;
    uint64_t count = 0;
    for (uint32_t k = 0; k < working_size(ctx); ++k)
        count += ctx->solver.x_next[k] != 0;
    return eits_affords(ctx, count * ctx->model->rank + eits_gradient_macs(ctx));
}

/* Make one iteration from z with the given step; solver.gradient is the gradient at z, and *t is
 * the momentum number t. Returns 0 if the limit of multiply-accumulates does not allow it; x is
 * then unchanged. */
static int iterate(eits_context *ctx, const eits_scratch *scratch, eits_real lambda, eits_real step,
                   eits_real *t)
{
    const eits_real t_next = R(0.5) * (1 + eits_sqrt(eits_fma(4 * *t, *t, 1)));
    const eits_real beta = (*t - 1) / t_next;
    const eits_prox how = {
        .step = step, .threshold = step * lambda, .beta = beta, .sign = ctx->options.sign};
    ctx->kernels->prox(&how, working_size(ctx), ctx->solver.gradient, ctx->solver.x,
                       ctx->solver.x_next, ctx->solver.z);
    if (!affords_product(ctx))
        return 0;
    ctx->info.nonzeros =
        by_working_set(ctx)
            ? eits_apply_working(ctx, scratch, ctx->solver.x_next, ctx->solver.sx_next)
            : eits_apply(ctx, scratch, ctx->solver.x_next, ctx->solver.sx_next);
    ctx->info.macs += (uint64_t)ctx->info.nonzeros * ctx->model->rank;
    /* S z follows from S x as z follows from x, because S is linear. This saves a product. */
    ctx->kernels->extrapolate(ctx->solver.sz, beta, ctx->solver.sx_next, ctx->solver.sx,
                              EITS_STRIDE(ctx->model->rank));
    swap(&ctx->solver.x, &ctx->solver.x_next);
    swap(&ctx->solver.sx, &ctx->solver.sx_next);
    *t = t_next;
    return 1;
}

/* When the working set is updated. The first look at every column comes after gap_every iterations,
 * the next after EITS_LOOK_GROWTH times as many, and so on, because early looks matter most. If a
 * gap is to be reached, each look comes after gap_every iterations. In between, columns at rest are
 * left out every few iterations. */
typedef struct schedule {
    uint32_t next_look, interval;
} schedule;

static int looks_at_every_column(const eits_context *ctx, uint32_t k, const schedule *s)
{
    return !by_working_set(ctx) || k >= s->next_look;
}

/* Return 1 if the limit of multiply-accumulates leaves room for the gradient of iteration k and the
 * gap after it. */
static int affords_gradient(const eits_context *ctx, uint32_t k, const schedule *s)
{
    const uint64_t total = eits_gradient_macs(ctx);
    const uint64_t some = (uint64_t)ctx->solver.working_count * ctx->model->rank +
                          eits_forward_macs(ctx) + eits_adjoint_macs(ctx);
    return eits_affords(ctx, total + (looks_at_every_column(ctx, k, s) ? total : some));
}

/* Compute the gradient at z for iteration k (from 1): of every column, or of the working set.
 */
static void prepare_gradient(eits_context *ctx, const eits_scratch *scratch, eits_real lambda,
                             uint32_t k, schedule *s, int known)
{
    if (looks_at_every_column(ctx, k, s)) {
        if (!known)
            eits_take_gradient(ctx, ctx->solver.sz);
        if (!by_working_set(ctx))
            return;
        eits_working_set_choose(ctx, scratch, lambda);
        s->next_look = s->interval < UINT32_MAX - k ? k + s->interval : UINT32_MAX;
        s->interval = ctx->options.gap_rel > 0 || s->interval > UINT32_MAX / EITS_LOOK_GROWTH / 2
                          ? s->interval
                          : EITS_LOOK_GROWTH * s->interval;
        return;
    }
    take_working_gradient(ctx, ctx->solver.sz);
    if (k % EITS_PRUNE_EVERY == 1)
        eits_working_set_prune(ctx, lambda);
}

/* Iterate until one of four ends: the number of iterations, the gap, the multiply-accumulates, or
 * divergence.
 *
 * The limit of multiply-accumulates is checked before each product, and the cost of the gap at the
 * end is reserved, so a solve that is cut short still has its gap. If the limit is reached, the
 * last complete x is the result. */
static void iterate_to_the_end(eits_context *ctx, const eits_scratch *scratch, eits_real lambda,
                               int gradient_known)
{
    const eits_options *o = &ctx->options;
    const eits_layout layout = by_working_set(ctx) ? EITS_LAYOUT_WORKING : EITS_LAYOUT_FULL;
    const eits_real scale = R(0.5) * ctx->info.data_norm * ctx->info.data_norm;
    const eits_real ceiling = eits_ceiling(ctx);
    eits_real step = 1 / (eits_real)ctx->model->lipschitz, t = 1;
    eits_duality_gap c = {0};
    int gap_known = 0; /* 1: c belongs to the present x */
    /* The active set may have spent iterations before FISTA continues its solve. */
    const uint32_t first = ctx->info.iterations + 1;
    schedule looks = {.next_look = first, .interval = o->gap_every};
    restart_momentum(ctx);
    ctx->info.stop = EITS_STOP_ITERATIONS;
    for (uint32_t k = first; k <= o->iterations; ++k) {
        const int known = gradient_known && k == 1;
        if (!known && !affords_gradient(ctx, k, &looks))
            ctx->info.stop = EITS_STOP_MACS;
        else
            prepare_gradient(ctx, scratch, lambda, k, &looks, known);
        if (ctx->info.stop == EITS_STOP_MACS || !iterate(ctx, scratch, lambda, step, &t)) {
            ctx->info.stop = EITS_STOP_MACS;
            break;
        }
        ctx->info.iterations = k;
        gap_known = 0;
        if (k != o->iterations && k % o->gap_every != 0)
            continue;
        /* The gap costs a whole gradient. It is computed at the end, at the interval of
         * options.gap_every if a gap is asked for, and when |S x| shows that the objective may have
         * risen. */
        const int none = ctx->info.nonzeros == 0;
        if (k != o->iterations && !(o->gap_rel > 0) && !none &&
            eits_dot(ctx->kernels, ctx->solver.sx, ctx->solver.sx, ctx->model->rank) <=
                4 * 2 * scale)
            continue; /* if the objective is below its value at zero, then |S x| <= 2 |y| */
        c = eits_find_duality_gap(ctx, lambda, layout);
        gap_known = 1;
        /* a step that is too long may also drive all coefficients beyond their sign, to zero; then
         * the gap is that of the start */
        if (!(c.objective <= ceiling) || (none && c.gap > EITS_MAX_RISE * scale)) {
            if (ctx->info.step_halvings == EITS_MAX_STEP_HALVINGS || k == o->iterations) {
                ctx->info.stop = EITS_STOP_DIVERGED;
                break;
            }
            ++ctx->info.step_halvings;
            step *= R(0.5);
            t = 1;
            start_over_from_zero(ctx);
            /* With the shorter step everything begins again, including the schedule; only the count
             * of iterations continues. */
            looks = (schedule){.next_look = k + 1, .interval = o->gap_every};
            c = eits_duality_gap_at_zero(ctx, lambda);
            continue;
        }
        if (o->gap_rel > 0 && c.gap <= o->gap_rel * scale) {
            ctx->info.stop = EITS_STOP_GAP;
            break;
        }
    }
    if (ctx->info.stop == EITS_STOP_MACS && !gap_known) {
        c = ctx->info.iterations == 0 && gradient_known
                ? eits_duality_gap_at_zero(ctx, lambda)
                : eits_find_duality_gap(ctx, lambda, layout);
        if (!(c.objective <= ceiling))
            ctx->info.stop = EITS_STOP_DIVERGED;
    }
    eits_report_duality_gap(ctx, c);
}

/* x and x_next were swapped in each iteration. Copy x back if it is in x_next, which is only
 * borrowed. */
static void bring_home(eits_context *ctx, eits_real *home)
{
    if (ctx->solver.x == home)
        return;
    swap(&ctx->solver.x, &ctx->solver.x_next);
    eits_copy(ctx->solver.x, ctx->solver.x_next, ctx->model->n_pixels);
}

void eits_run_fista(eits_context *ctx, const eits_scratch *scratch, eits_real lambda,
                    int gradient_known)
{
    /* x must be in its own memory after the solve. */
    eits_real *const home = ctx->solver.x;
    ctx->solver.working_count = 0;
    if (by_working_set(ctx) && !gradient_known) /* a warm start */
        eits_working_set_begin(ctx);
    iterate_to_the_end(ctx, scratch, lambda, gradient_known);
    if (by_working_set(ctx))
        eits_working_set_end(ctx);
    bring_home(ctx, home);
}
