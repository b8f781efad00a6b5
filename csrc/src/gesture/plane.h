/* Places, distances and angles in the plane of the skin. */
#ifndef EITSKIN_PLANE_H
#define EITSKIN_PLANE_H

#include "base/vec.h"
#include "gesture/constants.h"

static inline eits_real eits_distance(eits_real dx_mm, eits_real dy_mm)
{
    return eits_sqrt(dx_mm * dx_mm + dy_mm * dy_mm);
}

/* Returns 0 for a NaN, and for a coordinate so large that its square would overflow. */
static inline int eits_is_place(eits_real x_mm, eits_real y_mm)
{
    return eits_fabs(x_mm) <= EITS_MAX_PLACE_MM && eits_fabs(y_mm) <= EITS_MAX_PLACE_MM;
}

/* Returns the angle of (x, y) from the first axis, -180 to 180 degrees; 0 for (0, 0). */
eits_real eits_angle_deg(eits_real y, eits_real x);

#endif
