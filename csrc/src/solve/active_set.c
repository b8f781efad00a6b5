/* The active set method finds the exact optimum over a few columns, by Newton's step on a factor of
 * their products. Then columns join whose correlation exceeds lambda and is the greatest among
 * their neighbours in the image. This repeats until no column is missing. Between two looks at
 * every column, the method looks only at the neighbours of columns that have been active (Lawson
 * and Hanson, Solving Least Squares Problems, 1974, chapter 23, with several columns at a time).
 * Each step keeps signs and lowers the objective. A column that depends on the active ones moves
 * together with them, along the direction that leaves S x unchanged, until one of them is zero and
 * is dropped. So the factor never has more rows than there are directions.
 *
 * Why it exists beside FISTA: FISTA approaches the optimum; this method ends at it and reports that
 * (EITS_STOP_OPTIMUM). With the few columns of a sparse optimum the steps are cheap; the look at
 * every column, once per round, is expensive: n_pixels x rank multiply-accumulates. Therefore there
 * are looks at the neighbours of the active columns alone, and rounds that add several columns at
 * once.
 *
 * On the active columns A with signs g the objective is a parabola, with the optimum at
 * S_A'(y - S_A x_A) = lambda g. "pull" is the difference of the two sides; Newton's step is
 * G^-1 pull (active_columns.c). Scaling the step by t scales the pulls by 1 - t, so they need no
 * product within a round.
 *
 * Invariants: working[] with x[], sign[], pull[] are parallel lists, in no order of columns; the
 * factor's column k belongs to working[k]; an active coefficient never has the sign opposite to
 * sign[k]. Three flags end the rounds: limited (multiply-accumulates spent), loose (a column is
 * active that the factor lacks) and broken (a step that is not finite). After the latter two, FISTA
 * continues from the coefficients reached, since it needs no factor. */
#include "base/vec.h"
#include "context/products.h"
#include "frame/whitening.h"
#include "solve/active_columns.h"
#include "solve/constants.h"
#include "solve/solve.h"

/* Return the fraction of its step that coefficient k can go; 2 if it keeps its sign to the end.
 *
 * A coefficient that would change its sign stops at zero: beyond zero lambda |x| has another slope,
 * and the step no longer leads to the optimum. */
static eits_real reach(const eits_context *ctx, const eits_active *a, uint32_t k)
{
    const eits_real x = ctx->solver.x[k], target = x + a->step[k];
    if (a->sign[k] * target > 0)
        return 2;
    return x == 0 ? 0 : -x / a->step[k];
}

/* Make Newton's step to the optimum of the active columns, and repeat it without the columns that
 * would change sign. All coefficients go the same fraction of their steps: that of the first one
 * which reaches zero. The objective falls all along this step; if coefficients moved separately, it
 * might not. Each turn drops a column or ends. */
static void settle(eits_context *ctx, eits_active *a)
{
    while (ctx->solver.working_count > 0) {
        const uint32_t count = ctx->solver.working_count;
        if (!eits_active_affords(ctx, a, eits_factor_macs(count)))
            return;
        eits_factor_solve(ctx, count, a->pull, a->work, a->step);
        ctx->info.macs += eits_factor_macs(count);
        if (!eits_all_finite(a->step, count)) {
            a->broken = 1;
            return;
        }
        eits_real fraction = 1;
        for (uint32_t k = 0; k < count; ++k) {
            a->reach[k] = reach(ctx, a, k);
            fraction = a->reach[k] < fraction ? a->reach[k] : fraction;
        }
        for (uint32_t k = 0; k < count; ++k) {
            ctx->solver.x[k] += fraction * a->step[k];
            a->pull[k] *= 1 - fraction;
        }
        a->moved = a->moved || fraction > 0;
        uint32_t dropped = 0;
        for (uint32_t k = count; k-- > 0;) {
            if (a->reach[k] <= fraction) { /* the last column, which moves to this place, does not
                                              end its step here */
                eits_active_drop(ctx, a, k);
                ++dropped;
            }
        }
        if (dropped == 0 || a->limited)
            return;
    }
}

/* Take the pulls of the active columns from solver.gradient, and set it to zero for them. Returns
 * the greatest pull. */
static eits_real take_pulls(eits_context *ctx, eits_active *a)
{
    eits_real greatest = 0;
    for (uint32_t k = 0; k < ctx->solver.working_count; ++k) {
        eits_real *g = &ctx->solver.gradient[ctx->solver.working[k]];
        a->pull[k] = *g - a->sign[k] * a->lambda;
        greatest = eits_larger(eits_fabs(a->pull[k]), greatest);
        *g = 0;
    }
    return greatest;
}

