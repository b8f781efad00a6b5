#include "app/link/upload.h"

#include "app/clock.h"
#include "app/link/scanning.h"
#include "app/link/state.h"
#include "app/link/stream.h"
#include "app/solve/models.h"
#include "app/solve/store.h"

static void pause_scan(fw_host_link *link)
{
    fw_upload *upload = &link->upload;
    upload->last_us = fw_now_us(link->board);
    if (upload->active)
        return;
    upload->active = true;
    fw_scanning_restart(link); /* stops it, and the generator */
}

/* End the upload, and scan the model in use again. */
static void leave(fw_host_link *link)
{
    link->upload.active = false;
    fw_scanning_restart(link);
}

fw_answer fw_upload_begin(fw_host_link *link, uint32_t bytes, uint32_t crc)
{
    const fw_store *store = &link->board->store;
    fw_upload *upload = &link->upload;
    if (bytes > fw_store_room(store))
        return fw_refuse(EITS_REPLY_MODEL_SIZE, (int32_t)fw_store_room(store), 0);
    pause_scan(link);
    /* an upload that was interrupted is resumed */
    if (upload->begun && upload->bytes == bytes && upload->crc == crc)
        return fw_refuse(EITS_REPLY_OK, (int32_t)upload->offset, 0);
    upload->bank = fw_models_spare_bank(link->solve);
    upload->bytes = bytes;
    upload->crc = crc;
    upload->offset = 0;
    upload->begun = store->ops->erase(store->ctx, upload->bank) == FW_OK;
    upload->last_us = fw_now_us(link->board);
    if (upload->begun)
        return (fw_answer){0};
    leave(link);
    return fw_refuse(EITS_REPLY_FLASH, 0, 0);
}

static fw_status program(const fw_store *store, const fw_upload *upload, const uint8_t *bytes,
                         size_t size)
{
    const size_t whole = size - size % 4u;
    fw_status status =
        whole > 0 ? store->ops->program(store->ctx, upload->bank, upload->offset, bytes, whole)
                  : FW_OK;
    /* the end of a model: the rest of its last word stays erased */
    if (status == FW_OK && whole < size) {
        uint8_t last[4] = {0xFF, 0xFF, 0xFF, 0xFF};
        for (size_t k = whole; k < size; ++k)
            last[k - whole] = bytes[k];
        status = store->ops->program(store->ctx, upload->bank, upload->offset + (uint32_t)whole,
                                     last, sizeof last);
    }
    return status;
}

fw_answer fw_upload_data(fw_host_link *link, uint32_t offset, const uint8_t *bytes, size_t size)
{
    fw_upload *upload = &link->upload;
    if (!upload->begun)
        return fw_refuse(EITS_REPLY_OFFSET, -1, 0);
    pause_scan(link);
    if (offset != upload->offset)
        return fw_refuse(EITS_REPLY_OFFSET, (int32_t)upload->offset, 0);
    const uint32_t left = upload->bytes - offset;
    if (size > left)
        return fw_refuse(EITS_REPLY_RANGE, 4, (int32_t)upload->bytes);
    if (size % 4u != 0 && size != left)
        return fw_refuse(EITS_REPLY_LENGTH,
                         (int32_t)(sizeof(eits_command_model_data) + size - size % 4u), 0);
    if (program(&link->board->store, upload, bytes, size) != FW_OK) {
        upload->begun = false;
        leave(link);
        return fw_refuse(EITS_REPLY_FLASH, (int32_t)offset, 0);
    }
    upload->offset += (uint32_t)size;
    return (fw_answer){0};
}

fw_answer fw_upload_commit(fw_host_link *link)
{
    const fw_store *store = &link->board->store;
    fw_upload *upload = &link->upload;
    if (!upload->begun || upload->offset != upload->bytes)
        return fw_refuse(EITS_REPLY_OFFSET, upload->begun ? (int32_t)upload->offset : -1, 0);
    pause_scan(link);
    upload->begun = false; /* the upload is not resumed, however the commit ends */
    fw_answer answer = {0};
    answer.status =
        fw_models_try(link->solve, upload->bank, upload->bytes, upload->crc, answer.detail);
    if (answer.status == EITS_REPLY_OK) {
        if (fw_models_commit(link->solve, upload->bank, upload->bytes, upload->crc) != FW_OK) {
            answer = fw_refuse(EITS_REPLY_FLASH, (int32_t)fw_store_room(store), 0);
        } else {
            fw_stream_reset(link);
            fw_models_open_newest(link->solve);
        }
    }
    leave(link);
    return answer;
}

void fw_upload_check(fw_host_link *link)
{
    if (link->upload.active && fw_now_us(link->board) - link->upload.last_us > FW_UPLOAD_TIMEOUT_US)
        leave(link);
}
