/* The model in use, and the bank for the next one. */
#ifndef FW_MODELS_H
#define FW_MODELS_H

#include "eitskin/link.h"
#include "eitskin/model.h"
#include "hal/hal.h"

typedef struct fw_solve fw_solve;

typedef struct fw_model_file {
    const uint8_t *bytes;
    uint32_t size, crc, bank;
} fw_model_file;

/* Open the newest model that can be used; raises NO_MODEL if there is none. */
void fw_models_open_newest(fw_solve *solve);

/* Returns the file of the open model, in flash. */
fw_model_file fw_models_file(const fw_solve *solve);

/* Raise or clear NO_MODEL, depending on whether a model is open. */
void fw_models_report(fw_solve *solve);

/* Returns the bank that is not in use; while no model is open, one without a valid record. */
uint32_t fw_models_spare_bank(const fw_solve *solve);

/* Verify `size` bytes in a bank, and run the model's golden frame. Returns the status of the reply
 * to the host, with its details. The scan must have been stopped. */
eits_reply_status fw_models_try(fw_solve *solve, uint32_t bank, uint32_t size, uint32_t crc,
                                int32_t detail[2]);

/* Make that bank the newest one. Errors: as fw_store_commit. */
fw_status fw_models_commit(fw_solve *solve, uint32_t bank, uint32_t size, uint32_t crc);

#endif
