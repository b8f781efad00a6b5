/* One shape, and its response to the field in which it lies. */
#ifndef EITSKIN_FORM_H
#define EITSKIN_FORM_H

#include "multipole/complex.h"
#include "multipole/multipole.h"

/* binomial(n, (n - k) / 2) for n, k up to EITS_POLE_TERMS, and 2^(1-n). */
extern const eits_real eits_pole_binomial[EITS_POLE_TERMS + 1][EITS_POLE_TERMS + 1];
extern const eits_real eits_pole_halves[EITS_POLE_TERMS + 1];

typedef struct eits_form {
    uint32_t orders;
    eits_complex turn[EITS_POLE_TERMS]; /* e^(i n phi), n = 1 ... orders */
    eits_real f2;                       /* a^2 - b^2 */
    eits_real excess;                   /* contrast - 1 */
    eits_real tc[EITS_POLE_ORDERS], ts[EITS_POLE_ORDERS];
    eits_real gap[EITS_POLE_ORDERS]; /* (a+b)^(2n) - (a-b)^(2n) */
    /* beta_n+1 = sum over k = n, n + 2, ... of to_mode[n][k] a_k+1; the others are not set */
    eits_complex to_mode[EITS_POLE_ORDERS][EITS_POLE_ORDERS];
} eits_form;

eits_form eits_form_of(const eits_shape *s, uint32_t orders);

/* Compute beta_n of each electrode from the Taylor coefficients `a`. */
void eits_modes(const eits_form *f, const eits_real *a, uint32_t electrodes, eits_real *out);

/* out += s a, for complex arrays of `electrodes` numbers (real parts, then imaginary parts). */
void eits_add_times(eits_real *out, eits_complex s, const eits_real *a, uint32_t electrodes);

#endif
