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

/* Sums that any other arithmetic than plain IEEE gives another result for. (1 + e)^2 - (1 + 2
 * e) is 0 where the product is rounded before the sum, since e^2 is below half a bit of 1, and e^2
 * where both are one operation (contraction to a fused multiply-add). (large + 1) - large is 0
 * where the sum is rounded first, and 1 where a compiler may change the order of sums. 1 and 3/4 of
 * its unit make 1 and a unit where rounding is to nearest or up; a product that goes up is left by
 * the first. Half the least normal number is 0 where a processor flushes subnormals.
 *
 * Volatile, so that the operations are done by the program and not by the compiler. */
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
