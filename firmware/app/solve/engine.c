#include "app/solve/engine.h"

#include <string.h>

void fw_engine_init(fw_engine *engine, void *workspace, size_t workspace_bytes)
{
    *engine = (fw_engine){.workspace = workspace, .workspace_bytes = workspace_bytes, .cosine = 1};
}

/* The workspace begins with the core's part and ends with what is saved; the rest is between. */
static size_t frame_bytes(const eits_model *model)
{
    return EITS_ALIGN16(model->n_rows * sizeof(fw_iq)) +
           EITS_ALIGN16(model->n_rows * (sizeof(float) + 1u));
}

size_t fw_engine_needs(const eits_model *model)
{
    const size_t rows = model->n_rows;
    return EITS_ALIGN16(eits_workspace_size(model, 0)) + 2 * frame_bytes(model) +
           EITS_ALIGN16(rows * sizeof(uint16_t)) + EITS_ALIGN16(rows) + eits_saved_size(model);
}

static void *take(uint8_t **next, size_t bytes)
{
    void *taken = *next;
    memset(taken, 0, bytes);
    *next += EITS_ALIGN16(bytes);
    return taken;
}

/* Set up the tracker of touches, if there is enough memory for it. */
static void start_fast(fw_engine *engine, uint8_t *next)
{
    const size_t bytes = EITS_ALIGN16(eits_fast_size(&engine->model));
    const size_t frame = EITS_ALIGN16(engine->model.n_rows * sizeof(float));
    const size_t numbers = EITS_ALIGN16(engine->model.n_rows * sizeof(uint16_t));
    engine->fast = NULL;
    engine->fast_bytes = 0;
    if (next + bytes + frame + numbers > engine->saved.core)
        return;
    engine->aligned = take(&next, frame);
    engine->drive_of = take(&next, numbers);
    if (eits_fast_init(next, bytes, engine->ctx, &engine->fast) != EITS_OK) {
        engine->fast = NULL;
        return;
    }
    engine->fast_bytes = bytes + frame + numbers;
    for (uint32_t number = 0; number < eits_fast_drives(engine->fast); ++number) {
        uint32_t count = 0;
        const uint16_t *rows = eits_fast_rows(engine->fast, number, &count);
        for (uint32_t k = 0; k < count; ++k)
            engine->drive_of[rows[k]] = (uint16_t)number;
    }
}

static void lay_out(fw_engine *engine)
{
    const size_t rows = engine->model.n_rows;
    uint8_t *next = engine->workspace + EITS_ALIGN16(eits_workspace_size(&engine->model, 0));
    for (int k = 0; k < 2; ++k) {
        fw_frame *frame = &engine->frames[k];
        *frame = (fw_frame){0};
        frame->z = take(&next, rows * sizeof(fw_iq));
        frame->volts = take(&next, rows * (sizeof(float) + 1u));
        frame->quality = (uint8_t *)(frame->volts + rows);
    }
    engine->unique = take(&next, rows * sizeof(uint16_t));
    engine->flags = take(&next, rows);
    uint8_t *end = engine->workspace + engine->workspace_bytes - engine->workspace_bytes % 16u;
    /* not cleared: it may hold what will be restored */
    engine->saved.core = end - eits_saved_size(&engine->model);
    start_fast(engine, next);
}

/* List the rows that are not the second row of a fold, in the order of measurement. Rows without a
 * fold are included. */
static void list_unique(fw_engine *engine)
{
    const eits_model *model = &engine->model;
    for (uint32_t k = 0; k < model->n_folded; ++k) {
        if (model->fold[k].second != EITS_FOLD_NONE)
            engine->flags[model->fold[k].second] = 1;
    }
    engine->n_unique = 0;
    for (uint32_t i = 0; i < model->n_rows; ++i) {
        const uint32_t row = model->scan_order == NULL ? i : model->scan_order[i];
        if (!engine->flags[row])
            engine->unique[engine->n_unique++] = (uint16_t)row;
        engine->flags[row] = 0;
    }
}

/* Frames come in sequence, so touches are followed over time. */
static eits_status start_core(fw_engine *engine)
{
    const eits_status status = eits_init(engine->workspace, eits_workspace_size(&engine->model, 0),
                                         &engine->model, &engine->ctx);
    if (status != EITS_OK)
        return status;
    eits_options options = *eits_get_options(engine->ctx);
    (void)eits_options_track(&options);
    options.noise_floor_v = engine->noise_floor_v;
    return eits_set_options(engine->ctx, &options);
}

eits_status fw_engine_open(fw_engine *engine, const eits_model *model)
{
    fw_engine_close(engine);
    const size_t needs = fw_engine_needs(model);
    if (needs > engine->workspace_bytes - engine->workspace_bytes % 16u)
        return EITS_E_WORKSPACE;
    engine->model = *model;
    const eits_status status = start_core(engine);
    if (status != EITS_OK)
        return status;
    lay_out(engine);
    list_unique(engine);
    engine->used_bytes = needs + engine->fast_bytes;
    engine->open = true;
    return EITS_OK;
}

void fw_engine_close(fw_engine *engine)
{
    engine->open = engine->tared = engine->phase_known = engine->saved.before_tare = false;
    engine->cosine = 1;
    engine->sine = 0;
    engine->used_bytes = 0;
    engine->fast = NULL;
}

void fw_engine_set_noise_floor(fw_engine *engine, float volts)
{
    engine->noise_floor_v = volts;
    if (!engine->open)
        return;
    eits_options options = *eits_get_options(engine->ctx);
    options.noise_floor_v = volts;
    (void)eits_set_options(engine->ctx, &options);
}

fw_scan_table fw_engine_table(const fw_engine *engine)
{
    return (fw_scan_table){engine->model.protocol, engine->model.n_rows, engine->model.scan_order,
                           engine->unique, engine->n_unique};
}

void fw_engine_save(fw_engine *engine)
{
    fw_saved *saved = &engine->saved;
    (void)eits_save(engine->ctx, saved->core, eits_saved_size(&engine->model));
    saved->cosine = engine->cosine;
    saved->sine = engine->sine;
    saved->tared = engine->tared;
    saved->phase_known = engine->phase_known;
    saved->before_tare = false;
}

void fw_engine_restore(fw_engine *engine)
{
    const fw_saved *saved = &engine->saved;
    (void)eits_restore(engine->ctx, saved->core, eits_saved_size(&engine->model));
    engine->cosine = saved->cosine;
    engine->sine = saved->sine;
    engine->tared = saved->tared;
    engine->phase_known = saved->phase_known;
}

eits_status fw_engine_self_test(fw_engine *engine, const eits_model *model, float *difference)
{
    const size_t size = eits_workspace_size(model, 0);
    *difference = 0;
    if (size > engine->workspace_bytes)
        return EITS_E_WORKSPACE;
    const uint8_t *kept_from = engine->workspace + engine->workspace_bytes;
    if (engine->open) {
        fw_engine_save(engine);
        kept_from = engine->saved.core;
    }
    eits_status status = eits_init(engine->workspace, size, model, &engine->ctx);
    if (status == EITS_OK)
        status = eits_self_test(engine->ctx, difference);
    if (!engine->open)
        return status;
    const bool survived = engine->workspace + size <= kept_from;
    const bool other = model->protocol != engine->model.protocol;
    (void)start_core(engine); /* it fitted before */
    if (other) {
        lay_out(engine);
        list_unique(engine);
    }
    if (survived)
        fw_engine_restore(engine);
    else
        engine->tared = engine->phase_known = false;
    return status;
}
