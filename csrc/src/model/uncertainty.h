/* Section UNCE of a model: what the model itself may be wrong by. */
#ifndef EITSKIN_UNCERTAINTY_H
#define EITSKIN_UNCERTAINTY_H

#include "eitskin/model.h"

/* model->uncertainty from the section's bytes; all zero where `bytes` is NULL, that is where the
 * model has no such section. model->rank and row_form are known.
 * Errors: EITS_E_MODEL_SECTION (its size), EITS_E_MODEL_VALUE (numbers that are not finite, a
 * variance below 0, or a model that does not say how it was whitened). */
eits_status eits_read_uncertainty(eits_model *model, const uint8_t *bytes, uint32_t size);

#endif
