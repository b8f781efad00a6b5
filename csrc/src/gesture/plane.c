#include "gesture/plane.h"

/* Returns atan(t) in degrees for t from 0 to 1, by Abramowitz and Stegun, Handbook of Mathematical
 * Functions, 4.4.47: within 1e-5 rad. */
static eits_real angle_of_slope(eits_real t)
{
    const eits_real s = t * t;
    eits_real sum = R(0.0208351);
    sum = R(-0.0851330) + sum * s;
    sum = R(0.1801410) + sum * s;
    sum = R(-0.3302995) + sum * s;
    sum = R(0.9998660) + sum * s;
    return sum * t * R(57.29577951308232);
}

/* The C library's atan2 is not used: its last bits differ from target to target. */
eits_real eits_angle_deg(eits_real y, eits_real x)
{
    const eits_real high = eits_fabs(y), wide = eits_fabs(x);
    if (high == 0 && wide == 0)
        return 0;
    eits_real angle = high <= wide ? angle_of_slope(high / wide) : 90 - angle_of_slope(wide / high);
    angle = x < 0 ? 180 - angle : angle;
    return y < 0 ? -angle : angle;
}
