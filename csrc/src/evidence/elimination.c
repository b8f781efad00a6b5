/* Which discs stay: backward elimination by likelihood ratio.
 *
 * The discs as fitted are linearised once; the linearisation tells what F would rise by without
 * each. Where every rise is far above the threshold and no two discs are near each other, nothing
 * else is done. Else the discs are fitted to the data in Sigma's metric, and so are the likeliest
 * of the simpler answers: the weakest disc left out, near pairs as one. The simpler one is taken
 * while F rises by less than the threshold, times what the data fit worse than they should: where
 * the model is wrong by more than it says, more is asked of a touch.
 *
 * The whole is done a second time for a sheet that has drifted since its reference (+ D), and the
 * likelier of the two stands, by F + threshold n + log det Sigma: allowing for a drift that is not
 * there would cost light touches. */
#include "evidence/evidence.h"

#include "base/vec.h"
#include "evidence/constants.h"
#include "kernels/kernels.h"

/* One hypothesis's answer, and what is known of each disc of it. */
typedef struct verdict {
    eits_answer answer;
    eits_real evidence; /* F + threshold n + log det Sigma */
    eits_real rise[EITS_MAX_TOUCHES];
    eits_real place_mm2[EITS_MAX_TOUCHES][3];
    eits_real best_mm[EITS_MAX_TOUCHES][2]; /* where the linearisation has the disc */
    eits_real pair[EITS_MAX_TOUCHES];       /* log odds that it is two (pair.c) */
    int changed;                            /* 1: discs were dropped or merged */
    int clear;                              /* 1: by the linearisation without shapes alone */
} verdict;

