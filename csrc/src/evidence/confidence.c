/* What the test's numbers have meant on scenes with a truth.
 *
 * The test tells how much more likely the data are with a disc than without, under the errors that
 * the model admits to. It does not say how often that has been right, nor how far places were off:
 * both were counted on scenes of other worlds (docs/results/belief.md).
 *
 * A disc is a touch with probability rise / (rise + HALF), a logistic function of the logarithm of
 * its rise. A place is off by what the data leave open (the covariance, as far as it was found
 * true), by what the test would move it, and by what the skin is unlike its model, for which the
 * reference's distance from the model's stands. */
#include "evidence/evidence.h"

#include "base/vec.h"
#include "diagnostics/diagnostics.h"
#include "evidence/constants.h"

static int is_known(const eits_real *place_mm2, const eits_real *apart_mm)
{
    return eits_all_finite(place_mm2, 3) && eits_all_finite(apart_mm, 2) && place_mm2[0] > 0 &&
           place_mm2[2] > 0;
}

void eits_rate_touches(const eits_context *ctx, eits_fit *f)
{
    const eits_real pixel = (eits_real)ctx->model->pixel_mm,
                    least = pixel * pixel *
                            eits_fma(EITS_PLACE_DISTANCE, ctx->reference.distance, EITS_PLACE_MIN),
                    reach = EITS_MAX_MOVE * pixel;
    for (uint32_t k = 0; k < f->count; ++k) {
        eits_real *place = f->place_mm2[k];
        if (!f->tested || !is_known(place, f->apart_mm[k])) {
            eits_zero(place, 3);
        } else {
            const eits_real x = eits_clamp(f->apart_mm[k][0], -reach, reach),
                            y = eits_clamp(f->apart_mm[k][1], -reach, reach);
            place[0] = eits_fma(EITS_PLACE_FACTOR, place[0], eits_fma(x, x, least));
            place[1] = eits_fma(EITS_PLACE_FACTOR, place[1], x * y);
            place[2] = eits_fma(EITS_PLACE_FACTOR, place[2], eits_fma(y, y, least));
        }
        const eits_real rise = f->rise[k];
        f->confidence[k] =
            f->tested && rise > 0 ? 1 - EITS_CONFIDENCE_HALF / (rise + EITS_CONFIDENCE_HALF) : 0;
    }
}

void eits_check_count(eits_context *ctx, const eits_fit *f)
{
    if (!f->tested || !eits_wants(ctx, EITS_DIAGNOSTIC_CROWDED))
        return;
    for (uint32_t k = 0; k < f->count; ++k) {
        if (ctx->evidence.spent || f->pair[k] > EITS_PAIR_ODDS ||
            f->confidence[k] < EITS_MIN_CONFIDENCE)
            ctx->info.diagnostics |= EITS_DIAGNOSTIC_CROWDED;
    }
}
