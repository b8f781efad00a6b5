/* Whether a disc may be two touches side by side.
 *
 * Both an oblong touch and a pair of touches bulge the disc's edge along one axis. But an oblong
 * touch is also a stronger dipole along that axis, and two fingers, whose long axes lie across the
 * line of their middles, are a weaker one; and two make a wider disc than their strength suggests.
 * With a the edge's bulge, b the dipole's part along it, both over what is known of them, g the
 * growth of the radius that the linearisation asks for:
 *
 *     log odds = OFFSET + BULGE a + DIPOLE b + BOTH |bulge| |dipole| + GROWTH g + GROWTH_2 g^2
 *
 * fitted on scenes of one and of two (studies/results/belief.md). What is likelier two than one is
 * tried as two, side by side on the line along which the edge bulges (touch_test.c). */
#include "evidence/evidence.h"

#include "base/vec.h"
#include "evidence/constants.h"

static eits_real length(eits_real x, eits_real y)
{
    return eits_sqrt(eits_fma(x, x, y * y));
}

eits_real eits_pair_score(const eits_scratch *scratch, const eits_answer *answer,
                          const eits_likelihood *likelihood, uint32_t k)
{
    const uint32_t p = answer->parameters, first = k * p;
    if (p < EITS_SHAPE_PARAMETERS)
        return -1;
    const size_t stride = EITS_STRIDE(likelihood->count);
    eits_real at[EITS_SHAPE_PARAMETERS], deviation[EITS_SHAPE_PARAMETERS];
    for (uint32_t i = EITS_PLACE_PARAMETERS - 1; i < p; ++i) {
        const eits_real variance = scratch->square[(stride + 1u) * (first + i)];
        at[i] = likelihood->step[first + i] +
                (i < EITS_PLACE_PARAMETERS ? answer->disc[k].radius_mm / answer->radius_mm[k] - 1
                                           : answer->shape[k][i - EITS_PLACE_PARAMETERS]);
        deviation[i] =
            eits_sqrt(variance > EITS_PAIR_MIN_VARIANCE ? variance : EITS_PAIR_MIN_VARIANCE);
    }
    const eits_real bulge = length(at[4], at[5]), dipole = length(at[6], at[7]),
                    along = eits_fma(at[4], at[6], at[5] * at[7]) /
                            (bulge > EITS_PAIR_MIN_BULGE ? bulge : EITS_PAIR_MIN_BULGE);
    eits_real sum = eits_fma(EITS_PAIR_BULGE, bulge / deviation[4], EITS_PAIR_OFFSET);
    sum = eits_fma(EITS_PAIR_DIPOLE, along / deviation[6], sum);
    sum = eits_fma(EITS_PAIR_BOTH * bulge, dipole, sum);
    sum = eits_fma(EITS_PAIR_GROWTH, at[3], sum);
    return eits_fma(EITS_PAIR_GROWTH_2 * at[3], at[3], sum);
}

void eits_pair_line(const eits_answer *answer, const eits_likelihood *likelihood, uint32_t k,
                    eits_real line[2])
{
    const eits_real *step = likelihood->step + (size_t)k * answer->parameters;
    line[0] = line[1] = 0;
    if (answer->parameters < EITS_SHAPE_PARAMETERS)
        return;
    const eits_real x = answer->shape[k][0] + step[EITS_PLACE_PARAMETERS],
                    y = answer->shape[k][1] + step[EITS_PLACE_PARAMETERS + 1], bulge = length(x, y);
    eits_half_angle(x, y, bulge > EITS_PAIR_MIN_BULGE ? bulge : EITS_PAIR_MIN_BULGE, line);
}

/* Both of the same strength, and together of the area and strength of the one: where the one was
 * fitted to both, that is about what they have. */
int eits_split_disc(const eits_context *ctx, const eits_answer *one, uint32_t k,
                    const eits_real line[2], eits_answer *two)
{
    const uint32_t last = one->count;
    const eits_disc disc = one->disc[k];
    const eits_real least = ctx->options.touch_min_radius_mm, half = disc.radius_mm * R(0.70710678),
                    radius = half > least ? half : least, apart = EITS_SPLIT_APART * disc.radius_mm;
    *two = *one;
    two->count = last + 1u;
    two->parameters = eits_shape_parameters(ctx, two->count);
    for (int side = 0; side < 2; ++side) {
        const uint32_t at = side == 0 ? k : last;
        const eits_real away = side == 0 ? apart : -apart;
        two->disc[at] = disc;
        two->disc[at].x_mm = eits_fma(away, line[0], disc.x_mm);
        two->disc[at].y_mm = eits_fma(away, line[1], disc.y_mm);
        two->disc[at].radius_mm = two->radius_mm[at] = radius;
        two->disc[at].change =
            disc.change * disc.radius_mm * disc.radius_mm / (2 * radius * radius);
        memset(two->shape[at], 0, sizeof two->shape[at]);
    }
    return two->parameters > 0 && eits_disc_on_skin(ctx, &two->disc[k]) &&
           eits_disc_on_skin(ctx, &two->disc[last]);
}
