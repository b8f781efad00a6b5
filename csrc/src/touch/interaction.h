/* The interaction of touches: each lies in the field that the others change.
 *
 * The Jacobian describes each disc in the untouched field only: dV = - C integral of change
 * E(drive) . E(measure). That is the multipole model's answer of a disc in the electrodes' own
 * field (multipole/multipole.h), with q = change / sigma, sigma the skin's conductivity. The
 * interaction is what the answers change by in the field that the other discs and their images in
 * the rim send out. A disc's own image is left out: halves of one touch would have it twice.
 */
#ifndef EITSKIN_INTERACTION_H
#define EITSKIN_INTERACTION_H

#include "multipole/multipole.h"
#include "touch/disc.h"

/* Return 1 if this frame's touches are corrected for interaction: the model has fields, its data
 * are differences, and the option asks for it. */
int eits_has_interaction(const eits_context *ctx);

/* Return the disc as the multipole model varies it. */
eits_shape eits_disc_as_shape(const eits_context *ctx, const eits_disc *disc);

/* `data` (stride numbers) = frame.y minus the part that the interaction of the discs adds to it, so
 * that the discs' own answers are left. The multipole model's slots then hold these discs. Returns
 * the multiply-accumulates. */
uint64_t eits_remove_interaction(eits_context *ctx, const eits_scratch *scratch,
                                 const eits_disc *disc, uint32_t count, eits_real *data);

#endif
