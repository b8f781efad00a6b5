/* What the test's numbers mean: how sure of a touch, and of its place; nothing where there was no
 * test. */
#include "check.h"

#include "evidence/constants.h"
#include "evidence/evidence.h"

#include <math.h>

static eits_fit rated(double rise, uint32_t tested, const eits_real *place_mm2)
{
    eits_fit f = {.count = 1, .tested = tested, .rise = {(eits_real)rise}};
    for (int i = 0; i < 3; ++i)
        f.place_mm2[0][i] = place_mm2[i];
    eits_rate_touches(&f);
    return f;
}

static void probability_is_logistic_in_the_logarithm_of_the_rise(void)
{
    const eits_real place[3] = {R(0.5), R(-0.25), R(0.75)};
    const double half = (double)EITS_CONFIDENCE_HALF, power = EITS_CONFIDENCE_STEPS / 2.0;
    double before = -1;
    for (double rise = 0.125; rise < 1e6; rise *= 1.25) {
        const double got = (double)rated(rise, 1, place).confidence[0];
        CHECK_NEAR(got, 1 / (1 + exp(-power * log(rise / half))), 1e-5);
        CHECK(got >= before && got <= 1);
        before = got;
    }
    const double odd[] = {0, -1, NAN};
    for (int k = 0; k < 3; ++k)
        CHECK(rated(odd[k], 1, place).confidence[0] == 0);
    CHECK(rated(1e38, 1, place).confidence[0] <= 1);
}

static void places_get_the_factor_and_the_least_there_is(void)
{
    const eits_real place[3] = {R(0.5), R(-0.25), R(0.75)};
    const eits_fit f = rated(100, 1, place);
    for (int i = 0; i < 3; ++i)
        CHECK_NEAR(f.place_mm2[0][i],
                   (double)(EITS_PLACE_FACTOR * place[i] + (i == 1 ? 0 : EITS_PLACE_MIN_MM2)),
                   1e-6);
    CHECK(f.place_mm2[0][0] * f.place_mm2[0][2] > f.place_mm2[0][1] * f.place_mm2[0][1]);
}

static void what_is_not_known_is_zero(void)
{
    const eits_real place[3] = {R(0.5), 0, R(0.5)};
    const eits_fit not_tested = rated(100, 0, place);
    CHECK(not_tested.confidence[0] == 0 && not_tested.place_mm2[0][0] == 0);
    const eits_real bad[][3] = {{R(NAN), 0, 1}, {1, R(INFINITY), 1}, {0, 0, 1}, {1, 0, -1}};
    for (int k = 0; k < 4; ++k) {
        const eits_fit f = rated(100, 1, bad[k]);
        for (int i = 0; i < 3; ++i)
            CHECK(f.place_mm2[0][i] == 0);
        CHECK(f.confidence[0] > 0);
    }
}

int main(void)
{
    probability_is_logistic_in_the_logarithm_of_the_rise();
    places_get_the_factor_and_the_least_there_is();
    what_is_not_known_is_zero();
    return checks_report("evidence_confidence");
}
