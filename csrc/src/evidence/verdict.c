/* One linearisation of an answer gives, for each of its discs, the rise of F without that disc, its
 * place and its shape. */
#include "evidence/verdict.h"

#include "base/vec.h"
#include "evidence/constants.h"

/* Data that fit worse than their covariance says need more evidence for each disc, in proportion.
 * They never need less: a misfit below that is luck. */
eits_real eits_excess(const eits_context *ctx, eits_real misfit, uint32_t count)
{
    const eits_real data = (eits_real)(ctx->model->rank - ctx->evidence.drifts),
                    free = data - (eits_real)(EITS_PLACE_PARAMETERS * count),
                    of = misfit / (free > EITS_MIN_FREEDOM ? free : EITS_MIN_FREEDOM);
    return of > 1 ? of : 1;
}

uint32_t eits_weakest(const eits_scratch *scratch, const eits_answer *answer,
                      const eits_likelihood *likelihood, eits_real *rise)
{
    uint32_t weakest = 0;
    for (uint32_t k = 0; k < answer->count; ++k) {
        rise[k] = eits_linear_rise(scratch, answer, likelihood, k);
        /* the first of equals, on every target */
        weakest = rise[k] < rise[weakest] ? k : weakest;
    }
    return weakest;
}

/* The covariance of a place: the inverse's block times the factor by which the data fit worse than
 * they should. */
static void place_of(const eits_context *ctx, const eits_scratch *scratch,
                     const eits_likelihood *likelihood, eits_verdict *v, uint32_t k)
{
    /* `step` and the inverse are in pixels; results are in millimetres. best_mm is where one more
     * Gauss-Newton step would put the disc. */
    const uint32_t p = v->answer.parameters;
    const size_t stride = EITS_STRIDE(likelihood->count);
    const eits_real pixel = (eits_real)ctx->model->pixel_mm,
                    unit = pixel * pixel * eits_excess(ctx, v->answer.misfit, v->answer.count),
                    *x = scratch->square + stride * (k * p + 1u) + k * p + 1u, *y = x + stride;
    v->place_mm2[k][0] = unit * x[0];
    v->place_mm2[k][1] = unit * x[1];
    v->place_mm2[k][2] = unit * y[1];
    v->best_mm[k][0] = eits_fma(pixel, likelihood->step[k * p + 1], v->answer.disc[k].x_mm);
    v->best_mm[k][1] = eits_fma(pixel, likelihood->step[k * p + 2], v->answer.disc[k].y_mm);
}

uint32_t eits_look(const eits_context *ctx, const eits_scratch *scratch, eits_verdict *v,
                   const eits_likelihood *likelihood)
{
    if (!v->fitted)
        v->answer.misfit = likelihood->least;
    v->here = likelihood->here;
    for (uint32_t k = 0; k < v->answer.count; ++k) {
        place_of(ctx, scratch, likelihood, v, k);
        v->pair[k] = eits_pair_score(scratch, &v->answer, likelihood, k);
        eits_pair_line(&v->answer, likelihood, k, v->line[k]);
    }
    return eits_weakest(scratch, &v->answer, likelihood, v->rise);
}

eits_real eits_needed_rise(const eits_context *ctx, const eits_verdict *v)
{
    return EITS_TOUCH_EVIDENCE * eits_excess(ctx, v->answer.misfit, v->answer.count);
}

int eits_fits(const eits_context *ctx, const eits_verdict *v)
{
    return eits_excess(ctx, v->answer.misfit, v->answer.count) <= EITS_FITS;
}
