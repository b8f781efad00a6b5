/* The whole test of touches: it decides under which covariance the discs are tested, and for how
 * long.
 *
 * Discs that are clear need one look. The others are eliminated (elimination.c); as soon as the
 * data are found not to fit, the same is done for a sheet that has drifted since its reference (+
 * D). The likelier of the two stands, by F + threshold n + log det Sigma: allowing for a drift that
 * is not there would cost light touches. The sheet without drift is tested further only where its F
 * leaves it a chance. At last each disc whose shape says that it is two touches rather than one is
 * tried as two.
 *
 * After the first look, the test makes no more columns than options.test_columns and the frame's
 * work (EITS_TEST_WORK) allow: each step asks first whether it may (eits_may_make). Where it may
 * not, the answer so far is reported, and the count is said to be uncertain. */
#include "evidence/verdict.h"

#include "base/vec.h"
#include "evidence/constants.h"

/* F + threshold n + log det Sigma */
static eits_real evidence(const eits_verdict *v)
{
    return eits_fma(EITS_TOUCH_EVIDENCE, (eits_real)v->answer.count, v->answer.misfit) +
           v->log_determinant;
}

/* The covariance, and the data in its metric; 0 where there is none. */
static int take_errors(eits_context *ctx, const eits_scratch *scratch, const eits_fit *f,
                       eits_verdict *v, int drift, uint64_t *macs)
{
    v->drift = drift;
    if (!eits_factor_covariance(ctx, scratch, drift, &v->log_determinant, macs))
        return 0;
    eits_copy(ctx->evidence.data, f->data, EITS_STRIDE(ctx->model->rank));
    *macs += eits_whiten_errors(ctx, ctx->evidence.data);
    return 1;
}

/* The disc that is likeliest to be two; one past the last where none is likely enough. */
static uint32_t likeliest_pair(const eits_context *ctx, const eits_verdict *v)
{
    const uint32_t count = v->answer.count;
    uint32_t likeliest = 0;
    for (uint32_t k = 1; k < count; ++k)
        likeliest = v->pair[k] > v->pair[likeliest] ? k : likeliest;
    const int may_be =
        count > 0 && count < ctx->options.max_touches && v->pair[likeliest] > EITS_SPLIT_ODDS;
    return may_be ? likeliest : count;
}

/* The amount by which F has to fall for disc k to become two discs. It is larger where the disc's
 * shape speaks less for two. */
static eits_real needed_fall(const eits_context *ctx, const eits_verdict *v, uint32_t k,
                             eits_real misfit, uint32_t count)
{
    const eits_real rise = eits_fma(-EITS_SPLIT_RISE_OF_ODDS, v->pair[k], EITS_SPLIT_RISE),
                    least = rise > EITS_SPLIT_MIN_RISE ? rise : EITS_SPLIT_MIN_RISE;
    return least * EITS_TOUCH_EVIDENCE * eits_excess(ctx, misfit, count);
}

/* Whether F may fall enough where two leave `misfit`: before the one is fitted, which only lowers
 * its own. */
static int may_fall(const eits_context *ctx, const eits_verdict *v, uint32_t k, eits_real misfit)
{
    return v->here - misfit > needed_fall(ctx, v, k, misfit, v->answer.count + 1u);
}

/* Replace disc k by two where F falls enough. Returns 1 if the two are taken. The fit has twice the
 * usual steps, because one disc and two are compared at their best. Two that are far from it after
 * the first fit are given up. */
static int take_split(eits_context *ctx, const eits_scratch *scratch, eits_verdict *v, uint32_t k,
                      uint64_t *macs)
{
    eits_likelihood now = {.at_hand = 0}, of_one = {.at_hand = 0};
    eits_answer one = v->answer, two;
    if (!may_fall(ctx, v, k, 0) || !eits_split_disc(ctx, &v->answer, k, v->line[k], &two))
        return 0;
    *macs += eits_refit(ctx, scratch, &two, &now, 0, R(INFINITY));
    if (!(two.misfit < R(INFINITY)) || !(now.least < EITS_SPLIT_HOPE * one.misfit) ||
        !may_fall(ctx, v, k, now.least))
        return 0;
    *macs += eits_refit(ctx, scratch, &two, &now, 0, R(INFINITY));
    eits_likelihood of_two = now;
    if (!may_fall(ctx, v, k, two.misfit))
        return 0;
    if (!v->fitted) {
        for (int times = 0; times < 2; ++times)
            *macs += eits_refit(ctx, scratch, &one, &of_one, 0, R(INFINITY));
        of_two.at_hand = 0;
    }
    if (!(one.misfit < R(INFINITY)) ||
        !(one.misfit - two.misfit > needed_fall(ctx, v, k, two.misfit, two.count)))
        return 0;
    v->answer = two;
    v->changed = v->fitted = 1;
    if (!of_two.at_hand)
        *macs += eits_linearise(ctx, scratch, &v->answer, &of_two);
    (void)eits_look(ctx, scratch, v, &of_two);
    return 1;
}

