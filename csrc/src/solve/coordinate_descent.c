/* Coordinate descent with the residual kept (Friedman et al., Ann. Appl. Stat. 1 (2007) 302,
 * doi 10.1214/07-AOAS131). A sweep goes over a list of columns: at a look, those that are not zero
 * or whose correlation with the residual exceeds lambda; then without those that stayed at zero.
 * The residual is kept within the directions that count, so a column's correlation needs no
 * projection; where at most one direction is ignored its part is kept apart and costs nothing
 * either. Where rows left out are whitened again (whitening.h) what is kept is F' of the residual.
 *
 * The step for coefficient j, all others fixed, is the exact minimum of a parabola plus lambda |x|:
 * x_j = shrink(|s_j|^2 x_j + s_j'r, lambda) / |s_j|^2. It needs no step length, so it also works
 * where a Lipschitz constant cannot be trusted; and it needs no factor, so the active set falls
 * back on it. A visit costs 2 rank multiply-accumulates where the coefficient stays, and as many
 * again where it moves.
 *
 * Invariant between visits: solver.residual = F'Q(y - F S x) up to the part along one ignored
 * direction, which `along` has. Updates gather rounding, so each look computes S x and the residual
 * again, and the gap is always that of the look. */
#include "base/vec.h"
#include "context/products.h"
#include "context/projection.h"
#include "frame/whitening.h"
#include "kernels/column.h"
#include "kernels/kernels.h"
#include "solve/constants.h"
#include "solve/solve.h"

typedef struct descent {
    eits_real lambda;
    /* where one direction is ignored: the residual's part along it, which solver.residual then
     * has too */
    eits_real along;
    eits_real *norm;  /* |s_j|^2; negative: not known yet */
    eits_real *slant; /* s_j along the direction ignored */
    int apart; /* at most one direction is ignored, and nothing is whitened for masked rows */
} descent;

static uint64_t macs_of_a_visit(const eits_context *ctx, const descent *d)
{
    const uint64_t rank = ctx->model->rank;
    if (ctx->whitening.form)
        return 3u * rank + 2u * eits_forward_macs(ctx) + eits_adjoint_macs(ctx);
    return rank * (d->apart ? 4u : 3u + 2u * ctx->projection.count);
}

/* Whether the limit of MACs leaves room for one more visit, S x with one more column, and the gap
 * after it. */
static int affords_visit(const eits_context *ctx, const descent *d)
{
    return eits_affords(ctx, macs_of_a_visit(ctx, d) +
                                 ((uint64_t)ctx->info.nonzeros + 1) * ctx->model->rank +
                                 eits_gradient_macs(ctx));
}

/* F s_j of a column. */
static eits_real *see(eits_context *ctx, const eits_real *column, eits_real scale)
{
    eits_real *seen = ctx->solver.sx_next;
    for (uint32_t i = 0; i < ctx->model->rank; ++i)
        seen[i] = scale * column[i];
    ctx->info.macs += eits_whiten(ctx, seen);
    return seen;
}

/* |F s_j|^2 and, where one direction is ignored, s_j's part along it. Found at a column's first
 * visit and valid for this solve alone, as F and the direction change with the rows in use. The
 * norm is that before the projection: at least as large as the exact one, hence a step that is
 * safe, if a little short. */
static void measure(eits_context *ctx, descent *d, uint32_t j, const eits_real *column,
                    eits_real scale)
{
    const uint32_t rank = ctx->model->rank;
    if (ctx->whitening.form) {
        const eits_real *seen = see(ctx, column, scale);
        d->norm[j] = eits_dot(ctx->kernels, seen, seen, rank);
        ctx->info.macs += rank;
        return;
    }
    d->norm[j] = scale * scale * eits_dot(ctx->kernels, column, column, rank);
    ctx->info.macs += rank;
    if (!d->apart || ctx->projection.count == 0)
        return;
    d->slant[j] = scale * eits_dot(ctx->kernels, column, ctx->projection.basis, rank);
    ctx->info.macs += rank;
}

