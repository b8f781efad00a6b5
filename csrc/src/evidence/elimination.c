/* Which discs stay: backward elimination by likelihood ratio.
 *
 * The discs as fitted are linearised once; the linearisation tells what F would rise by without
 * each. Where every rise is far above the threshold and no two discs are near each other, nothing
 * else is done. Else the discs are fitted to the data in Sigma's metric, and so are the likeliest
 * of the simpler answers: the weakest disc left out, near pairs as one. The simpler one is taken
 * while F rises by less than the threshold, times what the data fit worse than they should: where
 * the model is wrong by more than it says, more is asked of a touch.
 *
 * As soon as the data are found not to fit, the same is done for a sheet that has drifted since its
 * reference (+ D). The likelier of the two stands, by F + threshold n + log det Sigma: allowing for
 * a drift that is not there would cost light touches. What has no drift is gone on with only where
 * F as it is leaves it a chance.
 *
 * At last what its shape says to be two rather than one is tried as two. */
#include "evidence/evidence.h"

#include "base/vec.h"
#include "evidence/constants.h"
#include "kernels/kernels.h"

/* One hypothesis's answer, and what is known of each disc of it. */
typedef struct verdict {
    eits_answer answer;
    eits_real log_determinant; /* of Sigma */
    eits_real rise[EITS_MAX_TOUCHES];
    eits_real place_mm2[EITS_MAX_TOUCHES][3];
    eits_real best_mm[EITS_MAX_TOUCHES][2]; /* where the linearisation has the disc */
    eits_real pair[EITS_MAX_TOUCHES];       /* log odds that it is two (pair.c) */
    eits_real line[EITS_MAX_TOUCHES][2];    /* on which two in its place would lie */
    eits_real axis[EITS_MAX_TOUCHES][2];    /* half of its long axis over its radius */
    int drift;                              /* 1: of a sheet that has drifted */
    int changed;                            /* 1: discs were dropped, merged or split */
    int fitted;                             /* 1: in Sigma's metric */
    int linear; /* 1: what the linearisation can do without is to be left out at once */
} verdict;

/* How much worse the data fit than Sigma says; at least 1. */
static eits_real excess(const eits_context *ctx, eits_real misfit, uint32_t count)
{
    const eits_real data = (eits_real)(ctx->model->rank - ctx->evidence.drifts),
                    free = data - (eits_real)(EITS_PLACE_PARAMETERS * count),
                    of = misfit / (free > EITS_MIN_FREEDOM ? free : EITS_MIN_FREEDOM);
    return of > 1 ? of : 1;
}

static int is_near(const eits_disc *a, const eits_disc *b)
{
    const eits_real dx = a->x_mm - b->x_mm, dy = a->y_mm - b->y_mm,
                    reach = EITS_MERGE_REACH * (a->radius_mm + b->radius_mm);
    return a->polarity == b->polarity && eits_fma(dx, dx, dy * dy) < reach * reach;
}

/* Whether near discs may be one touch: where one of them is worth little beside the other. */
static int may_be_one(const verdict *v, uint32_t i, uint32_t j, eits_real needed)
{
    const eits_real weaker = v->rise[i] < v->rise[j] ? v->rise[i] : v->rise[j];
    return weaker < EITS_CLEAR_AS_DISCS * needed && is_near(&v->answer.disc[i], &v->answer.disc[j]);
}

static int any_may_be_one(const verdict *v, eits_real needed)
{
    for (uint32_t j = 1; j < v->answer.count; ++j) {
        for (uint32_t i = 0; i < j; ++i) {
            if (may_be_one(v, i, j, needed))
                return 1;
        }
    }
    return 0;
}

/* As many shapes as there is room for; what is at hand is then of another answer. */
static void add_shapes(const eits_context *ctx, eits_answer *answer, eits_likelihood *likelihood)
{
    const uint32_t parameters = eits_shape_parameters(ctx, answer->count);
    if (parameters > answer->parameters) {
        answer->parameters = parameters;
        likelihood->at_hand = 0;
    }
}

