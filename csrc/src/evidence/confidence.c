/* The touch test's numbers become a confidence and a bound of the place, as counted on scenes whose
 * truth is known.
 *
 * The test tells how much more likely the data are with a disc than without, under the errors that
 * the model admits to. It does not say how often that has been right, nor how far places were off:
 * both were counted on scenes of other worlds (studies/results/belief.md).
 *
 * A disc is a touch with probability rise / (rise + HALF), a logistic function of the logarithm of
 * its rise. A place is off by what the data leave open (the covariance, as far as it was found
 * true), by some of what the test would move it, and by what the skin is unlike its model: what the
 * correction by the reference leaves (frame/places.c), or, where there is none, the reference's
 * distance from the model's.
 *
 * A taught model has no such test. There the fit's normal equations say how far a place is known,
 * with the strengths of all discs free and what is left of the data for their noise, and the model
 * by how much presses that it had not been taught were further off. */
#include "evidence/evidence.h"

#include "base/vec.h"
#include "context/places.h"
#include "context/projection.h"
#include "diagnostics/diagnostics.h"
#include "evidence/constants.h"
#include "frame/constants.h"

static int is_known(const eits_real *place_mm2, const eits_real *apart_mm)
{
    return eits_all_finite(place_mm2, 3) && eits_all_finite(apart_mm, 2) && place_mm2[0] > 0 &&
           place_mm2[2] > 0;
}

eits_real eits_variance_of_all(const eits_context *ctx, eits_real least)
{
    const eits_reference *b = &ctx->reference;
    const eits_real pixel = (eits_real)ctx->model->pixel_mm;
    const eits_real floor = pixel * pixel * least,
                    trust = eits_corrects_places(ctx) ? b->place_trust : 0,
                    stays = pixel * pixel * EITS_PLACE_DISTANCE * b->distance;
    return floor + eits_fma(trust, EITS_PLACE_GEOMETRY * b->place_mm2 - stays, stays);
}

eits_real eits_confidence(eits_real rise)
{
    return rise > 0 ? 1 - EITS_CONFIDENCE_HALF / (rise + EITS_CONFIDENCE_HALF) : 0;
}

void eits_rate_touches(const eits_context *ctx, eits_fit *f)
{
    const eits_real least = eits_variance_of_all(ctx, EITS_PLACE_MIN),
                    reach = EITS_MAX_MOVE * (eits_real)ctx->model->pixel_mm;
    for (uint32_t k = 0; k < f->count; ++k) {
        eits_real *place = f->place_mm2[k];
        if (!f->tested || !is_known(place, f->apart_mm[k])) {
            eits_zero(place, 3);
        } else {
            const eits_real x = EITS_PLACE_APART * eits_clamp(f->apart_mm[k][0], -reach, reach),
                            y = EITS_PLACE_APART * eits_clamp(f->apart_mm[k][1], -reach, reach);
            place[0] = eits_fma(EITS_PLACE_FACTOR, place[0], eits_fma(x, x, least));
            place[1] = eits_fma(EITS_PLACE_FACTOR, place[1], x * y);
            place[2] = eits_fma(EITS_PLACE_FACTOR, place[2], eits_fma(y, y, least));
        }
        f->confidence[k] = f->tested ? eits_confidence(f->rise[k]) : 0;
    }
}

/* C = unit (G'G)^-1, G (rank x 2) the slopes of disc k's answer by x and y beside the directions.
 */
static void place_by_slopes(eits_context *ctx, const eits_scratch *scratch, eits_fit *f, uint32_t k,
                            const eits_real *directions, uint32_t count, eits_real unit)
{
    const uint32_t rank = ctx->model->rank;
    eits_real *x = scratch->row[5], *y = scratch->row[6], *place = f->place_mm2[k];
    const eits_real by_change = f->disc[k].change * f->disc[k].change;
    f->macs += eits_disc_atom(ctx, scratch, &f->disc[k], eits_atom(ctx, k), &scratch->row[5]);
    f->macs += eits_take_out(ctx, directions, count, x) + eits_take_out(ctx, directions, count, y);
    const eits_real xx = eits_dot(ctx->kernels, x, x, rank),
                    yy = eits_dot(ctx->kernels, y, y, rank),
                    xy = eits_dot(ctx->kernels, x, y, rank),
                    scale = unit / (by_change * eits_fma(xx, yy, -(xy * xy)));
    f->macs += 3u * (uint64_t)rank;
    place[0] = scale * yy;
    place[1] = -scale * xy;
    place[2] = scale * xx;
    if (!eits_all_finite(place, 3) || !(place[0] > 0) || !(place[2] > 0))
        eits_zero(place, 3);
}

void eits_place_touches(eits_context *ctx, const eits_scratch *scratch, eits_fit *f)
{
    if (f->tested || !(ctx->model->place_factor > 0))
        return;
    const uint32_t rank = ctx->model->rank;
    const eits_real data = (eits_real)rank - (eits_real)(EITS_PLACE_PARAMETERS * f->count),
                    unit = (eits_real)ctx->model->place_factor * eits_fit_left(ctx, f) /
                           (data > EITS_MIN_FREEDOM ? data : EITS_MIN_FREEDOM);
    uint32_t known = 0;
    for (uint32_t k = 0; k < f->count && known < rank; ++k) {
        eits_copy(scratch->square + EITS_STRIDE(rank) * known, eits_atom(ctx, k),
                  EITS_STRIDE(rank));
        known += (uint32_t)eits_add_direction(ctx, scratch->square, known, EITS_BASIS_TOLERANCE,
                                              &f->macs);
    }
    for (uint32_t k = 0; k < f->count; ++k)
        place_by_slopes(ctx, scratch, f, k, scratch->square, known, unit);
}

void eits_check_count(eits_context *ctx, const eits_fit *f)
{
    if (!f->tested || !eits_wants(ctx, EITS_DIAGNOSTIC_CROWDED) || eits_is_faint(ctx))
        return;
    for (uint32_t k = 0; k < f->count; ++k) {
        if (ctx->evidence.spent || f->cut || f->pair[k] > EITS_PAIR_ODDS ||
            f->confidence[k] < EITS_MIN_CONFIDENCE)
            ctx->info.diagnostics |= EITS_DIAGNOSTIC_CROWDED;
    }
}
