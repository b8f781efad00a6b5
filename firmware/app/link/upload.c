#include "app/link/upload.h"

#include "app/link/scanning.h"
#include "app/solve/models.h"

/* The bank that is not in use; with no model open, one whose record is not whole. */
static uint32_t spare_bank(const fw_instrument *instrument)
{
    fw_record record;
    if (instrument->engine.open)
        return 1u - instrument->bank;
    return fw_store_record(&instrument->board->store, 0, &record) ? 1u : 0u;
}

static void pause_scan(fw_instrument *instrument)
{
    fw_upload *upload = &instrument->upload;
    upload->last_us = fw_now_us(instrument);
    if (upload->active)
        return;
    upload->active = true;
    fw_start_scan(instrument); /* which stops it, and the generator */
}

/* The model in use goes on. */
static void leave(fw_instrument *instrument)
{
    instrument->upload.active = false;
    fw_start_scan(instrument);
}

fw_answer fw_upload_begin(fw_instrument *instrument, uint32_t bytes, uint32_t crc)
{
    const fw_store *store = &instrument->board->store;
    fw_upload *upload = &instrument->upload;
    if (bytes > fw_store_room(store))
        return fw_refuse(EITS_REPLY_MODEL_SIZE, (int32_t)fw_store_room(store), 0);
    pause_scan(instrument);
    /* cut short earlier: goes on where it was */
    if (upload->begun && upload->bytes == bytes && upload->crc == crc)
        return fw_refuse(EITS_REPLY_OK, (int32_t)upload->offset, 0);
    upload->bank = spare_bank(instrument);
    upload->bytes = bytes;
    upload->crc = crc;
    upload->offset = 0;
    upload->begun = store->ops->erase(store->ctx, upload->bank) == FW_OK;
    upload->last_us = fw_now_us(instrument);
    if (upload->begun)
        return (fw_answer){0};
    leave(instrument);
    return fw_refuse(EITS_REPLY_FLASH, 0, 0);
}

static fw_status program(const fw_store *store, const fw_upload *upload, const uint8_t *bytes,
                         size_t size)
{
    const size_t whole = size - size % 4u;
    fw_status status =
        whole > 0 ? store->ops->program(store->ctx, upload->bank, upload->offset, bytes, whole)
                  : FW_OK;
    /* the end of a model: what fills the last word stays erased */
    if (status == FW_OK && whole < size) {
        uint8_t last[4] = {0xFF, 0xFF, 0xFF, 0xFF};
        for (size_t k = whole; k < size; ++k)
            last[k - whole] = bytes[k];
        status = store->ops->program(store->ctx, upload->bank, upload->offset + (uint32_t)whole,
                                     last, sizeof last);
    }
    return status;
}

fw_answer fw_upload_data(fw_instrument *instrument, uint32_t offset, const uint8_t *bytes,
                         size_t size)
{
    fw_upload *upload = &instrument->upload;
    if (!upload->begun)
        return fw_refuse(EITS_REPLY_OFFSET, -1, 0);
    pause_scan(instrument);
    if (offset != upload->offset)
        return fw_refuse(EITS_REPLY_OFFSET, (int32_t)upload->offset, 0);
    const uint32_t left = upload->bytes - offset;
    if (size > left)
        return fw_refuse(EITS_REPLY_RANGE, 4, (int32_t)upload->bytes);
    if (size % 4u != 0 && size != left)
        return fw_refuse(EITS_REPLY_LENGTH,
                         (int32_t)(sizeof(eits_command_model_data) + size - size % 4u), 0);
    if (program(&instrument->board->store, upload, bytes, size) != FW_OK) {
        upload->begun = false;
        leave(instrument);
        return fw_refuse(EITS_REPLY_FLASH, (int32_t)offset, 0);
    }
    upload->offset += (uint32_t)size;
    return (fw_answer){0};
}

/* Verify what arrived and try it; the bank is not valid yet. */
static fw_answer try_model(fw_instrument *instrument, eits_model *model)
{
    const fw_upload *upload = &instrument->upload;
    const uint8_t *bytes =
        instrument->board->store.ops->bank(instrument->board->store.ctx, upload->bank);
    if (eits_crc32(0, bytes, upload->bytes) != upload->crc)
        return fw_refuse(EITS_REPLY_MODEL_CRC, 0, 0);
    eits_status status = eits_model_open(model, bytes, upload->bytes);
    if (status != EITS_OK)
        return fw_refuse(EITS_REPLY_MODEL_INVALID, (int32_t)status, 0);
    const fw_answer fits = fw_model_fits(instrument, model);
    if (fits.status != EITS_REPLY_OK)
        return fits;
    float difference;
    status = fw_engine_self_test(&instrument->engine, model, &difference);
    if (status != EITS_OK)
        return fw_refuse(EITS_REPLY_CORE, (int32_t)status, 0);
    if (difference != 0)
        return fw_refuse(EITS_REPLY_SELF_TEST, (int32_t)(1e9f * (difference < 2 ? difference : 2)),
                         0);
    return (fw_answer){0};
}

fw_answer fw_upload_commit(fw_instrument *instrument)
{
    const fw_store *store = &instrument->board->store;
    fw_upload *upload = &instrument->upload;
    if (!upload->begun || upload->offset != upload->bytes)
        return fw_refuse(EITS_REPLY_OFFSET, upload->begun ? (int32_t)upload->offset : -1, 0);
    pause_scan(instrument);
    upload->begun = false; /* however it ends, it is not resumed */
    eits_model model;
    fw_answer answer = try_model(instrument, &model);
    if (answer.status == EITS_REPLY_OK) {
        fw_record other;
        const uint32_t generation =
            fw_store_record(store, 1u - upload->bank, &other) ? other.generation + 1u : 1u;
        if (fw_store_commit(store, upload->bank, generation, upload->bytes, upload->crc) != FW_OK)
            answer = fw_refuse(EITS_REPLY_FLASH, (int32_t)fw_store_room(store), 0);
        else
            fw_open_newest(instrument);
    }
    leave(instrument);
    return answer;
}

void fw_upload_check(fw_instrument *instrument)
{
    if (instrument->upload.active &&
        fw_now_us(instrument) - instrument->upload.last_us > FW_UPLOAD_TIMEOUT_US)
        leave(instrument);
}
