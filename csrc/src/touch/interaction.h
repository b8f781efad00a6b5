/* What touches do to each other: each lies in the field that the others bend.
 *
 * A disc of radius R whose change is `change` (2 (c - 1) / (c + 1) of the skin's conductivity
 * sigma for a contrast of c) answers the field E as a dipole; at the distance vector r from it the
 * field grows by s (2 (E.u) u - E) / r^2, u = r / |r|, s = change area / (2 pi sigma)
 * (two-dimensional potential theory: a cylinder in a uniform field). The rim, which no current
 * crosses, mirrors the dipole. The Jacobian knows each disc in the untouched field only; to second
 * order in the changes, what it leaves out is dV(drive, measure) = - C sum over discs i of change_i
 * area_i dE_i(drive) . E_i(measure), dE_i the field that the others add at disc i. With x + iy for
 * vectors, conj(dE) = s (E / r^2 - conj(E) / D^2), D = a - b z of the place z, where a and b
 * describe the mirror at the source's place (docs/reference/eitm-format.md, "FLDS"). */
#ifndef EITSKIN_INTERACTION_H
#define EITSKIN_INTERACTION_H

#include "touch/disc.h"

/* Whether this frame's touches can be corrected for interaction: the model has the fields, its data
 * are differences, the option asks for it. */
int eits_has_interaction(const eits_context *ctx);

/* S/m mm^2: what the disc adds to a dipole's strength, its change integrated over its soft edge. */
eits_real eits_disc_moment(const eits_context *ctx, const eits_disc *disc);

/* `data` (stride numbers) = frame.y less what the interaction of the discs adds to it, so that
 * the discs' own answers are left. Returns the
 * multiply-accumulates.
 */
uint64_t eits_remove_interaction(eits_context *ctx, const eits_scratch *scratch,
                                 const eits_disc *disc, uint32_t count, eits_real *data);

#endif