/* Discs i < j as one of the same strength. */
static void merge(const eits_context *ctx, eits_answer *answer, uint32_t i, uint32_t j)
{
    const eits_disc a = answer->disc[i], b = answer->disc[j];
    eits_disc one = eits_merged_disc(&ctx->options, &a, &b);
    one.change = (a.change * a.radius_mm * a.radius_mm + b.change * b.radius_mm * b.radius_mm) /
                 (one.radius_mm * one.radius_mm);
    eits_leave_out(answer, j);
    answer->disc[i] = one;
    answer->radius_mm[i] = one.radius_mm;
    memset(answer->shape[i], 0, sizeof answer->shape[i]);
}

/* Rises of the answer's discs; returns the weakest. */
static uint32_t weakest_of(const eits_scratch *scratch, const eits_answer *answer,
                           const eits_likelihood *likelihood, eits_real *rise)
{
    uint32_t weakest = 0;
    for (uint32_t k = 0; k < answer->count; ++k) {
        rise[k] = eits_linear_rise(scratch, answer, likelihood, k);
        weakest = rise[k] < rise[weakest] ? k : weakest;
    }
    return weakest;
}

/* What its shape says of each disc. */
static void shapes_of(const eits_context *ctx, const eits_scratch *scratch,
                      const eits_likelihood *likelihood, verdict *v)
{
    const eits_real unit = excess(ctx, v->answer.misfit, v->answer.count);
    for (uint32_t k = 0; k < v->answer.count; ++k) {
        v->pair[k] = eits_pair_score(scratch, &v->answer, likelihood, k);
        eits_pair_line(&v->answer, likelihood, k, v->line[k]);
        eits_long_axis(scratch, &v->answer, likelihood, k, unit, v->axis[k]);
    }
}

/* How well each place is known: the inverse's blocks, times what the data fit worse. */
static void places_of(const eits_context *ctx, const eits_scratch *scratch,
                      const eits_likelihood *likelihood, verdict *v)
{
    const uint32_t p = v->answer.parameters;
    const size_t stride = EITS_STRIDE(likelihood->count);
    const eits_real pixel = (eits_real)ctx->model->pixel_mm,
                    unit = pixel * pixel * excess(ctx, v->answer.misfit, v->answer.count);
    for (uint32_t k = 0; k < v->answer.count; ++k) {
        const eits_real *x = scratch->square + stride * (k * p + 1u) + k * p + 1u, *y = x + stride;
        v->place_mm2[k][0] = unit * x[0];
        v->place_mm2[k][1] = unit * x[1];
        v->place_mm2[k][2] = unit * y[1];
        v->best_mm[k][0] = eits_fma(pixel, likelihood->step[k * p + 1], v->answer.disc[k].x_mm);
        v->best_mm[k][1] = eits_fma(pixel, likelihood->step[k * p + 2], v->answer.disc[k].y_mm);
    }
    shapes_of(ctx, scratch, likelihood, v);
}

/* Set what is known of each disc by the linearisation. Returns the weakest. */
static uint32_t look(const eits_context *ctx, const eits_scratch *scratch, verdict *v,
                     const eits_likelihood *likelihood)
{
    if (!v->fitted)
        v->answer.misfit = likelihood->least;
    places_of(ctx, scratch, likelihood, v);
    return weakest_of(scratch, &v->answer, likelihood, v->rise);
}

/* What F is to rise by without a touch. */
static eits_real needed(const eits_context *ctx, const verdict *v)
{
    return EITS_TOUCH_EVIDENCE * excess(ctx, v->answer.misfit, v->answer.count);
}

/* Whether the data are explained about as well as Sigma says. */
static int fits(const eits_context *ctx, const verdict *v)
{
    return excess(ctx, v->answer.misfit, v->answer.count) <= EITS_FITS;
}

/* F + threshold n + log det Sigma */
static eits_real evidence(const verdict *v)
{
    return eits_fma(EITS_TOUCH_EVIDENCE, (eits_real)v->answer.count, v->answer.misfit) +
           v->log_determinant;
}

/* Take a simpler answer where F rises by less than is allowed. */
static int take(verdict *v, const eits_answer *simpler, eits_real allowed)
{
    if (!(simpler->misfit - v->answer.misfit < allowed))
        return 0;
    v->answer = *simpler;
    v->changed = 1;
    return 1;
}

