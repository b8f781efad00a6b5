/* Compute a touch's force from its strength and place, by the model's calibration
 * (docs/guide/calibration.md). */
#include "eitskin/force.h"

#include "base/vec.h"
#include "model/constants.h"
#include "model/sections.h"

/* The values must ascend strictly, since forces are interpolated between two points: equal ones
 * would divide by zero. */
static int ascends_from_zero(const float *values, uint32_t count)
{
    for (uint32_t k = 1; k < count; ++k) {
        if (!eits_between(values[k], 0, 1e30f) || !(values[k] > values[k - 1]))
            return 0;
    }
    return values[0] == 0.0f;
}

eits_status eits_read_force(eits_model *model, const eits_section *found)
{
    eits_force *force = &model->force;
    if (found->data == NULL)
        return EITS_OK;
    if (found->size < sizeof(eits_force_head))
        return EITS_E_MODEL_SECTION;
    const eits_force_head *head = (const eits_force_head *)(const void *)found->data;
    if (head->points < 2 || head->points > EITS_MAX_FORCE_POINTS ||
        head->order > EITS_MAX_FORCE_ORDER || !eits_between(head->radius_mm, 1e-6f, 1e30f) ||
        !eits_between(head->reach, 0, 1e3f) || !eits_between(head->uncertainty, 0, 1e30f))
        return EITS_E_MODEL_VALUE;
    /* `order` is bounded above, so this size is small and exact */
    const uint32_t terms = (head->order + 1) * (head->order + 2) / 2;
    if (found->size != sizeof *head + (2 * head->points + terms) * 4)
        return EITS_E_MODEL_SECTION;
    const float *numbers = (const float *)(const void *)(head + 1);
    *force = (eits_force){head, numbers, numbers + head->points, numbers + 2 * head->points};
    if (!ascends_from_zero(force->strength, head->points) ||
        !ascends_from_zero(force->force_n, head->points))
        return EITS_E_MODEL_VALUE;
    for (uint32_t k = 0; k < terms; ++k) {
        if (!eits_between(force->gain[k], -1e6f, 1e6f))
            return EITS_E_MODEL_VALUE;
    }
    return EITS_OK;
}

/* Compute the place in units of the calibration's radius, limited to the calibrated area. */
static void place_of(const eits_force *force, eits_real x_mm, eits_real y_mm, eits_real *u,
                     eits_real *v)
{
    const eits_real reach = (eits_real)force->head->reach;
    *u = x_mm / (eits_real)force->head->radius_mm;
    *v = y_mm / (eits_real)force->head->radius_mm;
    const eits_real from = eits_sqrt(eits_fma(*u, *u, *v * *v));
    if (from > reach) {
        *u = *u / from * reach;
        *v = *v / from * reach;
    }
}

/* Returns the sum of c u^a v^b over a + b <= order. The terms are sorted by degree, then by falling
 * power of u: 1, u, v, u^2, u v, v^2... */
static eits_real gain_at(const eits_force *force, eits_real u, eits_real v)
{
    eits_real power[EITS_MAX_FORCE_ORDER + 1] = {1}, gain = 0; /* u^(degree - b) v^b, at b */
    const float *c = force->gain;
    for (uint32_t degree = 0; degree <= force->head->order; ++degree) {
        for (uint32_t b = 0; b <= degree; ++b)
            gain = eits_fma((eits_real)*c++, power[b], gain);
        if (degree == force->head->order)
            break;
        power[degree + 1] = power[degree] * v;
        for (uint32_t b = 0; b <= degree; ++b)
            power[b] *= u;
    }
    /* With few calibrated places the polynomial may turn negative between them; the limits keep the
     * force from changing its sign. */
    return gain > 1 / EITS_MAX_GAIN ? (gain < EITS_MAX_GAIN ? gain : EITS_MAX_GAIN)
                                    : 1 / EITS_MAX_GAIN;
}

eits_real eits_force_n(const eits_model *model, eits_real x_mm, eits_real y_mm,
                       eits_real strength_s_per_m_mm2)
{
    const eits_force *force = &model->force;
    if (force->head == NULL)
        return 0;
    /* The gain holds for the calibrated places. Further out a polynomial would run away, so the
     * last place on the same ray is used. */
    eits_real u, v;
    place_of(force, x_mm, y_mm, &u, &v);
    const eits_real strength = eits_fabs(strength_s_per_m_mm2) * gain_at(force, u, v);
    const uint32_t last = force->head->points - 1;
    uint32_t k = 1;
    /* there are few points, so a linear search is as quick as a binary one; it stops at the last
     * segment */
    while (k < last && strength > (eits_real)force->strength[k])
        ++k;
    const eits_real s0 = (eits_real)force->strength[k - 1], s1 = (eits_real)force->strength[k];
    const eits_real n0 = (eits_real)force->force_n[k - 1], n1 = (eits_real)force->force_n[k];
    const eits_real found = eits_fma((strength - s0) / (s1 - s0), n1 - n0, n0),
                    max = 2 * (eits_real)force->force_n[last];
    /* beyond the table, its last slope continues, up to twice its greatest force */
    return found < max ? found : max;
}