/* Split what is likelier two, the likeliest first. The covariance is made once more: another
 * hypothesis's may be available. */
static void split(eits_context *ctx, const eits_scratch *scratch, const eits_fit *f,
                  eits_verdict *v, uint64_t *macs)
{
    uint32_t k = likeliest_pair(ctx, v);
    if (k == v->answer.count)
        return;
    (void)take_errors(ctx, scratch, f, v, v->drift, macs); /* as before */
    if (ctx->evidence.columns_most > EITS_SPLIT_COLUMNS)
        ctx->evidence.columns_most = EITS_SPLIT_COLUMNS;
    while (k < v->answer.count && take_split(ctx, scratch, v, k, macs))
        k = likeliest_pair(ctx, v);
}

/* The most columns that the test may make. */
static uint32_t columns_of_frame(const eits_context *ctx, const eits_fit *f)
{
    const uint64_t work = eits_fit_limit(ctx, EITS_TEST_WORK);
    const uint32_t all = ctx->options.test_columns, rank = ctx->model->rank,
                   each = rank * (rank + EITS_COLUMN_ROWS),
                   left = f->macs < work ? (uint32_t)(work - f->macs) / each : 0;
    return all > 0 && all < left ? all : left;
}

/* Leave in v, which has all discs, those that stay. Returns 0 where they cannot be tested. */
static int judge(eits_context *ctx, const eits_scratch *scratch, eits_fit *f, eits_verdict *v)
{
    eits_verdict drifted = *v;
    uint64_t *macs = &f->macs;
    if (v->answer.parameters == 0 || !take_errors(ctx, scratch, f, v, 0, macs))
        return 0;
    if (!eits_may_make(ctx, eits_columns_of(&v->answer))) /* one look is always made */
        v->answer.parameters = EITS_PLACE_PARAMETERS;
    ctx->evidence.spent = 0;
    int whole = eits_eliminate(ctx, scratch, v, 0, macs);
    if (eits_fits(ctx, v) || !eits_may_make(ctx, eits_columns_of(&drifted.answer)))
        return 1;
    const int drifts = take_errors(ctx, scratch, f, &drifted, 1, macs);
    if (drifts)
        (void)eits_eliminate(ctx, scratch, &drifted, 1, macs);
    if (!whole && (!drifts || evidence(&drifted) >= v->answer.misfit + v->log_determinant))
        whole =
            take_errors(ctx, scratch, f, v, 0, macs) && eits_eliminate(ctx, scratch, v, 1, macs);
    if (drifts && (!whole || evidence(&drifted) < evidence(v)))
        *v = drifted;
    return 1;
}

void eits_test_touches(eits_context *ctx, const eits_scratch *scratch, eits_fit *f)
{
    ctx->evidence.columns_made = ctx->evidence.spent = 0;
    ctx->evidence.columns_most = columns_of_frame(ctx, f);
    if (f->count == 0)
        return;
    eits_verdict v = {.changed = 0};
    v.answer.count = f->count;
    v.answer.parameters = eits_shape_parameters(ctx, f->count);
    for (uint32_t k = 0; k < f->count; ++k) {
        v.answer.disc[k] = f->disc[k];
        v.answer.radius_mm[k] = f->disc[k].radius_mm;
    }
    if (!judge(ctx, scratch, f, &v))
        return;
    split(ctx, scratch, f, &v, &f->macs);
    const eits_real unit = eits_excess(ctx, v.answer.misfit, v.answer.count);
    f->tested = 1;
    f->drifts = v.drift != 0;
    f->changed = v.changed != 0;
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
