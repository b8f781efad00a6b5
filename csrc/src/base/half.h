/* Convert IEEE 754 half precision to float, exactly and including subnormal numbers. Infinities and
 * NaN do not occur: eits_model_open rejects them. */
#ifndef EITSKIN_HALF_H
#define EITSKIN_HALF_H

#include "base/arithmetic.h"

#include <stdint.h>
#include <string.h>

static inline float eits_half_to_float(uint16_t half)
{
#if defined(__ARM_ARCH_7EM__) && defined(__ARM_FP)
    /* both FPUs of that architecture convert halves, though GCC does not know this for fpv5-sp-d16
     */
    float value;
    __asm__("vmov %0, %1\n\tvcvtb.f32.f16 %0, %0" : "=t"(value) : "r"((uint32_t)half));
    return value;
#else
    /* the exponent and fraction as float bits, 112 too low in the exponent, corrected by an exact
     * multiplication by 2^112 */
    const uint32_t bits = (uint32_t)(half & 0x7FFFu) << 13;
    const uint32_t sign = (uint32_t)(half & 0x8000u) << 16;
    float value;
    memcpy(&value, &bits, sizeof value);
    value *= 0x1p112f;
    uint32_t result;
    memcpy(&result, &value, sizeof result);
    result |= sign;
    memcpy(&value, &result, sizeof value);
    return value;
#endif
}

/* Convert two neighbouring numbers, which takes one load. */
static inline void eits_halves_to_floats(const uint16_t *halves, float value[2])
{
#if defined(__ARM_ARCH_7EM__) && defined(__ARM_FP)
    uint32_t both;
    memcpy(&both, halves, sizeof both);
    __asm__("vmov %0, %2\n\tvcvtt.f32.f16 %1, %0\n\tvcvtb.f32.f16 %0, %0"
            : "=&t"(value[0]), "=&t"(value[1])
            : "r"(both));
#else
    value[0] = eits_half_to_float(halves[0]);
    value[1] = eits_half_to_float(halves[1]);
#endif
}

#endif
