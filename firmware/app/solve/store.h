/* Two model banks in flash. Each ends with a record that says how new its model is; without a valid
 * record a bank holds no model.
 *
 * A model is programmed into the bank that is not in use, and its record last. So after a power cut
 * at any byte the old bank is still the newest valid one. */
#ifndef FW_STORE_H
#define FW_STORE_H

#include "eitskin/model.h"
#include "hal/hal.h"

#define FW_RECORD_MAGIC 0x4B4E4245u /* "EBNK" */
#define FW_RECORD_BYTES 32u

typedef struct fw_record {
    uint32_t magic;
    uint32_t generation; /* counts up with each model; wraps */
    uint32_t model_bytes;
    uint32_t model_crc; /* CRC-32 of all of them */
    uint32_t reserved[3];
    uint32_t crc; /* of the 28 bytes before */
} fw_record;

/* Returns the maximum number of bytes of a model. */
uint32_t fw_store_room(const fw_store *store);

/* Read the record of a bank. Returns false if it is not valid. The model is not checked. */
bool fw_store_record(const fw_store *store, uint32_t bank, fw_record *record);

/* Open the model of a bank. Errors: EITS_E_MODEL_CRC if it does not match the record,
 * EITS_E_MODEL_*. */
eits_status fw_store_open(const fw_store *store, uint32_t bank, const fw_record *record,
                          eits_model *model);

/* List the banks with a valid record, the newest first. Returns their number. */
uint32_t fw_store_newest(const fw_store *store, uint32_t banks[FW_BANKS]);

/* Make a bank valid, as the last step. Errors: those of programming; FW_E_FLASH if the record does
 * not read back. */
fw_status fw_store_commit(const fw_store *store, uint32_t bank, uint32_t generation,
                          uint32_t model_bytes, uint32_t model_crc);

#endif
