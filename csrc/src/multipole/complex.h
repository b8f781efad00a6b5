/* Complex numbers as pairs, with a fixed order of roundings. */
#ifndef EITSKIN_COMPLEX_H
#define EITSKIN_COMPLEX_H

#include "base/vec.h"

typedef struct eits_complex {
    eits_real re, im;
} eits_complex;

static inline eits_complex eits_times(eits_complex a, eits_complex b)
{
    return (eits_complex){eits_fma(a.re, b.re, -(a.im * b.im)), eits_fma(a.re, b.im, a.im * b.re)};
}

/* sum + a b */
static inline eits_complex eits_plus_times(eits_complex sum, eits_complex a, eits_complex b)
{
    return (eits_complex){eits_fma(a.re, b.re, eits_fma(-a.im, b.im, sum.re)),
                          eits_fma(a.re, b.im, eits_fma(a.im, b.re, sum.im))};
}

static inline eits_complex eits_scaled(eits_real s, eits_complex a)
{
    return (eits_complex){s * a.re, s * a.im};
}

static inline eits_complex eits_conjugate(eits_complex a)
{
    return (eits_complex){a.re, -a.im};
}

/* Return 1 / a, or 0 if a is almost zero, as with two middles in one place. */
static inline eits_complex eits_inverse(eits_complex a)
{
    const eits_real square = eits_fma(a.re, a.re, a.im * a.im);
    if (!(square > R(1e-12)))
        return (eits_complex){0, 0};
    return (eits_complex){a.re / square, -(a.im / square)};
}

#endif