/* How much worse the data fit than Sigma says; at least 1. */
static eits_real excess(const eits_context *ctx, eits_real misfit, uint32_t count)
{
    const eits_real data = (eits_real)(ctx->model->rank - ctx->evidence.drifts),
                    free = data - R(4.0) * (eits_real)count,
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

static eits_answer without(const eits_context *ctx, const eits_answer *from, uint32_t k)
{
    eits_answer to = *from;
    --to.count;
    for (uint32_t l = k; l < to.count && l + 1u < EITS_MAX_TOUCHES; ++l) {
        to.disc[l] = to.disc[l + 1];
        to.radius_mm[l] = to.radius_mm[l + 1];
        memcpy(to.shape[l], to.shape[l + 1], sizeof to.shape[l]);
    }
    const uint32_t parameters = eits_shape_parameters(ctx, to.count);
    to.parameters = parameters > to.parameters ? parameters : to.parameters;
    return to;
}

/* Discs i < j as one of the same strength. */
static eits_answer with_merged(const eits_context *ctx, const eits_answer *from, uint32_t i,
                               uint32_t j)
{
    const eits_disc *a = &from->disc[i], *b = &from->disc[j];
    eits_answer to = without(ctx, from, j);
    eits_disc one = eits_merged_disc(&ctx->options, a, b);
    one.change =
        (a->change * a->radius_mm * a->radius_mm + b->change * b->radius_mm * b->radius_mm) /
        (one.radius_mm * one.radius_mm);
    to.disc[i] = one;
    to.radius_mm[i] = one.radius_mm;
    memset(to.shape[i], 0, sizeof to.shape[i]);
    return to;
}

/* Rises of the discs that are `in` the linearisation; returns the weakest of these, or count. */
static uint32_t weakest_of(const eits_scratch *scratch, const eits_likelihood *likelihood,
                           const uint8_t *out, verdict *v)
{
    uint32_t weakest = v->answer.count;
    for (uint32_t k = 0; k < v->answer.count; ++k) {
        if (out != NULL && out[k])
            continue;
        v->rise[k] = eits_linear_rise(scratch, &v->answer, likelihood, k);
        if (weakest == v->answer.count || v->rise[k] < v->rise[weakest])
            weakest = k;
    }
    return weakest;
}

static void pairs_of(const eits_scratch *scratch, const eits_likelihood *likelihood, verdict *v)
{
    for (uint32_t k = 0; k < v->answer.count; ++k)
        v->pair[k] = eits_pair_score(scratch, &v->answer, likelihood, k);
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
    pairs_of(scratch, likelihood, v);
}

/* Linearise, and set what is known of each disc by it. Returns the weakest. */
static uint32_t look(eits_context *ctx, const eits_scratch *scratch, verdict *v, int fitted,
                     eits_likelihood *likelihood, uint64_t *macs)
{
    *macs += eits_linearise(ctx, scratch, &v->answer, likelihood);
    if (!fitted)
        v->answer.misfit = likelihood->least;
    places_of(ctx, scratch, likelihood, v);
    return weakest_of(scratch, likelihood, NULL, v);
}

static eits_real needed(const eits_context *ctx, const verdict *v)
{
    return EITS_TOUCH_EVIDENCE * excess(ctx, v->answer.misfit, v->answer.count);
}

/* Leave out, one after another, whatever the linearisation can do without. Returns how many stay;
 * `out` marks those that do not. */
static uint32_t drop_linearly(eits_context *ctx, const eits_scratch *scratch, verdict *v,
                              eits_likelihood *likelihood, uint8_t *out, uint64_t *macs)
{
    uint32_t left = v->answer.count;
    memset(out, 0, EITS_MAX_TOUCHES);
    while (left > ctx->reference.far) {
        const uint32_t k = weakest_of(scratch, likelihood, out, v);
        if (!(v->rise[k] < EITS_TOUCH_EVIDENCE * excess(ctx, likelihood->least, left)))
            break;
        *macs += eits_linear_drop(ctx, scratch, &v->answer, likelihood, k);
        out[k] = 1;
        --left;
    }
    return left;
}

/* The discs that stay, fitted again; taken where F has risen by no more than they were found to be
 * worth. */
static int take_linear(eits_context *ctx, const eits_scratch *scratch, verdict *v,
                       const uint8_t *out, uint32_t left, uint64_t *macs)
{
    const eits_real before = v->answer.misfit;
    eits_answer rest = v->answer;
    for (uint32_t k = v->answer.count; k-- > 0;) {
        if (out[k])
            rest = without(ctx, &rest, k);
    }
    *macs += eits_refit(ctx, scratch, &rest, 0);
    const eits_real allowed = EITS_TOUCH_EVIDENCE * excess(ctx, rest.misfit, left);
    if (!(rest.misfit - before < allowed * (eits_real)(v->answer.count - left)))
        return 0;
    v->answer = rest;
    v->changed = 1;
    return 1;
}

/* The best of the answers with one disc less: without the weakest, or with a near pair as one. */
static int take_simpler(eits_context *ctx, const eits_scratch *scratch, verdict *v,
                        uint32_t weakest, uint64_t *macs)
{
    const eits_answer *from = &v->answer;
    const eits_real threshold = needed(ctx, v), enough = from->misfit + threshold;
    eits_answer best = without(ctx, from, weakest);
    *macs += eits_refit(ctx, scratch, &best, enough);
    for (uint32_t j = 1; j < from->count; ++j) {
        for (uint32_t i = 0; i < j; ++i) {
            if (!may_be_one(v, i, j, threshold))
                continue;
            eits_answer one = with_merged(ctx, from, i, j);
            *macs += eits_refit(ctx, scratch, &one, enough);
            if (one.misfit < best.misfit)
                best = one;
        }
    }
    if (!(best.misfit - from->misfit < needed(ctx, v)))
        return 0;
    v->answer = best;
    v->changed = 1;
    return 1;
}

/* From the discs as they are to those that stay, under the covariance at hand. */
static void eliminate(eits_context *ctx, const eits_scratch *scratch, verdict *v, uint64_t *macs)
{
    eits_likelihood likelihood;
    uint8_t out[EITS_MAX_TOUCHES];
    int fitted = 0, linear = 1;
    while (v->answer.count > ctx->reference.far) {
        uint32_t weakest = look(ctx, scratch, v, fitted, &likelihood, macs);
        if (v->rise[weakest] > EITS_CLEAR * needed(ctx, v) && !any_may_be_one(v, needed(ctx, v)))
            return;
        if (linear) {
            const uint32_t left = drop_linearly(ctx, scratch, v, &likelihood, out, macs);
            if (left < v->answer.count) {
                linear = take_linear(ctx, scratch, v, out, left, macs);
                fitted = linear || fitted;
                continue;
            }
        }
        /* too many to try each: what is left is believed */
        if (ctx->evidence.columns_made > EITS_TEST_COLUMNS)
            return;
        if (!fitted) {
            *macs += eits_refit(ctx, scratch, &v->answer, 0);
            weakest = look(ctx, scratch, v, 1, &likelihood, macs);
            fitted = 1;
        }
        if (!take_simpler(ctx, scratch, v, weakest, macs))
            return;
    }
    *macs += eits_refit(ctx, scratch, &v->answer, 0);
    if (v->answer.count > 0) /* on an instrument that is far from the model one stays */
        (void)look(ctx, scratch, v, 1, &likelihood, macs);
}

/* Whether the discs need no closer look: as discs, which costs least. Where discs leave something,
 * one look at their shapes then tells whether one may be two. */
static int is_clear(eits_context *ctx, const eits_scratch *scratch, verdict *v, uint64_t *macs)
{
    eits_likelihood likelihood;
    const uint32_t all = v->answer.parameters;
    v->answer.parameters = EITS_PLACE_PARAMETERS;
    const uint32_t weakest = look(ctx, scratch, v, 0, &likelihood, macs);
    v->clear = v->rise[weakest] > EITS_CLEAR_AS_DISCS * needed(ctx, v) &&
               !any_may_be_one(v, needed(ctx, v)) &&
               excess(ctx, v->answer.misfit, v->answer.count) < EITS_FITS_AS_DISCS;
    v->answer.parameters = all;
    if (v->clear && all > EITS_PLACE_PARAMETERS &&
        v->answer.misfit > EITS_PAIR_MISFIT * (eits_real)ctx->model->rank) {
        *macs += eits_linearise(ctx, scratch, &v->answer, &likelihood);
        pairs_of(scratch, &likelihood, v);
    }
    return v->clear;
}

static verdict judge(eits_context *ctx, const eits_scratch *scratch, const eits_fit *f, int drift,
                     uint64_t *macs)
{
    verdict v = {.evidence = -1};
    eits_real log_determinant;
    v.answer.count = f->count;
    v.answer.parameters = eits_shape_parameters(ctx, f->count);
    if (v.answer.parameters == 0 ||
        !eits_factor_covariance(ctx, scratch, drift, &log_determinant, macs)) {
        v.answer.parameters = 0;
        return v;
    }
    for (uint32_t k = 0; k < f->count; ++k) {
        v.answer.disc[k] = f->disc[k];
        v.answer.radius_mm[k] = f->disc[k].radius_mm;
    }
    ctx->evidence.columns_made = 0;
    eits_copy(ctx->evidence.data, f->data, EITS_STRIDE(ctx->model->rank));
    *macs += eits_whiten_errors(ctx, ctx->evidence.data);
    if (drift || !is_clear(ctx, scratch, &v, macs))
        eliminate(ctx, scratch, &v, macs);
    v.evidence =
        eits_fma(EITS_TOUCH_EVIDENCE, (eits_real)v.answer.count, v.answer.misfit) + log_determinant;
    return v;
}

void eits_test_touches(eits_context *ctx, const eits_scratch *scratch, eits_fit *f)
{
    if (f->count == 0)
        return;
    verdict v = judge(ctx, scratch, f, 0, &f->macs);
    if (v.answer.parameters == 0)
        return;
    if (!v.clear && excess(ctx, v.answer.misfit, v.answer.count) > EITS_FITS) {
        const verdict drifted = judge(ctx, scratch, f, 1, &f->macs);
        if (drifted.answer.parameters > 0 && drifted.evidence < v.evidence)
            v = drifted;
    }
    const eits_real unit = excess(ctx, v.answer.misfit, v.answer.count);
    f->tested = 1;
    for (uint32_t k = 0; k < v.answer.count; ++k) {
        f->rise[k] = v.rise[k] / unit;
        memcpy(f->place_mm2[k], v.place_mm2[k], sizeof f->place_mm2[k]);
        const eits_disc *reported = v.changed ? &v.answer.disc[k] : &f->disc[k];
        f->apart_mm[k][0] = v.best_mm[k][0] - reported->x_mm;
        f->apart_mm[k][1] = v.best_mm[k][1] - reported->y_mm;
        f->pair[k] = v.pair[k];
    }
    if (!v.changed)
        return;
    f->count = v.answer.count;
    for (uint32_t k = 0; k < f->count; ++k)
        f->disc[k] = v.answer.disc[k];
    eits_fit_restart(ctx, scratch, f);
    eits_fit_explain(ctx, f);
}
