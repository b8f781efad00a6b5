#include "app/solve/tare.h"

void fw_tare_begin(fw_tare *tare, fw_engine *engine, uint32_t request, uint32_t frames,
                   uint32_t now_us)
{
    fw_engine_save(engine);
    *tare = (fw_tare){.active = true, .request = request, .wanted = frames, .since_us = now_us};
}

bool fw_tare_wants(const fw_tare *tare, const fw_frame *frame)
{
    return tare->active && (int32_t)(frame->time_us - tare->since_us) >= 0;
}

bool fw_tare_first(const fw_tare *tare)
{
    return tare->taken == 0;
}

void fw_tare_abort(fw_tare *tare, fw_engine *engine)
{
    if (tare->active)
        fw_engine_restore(engine);
    tare->active = false;
}

static eits_status add(fw_tare *tare, fw_engine *engine, const fw_frame *frame)
{
    eits_context *ctx = engine->ctx;
    const uint32_t rows = engine->model.n_rows;
    if (tare->wanted == 1)
        return eits_reference_set(ctx, frame->volts, rows);
    eits_status status = tare->taken == 0 ? eits_reference_begin(ctx, tare->wanted) : EITS_OK;
    if (status == EITS_OK)
        status = eits_reference_add(ctx, frame->volts, rows);
    if (status == EITS_OK && tare->taken + 1 == tare->wanted)
        status = eits_reference_finish(ctx);
    return status;
}

fw_tare_step fw_tare_add(fw_tare *tare, fw_engine *engine, const fw_frame *frame,
                         eits_status *status)
{
    if (!fw_tare_wants(tare, frame))
        return FW_TARE_NOT_YET;
    *status = add(tare, engine, frame);
    if (*status != EITS_OK && ++tare->refused > FW_TARE_REFUSED) {
        fw_tare_abort(tare, engine);
        return FW_TARE_FAILED;
    }
    if (*status != EITS_OK)
        return FW_TARE_REFUSED_FRAME;
    if (++tare->taken < tare->wanted)
        return FW_TARE_TAKEN;
    tare->active = false;
    engine->tared = engine->phase_known = true;
    eits_forget(engine->ctx);
    return FW_TARE_DONE;
}
