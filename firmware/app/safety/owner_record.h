/* The owner's settings in flash: records one behind another in two pages, the latest counts. A
 * full page is left as it is until the other one has begun, so that a cut at any write keeps the
 * old settings or the new. */
#ifndef FW_KEPT_H
#define FW_KEPT_H

#include "hal/hal.h"

#define FW_KEPT_MAGIC 0x54455345u /* "ESET" */
#define FW_KEPT_BYTES 32u

typedef struct fw_kept {
    uint32_t magic;
    uint32_t generation; /* counts up with each record; wraps */
    uint32_t settings;   /* bits of eits_setting */
    uint32_t current_limit_ua_rms;
    uint32_t reserved[3];
    uint32_t crc; /* of the 28 bytes before */
} fw_kept;

/* The latest settings; all 0 where there are none. */
fw_kept fw_kept_load(const fw_store *store);

/* Keep these. Errors: those of erasing and programming; FW_E_RANGE where the board keeps none. The
 * old settings stay then. */
fw_status fw_kept_save(const fw_store *store, uint32_t settings, uint32_t current_limit_ua_rms);

/* The limit in use: the owner's, else 1.25 times what the board's source gives; 0: none. */
uint32_t fw_current_limit_ua(const fw_kept *kept, uint32_t source_ua_rms);

#endif