/* Minimise over coefficient j alone, by a step for |s_j|^2 at least as large as that of its part
 * that counts, so that the objective cannot rise. Returns what the step is worth: |s_j|^2 step^2.
 */
static eits_real visit(eits_context *ctx, descent *d, uint32_t j)
{
    const eits_matrix *s = &ctx->model->sensitivity;
    const eits_real *column = eits_column(s, j, ctx->solver.sz), scale = eits_column_scale(s, j);
    const uint32_t rank = ctx->model->rank;
    /* Most columns are never visited, so norms are found when they are first needed. */
    if (d->norm[j] < 0)
        measure(ctx, d, j, column, scale);
    eits_real gradient = scale * eits_dot(ctx->kernels, column, ctx->solver.residual, rank);
    ctx->info.macs += rank;
    if (d->apart && ctx->projection.count == 1)
        gradient = eits_fma(-d->along, d->slant[j], gradient);
    const eits_real norm = d->norm[j], before = ctx->solver.x[j],
                    v = eits_fma(norm, before, gradient);
    const int up = ctx->options.sign != EITS_SIGN_DECREASE && v > d->lambda;
    const int down = ctx->options.sign != EITS_SIGN_INCREASE && v < -d->lambda;
    /* Soft threshold: the minimum of a parabola and lambda |x| along one axis. */
    const eits_real shrunk = up ? v - d->lambda : down ? v + d->lambda : 0;
    const eits_real after = norm > 0 ? shrunk / norm : 0, step = after - before;
    if (step == 0)
        return 0;
    ctx->solver.x[j] = after;
    ctx->info.nonzeros += (uint32_t)(after != 0) - (uint32_t)(before != 0);
    ctx->info.macs += rank;
    if (ctx->whitening.form) {
        eits_real *seen = see(ctx, column, scale);
        ctx->info.macs += eits_project(ctx, seen) + eits_adjoint_macs(ctx);
        eits_axpy(ctx->kernels, ctx->solver.residual, -step,
                  eits_adjoint(ctx, seen, ctx->solver.adjoint), rank);
        return norm * step * step;
    }
    eits_axpy(ctx->kernels, ctx->solver.residual, -step * scale, column, rank);
    if (!d->apart)
        ctx->info.macs += eits_project(ctx, ctx->solver.residual);
    else if (ctx->projection.count == 1)
        d->along = eits_fma(-step, d->slant[j], d->along);
    return norm * step * step;
}

typedef enum sweep_end { SWEEP_DONE, SWEEP_LIMIT } sweep_end;

/* One sweep; leaves columns out of the list that stayed at zero. *worth is the sum of what its
 * steps are worth. */
static sweep_end sweep(eits_context *ctx, descent *d, eits_real *worth)
{
    uint32_t count = 0, k = 0;
    *worth = 0;
    for (; k < ctx->solver.working_count && affords_visit(ctx, d); ++k) {
        const uint32_t j = ctx->solver.working[k];
        const eits_real won = visit(ctx, d, j);
        *worth += won;
        if (ctx->solver.x[j] != 0 || won != 0)
            ctx->solver.working[count++] = j;
    }
    const sweep_end end = k < ctx->solver.working_count ? SWEEP_LIMIT : SWEEP_DONE;
    ctx->solver.working_count = count;
    return end;
}

/* Compute S x, the residual and the gradient of every column again. */
static eits_duality_gap look(eits_context *ctx, const eits_scratch *scratch, descent *d)
{
    ctx->info.nonzeros = eits_apply(ctx, scratch, ctx->solver.x, ctx->solver.sx);
    ctx->info.macs += (uint64_t)ctx->info.nonzeros * ctx->model->rank;
    d->along = 0;
    return eits_find_duality_gap(ctx, d->lambda, EITS_LAYOUT_FULL);
}

/* All that are not zero, whether they move or not: only their sum tells when the sweep is at
 * rest. */
