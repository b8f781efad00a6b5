#include "app/solve/tare.h"

#include "app/clock.h"
#include "app/solve/state.h"
#include "app/solve/tracker.h"

void fw_tare_begin(fw_solve *solve, uint32_t request, uint32_t frames)
{
    fw_engine_save(&solve->engine);
    solve->tare = (fw_tare){
        .active = true, .request = request, .wanted = frames, .since_us = fw_now_us(solve->board)};
}

bool fw_tare_active(const fw_solve *solve)
{
    return solve->tare.active;
}

uint32_t fw_tare_request(const fw_solve *solve)
{
    return solve->tare.request;
}

bool fw_tare_wants(const fw_solve *solve, const fw_frame *frame)
{
    return solve->tare.active && (int32_t)(frame->time_us - solve->tare.since_us) >= 0;
}

bool fw_tare_first(const fw_solve *solve)
{
    return solve->tare.taken == 0;
}

bool fw_tare_abort(fw_solve *solve)
{
    const bool active = solve->tare.active;
    if (active)
        fw_engine_restore(&solve->engine);
    solve->tare.active = false;
    return active;
}

static eits_status add(const fw_tare *tare, fw_engine *engine, const fw_frame *frame)
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

fw_tare_step fw_tare_add(fw_solve *solve, const fw_frame *frame, eits_status *status)
{
    fw_tare *tare = &solve->tare;
    fw_engine *engine = &solve->engine;
    if (!fw_tare_wants(solve, frame))
        return FW_TARE_NOT_YET;
    *status = add(tare, engine, frame);
    /* the core finds a touch once all frames are in; further frames cannot change that */
    const bool touched = *status == EITS_E_REFERENCE_TOUCHED;
    if (touched || (*status != EITS_OK && ++tare->refused > FW_TARE_REFUSED)) {
        (void)fw_tare_abort(solve);
        return FW_TARE_FAILED;
    }
    if (*status != EITS_OK)
        return FW_TARE_REFUSED_FRAME;
    if (++tare->taken < tare->wanted)
        return FW_TARE_TAKEN;
    eits_forget(engine->ctx);
    fw_tracker_new_reference(solve); /* drives are not tracked while the tare is active */
    tare->active = false;
    engine->saved.before_tare = engine->saved.tared;
    engine->tared = engine->phase_known = true;
    return FW_TARE_DONE;
}

bool fw_tare_undo(fw_solve *solve)
{
    fw_engine *engine = &solve->engine;
    if (!engine->saved.before_tare)
        return false;
    const eits_options options = *eits_get_options(engine->ctx); /* may have been set since */
    fw_engine_restore(engine);
    (void)eits_set_options(engine->ctx, &options);
    eits_forget(engine->ctx);
    fw_tracker_new_reference(solve);
    engine->saved.before_tare = false;
    return true;
}