/* Leave out of `rest`, one after another from the weakest on, whatever the linearisation can do
 * without. */
static void drop_linearly(eits_context *ctx, const eits_scratch *scratch, const verdict *v,
                          uint32_t weakest, eits_answer *rest, eits_likelihood *likelihood,
                          uint64_t *macs)
{
    eits_real rise[EITS_MAX_TOUCHES];
    memcpy(rise, v->rise, sizeof rise);
    while (rise[weakest] < EITS_TOUCH_EVIDENCE * excess(ctx, likelihood->least, rest->count)) {
        *macs += eits_linear_drop(ctx, scratch, rest, likelihood, weakest);
        if (rest->count <= ctx->reference.far)
            break;
        weakest = weakest_of(scratch, rest, likelihood, rise);
    }
    add_shapes(ctx, rest, likelihood);
}

/* The same, fitted again; taken where F has risen by no more than the discs were found to be worth.
 * Returns 1 if it was, -1 if not, 0 where there is nothing to leave out. */
static int take_linear(eits_context *ctx, const eits_scratch *scratch, verdict *v, uint32_t weakest,
                       eits_likelihood *likelihood, uint64_t *macs)
{
    eits_answer rest = v->answer;
    drop_linearly(ctx, scratch, v, weakest, &rest, likelihood, macs);
    if (rest.count == v->answer.count)
        return 0;
    *macs += eits_refit(ctx, scratch, &rest, likelihood, 0);
    const eits_real allowed = EITS_TOUCH_EVIDENCE * excess(ctx, rest.misfit, rest.count);
    return take(v, &rest, allowed * (eits_real)(v->answer.count - rest.count)) ? 1 : -1;
}

/* The best of the answers with one disc less: without the weakest, or with a near pair as one. */
static int take_simpler(eits_context *ctx, const eits_scratch *scratch, verdict *v,
                        uint32_t weakest, eits_likelihood *likelihood, uint64_t *macs)
{
    const eits_real threshold = needed(ctx, v), enough = v->answer.misfit + threshold;
    eits_answer best = v->answer;
    *macs += eits_linear_drop(ctx, scratch, &best, likelihood, weakest);
    add_shapes(ctx, &best, likelihood);
    *macs += eits_refit(ctx, scratch, &best, likelihood, enough);
    for (uint32_t j = 1; j < v->answer.count; ++j) {
        for (uint32_t i = 0; i < j; ++i) {
            if (!may_be_one(v, i, j, threshold))
                continue;
            eits_answer one = v->answer;
            merge(ctx, &one, i, j);
            add_shapes(ctx, &one, likelihood);
            likelihood->at_hand = 0;
            *macs += eits_refit(ctx, scratch, &one, likelihood, enough);
            if (one.misfit < best.misfit)
                best = one;
            else
                likelihood->at_hand = 0;
        }
    }
    return take(v, &best, threshold);
}

/* From the discs as they are to those that stay, under the covariance at hand; not `to_the_end`: 0
 * as soon as the data are found not to fit, to be gone on with another time. */
static int eliminate(eits_context *ctx, const eits_scratch *scratch, verdict *v, int to_the_end,
                     uint64_t *macs)
{
    eits_likelihood now = {.at_hand = 0};
    while (v->answer.count > ctx->reference.far) {
        if (!now.at_hand)
            *macs += eits_linearise(ctx, scratch, &v->answer, &now);
        uint32_t weakest = look(ctx, scratch, v, &now);
        if (v->rise[weakest] > EITS_CLEAR * needed(ctx, v) && !any_may_be_one(v, needed(ctx, v)))
            return 1;
        if (!to_the_end && excess(ctx, v->answer.misfit, v->answer.count) >
                               (v->fitted ? EITS_FITS : EITS_FITS_AS_DISCS))
            return 0;
        if (v->linear) {
            const int taken = take_linear(ctx, scratch, v, weakest, &now, macs);
            v->linear = taken >= 0;
            v->fitted |= taken > 0;
            if (taken > 0)
                continue;
            now.at_hand = now.at_hand && taken == 0;
        }
        /* too many to try each: what is left is believed */
        if (ctx->evidence.columns_made > EITS_TEST_COLUMNS)
            return 1;
        const int was_fitted = v->fitted;
        if (!was_fitted)
            *macs += eits_refit(ctx, scratch, &v->answer, &now, 0);
        v->fitted = 1;
        if (!now.at_hand)
            *macs += eits_linearise(ctx, scratch, &v->answer, &now);
        if (!was_fitted)
            weakest = look(ctx, scratch, v, &now);
        if (!to_the_end && !fits(ctx, v))
            return 0;
        if (!take_simpler(ctx, scratch, v, weakest, &now, macs))
            return 1;
    }
    v->fitted = 1;
    *macs += eits_refit(ctx, scratch, &v->answer, &now, 0);
    if (v->answer.count == 0)
        return 1;
    /* on an instrument that is far from the model one stays */
    if (!now.at_hand)
        *macs += eits_linearise(ctx, scratch, &v->answer, &now);
    (void)look(ctx, scratch, v, &now);
    return 1;
}

