/* From a touch's strength and place to its load, by the model's calibration
 * (docs/guide/calibration.md). */
#include "eitskin/load.h"

#include "base/vec.h"

/* A polynomial is trusted near what it was fitted to only: its gain is kept within a factor of so
 * much of 1. */
static const eits_real MOST_GAIN = R(4.0);

/* The place in units of the calibration's radius, no further out than it was calibrated. */
static void place_of(const eits_load *load, eits_real x_mm, eits_real y_mm, eits_real *u,
                     eits_real *v)
{
    const eits_real reach = (eits_real)load->head->reach;
    *u = x_mm / (eits_real)load->head->radius_mm;
    *v = y_mm / (eits_real)load->head->radius_mm;
    const eits_real from = eits_sqrt(eits_fma(*u, *u, *v * *v));
    if (from > reach) {
        *u = *u / from * reach;
        *v = *v / from * reach;
    }
}

/* Sum of c u^a v^b over a + b <= order; by degree, then by falling power of u: 1, u, v, u^2, u v,
 * v^2... */
static eits_real gain_at(const eits_load *load, eits_real u, eits_real v)
{
    eits_real power[EITS_MAX_LOAD_ORDER + 1] = {1}, gain = 0; /* u^(degree - b) v^b, at b */
    const float *c = load->gain;
    for (uint32_t degree = 0; degree <= load->head->order; ++degree) {
        for (uint32_t b = 0; b <= degree; ++b)
            gain = eits_fma((eits_real)*c++, power[b], gain);
        if (degree == load->head->order)
            break;
        power[degree + 1] = power[degree] * v;
        for (uint32_t b = 0; b <= degree; ++b)
            power[b] *= u;
    }
    return gain > 1 / MOST_GAIN ? (gain < MOST_GAIN ? gain : MOST_GAIN) : 1 / MOST_GAIN;
}

eits_real eits_load_n(const eits_model *model, eits_real x_mm, eits_real y_mm,
                      eits_real strength_s_per_m_mm2)
{
    const eits_load *load = &model->load;
    if (load->head == NULL)
        return 0;
    eits_real u, v;
    place_of(load, x_mm, y_mm, &u, &v);
    const eits_real strength = eits_fabs(strength_s_per_m_mm2) * gain_at(load, u, v);
    const uint32_t last = load->head->points - 1;
    uint32_t k = 1;
    while (k < last && strength > (eits_real)load->strength[k])
        ++k;
    const eits_real s0 = (eits_real)load->strength[k - 1], s1 = (eits_real)load->strength[k];
    const eits_real n0 = (eits_real)load->load_n[k - 1], n1 = (eits_real)load->load_n[k];
    const eits_real found = eits_fma((strength - s0) / (s1 - s0), n1 - n0, n0),
                    most = 2 * (eits_real)load->load_n[last];
    /* beyond the table: its last slope, to twice its greatest load */
    return found < most ? found : most;
}
