/* A disc or an ellipse in its own frame (multipole.h has the formulas). */
#include "multipole/form.h"

#include "base/vec.h"
#include "multipole/constants.h"

const eits_real eits_pole_binomial[EITS_POLE_TERMS + 1][EITS_POLE_TERMS + 1] = {
    {1},
    {1, 1},
    {1, 2, 1},
    {1, 3, 3, 1},
    {1, 4, 6, 4, 1},
    {1, 5, 10, 10, 5, 1},
    {1, 6, 15, 20, 15, 6, 1}};

const eits_real eits_pole_halves[EITS_POLE_TERMS + 1] = {2,        1,         R(0.5),    R(0.25),
                                                         R(0.125), R(0.0625), R(0.03125)};

void eits_add_times(eits_real *out, eits_complex s, const eits_real *a, uint32_t electrodes)
{
    eits_real *im = out + electrodes;
    const eits_real *a_im = a + electrodes;
    for (uint32_t e = 0; e < electrodes; ++e) {
        out[e] = eits_fma(s.re, a[e], eits_fma(-s.im, a_im[e], out[e]));
        im[e] = eits_fma(s.re, a_im[e], eits_fma(s.im, a[e], im[e]));
    }
}

/* Return eta; `axis` gets e^(i phi) of the long axis. */
static eits_real long_axis(const eits_shape *s, eits_complex *axis)
{
    const eits_real eta = eits_pole_eta(s);
    eits_real unit[2];
    *axis = (eits_complex){1, 0};
    if (!(eta > R(1e-6)))
        return 0;
    eits_half_angle(s->e1, s->e2, eta, unit);
    *axis = (eits_complex){unit[0], unit[1]};
    return eta < EITS_POLE_MAX_ETA ? eta : EITS_POLE_MAX_ETA;
}

/* T_nk = f^(k-n) 2^(1-k) binomial(k, (k-n)/2) e^(i k phi) */
static void set_modes(eits_form *f)
{
    for (uint32_t n = 1; n <= f->orders; ++n) {
        eits_real power = 1;
        for (uint32_t k = n; k <= f->orders; k += 2u) {
            const eits_real factor =
                power * eits_pole_halves[k] * eits_pole_binomial[k][(k - n) / 2u];
            f->to_mode[n - 1u][k - 1u] = eits_scaled(factor, f->turn[k - 1u]);
            power *= f->f2;
        }
    }
}

eits_form eits_form_of(const eits_shape *s, uint32_t orders)
{
    eits_form f;
    eits_complex axis;
    const eits_real eta = long_axis(s, &axis), r2 = s->radius * s->radius;
    const eits_real contrast = (2 + s->amplitude) / (2 - s->amplitude);
    /* a + b and a - b squared: with a b = r^2, (a + b)^2 = 4 r^2 / (1 - eta^2) */
    const eits_real wide = 4 * r2 / (1 - eta * eta), narrow = eta * eta * wide;
    f.orders = orders;
    f.f2 = eta * wide;
    f.excess = contrast - 1;
    eits_complex turn = {1, 0};
    eits_real en = 1, wn = 1, nn = 1;
    for (uint32_t n = 0; n < orders; ++n) {
        turn = eits_times(turn, axis);
        en *= eta;
        wn *= wide;
        nn *= narrow;
        f.turn[n] = turn;
        f.tc[n] = 2 / (eits_fma(contrast, 1 - en, 1 + en));
        f.ts[n] = 2 / (eits_fma(contrast, 1 + en, 1 - en));
        f.gap[n] = wn - nn;
    }
    set_modes(&f);
    return f;
}

void eits_modes(const eits_form *f, const eits_real *a, uint32_t electrodes, eits_real *out)
{
    const size_t width = 2u * (size_t)electrodes;
    for (uint32_t n = 0; n < f->orders; ++n) {
        eits_real *to = out + width * n;
        eits_zero(to, width);
        for (uint32_t k = n; k < f->orders; k += 2u) {
            eits_add_times(to, f->to_mode[n][k], a + width * k, electrodes);
            if (f->f2 == 0)
                break;
        }
    }
}
