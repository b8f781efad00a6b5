#include "app/link/tracks.h"

#include "app/acquire/acquire.h"
#include "app/clock.h"
#include "app/link/state.h"
#include "app/safety/current_enable.h"
#include "app/solve/tracker.h"

static bool asked_for(const fw_host_link *link)
{
    return (link->stream.what & FW_TRACKED) != 0 && link->stream.every == 1;
}

static bool wanted(const fw_host_link *link)
{
    return asked_for(link) && fw_tracker_ready(link->solve) && !fw_current_settling(link->safety);
}

static uint16_t short_us(uint32_t us)
{
    return (uint16_t)(us < UINT16_MAX ? us : UINT16_MAX);
}

static void send(fw_host_link *link, const fw_scan_drive *drive, const fw_track_update *update,
                 uint32_t began_us)
{
    eits_packet_drive_touch body[EITS_FAST_TOUCHES];
    for (uint32_t k = 0; k < update->count; ++k) {
        const eits_fast_touch *t = &update->touches[k];
        body[k] = (eits_packet_drive_touch){.id = (uint16_t)t->id,
                                            .confirmed = (uint16_t)t->confirmed,
                                            .x_mm = t->x_mm,
                                            .y_mm = t->y_mm,
                                            .vx_mm_per_s = t->vx_mm_per_s,
                                            .vy_mm_per_s = t->vy_mm_per_s,
                                            .strength_s_per_m_mm2 = t->strength_s_per_m_mm2,
                                            .radius_mm = t->radius_mm,
                                            .x_variance_mm2 = t->x_variance_mm2,
                                            .xy_covariance_mm2 = t->xy_covariance_mm2,
                                            .y_variance_mm2 = t->y_variance_mm2};
    }
    const uint32_t now_us = fw_now_us(link->board);
    const eits_packet_drive_touches head = {.frame = drive->frame,
                                            .time_us = drive->time_us,
                                            .begun = update->begun,
                                            .age_us = short_us(now_us - drive->end_us),
                                            .update_us = short_us(now_us - began_us),
                                            .drive = (uint16_t)update->drive,
                                            .count = (uint16_t)update->count};
    (void)fw_tx_queue_send(&link->tx_queue, EITS_PACKET_DRIVE_TOUCHES, &head, sizeof head, body,
                           update->count * sizeof body[0]);
}

/* A packet without touches is sent only once in a row. */
static void track(fw_host_link *link, const fw_scan_drive *drive)
{
    fw_track_update update;
    const uint32_t began_us = fw_now_us(link->board);
    if (!fw_tracker_take(link->solve, drive, &update))
        return;
    if ((link->stream.what & EITS_STREAM_DRIVE_TOUCHES) != 0 &&
        (update.first || update.count > 0 || link->tracks.reported > 0))
        send(link, drive, &update, began_us);
    link->tracks.reported = update.count;
}

/* This runs between the interrupts and the main loop, and when the main loop itself calls go_on. */
static void work(void *user)
{
    fw_host_link *link = user;
    fw_tracks *tracks = &link->tracks;
    const fw_scan_drive *drive;
    if (tracks->working)
        return;
    tracks->working = true;
    while (!tracks->held && !fw_tracker_waits(link->solve) && !link->tx_queue.busy &&
           (drive = fw_acquire_next_drive(link->acquire)) != NULL) {
        if (wanted(link))
            track(link, drive);
        else
            fw_tracker_skip(link->solve);
        fw_acquire_take_drive(link->acquire);
    }
    tracks->working = false;
}

/* Process drives that may be waiting. */
static void go_on(void *user)
{
    const fw_host_link *link = user;
    const fw_board *board = link->board;
    if (fw_acquire_next_drive(link->acquire) != NULL)
        board->system->later(board->system_ctx, work, user);
}

void fw_tracks_init(fw_host_link *link)
{
    link->tx_queue.free = go_on;
    link->tx_queue.user = link;
}

void fw_tracks_hold(fw_host_link *link)
{
    link->tracks.held = true;
}

void fw_tracks_release(fw_host_link *link)
{
    link->tracks.held = false;
    go_on(link);
}

void fw_tracks_restart(fw_host_link *link)
{
    const bool on = asked_for(link) && fw_tracker_possible(link->solve);
    fw_tracker_forget(link->solve);
    fw_acquire_report_drives(link->acquire, on ? go_on : NULL, link);
}

void fw_tracks_at_frame(fw_host_link *link, bool taken)
{
    if (fw_tracker_at_frame(link->solve, taken))
        go_on(link);
}

const float *fw_tracks_align(fw_host_link *link, fw_frame *frame)
{
    const float *volts;
    if (fw_tracker_align(link->solve, frame, &volts))
        go_on(link);
    return volts;
}

bool fw_tracks_misses(fw_host_link *link, const fw_frame *frame)
{
    const bool first = !link->stream.began;
    link->stream.began = true;
    return first && (frame->flags & EITS_RAW_ALIGNED) == 0 && wanted(link) &&
           fw_tracker_possible(link->solve);
}
