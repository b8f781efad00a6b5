#include "app/link/stream.h"

#include "app/link/report.h"
#include "app/link/tracks.h"
#include "app/solve/phase.h"

/* What the scan itself tells. */
static void report_scan(fw_instrument *instrument, const fw_frame *frame, const fw_quality *quality)
{
    fw_faults *faults = &instrument->faults;
    fw_fault_detail detail = {.frame = frame->number};
    fw_fault_set(faults, EITS_FAULT_SCAN_STALLED, false, detail);
    detail.value = (int32_t)frame->bus_errors;
    fw_fault_set(faults, EITS_FAULT_BUS, frame->bus_errors > 0, detail);
    detail.index = (int32_t)quality->first_saturated;
    detail.value = (int32_t)quality->saturated;
    fw_fault_observe(faults, EITS_FAULT_SATURATED, quality->saturated > 0, detail);
    if (!quality->checked)
        return;
    /* one frame in which a touch moves has reciprocals that disagree too */
    const bool doubtful = (float)quality->worst_permille > 1000.0f * FW_RECIPROCITY_FRACTION;
    instrument->doubtful = doubtful ? instrument->doubtful + 1 : 0;
    instrument->agreeing = doubtful ? 0 : instrument->agreeing + 1;
    detail.index = (int32_t)quality->worst_row;
    detail.value = (int32_t)quality->worst_permille;
    if (instrument->doubtful >= FW_RECIPROCITY_FRAMES ||
        instrument->agreeing >= FW_RECIPROCITY_FRAMES)
        fw_fault_set(faults, EITS_FAULT_RECIPROCITY, doubtful, detail);
}

/* What the core found in this frame; `referenced`: its reference may be stale. */
static void send_diagnostics(fw_instrument *instrument, const fw_frame *frame,
                             const eits_info *info, bool referenced)
{
    instrument->outliers += info->outliers;
    fw_diagnostics_open(&instrument->faults, frame->number, info->open_electrodes);
    fw_diagnostics_skin(&instrument->faults, frame->number, info);
    if (referenced)
        fw_diagnostics_reference(&instrument->faults, frame->number, info);
}

/* Look at a frame that is not solved: faults are reported whether anything is streamed or not. */
static void examine(fw_instrument *instrument, const fw_frame *frame, const fw_quality *quality)
{
    const fw_engine *engine = &instrument->engine;
    const eits_info untared = {.open_electrodes = quality->open};
    if (engine->tared)
        (void)eits_examine(engine->ctx, frame->volts, engine->model.n_rows);
    /* without a reference none is stale */
    send_diagnostics(instrument, frame, engine->tared ? eits_get_info(engine->ctx) : &untared,
                     !engine->tared);
}

static void send_raw(fw_instrument *instrument, const fw_frame *frame, uint32_t flags)
{
    const uint32_t rows = instrument->engine.model.n_rows;
    const eits_packet_raw head = {.frame = frame->number,
                                  .time_us = frame->time_us,
                                  .scan_us = frame->scan_us,
                                  .n_rows = (uint16_t)rows,
                                  .flags = (uint16_t)(frame->flags | flags)};
    if ((instrument->stream.what & EITS_STREAM_RAW) != 0)
        (void)fw_tx_queue_send(&instrument->tx_queue, EITS_PACKET_RAW, &head, sizeof head,
                               frame->volts, 5 * (size_t)rows);
}

static void take_tare(fw_instrument *instrument, const fw_frame *frame)
{
    eits_status status = EITS_OK;
    const fw_tare_step step = fw_tare_add(&instrument->tare, &instrument->engine, frame, &status);
    if (step == FW_TARE_TAKEN || step == FW_TARE_DONE)
        send_raw(instrument, frame, EITS_RAW_REFERENCE);
    if (step == FW_TARE_DONE) {
        (void)eits_gestures_init(&instrument->gestures, NULL); /* ids begin again, too */
        const fw_fault_detail detail = {.frame = frame->number};
        fw_fault_set(&instrument->faults, EITS_FAULT_STALE_REFERENCE, false, detail);
        fw_fault_set(&instrument->faults, EITS_FAULT_UNLIKE_MODEL, false, detail);
        fw_send_tare_reply(instrument, (fw_answer){0});
    }
    if (step == FW_TARE_FAILED)
        fw_send_tare_reply(instrument,
                           (fw_answer){.status = EITS_REPLY_CORE, .detail = {(int32_t)status}});
}

