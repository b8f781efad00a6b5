/* Convert a touch's place in the modelled skin to its place on the real skin, and back. */
#ifndef EITSKIN_PLACES_H
#define EITSKIN_PLACES_H

#include "context/context.h"

/* Return 1 if places are corrected by the reference. This is so with row gains, for which the
 * correction was computed. */
int eits_corrects_places(const eits_context *ctx);

/* Return 1 if the model fulfils the conditions of the multipole model: it has fields, and its data
 * are differences. */
int eits_has_poles(const eits_context *ctx);

/* Return 1 if touches may be fitted jointly (joint/joint.h): the option is on, and the model has
 * the fields and the row errors for it. */
int eits_may_fit_jointly(const eits_context *ctx);

/* Return 1 if the reference is so far from the model that the model's errors matter in the joint
 * fit, else 0. The result is an index of eits_row_errors.moves. */
uint32_t eits_weighs_errors(const eits_context *ctx);

/* Change `at`, mm, from a touch's place in the modelled skin to its place on the real skin. The
 * shift is at most EITS_MAX_SHIFT. */
void eits_place_on_skin(const eits_context *ctx, eits_real at[2]);

/* Change `at` back. */
void eits_place_in_model(const eits_context *ctx, eits_real at[2]);

#endif
