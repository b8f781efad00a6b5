/* eitskin: how hard a touch presses, on a skin that was calibrated with known weights.
 *
 * A harder press changes the conductivity more, but not in proportion, because the gel saturates.
 * The same press also gives a different strength at a different place. Calibration
 * (docs/guide/calibration.md) fits both: a gain, a polynomial in the place, which makes strengths
 * comparable; and a table from strength to newtons. eits_find_touches fills in eits_touch.force_n
 * with this function.
 */
#ifndef EITSKIN_FORCE_H
#define EITSKIN_FORCE_H

#include "eitskin/model.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The force, N, of a touch of this strength (S mm^2/m, of either sign) at (x, y), by the model's
 * section LOAD; 0 if the model has none. The strength times the gain at that place is looked up in
 * the table, with straight lines between its points. Beyond the last point the last slope
 * continues, up to twice the greatest force. A place further out than the calibration went counts
 * as on the rim of the calibrated area. */
eits_real eits_force_n(const eits_model *model, eits_real x_mm, eits_real y_mm,
                       eits_real strength_s_per_m_mm2);

#ifdef __cplusplus
}
#endif
#endif