/* Whether this frame is one of those that are streamed. */
static bool due(fw_stream *stream)
{
    if (stream->what == 0)
        return false;
    if (stream->phase > 0) {
        --stream->phase;
        return false;
    }
    stream->phase = stream->every - 1u;
    return true;
}

static uint32_t low_word(uint64_t count)
{
    return count > UINT32_MAX ? UINT32_MAX : (uint32_t)count;
}

static void send_solved(fw_instrument *instrument, const fw_frame *frame, eits_packet_solved *head,
                        const eits_touch *touches, uint32_t count)
{
    const uint32_t pixels = instrument->engine.model.n_pixels;
    if ((instrument->stream.what & EITS_STREAM_IMAGE) != 0) {
        head->count = (uint16_t)pixels;
        head->age_us = fw_now_us(instrument) - frame->end_us;
        (void)fw_tx_queue_send(&instrument->tx_queue, EITS_PACKET_IMAGE, head, sizeof *head,
                               eits_get_image(instrument->engine.ctx), pixels * sizeof(float));
    }
    if ((instrument->stream.what & EITS_STREAM_TOUCHES) != 0) {
        eits_packet_touch body[EITS_MAX_TOUCHES];
        for (uint32_t k = 0; k < count; ++k) {
            const eits_touch t = touches[k];
            body[k] = (eits_packet_touch){.id = t.id,
                                          .x_mm = t.x_mm,
                                          .y_mm = t.y_mm,
                                          .radius_mm = t.radius_mm,
                                          .strength_s_per_m_mm2 = t.strength_s_per_m_mm2,
                                          .explained = t.explained,
                                          .force_n = t.force_n,
                                          .confidence = t.confidence,
                                          .x_variance_mm2 = t.x_variance_mm2,
                                          .xy_covariance_mm2 = t.xy_covariance_mm2,
                                          .y_variance_mm2 = t.y_variance_mm2,
                                          .long_x_mm = t.long_x_mm,
                                          .long_y_mm = t.long_y_mm};
        }
        head->count = (uint16_t)count;
        head->age_us = fw_now_us(instrument) - frame->end_us;
        (void)fw_tx_queue_send(&instrument->tx_queue, EITS_PACKET_TOUCHES, head, sizeof *head, body,
                               count * sizeof body[0]);
    }
}

/* What the touches of a frame amounted to; of a rejected one nothing is known. */
static void send_events(fw_instrument *instrument, const fw_frame *frame, eits_status status,
                        const eits_touch *touches, uint32_t count)
{
    eits_packet_event *body = instrument->events_sent;
    eits_packet_events head = {.frame = frame->number, .time_us = frame->time_us};
    if ((instrument->stream.what & EITS_STREAM_EVENTS) == 0)
        return;
    if (status == EITS_OK)
        (void)eits_gestures_update(&instrument->gestures, touches, count, frame->time_us,
                                   instrument->events, EITS_MAX_EVENTS, &head.count);
    for (uint32_t k = 0; k < head.count; ++k) {
        const eits_event *e = &instrument->events[k];
        body[k] = (eits_packet_event){.kind = (uint16_t)e->kind,
                                      .phase = (uint16_t)e->phase,
                                      .first_id = e->first_id,
                                      .second_id = e->second_id,
                                      .x_mm = e->x_mm,
                                      .y_mm = e->y_mm,
                                      .direction_deg = e->direction_deg,
                                      .value = e->value};
    }
    (void)fw_tx_queue_send(&instrument->tx_queue, EITS_PACKET_EVENTS, &head, sizeof head, body,
                           head.count * sizeof body[0]);
}

/* `volts`: the frame's, or as the drives have brought them to one instant. Returns the microseconds
 * that the solver took, touches included. */
