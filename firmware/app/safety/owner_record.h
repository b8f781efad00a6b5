/* The owner's settings in flash: records one behind another in two pages; the latest one counts. A
 * full page is not erased before the other page holds a record. So after a power cut at any write
 * there are either the old settings or the new ones. */
#ifndef FW_OWNER_RECORD_H
#define FW_OWNER_RECORD_H

#include "hal/hal.h"

#define FW_OWNER_RECORD_MAGIC 0x54455345u /* "ESET" */
#define FW_OWNER_RECORD_BYTES 32u

typedef struct fw_owner_record {
    uint32_t magic;
    uint32_t generation; /* counts up with each record; wraps */
    uint32_t settings;   /* bits of eits_setting */
    uint32_t current_limit_ua_rms;
    uint32_t reserved[3];
    uint32_t crc; /* of the 28 bytes before */
} fw_owner_record;

/* The latest settings; all 0 if there are none. */
fw_owner_record fw_owner_record_load(const fw_store *store);

/* Store these. Errors: those of erasing and programming; FW_E_RANGE if the board stores none. The
 * old settings stay then. */
fw_status fw_owner_record_save(const fw_store *store, uint32_t settings,
                               uint32_t current_limit_ua_rms);

#endif
