/* The interaction of touches: each lies in the field that the others change.
 *
 * A disc of area A whose change is `change` (for a contrast of c, 2 (c - 1) / (c + 1) of the skin's
 * conductivity sigma) responds to the field E as a dipole. At the distance vector r from it the
 * field grows by s (2 (E.u) u - E) / r^2, with u = r / |r| and s = change A / (2 pi sigma)
 * (two-dimensional potential theory: a cylinder in a uniform field). No current crosses the rim, so
 * the rim mirrors the dipole. The Jacobian describes each disc in the untouched field only. To
 * second order in the changes, the missing part is dV(drive, measure) = - C sum over discs i of
 * change_i A_i dE_i(drive) . E_i(measure), where dE_i is the field that the other discs add at disc
 * i. With x + iy for vectors, conj(dE) = s (E / r^2 - conj(E) / D^2). Here D = a - b z at the place
 * z, and a and b describe the mirror at the source's place (docs/reference/eitm-format.md, "FLDS").
 */
#ifndef EITSKIN_INTERACTION_H
#define EITSKIN_INTERACTION_H

#include "touch/disc.h"

/* Return 1 if this frame's touches are corrected for interaction: the model has fields, its data
 * are differences, and the option asks for it. */
int eits_has_interaction(const eits_context *ctx);

/* Return the disc's contribution to a dipole's strength, S mm^2/m: its change integrated over the
 * disc with its soft edge. */
eits_real eits_disc_moment(const eits_context *ctx, const eits_disc *disc);

/* `data` (stride numbers) = frame.y minus the part that the interaction of the discs adds to it, so
 * that the discs' own answers are left. Returns the multiply-accumulates.
 */
uint64_t eits_remove_interaction(eits_context *ctx, const eits_scratch *scratch,
                                 const eits_disc *disc, uint32_t count, eits_real *data);

#endif