static uint32_t solve(fw_instrument *instrument, const fw_frame *frame, const float *volts,
                      const fw_quality *quality)
{
    eits_context *ctx = instrument->engine.ctx;
    eits_touch touches[EITS_MAX_TOUCHES];
    uint32_t count = 0;
    const uint32_t began_us = fw_now_us(instrument);
    const eits_status status =
        eits_reconstruct(ctx, volts, instrument->engine.model.n_rows, NULL, NULL);
    const uint32_t solved_us = fw_now_us(instrument);
    const bool wanted = (instrument->stream.what &
                         (EITS_STREAM_TOUCHES | EITS_STREAM_EVENTS | EITS_STREAM_FOLLOWED)) != 0;
    if (wanted && status == EITS_OK)
        (void)eits_find_touches(ctx, touches, EITS_MAX_TOUCHES, &count);
    eits_info info = *eits_get_info(ctx);
    if (volts != frame->volts && status == EITS_OK)
        fw_follow_found(instrument, touches, count, &info);
    const uint32_t done_us = fw_now_us(instrument);
    eits_packet_solved head = {.frame = frame->number,
                               .time_us = frame->time_us,
                               .solve_us = solved_us - began_us,
                               .touch_us = done_us - solved_us,
                               .status = (uint16_t)-status,
                               .stop = (uint16_t)info.stop,
                               .masked = (uint16_t)info.masked,
                               .iterations = info.iterations,
                               .nonzeros = info.nonzeros,
                               .macs = low_word(info.macs),
                               .touch_macs = low_word(info.touch_macs),
                               .lambda = info.lambda,
                               .lambda_max = info.lambda_max,
                               .lambda_noise = info.lambda_noise,
                               .gap_rel = info.gap_rel,
                               .residual = info.residual,
                               .data_norm = info.data_norm};
    fw_diagnostics_head(&head, &info, quality, eits_get_options(ctx));
    fw_stats_add(&instrument->stats, EITS_STAGE_SOLVE, head.solve_us);
    if (wanted)
        fw_stats_add(&instrument->stats, EITS_STAGE_TOUCHES, head.touch_us);
    ++instrument->frames_solved;
    instrument->touched = count > 0;
    fw_fault_set(&instrument->faults, EITS_FAULT_SOLVER, status != EITS_OK,
                 (fw_fault_detail){.frame = frame->number, .value = (int32_t)status});
    send_diagnostics(instrument, frame, &info, status == EITS_OK);
    send_solved(instrument, frame, &head, touches, count);
    send_events(instrument, frame, status, touches, count);
    return done_us - began_us;
}

static void check_deadline(fw_instrument *instrument, const fw_frame *frame, uint32_t now_us)
{
    const uint32_t period = instrument->settings.frame_period_us, late = now_us - frame->end_us;
    const bool missed = period != 0 && late > period;
    instrument->deadlines_missed += missed;
    fw_fault_set(
        &instrument->faults, EITS_FAULT_DEADLINE, missed,
        (fw_fault_detail){.frame = frame->number, .value = missed ? (int32_t)(late - period) : 0});
}

void fw_process_frame(fw_instrument *instrument, fw_frame *frame)
{
    fw_engine *engine = &instrument->engine;
    fw_stream *stream = &instrument->stream;
    const bool untouched = fw_tare_wants(&instrument->tare, frame);
    const bool solved = engine->tared && (stream->what & ~(uint32_t)EITS_STREAM_RAW) != 0;
    fw_quality quality;
    instrument->last_frame = frame->number;
    fw_quality_prepare(engine, frame);
    if (untouched ? fw_tare_first(&instrument->tare) : !engine->phase_known)
        fw_phase_learn(engine, frame);
    fw_phase_apply(engine, frame);
    fw_quality_check(engine, frame, untouched || !engine->tared, &quality);
    report_scan(instrument, frame, &quality);
    fw_stats_add(&instrument->stats, EITS_STAGE_SCAN, frame->scan_us);
    fw_stats_add(&instrument->stats, EITS_STAGE_DEMODULATE, frame->busy_us);
    if (untouched) {
        fw_diagnostics_open(&instrument->faults, frame->number, quality.open);
        take_tare(instrument, frame);
        return;
    }
    if (!due(stream)) {
        examine(instrument, frame, &quality);
        return;
    }
    const uint32_t began_us = fw_now_us(instrument);
    const bool follows = (stream->what & EITS_STREAM_FOLLOWED) != 0;
    const float *volts = follows ? fw_follow_align(instrument, frame) : frame->volts;
    uint32_t solving_us = 0;
    send_raw(instrument, frame, 0);
    if (solved && volts != NULL)
        solving_us = solve(instrument, frame, volts, &quality);
    else if (!solved)
        examine(instrument, frame, &quality);
    const uint32_t done_us = fw_now_us(instrument);
    fw_stats_add(&instrument->stats, EITS_STAGE_SEND, done_us - began_us - solving_us);
    fw_stats_add(&instrument->stats, EITS_STAGE_FRAME, done_us - frame->time_us);
    check_deadline(instrument, frame, done_us);
    if (stream->counted && --stream->left == 0)
        stream->what = 0;
}
