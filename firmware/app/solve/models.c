#include "app/solve/models.h"

fw_answer fw_model_fits(const fw_instrument *instrument, const eits_model *model)
{
    const size_t raw = sizeof(eits_packet_raw) + 5 * (size_t)model->n_rows;
    const size_t image = sizeof(eits_packet_solved) + 4 * (size_t)model->n_pixels;
    const size_t memory = instrument->engine.workspace_bytes;
    if (model->n_electrodes > FW_ELECTRODES)
        return fw_refuse(EITS_REPLY_MODEL_SCAN, (int32_t)model->n_electrodes,
                         (int32_t)FW_ELECTRODES);
    if (raw > EITS_LINK_MAX_PAYLOAD || image > EITS_LINK_MAX_PAYLOAD)
        return fw_refuse(EITS_REPLY_MODEL_SIZE, (int32_t)EITS_LINK_MAX_PAYLOAD,
                         (int32_t)(raw > image ? raw : image));
    if (fw_engine_needs(model) > memory)
        return fw_refuse(EITS_REPLY_MODEL_SIZE, (int32_t)memory, (int32_t)fw_engine_needs(model));
    return (fw_answer){0};
}

void fw_report_no_model(fw_instrument *instrument)
{
    fw_fault_set(&instrument->faults, EITS_FAULT_NO_MODEL, !instrument->engine.open,
                 (fw_fault_detail){.frame = instrument->last_frame,
                                   .value = (int32_t)instrument->no_model_why});
}

static eits_status open_bank(fw_instrument *instrument, uint32_t bank)
{
    const fw_store *store = &instrument->board->store;
    eits_model model;
    if (!fw_store_record(store, bank, &instrument->record))
        return EITS_E_MODEL_MAGIC;
    eits_status status = fw_store_open(store, bank, &instrument->record, &model);
    if (status == EITS_OK) {
        const eits_reply_status fits = fw_model_fits(instrument, &model).status;
        if (fits != EITS_REPLY_OK)
            status = fits == EITS_REPLY_MODEL_SCAN ? EITS_E_MODEL_VALUE : EITS_E_WORKSPACE;
    }
    if (status == EITS_OK)
        status = fw_engine_open(&instrument->engine, &model);
    instrument->bank = bank;
    return status;
}

void fw_open_newest(fw_instrument *instrument)
{
    uint32_t banks[FW_BANKS];
    const uint32_t count = fw_store_newest(&instrument->board->store, banks);
    instrument->stream = (fw_stream){.every = 1};
    instrument->no_model_why = EITS_E_MODEL_MAGIC;
    fw_engine_close(&instrument->engine);
    for (uint32_t k = 0; k < count && !instrument->engine.open; ++k) {
        const eits_status status = open_bank(instrument, banks[k]);
        if (k == 0)
            instrument->no_model_why = status;
    }
    const fw_scan_table table = fw_engine_table(&instrument->engine);
    const uint64_t min_us =
        (uint64_t)fw_scan_rows(&instrument->settings, &table) * fw_slot_us(&instrument->settings);
    if (instrument->engine.open && !instrument->board->frames_given &&
        instrument->settings.frame_period_us < min_us)
        instrument->settings.frame_period_us = 0; /* it was for a shorter table */
    fw_report_no_model(instrument);
}