/* S x is computed again from x instead of updated along the steps: the gap is a bound only if it
 * belongs to the x that is returned. */
static eits_duality_gap check_gap(eits_context *ctx, const eits_scratch *scratch,
                                  const eits_active *a)
{
    ctx->info.nonzeros = eits_apply_working(ctx, scratch, ctx->solver.x, ctx->solver.sx);
    ctx->info.macs += (uint64_t)ctx->info.nonzeros * ctx->model->rank;
    return eits_find_duality_gap(ctx, a->lambda, EITS_LAYOUT_WORKING);
}

static void start_over_from_zero(eits_context *ctx)
{
    ctx->solver.working_count = 0;
    ctx->info.nonzeros = 0;
    eits_zero(ctx->solver.x, ctx->model->n_pixels);
    eits_zero(ctx->solver.sx, EITS_STRIDE(ctx->model->rank));
}

/* Add the first `missing` columns of the list, and step to the optimum with them. Returns 1 if any
 * coefficient changed.
 *
 * A column that has no row in the factor ends the round, because no step may be based on it. */
static int take_in(eits_context *ctx, const eits_scratch *scratch, eits_active *a, uint32_t missing)
{
    a->moved = 0;
    for (uint32_t k = 0; k < missing && !a->limited && !a->loose; ++k)
        eits_active_add(ctx, a, scratch->index[k]);
    if (!a->loose)
        settle(ctx, a);
    return a->moved;
}

/* The next columns to join are mostly neighbours of columns that are or were active, so look only
 * there. *objective is the last known objective. Returns 1 if any coefficient changed. */
static int look_nearby(eits_context *ctx, const eits_scratch *scratch, eits_active *a,
                       eits_real *objective)
{
    const uint64_t rank = ctx->model->rank;
    if (a->limited || a->loose || a->broken ||
        !eits_affords(ctx, ctx->solver.working_count * rank + eits_forward_macs(ctx) +
                               eits_macs_to_finish(ctx, ctx->solver.working_count)))
        return 0;
    ctx->info.macs += rank * eits_apply_working(ctx, scratch, ctx->solver.x, ctx->solver.sx);
    ctx->info.macs += eits_take_residual(ctx, ctx->solver.sx);
    eits_real l1 = 0;
    for (uint32_t k = 0; k < ctx->solver.working_count; ++k)
        l1 += eits_fabs(ctx->solver.x[k]);
    const eits_real now = R(0.5) * eits_dot(ctx->kernels, ctx->solver.residual,
                                            ctx->solver.residual, ctx->model->rank) +
                          a->lambda * l1;
    if (!(now < *objective * (1 - EITS_WORTHWHILE)))
        return 0;
    *objective = now;
    eits_nearby_add(ctx, &a->near);
    if (!eits_affords(ctx, a->near.count * rank + eits_adjoint_macs(ctx) +
                               eits_macs_to_finish(ctx, ctx->solver.working_count)))
        return 0;
    eits_take_gradient_nearby(ctx, scratch, &a->near);
    (void)take_pulls(ctx, a);
    const uint32_t missing = eits_list_violations(ctx, scratch, a->lambda + a->tolerance, &a->near);
    return missing > 0 && take_in(ctx, scratch, a, missing);
}

/* Make one round; *c becomes the duality gap after it. */
static int round_of(eits_context *ctx, const eits_scratch *scratch, eits_active *a,
                    uint32_t missing, eits_duality_gap *c)
{
    eits_real objective = c->objective;
    ++ctx->info.iterations;
    const int moved = take_in(ctx, scratch, a, missing);
    for (int looks = 0;
         moved && looks < EITS_LOOKS_NEARBY && look_nearby(ctx, scratch, a, &objective); ++looks)
        ;
    if (moved)
        *c = check_gap(ctx, scratch, a);
    return moved;
}

/* Rounds until something ends them. Returns 0 if the factor failed and FISTA has to continue.
 *
 * At the level of rounding the objective no longer falls, although columns still seem to violate
 * the conditions. The first such round is repeated with the worst column alone, because several at
 * once may undo each other. After the second one, the result is the optimum within the precision of
 * the numbers. */