/* Whether the discs need no closer look: as discs, which costs least. Where discs leave something,
 * one look at their shapes then tells whether one may be two. */
static int is_clear(eits_context *ctx, const eits_scratch *scratch, verdict *v, uint64_t *macs)
{
    eits_likelihood now;
    const uint32_t all = v->answer.parameters;
    v->answer.parameters = EITS_PLACE_PARAMETERS;
    *macs += eits_linearise(ctx, scratch, &v->answer, &now);
    const uint32_t weakest = look(ctx, scratch, v, &now);
    const int clear = v->rise[weakest] > EITS_CLEAR_AS_DISCS * needed(ctx, v) &&
                      !any_may_be_one(v, needed(ctx, v)) &&
                      excess(ctx, v->answer.misfit, v->answer.count) < EITS_FITS_AS_DISCS;
    v->answer.parameters = all;
    if (clear && all > EITS_PLACE_PARAMETERS &&
        v->answer.misfit > EITS_PAIR_MISFIT * (eits_real)ctx->model->rank) {
        *macs += eits_linearise(ctx, scratch, &v->answer, &now);
        shapes_of(ctx, scratch, &now, v);
    }
    return clear;
}

/* The covariance, and the data in its metric; 0 where there is none. */
static int take_errors(eits_context *ctx, const eits_scratch *scratch, const eits_fit *f,
                       verdict *v, int drift, uint64_t *macs)
{
    v->drift = drift;
    if (!eits_factor_covariance(ctx, scratch, drift, &v->log_determinant, macs))
        return 0;
    eits_copy(ctx->evidence.data, f->data, EITS_STRIDE(ctx->model->rank));
    *macs += eits_whiten_errors(ctx, ctx->evidence.data);
    return 1;
}

/* The disc that is likeliest to be two; one past the last where none is likely enough. */
static uint32_t likeliest_pair(const eits_context *ctx, const verdict *v)
{
    const uint32_t count = v->answer.count;
    uint32_t likeliest = 0;
    for (uint32_t k = 1; k < count; ++k)
        likeliest = v->pair[k] > v->pair[likeliest] ? k : likeliest;
    const int may_be = count > 0 && count < ctx->options.max_touches &&
                       v->pair[likeliest] > EITS_SPLIT_ODDS &&
                       ctx->evidence.columns_made <= EITS_TEST_COLUMNS;
    return may_be ? likeliest : count;
}

/* Twice the usual steps: one disc and two are compared at their best. */
static uint64_t refit_well(eits_context *ctx, const eits_scratch *scratch, eits_answer *answer,
                           eits_likelihood *likelihood)
{
    likelihood->at_hand = 0;
    const uint64_t macs = eits_refit(ctx, scratch, answer, likelihood, 0);
    return macs + eits_refit(ctx, scratch, answer, likelihood, 0);
}

