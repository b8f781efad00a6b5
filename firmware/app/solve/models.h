/* Which model is in use. */
#ifndef FW_MODELS_H
#define FW_MODELS_H

#include "app/instrument.h"
#include "app/link/answer.h"

/* Whether a model can be scanned here and its packets and memory have room: OK, MODEL_SCAN or
 * MODEL_SIZE. */
fw_answer fw_model_fits(const fw_instrument *instrument, const eits_model *model);

/* Open the newest model that can be used; raises NO_MODEL where there is none. */
void fw_open_newest(fw_instrument *instrument);

/* Raise or clear NO_MODEL, by whether one is open. */
void fw_report_no_model(fw_instrument *instrument);

#endif
