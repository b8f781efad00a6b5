/* Small vector sums in a fixed order: eight lanes, each a chain of fused multiply-adds, then a
 * fixed tree. */
#ifndef EITSKIN_VEC_H
#define EITSKIN_VEC_H

#include "base/arithmetic.h"
#include "base/fma.h"

#include <math.h>
#include <string.h>

#ifdef EITS_DOUBLE
#define eits_sqrt sqrt
#define eits_fabs fabs
#else
#define eits_sqrt sqrtf
#define eits_fabs fabsf
#endif

#define R(x) ((eits_real)(x))

static inline eits_real eits_tree8(const eits_real lane[8])
{
    return ((lane[0] + lane[4]) + (lane[2] + lane[6])) +
           ((lane[1] + lane[5]) + (lane[3] + lane[7]));
}

static inline void eits_zero(eits_real *out, size_t count)
{
    memset(out, 0, count * sizeof *out);
}

static inline void eits_copy(eits_real *out, const eits_real *a, size_t count)
{
    memmove(out, a, count * sizeof *out); /* memmove, since `out` may be `a` */
}

static inline eits_real eits_larger(eits_real a, eits_real b)
{
    return a > b ? a : b;
}

static inline eits_real eits_clamp(eits_real v, eits_real low, eits_real high)
{
    return v < low ? low : (v > high ? high : v);
}

/* Returns 1 if the value is finite. It tests the exponent's bits, so that no compiler flag can
 * remove the test. */
static inline int eits_is_finite(eits_real value)
{
#ifdef EITS_DOUBLE
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return (bits & 0x7FF0000000000000u) != 0x7FF0000000000000u;
#else
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return (bits & 0x7F800000u) != 0x7F800000u;
#endif
}

/* Returns 1 if each of the values is finite. */
static inline int eits_all_finite(const eits_real *values, size_t count)
{
    int all = 1;
    for (size_t i = 0; i < count; ++i)
        all &= eits_is_finite(values[i]);
    return all;
}

/* Compute the unit vector at half the angle of (x, y), between -90 and 90 degrees; `size` is the
 * length of (x, y). */
static inline void eits_half_angle(eits_real x, eits_real y, eits_real size, eits_real axis[2])
{
    const eits_real cosine = x / size;
    axis[0] = eits_sqrt(cosine < -1 ? 0 : (1 + cosine) / 2);
    axis[1] = eits_sqrt(cosine > 1 ? 0 : (1 - cosine) / 2);
    if (y < 0)
        axis[1] = -axis[1];
}

#endif
