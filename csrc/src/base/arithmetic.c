#include "base/arithmetic.h"

#ifdef EITS_DOUBLE
#define TINY 0x1p-27
#else
#define TINY 0x1p-12
#endif

/* Two sums that any other arithmetic than plain IEEE gives another result for. (1 + e)^2 - (1 + 2
 * e) is 0 where the product is rounded before the sum, since e^2 is below half a bit of 1, and e^2
 * where both are one operation (contraction to a fused multiply-add). (large + 1) - large is 0
 * where the sum is rounded first, and 1 where a compiler may change the order of sums.
 *
 * Volatile, so that the operations are done by the program and not by the compiler. */
void eits_try_arithmetic(eits_real *contracted, eits_real *reordered)
{
    volatile eits_real tiny = (eits_real)TINY, one = 1;
    const eits_real e = tiny, unit = one, factor = unit + e, known = -(unit + 2 * e);
    *contracted = factor * factor + known;
    const eits_real large = unit / (e * e);
    *reordered = (large + unit) - large;
}

eits_status eits_judge_arithmetic(eits_real contracted, eits_real reordered)
{
    if (contracted != 0 || reordered != 0)
        return EITS_E_ARITHMETIC;
    return EITS_OK;
}
