#include "app/solve/models.h"

#include "app/acquire/acquire.h"
#include "app/safety/faults.h"
#include "app/solve/solve.h"
#include "app/solve/state.h"

static eits_reply_status refuse(eits_reply_status why, size_t a, size_t b, int32_t detail[2])
{
    detail[0] = (int32_t)a;
    detail[1] = (int32_t)b;
    return why;
}

/* Return whether the board can scan a model, and whether its packets and its memory fit. */
static eits_reply_status fits(const fw_solve *solve, const eits_model *model, int32_t detail[2])
{
    const size_t raw = sizeof(eits_packet_raw) + 5 * (size_t)model->n_rows;
    const size_t image = sizeof(eits_packet_solved) + 4 * (size_t)model->n_pixels;
    const size_t memory = solve->engine.workspace_bytes, needs = fw_engine_needs(model);
    const uint32_t electrodes = solve->board->multiplexers.electrodes;
    if (model->n_electrodes > electrodes)
        return refuse(EITS_REPLY_MODEL_SCAN, model->n_electrodes, electrodes, detail);
    if (raw > EITS_LINK_MAX_PAYLOAD || image > EITS_LINK_MAX_PAYLOAD)
        return refuse(EITS_REPLY_MODEL_SIZE, EITS_LINK_MAX_PAYLOAD, raw > image ? raw : image,
                      detail);
    if (needs > memory)
        return refuse(EITS_REPLY_MODEL_SIZE, memory, needs, detail);
    return EITS_REPLY_OK;
}

void fw_models_report(fw_solve *solve)
{
    fw_fault_set(solve->safety, EITS_FAULT_NO_MODEL, !solve->engine.open,
                 (fw_fault_detail){.value = (int32_t)solve->models.why_none});
}

static eits_status open_bank(fw_solve *solve, uint32_t bank)
{
    const fw_store *store = &solve->board->store;
    fw_record *record = &solve->models.record;
    eits_model model;
    int32_t detail[2];
    if (!fw_store_record(store, bank, record))
        return EITS_E_MODEL_MAGIC;
    eits_status status = fw_store_open(store, bank, record, &model);
    if (status == EITS_OK) {
        const eits_reply_status fit = fits(solve, &model, detail);
        if (fit != EITS_REPLY_OK)
            status = fit == EITS_REPLY_MODEL_SCAN ? EITS_E_MODEL_VALUE : EITS_E_WORKSPACE;
    }
    if (status == EITS_OK)
        status = fw_engine_open(&solve->engine, &model);
    solve->models.bank = bank;
    return status;
}

void fw_models_open_newest(fw_solve *solve)
{
    uint32_t banks[FW_BANKS];
    const uint32_t count = fw_store_newest(&solve->board->store, banks);
    solve->models.why_none = EITS_E_MODEL_MAGIC;
    fw_engine_close(&solve->engine);
    for (uint32_t k = 0; k < count && !solve->engine.open; ++k) {
        const eits_status status = open_bank(solve, banks[k]);
        if (k == 0)
            solve->models.why_none = status;
    }
    const fw_scan_table table = fw_engine_table(&solve->engine);
    if (solve->engine.open) /* the period may have been for a shorter table */
        fw_acquire_fit_period(solve->acquire, &table);
    fw_models_report(solve);
}

fw_model_file fw_models_file(const fw_solve *solve)
{
    const fw_store *store = &solve->board->store;
    const fw_models *models = &solve->models;
    return (fw_model_file){.bytes = store->ops->bank(store->ctx, models->bank),
                           .size = models->record.model_bytes,
                           .crc = models->record.model_crc,
                           .bank = models->bank};
}

uint32_t fw_models_spare_bank(const fw_solve *solve)
{
    fw_record record;
    if (solve->engine.open)
        return 1u - solve->models.bank;
    return fw_store_record(&solve->board->store, 0, &record) ? 1u : 0u;
}

eits_reply_status fw_models_try(fw_solve *solve, uint32_t bank, uint32_t size, uint32_t crc,
                                int32_t detail[2])
{
    const fw_store *store = &solve->board->store;
    const uint8_t *bytes = store->ops->bank(store->ctx, bank);
    eits_model model;
    if (eits_crc32(0, bytes, size) != crc)
        return EITS_REPLY_MODEL_CRC;
    eits_status status = eits_model_open(&model, bytes, size);
    if (status != EITS_OK) {
        detail[0] = (int32_t)status;
        return EITS_REPLY_MODEL_INVALID;
    }
    const eits_reply_status fit = fits(solve, &model, detail);
    if (fit != EITS_REPLY_OK)
        return fit;
    float difference;
    status = fw_engine_self_test(&solve->engine, &model, &difference);
    if (status != EITS_OK) {
        detail[0] = (int32_t)status;
        return EITS_REPLY_CORE;
    }
    detail[0] = fw_billionths(difference);
    return difference == 0 ? EITS_REPLY_OK : EITS_REPLY_SELF_TEST;
}

fw_status fw_models_commit(fw_solve *solve, uint32_t bank, uint32_t size, uint32_t crc)
{
    const fw_store *store = &solve->board->store;
    fw_record other;
    const uint32_t generation =
        fw_store_record(store, 1u - bank, &other) ? other.generation + 1u : 1u;
    return fw_store_commit(store, bank, generation, size, crc);
}
