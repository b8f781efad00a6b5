/* eits_fma(a, b, c) is a b + c, rounded once. The function of C libraries is exact, except that of
 * mingw-w64, which rounds twice. There the functions below are used, unless the compiler may use
 * the processor's own instruction. Include base/arithmetic.h first; it forbids contraction. */
#ifndef EITSKIN_FMA_H
#define EITSKIN_FMA_H

#include "eitskin/types.h"

#include <math.h>
#include <string.h>

#if defined(__MINGW32__) && defined(__x86_64__) && !defined(__FMA__)
#define EITS_OWN_FMA
#endif

/* In float: the product is exact in double. The sum is rounded to odd, by its exact error (Knuth's
 * two-sum), so that rounding it to float is as if it were the only rounding (Boldo and Melquiond
 * 2008). Products and sums of floats are finite in double. */
static inline float eits_float_fma(float a, float b, float c)
{
    const double product = (double)a * (double)b, sum = product + (double)c;
    const double high = sum - product, error = (product - (sum - high)) + ((double)c - high);
    uint64_t bits;
    memcpy(&bits, &sum, sizeof bits);
    if ((error > 0 || error < 0) && (bits & 1u) == 0)
        bits = (error > 0) == (sum > 0) ? bits + 1 : bits - 1;
    double odd;
    memcpy(&odd, &bits, sizeof odd);
    return (float)odd;
}

#ifndef EITS_OWN_FMA
#ifdef EITS_DOUBLE
#define eits_fma fma
#else
#define eits_fma fmaf
#endif
#elif defined(EITS_DOUBLE)
/* Uses the processor's instruction, if it has one; otherwise the result is rounded twice, which
 * eits_init reports. */
double eits_double_fma(double a, double b, double c);
#define eits_fma eits_double_fma
#else
#define eits_fma eits_float_fma
#endif

#endif
