/* A model over the wire into the bank that is not in use: verified, tried, made valid, and only
 * then taken up. */
#ifndef FW_UPLOAD_H
#define FW_UPLOAD_H

#include "app/instrument.h"
#include "app/link/answer.h"

/* MODEL_BEGIN, MODEL_DATA, MODEL_COMMIT: OK, or why not (docs/reference/link-protocol.md). From the
 * first on the scan is stopped, until the last, an error of the flash or a time without any. */
fw_answer fw_upload_begin(fw_instrument *instrument, uint32_t bytes, uint32_t crc);
fw_answer fw_upload_data(fw_instrument *instrument, uint32_t offset, const uint8_t *bytes,
                         size_t size);
fw_answer fw_upload_commit(fw_instrument *instrument);

/* An upload that the host has left: the model in use goes on; it may still be resumed. */
void fw_upload_check(fw_instrument *instrument);

#endif
