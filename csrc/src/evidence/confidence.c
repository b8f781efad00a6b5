/* What the test's numbers have meant on scenes with a truth.
 *
 * The test tells how much more likely the data are with a disc than without, under the errors that
 * the model admits to. It does not say how often that has been right, nor how far places were off:
 * both were counted on scenes of other worlds (docs/results/belief.md). A disc is one touch with
 * probability 1 / (1 + (HALF / rise)^n), a logistic function of the logarithm of its rise; n a
 * multiple of a half, so that roots and products do. */
#include "evidence/evidence.h"

#include "base/vec.h"
#include "evidence/constants.h"

/* ratio^(steps / 2), 0 <= ratio <= 1 */
static eits_real power(eits_real ratio, int steps)
{
    eits_real product = steps % 2 != 0 ? eits_sqrt(ratio) : 1;
    for (int k = 0; k < steps / 2; ++k)
        product *= ratio;
    return product;
}

static eits_real probability(eits_real rise)
{
    if (!(rise > 0))
        return 0;
    if (rise > EITS_CONFIDENCE_HALF)
        return 1 / (1 + power(EITS_CONFIDENCE_HALF / rise, EITS_CONFIDENCE_STEPS));
    const eits_real odds = power(rise / EITS_CONFIDENCE_HALF, EITS_CONFIDENCE_STEPS);
    return odds / (1 + odds);
}

void eits_rate_touches(eits_fit *f)
{
    for (uint32_t k = 0; k < f->count; ++k) {
        eits_real *place = f->place_mm2[k];
        if (!f->tested || !eits_all_finite(place, 3) || !(place[0] > 0) || !(place[2] > 0)) {
            eits_zero(place, 3);
        } else {
            for (uint32_t i = 0; i < 3; ++i)
                place[i] = eits_fma(EITS_PLACE_FACTOR, place[i], i == 1 ? 0 : EITS_PLACE_MIN_MM2);
        }
        f->confidence[k] = f->tested ? probability(f->rise[k]) : 0;
    }
}
