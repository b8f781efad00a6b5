#include "app/solve/frames.h"

#include "app/clock.h"
#include "app/safety/faults.h"
#include "app/solve/constants.h"
#include "app/solve/diagnostics.h"
#include "app/solve/phase.h"
#include "app/solve/state.h"
#include "app/solve/tare.h"
#include "app/solve/tracker.h"

#include <math.h>

/* A touch that moves during one scan makes reciprocal rows disagree, too: hence several frames. */
static void report_reciprocity(fw_solve *solve, const fw_quality *quality)
{
    const fw_fault_detail detail = {.index = (int32_t)quality->worst_row,
                                    .value = (int32_t)quality->worst_permille};
    const bool disagrees = (float)quality->worst_permille > 1000.0f * FW_RECIPROCITY_FRACTION;
    if (!quality->checked)
        return;
    solve->disagreeing = disagrees ? solve->disagreeing + 1 : 0;
    solve->agreeing = disagrees ? 0 : solve->agreeing + 1;
    if (solve->disagreeing >= FW_RECIPROCITY_FRAMES || solve->agreeing >= FW_RECIPROCITY_FRAMES)
        fw_fault_set(solve->safety, EITS_FAULT_RECIPROCITY, disagrees, detail);
}

static void report_scan(fw_solve *solve, const fw_frame *frame, const fw_quality *quality)
{
    fw_safety *safety = solve->safety;
    fw_fault_set(safety, EITS_FAULT_SCAN_STALLED, false, (fw_fault_detail){0});
    fw_fault_set(safety, EITS_FAULT_BUS, frame->bus_errors > 0,
                 (fw_fault_detail){.value = (int32_t)frame->bus_errors});
    fw_fault_observe(safety, EITS_FAULT_SATURATED, quality->saturated > 0,
                     (fw_fault_detail){.index = (int32_t)quality->first_saturated,
                                       .value = (int32_t)quality->saturated});
    report_reciprocity(solve, quality);
}

bool fw_frame_check(fw_solve *solve, fw_frame *frame, fw_quality *quality)
{
    fw_engine *engine = &solve->engine;
    const bool for_tare = fw_tare_wants(solve, frame);
    fw_faults_at_frame(solve->safety, frame->number);
    fw_quality_prepare(engine, frame);
    if (for_tare ? fw_tare_first(solve) : !engine->phase_known)
        fw_phase_learn(engine, frame);
    fw_phase_apply(engine, frame);
    fw_quality_check(engine, frame, for_tare || !engine->tared, quality);
    report_scan(solve, frame, quality);
    return for_tare;
}

/* `referenced`: the frame shows whether the reference is stale. */
static void report_diagnostics(fw_solve *solve, const eits_info *info, bool referenced)
{
    solve->outliers += info->outliers;
    fw_diagnostics_open(solve->safety, info->open_electrodes);
    fw_diagnostics_skin(solve->safety, info);
    if (referenced)
        fw_diagnostics_reference(solve->safety, info);
}

void fw_frame_examine(fw_solve *solve, const fw_frame *frame, const fw_quality *quality)
{
    const fw_engine *engine = &solve->engine;
    const eits_info untared = {.open_electrodes = quality->open};
    if (engine->tared)
        (void)eits_examine(engine->ctx, frame->volts, engine->model.n_rows);
    /* without a reference, none is stale */
    report_diagnostics(solve, engine->tared ? eits_get_info(engine->ctx) : &untared,
                       !engine->tared);
}

static uint32_t low_word(uint64_t count)
{
    return count > UINT32_MAX ? UINT32_MAX : (uint32_t)count;
}

static eits_packet_solved head_of(const fw_frame *frame, const eits_info *info, eits_status status)
{
    return (eits_packet_solved){.frame = frame->number,
                                .time_us = frame->time_us,
                                .status = (uint16_t)-status,
                                .stop = (uint8_t)info->stop,
                                .shown = (uint8_t)info->shown,
                                .masked = (uint16_t)info->masked,
                                .iterations = info->iterations,
                                .nonzeros = info->nonzeros,
                                .macs = low_word(info->macs),
                                .touch_macs = low_word(info->touch_macs),
                                .lambda = info->lambda,
                                .lambda_max = info->lambda_max,
                                .lambda_noise = info->lambda_noise,
                                .gap_rel = info->gap_rel,
                                .residual = info->residual,
                                .data_norm = info->data_norm};
}

void fw_frame_solve(fw_solve *solve, const fw_frame *frame, const float *volts,
                    const fw_quality *quality, bool touches, fw_solved *out)
{
    eits_context *ctx = solve->engine.ctx;
    out->count = 0;
    const uint32_t began_us = fw_now_us(solve->board);
    out->status = eits_reconstruct(ctx, volts, solve->engine.model.n_rows, NULL, NULL);
    const uint32_t solved_us = fw_now_us(solve->board);
    if (touches && out->status == EITS_OK)
        (void)eits_find_touches(ctx, out->touches, EITS_MAX_TOUCHES, &out->count);
    eits_info info = *eits_get_info(ctx);
    if (touches && out->status == EITS_OK)
        out->count = fw_tracker_note(solve, volts != frame->volts, out->touches, out->count, &info);
    const uint32_t done_us = fw_now_us(solve->board);
    out->head = head_of(frame, &info, out->status);
    out->head.solve_us = solved_us - began_us;
    out->head.touch_us = done_us - solved_us;
    fw_diagnostics_head(&out->head, &info, quality, eits_get_options(ctx));
    ++solve->frames_solved;
    solve->touched = out->count > 0;
    fw_fault_set(solve->safety, EITS_FAULT_SOLVER, out->status != EITS_OK,
                 (fw_fault_detail){.value = (int32_t)out->status});
    report_diagnostics(solve, &info, out->status == EITS_OK);
}

void fw_frame_follow(fw_solve *solve, const fw_frame *frame, fw_solved *out)
{
    out->count = fw_tracker_report(solve, out->touches);
    uint32_t masked = 0;
    for (uint32_t i = 0; i < solve->engine.model.n_rows; ++i)
        masked += isfinite(frame->volts[i]) ? 0 : 1;
    const eits_info info = {.touches = out->count,
                            .masked = masked,
                            .shown = out->count > 0 ? EITS_SHOWN_TOUCHES : EITS_SHOWN_SOLVER};
    out->status = EITS_OK;
    out->head = head_of(frame, &info, EITS_OK);
    solve->touched = out->count > 0;
}

void fw_frames_forget(fw_solve *solve)
{
    solve->disagreeing = solve->agreeing = 0;
}
