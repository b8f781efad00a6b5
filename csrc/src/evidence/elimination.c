/* Backward elimination by likelihood ratio decides which discs stay.
 *
 * The discs as fitted are linearised once. The linearisation tells by how much F would rise without
 * each of them. Where every rise is far above the threshold, nothing else is done. Otherwise the
 * discs are fitted to the data in Sigma's metric, and so are the discs without the weakest one. The
 * simpler answer is taken while F rises by less than the threshold times the factor by which the
 * data fit worse than they should. So a touch needs more evidence where the model is wrong by more
 * than it says.
 *
 * If the limit of columns is reached, the linearisation alone decides, and leaves out the discs
 * that it does not need.
 */
#include "evidence/verdict.h"

#include "base/vec.h"
#include "evidence/constants.h"

/* Give the answer as many shape parameters as there is room for. The stored linearisation then
 * belongs to another answer. */
static void add_shapes(const eits_context *ctx, eits_answer *answer, eits_likelihood *likelihood)
{
    const uint32_t parameters = eits_shape_parameters(ctx, answer->count);
    if (parameters > answer->parameters) {
        answer->parameters = parameters;
        likelihood->at_hand = 0;
    }
}

/* Leave out of `rest`, one after another from the weakest on, whatever the linearisation can do
 * without. The others get shapes where columns are left for them. */
static void drop_linearly(eits_context *ctx, const eits_scratch *scratch, const eits_verdict *v,
                          uint32_t weakest, eits_answer *rest, eits_likelihood *likelihood,
                          uint64_t *macs)
{
    eits_real rise[EITS_MAX_TOUCHES];
    memcpy(rise, v->rise, sizeof rise);
    while (rise[weakest] < EITS_TOUCH_EVIDENCE * eits_excess(ctx, likelihood->least, rest->count)) {
        *macs += eits_linear_drop(ctx, scratch, rest, likelihood, weakest);
        if (rest->count <= ctx->reference.far)
            break;
        weakest = eits_weakest(scratch, rest, likelihood, rise);
    }
    if (eits_may_make(ctx, rest->count * eits_shape_parameters(ctx, rest->count)))
        add_shapes(ctx, rest, likelihood);
}

/* The answer without the weakest disc, unless that is clear. Where the linearisation alone has
 * judged the discs, they are fitted only if that may decide. */
static int take_simpler(eits_context *ctx, const eits_scratch *scratch, eits_verdict *v,
                        uint32_t weakest, eits_likelihood *likelihood, uint64_t *macs)
{
    const eits_real threshold = eits_needed_rise(ctx, v), enough = v->answer.misfit + threshold,
                    here = likelihood->here;
    eits_answer best = v->answer;
    best.misfit = R(INFINITY);
    if (!(v->rise[weakest] > EITS_CLEAR * threshold)) {
        *macs += eits_linear_drop(ctx, scratch, &best, likelihood, weakest);
        add_shapes(ctx, &best, likelihood);
        *macs += eits_refit(ctx, scratch, &best, likelihood, enough, R(INFINITY));
    }
    if (!v->fitted && !(best.misfit < enough) && best.misfit < here + threshold) {
        likelihood->at_hand = 0;
        *macs += eits_refit(ctx, scratch, &v->answer, likelihood, 0, R(INFINITY));
        likelihood->at_hand = 0;
        v->fitted = 1;
    }
    if (!(best.misfit - v->answer.misfit < eits_needed_rise(ctx, v)))
        return 0;
    v->fitted = 1;
    v->answer = best;
    v->changed = 1;
    return 1;
}

int eits_eliminate(eits_context *ctx, const eits_scratch *scratch, eits_verdict *v, int to_the_end,
                   uint64_t *macs)
{
    eits_likelihood now = {.at_hand = 0};
    /* Columns of the discs as they came, with which a later elimination would begin again. */
    const uint32_t others = eits_columns_of(&v->answer);
    if (to_the_end && !eits_may_make(ctx, eits_columns_of(&v->answer)))
        return 0;
    while (v->answer.count > ctx->reference.far) {
        if (!now.at_hand)
            *macs += eits_linearise(ctx, scratch, &v->answer, &now);
        uint32_t weakest = eits_look(ctx, scratch, v, &now);
        if (v->rise[weakest] > EITS_CLEAR * eits_needed_rise(ctx, v))
            return 1;
        if (!to_the_end &&
            eits_excess(ctx, v->answer.misfit, v->answer.count) >
                (v->fitted ? EITS_FITS : EITS_FITS_AS_DISCS) &&
            eits_may_make(ctx, others))
            return 0;
        eits_answer rest = v->answer;
        drop_linearly(ctx, scratch, v, weakest, &rest, &now, macs);
        if (rest.count < v->answer.count) {
            *macs += eits_refit(ctx, scratch, &rest, &now, 0, R(INFINITY));
            if (!(rest.misfit < R(INFINITY)))
                return 1;
            v->answer = rest;
            v->changed = v->fitted = 1;
            continue;
        }
        if (!eits_may_make(ctx, 2 * eits_columns_of(&v->answer)))
            return 1;
        if (!v->fitted && (!(v->rise[weakest] > EITS_CLEAR * eits_needed_rise(ctx, v)) ||
                           eits_excess(ctx, now.here, v->answer.count) > EITS_FITS)) {
            *macs += eits_refit(ctx, scratch, &v->answer, &now, 0, R(INFINITY));
            v->fitted = 1;
            if (!now.at_hand)
                *macs += eits_linearise(ctx, scratch, &v->answer, &now);
            weakest = eits_look(ctx, scratch, v, &now);
        }
        if (!to_the_end && !eits_fits(ctx, v) && eits_may_make(ctx, others))
            return 0;
        if (v->rise[weakest] < eits_needed_rise(ctx, v) &&
            !eits_may_make(ctx, 2 * eits_columns_of(&v->answer)))
            continue;
        if (!take_simpler(ctx, scratch, v, weakest, &now, macs))
            return 1;
    }
    v->fitted = 1;
    *macs += eits_refit(ctx, scratch, &v->answer, &now, 0, R(INFINITY));
    if (v->answer.count == 0)
        return 1;
    /* on an instrument that is far from the model one stays */
    if (!now.at_hand)
        *macs += eits_linearise(ctx, scratch, &v->answer, &now);
    (void)eits_look(ctx, scratch, v, &now);
    return 1;
}
