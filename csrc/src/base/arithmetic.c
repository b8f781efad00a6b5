#include "base/arithmetic.h"
#include "base/fma.h"

#ifdef EITS_DOUBLE
#define TINY    0x1p-27
#define UNIT    0x1p-52
#define LEAST   0x1p-1022
/* their product is 2^53 + 1 */
#define FACTORS 321.0, 28059810762433.0
#else
#define TINY    0x1p-12
#define UNIT    0x1p-23
#define LEAST   0x1p-126
/* their product is 2^24 + 1 */
#define FACTORS 24929.0f, 673.0f
#endif

/* Each of these sums is 0 in plain IEEE arithmetic and another number in any other arithmetic. (1 +
 * e)^2 - (1 + 2e) is 0 if the product is rounded before the sum, since e^2 is below half a bit of
 * 1, and e^2 if the compiler contracts both into a fused multiply-add. (large + 1) - large is 0 if
 * the first sum is rounded first, and 1 if the compiler changes the order of sums. 1 + 3/4 unit
 * gives 1 + unit if sums are rounded to nearest or up; the first sum shows a product that is
 * rounded up. Half the least normal number is 0 if the processor flushes subnormal numbers.
 *
 * The product of the two FACTORS lies halfway between two numbers. With the little that is added,
 * it is rounded up, unless the sum was rounded before; then it goes to the even one below.
 *
 * The numbers are volatile, so that the program and not the compiler computes the sums. */
void eits_try_arithmetic(eits_real left[EITS_ARITHMETIC_TRIALS])
{
    volatile eits_real tiny = (eits_real)TINY, one = 1, last = (eits_real)UNIT,
                       least = (eits_real)LEAST, half = (eits_real)0.5;
    const eits_real e = tiny, unit = one, factor = unit + e, known = -(unit + 2 * e);
    left[0] = factor * factor + known;
    const eits_real large = unit / (e * e);
    left[1] = (large + unit) - large;
    volatile eits_real near = unit + (eits_real)0.75 * last, small = least * half;
    left[2] = near - (unit + last);
    left[3] = 2 * small - least;
    volatile eits_real halves[3] = {FACTORS, (eits_real)0x1p-60};
    const eits_real fused = eits_fma(halves[0], halves[1], halves[2]);
    left[4] = fused - (halves[0] * halves[1] + 2);
}

#if defined(EITS_OWN_FMA) && defined(EITS_DOUBLE)
__attribute__((target("fma"))) static double fused(double a, double b, double c)
{
    return __builtin_fma(a, b, c);
}

double eits_double_fma(double a, double b, double c)
{
    return __builtin_cpu_supports("fma") ? fused(a, b, c) : fma(a, b, c);
}
#endif

eits_status eits_judge_arithmetic(const eits_real left[EITS_ARITHMETIC_TRIALS])
{
    for (int k = 0; k < EITS_ARITHMETIC_TRIALS; ++k) {
        if (left[k] != 0)
            return EITS_E_ARITHMETIC;
    }
    return EITS_OK;
}
