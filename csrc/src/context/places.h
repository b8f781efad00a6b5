/* From where the modelled skin has a touch to where it lies, and back. */
#ifndef EITSKIN_PLACES_H
#define EITSKIN_PLACES_H

#include "context/context.h"

/* Whether places are corrected by what the reference tells: with row gains, for which it holds. */
int eits_corrects_places(const eits_context *ctx);

/* Whether the model has what multipoles take: fields, and data that are differences. */
int eits_has_poles(const eits_context *ctx);

/* Whether touches are fitted jointly (joint/joint.h): the option is on, and the model has the
 * fields and the row errors that it takes. */
int eits_may_fit_jointly(const eits_context *ctx);

/* 1 where the reference is so far from the model that its errors matter in the joint fit, else 0:
 * the index of eits_row_errors.moves. */
uint32_t eits_weighs_errors(const eits_context *ctx);

/* at, mm: from where the modelled skin has a touch to where it lies; by at most EITS_MAX_SHIFT. */
void eits_place_on_skin(const eits_context *ctx, eits_real at[2]);

/* And back. */
void eits_place_in_model(const eits_context *ctx, eits_real at[2]);

#endif
