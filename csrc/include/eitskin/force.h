/* eitskin: how hard a touch presses, on a skin that was calibrated with known weights.
 *
 * A press changes the conductivity more the harder it is, but not in proportion: the gel saturates.
 * And the same press gives another strength at another place. Calibration
 * (docs/guide/calibration.md) fits both: a gain, a polynomial in the place, that makes strengths
 * comparable; and a table from strength to newtons. eits_find_touches fills in eits_touch.force_n
 * by this function.
 */
#ifndef EITSKIN_FORCE_H
#define EITSKIN_FORCE_H

#include "eitskin/model.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The force in newtons of a touch of this strength (S/m mm^2, of either sign) at (x, y), by the
 * section LOAD of an open model; 0 where it has none. The strength times the gain of the place is
 * looked up in the table, straight between its points; beyond the last, the last slope goes on to
 * twice the greatest force; a place further out than was calibrated counts as on the calibrated
 * rim.
 */
eits_real eits_force_n(const eits_model *model, eits_real x_mm, eits_real y_mm,
                       eits_real strength_s_per_m_mm2);

#ifdef __cplusplus
}
#endif
#endif