/* Disc k as two, where F falls by the more the less its shape says so; 1 if they are taken. */
static int take_split(eits_context *ctx, const eits_scratch *scratch, verdict *v, uint32_t k,
                      uint64_t *macs)
{
    eits_likelihood now;
    eits_answer one = v->answer, two;
    if (!eits_split_disc(ctx, &v->answer, k, v->line[k], &two))
        return 0;
    if (!v->fitted)
        *macs += refit_well(ctx, scratch, &one, &now);
    *macs += refit_well(ctx, scratch, &two, &now);
    const eits_real rise = eits_fma(-EITS_SPLIT_RISE_OF_ODDS, v->pair[k], EITS_SPLIT_RISE),
                    least = rise > EITS_SPLIT_MIN_RISE ? rise : EITS_SPLIT_MIN_RISE;
    if (!(one.misfit - two.misfit >
          least * EITS_TOUCH_EVIDENCE * excess(ctx, two.misfit, two.count)))
        return 0;
    v->answer = two;
    v->changed = v->fitted = 1;
    if (!now.at_hand)
        *macs += eits_linearise(ctx, scratch, &v->answer, &now);
    (void)look(ctx, scratch, v, &now);
    return 1;
}

/* Split what is likelier two, the likeliest first. The covariance is made once more: another
 * hypothesis's may be at hand. */
static void split(eits_context *ctx, const eits_scratch *scratch, const eits_fit *f, verdict *v,
                  uint64_t *macs)
{
    uint32_t k = likeliest_pair(ctx, v);
    if (k == v->answer.count)
        return;
    (void)take_errors(ctx, scratch, f, v, v->drift, macs); /* as before */
    while (k < v->answer.count && take_split(ctx, scratch, v, k, macs))
        k = likeliest_pair(ctx, v);
}

/* Which discs stay, in v, which has them all; 0 where they cannot be tested. */
static int judge(eits_context *ctx, const eits_scratch *scratch, eits_fit *f, verdict *v)
{
    verdict drifted = *v;
    uint64_t *macs = &f->macs;
    if (v->answer.parameters == 0 || !take_errors(ctx, scratch, f, v, 0, macs))
        return 0;
    ctx->evidence.columns_made = 0;
    if (is_clear(ctx, scratch, v, macs))
        return 1;
    int whole = eliminate(ctx, scratch, v, 0, macs);
    if (fits(ctx, v))
        return 1;
    const int drifts = take_errors(ctx, scratch, f, &drifted, 1, macs);
    if (drifts)
        (void)eliminate(ctx, scratch, &drifted, 1, macs);
    if (!whole && (!drifts || evidence(&drifted) >= v->answer.misfit + v->log_determinant))
        whole = take_errors(ctx, scratch, f, v, 0, macs) && eliminate(ctx, scratch, v, 1, macs);
    if (drifts && (!whole || evidence(&drifted) < evidence(v)))
        *v = drifted;
    return 1;
}

void eits_test_touches(eits_context *ctx, const eits_scratch *scratch, eits_fit *f)
{
    if (f->count == 0)
        return;
    verdict v = {.linear = 1};
    v.answer.count = f->count;
    v.answer.parameters = eits_shape_parameters(ctx, f->count);
    for (uint32_t k = 0; k < f->count; ++k) {
        v.answer.disc[k] = f->disc[k];
        v.answer.radius_mm[k] = f->disc[k].radius_mm;
    }
    if (!judge(ctx, scratch, f, &v))
        return;
    split(ctx, scratch, f, &v, &f->macs);
    const eits_real unit = excess(ctx, v.answer.misfit, v.answer.count);
    f->tested = 1;
    for (uint32_t k = 0; k < v.answer.count; ++k) {
        f->rise[k] = v.rise[k] / unit;
        memcpy(f->place_mm2[k], v.place_mm2[k], sizeof f->place_mm2[k]);
        const eits_disc *reported = v.changed ? &v.answer.disc[k] : &f->disc[k];
        f->apart_mm[k][0] = v.best_mm[k][0] - reported->x_mm;
        f->apart_mm[k][1] = v.best_mm[k][1] - reported->y_mm;
        f->pair[k] = v.pair[k];
        f->long_mm[k][0] = reported->radius_mm * v.axis[k][0];
        f->long_mm[k][1] = reported->radius_mm * v.axis[k][1];
    }
    if (!v.changed)
        return;
    f->count = v.answer.count;
    for (uint32_t k = 0; k < f->count; ++k)
        f->disc[k] = v.answer.disc[k];
    eits_fit_restart(ctx, scratch, f);
    eits_fit_explain(ctx, f);
}