static int rounds(eits_context *ctx, const eits_scratch *scratch, eits_active *a,
                  eits_duality_gap *c)
{
    const eits_options *o = &ctx->options;
    const eits_real enough = o->gap_rel * R(0.5) * ctx->info.data_norm * ctx->info.data_norm;
    for (int stalls = 0;;) {
        if (o->gap_rel > 0 && c->gap <= enough) {
            ctx->info.stop = EITS_STOP_GAP;
            return 1;
        }
        if (ctx->info.iterations == o->iterations) {
            ctx->info.stop = EITS_STOP_ITERATIONS;
            return 1;
        }
        const eits_real pull = take_pulls(ctx, a), before = c->objective;
        const uint32_t missing = eits_list_violations(ctx, scratch, a->lambda + a->tolerance, NULL);
        if (stalls == EITS_MAX_STALLS || (missing == 0 && pull <= a->tolerance)) {
            ctx->info.stop = EITS_STOP_OPTIMUM;
            return 1;
        }
        /* After a stall at most one column is added: the one with the greatest violation. */
        const uint32_t added = stalls > 0 && missing > 1 ? 1 : missing;
        const int moved = round_of(ctx, scratch, a, added, c);
        if (a->broken || (a->loose && !a->limited) ||
            !(c->objective <= before * (1 + EITS_MAX_RISE)))
            return 0;
        if (a->limited) {
            ctx->info.stop = EITS_STOP_MACS;
            return 1;
        }
        stalls = c->objective < before * (1 - EITS_EPSILON) ? 0 : stalls + 1;
        if (!moved) /* the gradient is as it was, but for the active columns, set to zero */
            stalls = EITS_MAX_STALLS;
    }
}

void eits_run_active_set(eits_context *ctx, const eits_scratch *scratch, eits_real lambda,
                         int gradient_known)
{
    const uint32_t free = ctx->model->rank - ctx->projection.count;
    eits_active a = {.lambda = lambda,
                     .max = free < ctx->model->n_pixels ? free : ctx->model->n_pixels};
    /* Rounding of a correlation is about epsilon |s_j| |y|, and |s_j|^2 at most the Lipschitz
     * constant. */
    a.tolerance = EITS_TOLERANCE_EPSILONS * EITS_EPSILON *
                  eits_sqrt((eits_real)ctx->model->lipschitz) * ctx->info.data_norm;
    a.pull = scratch->row[5], a.sign = scratch->row[6], a.work = scratch->row[7],
    a.step = ctx->solver.sz;
    a.reach = ctx->solver.x_next, a.column = ctx->solver.sx_next;
    a.near = eits_nearby_none(ctx);
    eits_duality_gap c;
    /* the set changes column by column, so unpacked copies would be out of date at once */
    ctx->solver.working_count = ctx->solver.working_cached = 0;
    if (gradient_known) {
        eits_copy(ctx->solver.residual, ctx->frame.y, EITS_STRIDE(ctx->model->rank));
        c = eits_duality_gap_of(ctx, lambda, EITS_LAYOUT_WORKING);
    } else if (eits_active_begin_warm(ctx, &a)) {
        c = check_gap(ctx, scratch, &a);
        if (!(c.objective < eits_ceiling(ctx))) {
            start_over_from_zero(ctx);
            c = eits_find_duality_gap(ctx, lambda, EITS_LAYOUT_WORKING);
        }
    } else {
        ctx->info.stop = EITS_STOP_MACS;
        eits_report_duality_gap(ctx, eits_find_duality_gap(ctx, lambda, EITS_LAYOUT_FULL));
        return;
    }
    const int done = rounds(ctx, scratch, &a, &c);
    if (!done && !(eits_all_finite(ctx->solver.x, ctx->solver.working_count) &&
                   c.objective <= eits_ceiling(ctx)))
        start_over_from_zero(ctx);
    eits_working_set_end(ctx);
    if (done) {
        eits_report_duality_gap(ctx, c);
        return;
    }
    /* This is the cost of FISTA's first gradient, and of the gap after it. */
    const int affordable = eits_affords(ctx, 2 * eits_gradient_macs(ctx));
    if (affordable && ctx->info.iterations < ctx->options.iterations) {
        eits_run_fista(ctx, scratch, lambda, 0);
        return;
    }
    ctx->info.stop = affordable ? EITS_STOP_ITERATIONS : EITS_STOP_MACS;
    eits_report_duality_gap(ctx,
                            ctx->info.nonzeros == 0 ? eits_duality_gap_at_zero(ctx, lambda) : c);
}
