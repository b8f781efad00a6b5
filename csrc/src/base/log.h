/* The natural logarithm by basic operations only, so that its bits do not depend on a C library. */
#ifndef EITSKIN_LOG_H
#define EITSKIN_LOG_H

#include "base/vec.h"

/* Returns log(q) for a finite q > 0 that is not subnormal. With q = 2^k f, f in [sqrt(1/2), sqrt 2)
 * and s = (f-1)/(f+1), |s| < 0.172, log f = 2 atanh(s), by the series of atanh up to s^11 (float: 6
 * terms) or s^23 (double: 12 terms), truncated below one unit in the last place. */
static inline eits_real eits_log(eits_real q)
{
    int k = 0;
    while (q >= R(1.41421356237309504880)) {
        q *= R(0.5);
        ++k;
    }
    while (q < R(0.70710678118654752440)) {
        q *= R(2.0);
        --k;
    }
    const eits_real s = (q - 1) / (q + 1), s2 = s * s;
#ifdef EITS_DOUBLE
    const int terms = 12;
#else
    const int terms = 6;
#endif
    eits_real sum = 0;
    for (int n = terms - 1; n >= 0; --n)
        sum = eits_fma(sum, s2, 1 / (eits_real)(2 * n + 1));
    return eits_fma((eits_real)k, R(0.69314718055994530942), 2 * s * sum);
}

#endif
