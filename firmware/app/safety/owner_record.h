/* The owner's settings in flash: records one behind another in two pages; the latest one counts. A
 * full page is not erased before the other page holds a record. So after a power cut at any write
 * there are either the old settings or the new ones. */
#ifndef FW_OWNER_RECORD_H
#define FW_OWNER_RECORD_H

#include "eitskin/packets.h"
#include "hal/hal.h"

#define FW_OWNER_RECORD_MAGIC 0x32455345u /* "ESE2" */
#define FW_OWNER_RECORD_BYTES 128u

typedef struct fw_owner_record {
    uint32_t magic;
    uint32_t generation; /* counts up with each record; wraps */
    uint32_t settings;   /* bits of eits_setting */
    uint32_t current_limit_ua_rms;
    char name[EITS_NAME_CHARACTERS]; /* zero-filled; empty: none */
    /* As fitted; 0: as designed. Amplitude; volts at the converter per volt between the electrodes.
     */
    uint32_t source_ua, gain_ppm;
    uint32_t reserved[17]; /* 0, for later settings */
    uint32_t crc;          /* of the bytes before */
} fw_owner_record;

/* The latest settings; all 0 if there are none. */
fw_owner_record fw_owner_record_load(const fw_store *store);

/* Store the settings of `wanted`; its magic, generation and checksum are not looked at. Errors:
 * those of erasing and programming; FW_E_RANGE if the board stores none. The old settings stay
 * then. */
fw_status fw_owner_record_save(const fw_store *store, const fw_owner_record *wanted);

#endif
