/* Receives a model into the bank that is not in use. The model is verified and tried before the
 * bank becomes valid and the model is used. */
#ifndef FW_UPLOAD_H
#define FW_UPLOAD_H

#include "app/link/answer.h"

#include <stddef.h>
#include <stdint.h>

typedef struct fw_host_link fw_host_link;

#define FW_UPLOAD_TIMEOUT_US 10000000u /* without a command: the model in use is used again */

/* MODEL_BEGIN, MODEL_DATA, MODEL_COMMIT: OK, or why not (docs/reference/link-protocol.md). The scan
 * is stopped from the first command until the last one, an error of the flash, or the timeout. */
fw_answer fw_upload_begin(fw_host_link *link, uint32_t bytes, uint32_t crc);
fw_answer fw_upload_data(fw_host_link *link, uint32_t offset, const uint8_t *bytes, size_t size);
fw_answer fw_upload_commit(fw_host_link *link);

/* Call once per turn of the main loop. After the timeout the model in use is used again; the upload
 * may still be resumed. */
void fw_upload_check(fw_host_link *link);

#endif
