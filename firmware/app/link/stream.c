#include "app/link/stream.h"

#include "app/acquire/acquire.h"
#include "app/clock.h"
#include "app/link/report.h"
#include "app/link/state.h"
#include "app/link/tracks.h"
#include "app/safety/faults.h"
#include "app/solve/diagnostics.h"
#include "app/solve/frames.h"
#include "app/solve/solve.h"
#include "app/solve/tare.h"

void fw_stream_reset(fw_host_link *link)
{
    link->stream = (fw_stream){.every = 1};
}

static void send_raw(fw_host_link *link, const fw_frame *frame, uint32_t flags)
{
    const uint32_t rows = fw_solve_model(link->solve)->n_rows;
    const eits_packet_raw head = {.frame = frame->number,
                                  .time_us = frame->time_us,
                                  .scan_us = frame->scan_us,
                                  .n_rows = (uint16_t)rows,
                                  .flags = (uint16_t)(frame->flags | flags)};
    if ((link->stream.what & EITS_STREAM_RAW) != 0)
        (void)fw_tx_queue_send(&link->tx_queue, EITS_PACKET_RAW, &head, sizeof head, frame->volts,
                               5 * (size_t)rows);
}

/* Return whether this frame is streamed. */
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

static void send_solved(fw_host_link *link, const fw_frame *frame, eits_packet_solved *head,
                        const eits_touch *touches, uint32_t count)
{
    const uint32_t pixels = fw_solve_model(link->solve)->n_pixels;
    if ((link->stream.what & EITS_STREAM_IMAGE) != 0) {
        head->count = (uint16_t)pixels;
        head->age_us = fw_now_us(link->board) - frame->end_us;
        (void)fw_tx_queue_send(&link->tx_queue, EITS_PACKET_IMAGE, head, sizeof *head,
                               fw_solve_image(link->solve), pixels * sizeof(float));
    }
    if ((link->stream.what & EITS_STREAM_TOUCHES) != 0) {
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
                                          .long_y_mm = t.long_y_mm,
                                          .radius_sd_mm = t.radius_sd_mm,
                                          .confirmed = t.confirmed};
        }
        head->count = (uint16_t)count;
        head->age_us = fw_now_us(link->board) - frame->end_us;
        (void)fw_tx_queue_send(&link->tx_queue, EITS_PACKET_TOUCHES, head, sizeof *head, body,
                               count * sizeof body[0]);
    }
}

/* Send the events of a frame; a frame that the core has rejected has none. */
static void send_events(fw_host_link *link, const fw_frame *frame, eits_status status,
                        const eits_touch *touches, uint32_t count)
{
    eits_packet_event *body = link->events.sent;
    eits_packet_events head = {.frame = frame->number, .time_us = frame->time_us};
    if ((link->stream.what & EITS_STREAM_EVENTS) == 0)
        return;
    if (status == EITS_OK)
        (void)eits_gestures_update(&link->events.gestures, touches, count, frame->time_us,
                                   link->events.found, EITS_MAX_EVENTS, &head.count);
    for (uint32_t k = 0; k < head.count; ++k) {
        const eits_event *e = &link->events.found[k];
        body[k] = (eits_packet_event){.kind = (uint16_t)e->kind,
                                      .phase = (uint16_t)e->phase,
                                      .first_id = e->first_id,
                                      .second_id = e->second_id,
                                      .x_mm = e->x_mm,
                                      .y_mm = e->y_mm,
                                      .direction_deg = e->direction_deg,
                                      .value = e->value};
    }
    (void)fw_tx_queue_send(&link->tx_queue, EITS_PACKET_EVENTS, &head, sizeof head, body,
                           head.count * sizeof body[0]);
}

/* Returns the microseconds that the solver took, touches included. */
static uint32_t solve(fw_host_link *link, const fw_frame *frame, const float *volts,
                      const fw_quality *quality)
{
    fw_solved solved;
    const bool touches = (link->stream.what & FW_TRACKED) != 0;
    fw_frame_solve(link->solve, frame, volts, quality, touches, &solved);
    const uint32_t solve_us = solved.head.solve_us, touch_us = solved.head.touch_us;
    fw_stats_add(&link->stats, EITS_STAGE_SOLVE, solve_us);
    if (touches)
        fw_stats_add(&link->stats, EITS_STAGE_TOUCHES, touch_us);
    send_solved(link, frame, &solved.head, solved.touches, solved.count);
    send_events(link, frame, solved.status, solved.touches, solved.count);
    return solve_us + touch_us;
}

