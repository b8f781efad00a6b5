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
 * fitted on scenes of one and of two (docs/results/belief.md). */
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
