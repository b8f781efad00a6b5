#include "base/arithmetic.h"

#ifdef EITS_DOUBLE
#define TINY  0x1p-27
#define UNIT  0x1p-52
#define LEAST 0x1p-1022
#else
#define TINY  0x1p-12
#define UNIT  0x1p-23
#define LEAST 0x1p-126
#endif

/* Each of these sums is 0 in plain IEEE arithmetic and another number in any other arithmetic. (1 +
 * e)^2 - (1 + 2e) is 0 if the product is rounded before the sum, since e^2 is below half a bit of
 * 1, and e^2 if the compiler contracts both into a fused multiply-add. (large + 1) - large is 0 if
 * the first sum is rounded first, and 1 if the compiler changes the order of sums. 1 + 3/4 unit
 * gives 1 + unit if sums are rounded to nearest or up; the first sum shows a product that is
 * rounded up. Half the least normal number is 0 if the processor flushes subnormal numbers.
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
}

eits_status eits_judge_arithmetic(const eits_real left[EITS_ARITHMETIC_TRIALS])
{
    for (int k = 0; k < EITS_ARITHMETIC_TRIALS; ++k) {
        if (left[k] != 0)
            return EITS_E_ARITHMETIC;
    }
    return EITS_OK;
}