/* Stream a frame that must not be solved: it has the touches that drives follow, and the solver's
 * image of the frame before. */
static void follow(fw_host_link *link, const fw_frame *frame)
{
    fw_solved solved;
    fw_frame_follow(link->solve, frame, &solved);
    send_solved(link, frame, &solved.head, solved.touches, solved.count);
    send_events(link, frame, solved.status, solved.touches, solved.count);
}

static void check_deadline(fw_host_link *link, const fw_frame *frame, uint32_t now_us)
{
    const uint32_t period = fw_acquire_settings(link->acquire)->frame_period_us;
    const uint32_t late = now_us - frame->end_us;
    const bool missed = period != 0 && late > period;
    link->deadlines_missed += missed;
    fw_fault_set(link->safety, EITS_FAULT_DEADLINE, missed,
                 (fw_fault_detail){.value = missed ? (int32_t)(late - period) : 0});
}

void fw_reference_changed(fw_host_link *link)
{
    (void)eits_gestures_init(&link->events.gestures, NULL); /* ids begin again, too */
    fw_diagnostics_new_reference(link->safety);
}

static void take_tare(fw_host_link *link, const fw_frame *frame, const fw_quality *quality)
{
    eits_status status = EITS_OK;
    fw_diagnostics_open(link->safety, quality->open);
    const fw_tare_step step = fw_tare_add(link->solve, frame, &status);
    if (step == FW_TARE_TAKEN || step == FW_TARE_DONE)
        send_raw(link, frame, EITS_RAW_REFERENCE);
    if (step == FW_TARE_DONE) {
        fw_reference_changed(link);
        fw_send_tare_reply(link, (fw_answer){0});
    }
    if (step == FW_TARE_FAILED)
        fw_send_tare_reply(link,
                           (fw_answer){.status = EITS_REPLY_CORE, .detail = {(int32_t)status}});
}

static void stream(fw_host_link *link, fw_frame *frame, const fw_quality *quality)
{
    const uint32_t what = link->stream.what;
    const bool solved = fw_solve_tared(link->solve) && (what & ~(uint32_t)EITS_STREAM_RAW) != 0;
    const uint32_t began_us = fw_now_us(link->board);
    const float *aligned = fw_tracks_align(link, frame);
    if (fw_tracks_misses(link, frame)) {
        fw_frame_examine(link->solve, frame, quality);
        return;
    }
    const bool unsolved = (frame->flags & EITS_RAW_ALIGNED) != 0 && aligned == NULL;
    const float *volts = aligned != NULL ? aligned : frame->volts;
    uint32_t solving_us = 0;
    send_raw(link, frame, 0);
    if (solved && unsolved)
        follow(link, frame);
    else if (solved)
        solving_us = solve(link, frame, volts, quality);
    else if (!solved)
        fw_frame_examine(link->solve, frame, quality);
    const uint32_t done_us = fw_now_us(link->board);
    fw_stats_add(&link->stats, EITS_STAGE_SEND, done_us - began_us - solving_us);
    fw_stats_add(&link->stats, EITS_STAGE_FRAME, done_us - frame->time_us);
    check_deadline(link, frame, done_us);
    if (link->stream.counted && --link->stream.left == 0)
        link->stream.what = 0;
}

void fw_stream_frame(fw_host_link *link, fw_frame *frame)
{
    fw_quality quality;
    const bool for_tare = fw_frame_check(link->solve, frame, &quality);
    fw_stats_add(&link->stats, EITS_STAGE_SCAN, frame->scan_us);
    fw_stats_add(&link->stats, EITS_STAGE_DEMODULATE, frame->busy_us);
    if (for_tare)
        take_tare(link, frame, &quality);
    else if (due(&link->stream))
        stream(link, frame, &quality);
    else
        fw_frame_examine(link->solve, frame, &quality);
}