static void choose(eits_context *ctx, const descent *d)
{
    uint32_t count = 0;
    for (uint32_t j = 0; j < ctx->model->n_pixels; ++j) {
        ctx->solver.working[count] = j;
        count += ctx->solver.x[j] != 0 ||
                 eits_moves(ctx->solver.gradient[j], d->lambda, ctx->options.sign);
    }
    ctx->solver.working_count = count;
}

/* What all steps of a sweep are worth when only rounding moves: (8 epsilon |y|)^2. */
static eits_real rounding(const eits_context *ctx)
{
    return EITS_REST_EPSILONS * EITS_EPSILON * EITS_EPSILON * ctx->info.data_norm *
           ctx->info.data_norm;
}

/* Sweeps until a look is due: after sweep `last`, or once a sweep is worth little beside the first,
 * when a look is better. Returns 1 where the first moved nothing but by rounding: also what the
 * look brought in is at rest. */
static int descend(eits_context *ctx, descent *d, uint32_t last)
{
    eits_real first = 0, worth = 0;
    eits_copy(ctx->solver.residual, eits_adjoint(ctx, ctx->solver.residual, ctx->solver.adjoint),
              EITS_STRIDE(ctx->model->rank));
    ctx->info.macs += eits_adjoint_macs(ctx);
    for (int begun = 0; ctx->info.iterations < last && !(begun && worth <= EITS_SETTLED * first);
         begun = 1) {
        if (sweep(ctx, d, &worth) == SWEEP_LIMIT) {
            ctx->info.stop = EITS_STOP_MACS;
            return 0;
        }
        ++ctx->info.iterations;
        first = begun ? first : worth;
        if (!begun && worth <= rounding(ctx))
            return 1;
    }
    return 0;
}

void eits_run_coordinate(eits_context *ctx, const eits_scratch *scratch, eits_real lambda,
                         int gradient_known)
{
    const eits_options *o = &ctx->options;
    const eits_real scale = R(0.5) * ctx->info.data_norm * ctx->info.data_norm;
    const uint32_t end = o->iterations;
    descent d = {.lambda = lambda,
                 .norm = ctx->solver.z,
                 .slant = ctx->solver.x_next,
                 .apart = !ctx->whitening.form && ctx->projection.count <= 1};
    for (uint32_t j = 0; j < ctx->model->n_pixels; ++j)
        d.norm[j] = -1;
    eits_duality_gap c = {0};
    if (gradient_known) {
        eits_copy(ctx->solver.residual, ctx->frame.y, EITS_STRIDE(ctx->model->rank));
        c = eits_duality_gap_of(ctx, lambda, EITS_LAYOUT_FULL);
    } else {
        c = look(ctx, scratch, &d);
    }
    ctx->info.stop = EITS_STOP_ITERATIONS;
    /* Looks grow rare as in fista.c: EITS_LOOK_GROWTH times the interval each, unless a gap is to
     * be met. */
    uint32_t interval = o->gap_every;
    while (ctx->info.iterations < end) {
        choose(ctx, &d);
        if (!affords_visit(ctx, &d)) {
            ctx->info.stop = EITS_STOP_MACS;
            break;
        }
        const uint32_t done = ctx->info.iterations,
                       due = interval < end - done ? done + interval : end;
        const int resting = descend(ctx, &d, due);
        c = look(ctx, scratch, &d);
        if (!(c.objective <= eits_ceiling(ctx))) {
            ctx->info.stop = EITS_STOP_DIVERGED;
            break;
        }
        if (ctx->info.stop == EITS_STOP_MACS)
            break;
        if (o->gap_rel > 0 && c.gap <= o->gap_rel * scale) {
            ctx->info.stop = EITS_STOP_GAP;
            break;
        }
        if (resting) {
            ctx->info.stop = EITS_STOP_OPTIMUM;
            break;
        }
        interval = o->gap_rel > 0 || interval > UINT32_MAX / (2 * EITS_LOOK_GROWTH)
                       ? interval
                       : EITS_LOOK_GROWTH * interval;
    }
    eits_report_duality_gap(ctx, c);
}
