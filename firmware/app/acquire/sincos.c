#include "app/acquire/sincos.h"

/* Taylor's series around the nearest quarter turn, at most an eighth of a turn away: the first
 * omitted term is below 3e-8. */
void fw_sincos(uint32_t turn, float *cosine, float *sine)
{
    const uint32_t quarter = (turn + 0x20000000u) >> 30;
    const int32_t rest = (int32_t)(turn - (quarter << 30));
    const float x = (float)rest * 1.46291807926715968e-9f; /* 2 pi / 2^32 */
    const float q = x * x;
    const float s =
        x * (1.0f + q * (-1.0f / 6.0f +
                         q * (1.0f / 120.0f + q * (-1.0f / 5040.0f + q * (1.0f / 362880.0f)))));
    const float c =
        1.0f + q * (-0.5f + q * (1.0f / 24.0f + q * (-1.0f / 720.0f + q * (1.0f / 40320.0f))));
    switch (quarter & 3u) {
    case 0:
        *cosine = c;
        *sine = s;
        break;
    case 1:
        *cosine = -s;
        *sine = c;
        break;
    case 2:
        *cosine = -c;
        *sine = -s;
        break;
    default:
        *cosine = s;
        *sine = -c;
        break;
    }
}
