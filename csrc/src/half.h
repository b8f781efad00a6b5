/* IEEE 754 half precision to float, exactly; subnormals too. Infinities and NaN are refused when a model is opened. */
#ifndef EITSKIN_HALF_H
#define EITSKIN_HALF_H

#include <stdint.h>
#include <string.h>

static inline float eits_half_to_float(uint16_t half)
{
#if defined(__ARM_FP) && (__ARM_FP & 2) && defined(__ARM_FP16_FORMAT_IEEE)
    __fp16 value;
    memcpy(&value, &half, sizeof value);
    return (float)value; /* VCVTB.F32.F16 */
#else
    /* the exponent and fraction as float bits, 112 too low in the exponent, mended by an exact multiplication by 2^112 */
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

#endif
