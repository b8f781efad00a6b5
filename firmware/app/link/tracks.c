#include "app/link/tracks.h"

#include <math.h>
#include <string.h>

static bool wanted(const fw_instrument *instrument)
{
    return (instrument->stream.what & EITS_STREAM_FOLLOWED) != 0 && instrument->engine.tared &&
           !instrument->tare.active && instrument->drive.settling == 0;
}

bool fw_follow_possible(const fw_instrument *instrument)
{
    /* drives read the reference while frames are solved: it must stay */
    return instrument->engine.fast != NULL && !instrument->board->frames_given &&
           eits_get_options(instrument->engine.ctx)->reference_frames == 0 &&
           instrument->settings.check_every == 1 && instrument->board->system->later != NULL;
}

/* The drive that begins with this row; fast's number of drives where none has just these rows. */
static uint32_t number_of(const fw_instrument *instrument, const fw_scan_drive *drive)
{
    const fw_engine *engine = &instrument->engine;
    const uint32_t row = fw_scan_row_at(&instrument->scan, drive->first);
    const uint32_t number = engine->drive_of[row];
    uint32_t count = 0;
    const uint16_t *rows = eits_fast_rows(engine->fast, number, &count);
    return rows[0] == row && count == drive->count ? number : eits_fast_drives(engine->fast);
}

static void take_volts(const fw_instrument *instrument, const fw_scan_drive *drive,
                       const uint16_t *rows, float *volts)
{
    const fw_engine *engine = &instrument->engine;
    for (uint32_t k = 0; k < drive->count; ++k) {
        const uint32_t row = rows[k];
        const fw_iq z = drive->z[row];
        const bool use = drive->quality[row] == 0 && !eits_is_masked(engine->ctx, row);
        volts[k] = use ? z.i * engine->cosine + z.q * engine->sine : (float)NAN;
    }
}

static uint16_t short_us(uint32_t us)
{
    return (uint16_t)(us < UINT16_MAX ? us : UINT16_MAX);
}

static void send(fw_instrument *instrument, const fw_scan_drive *drive, uint32_t number,
                 uint32_t began_us, bool first)
{
    fw_follow *follow = &instrument->follow;
    eits_fast_touch touches[EITS_FAST_TOUCHES];
    eits_packet_followed_touch body[EITS_FAST_TOUCHES];
    uint32_t count = 0;
    (void)eits_fast_touches(instrument->engine.fast, touches, EITS_FAST_TOUCHES, &count);
    for (uint32_t k = 0; k < count; ++k) {
        const eits_fast_touch *t = &touches[k];
        body[k] = (eits_packet_followed_touch){.id = (uint16_t)t->id,
                                               .confirmed = (uint16_t)t->confirmed,
                                               .x_mm = t->x_mm,
                                               .y_mm = t->y_mm,
                                               .vx_mm_per_s = t->vx_mm_per_s,
                                               .vy_mm_per_s = t->vy_mm_per_s,
                                               .strength_s_per_m_mm2 = t->strength_s_per_m_mm2};
    }
    const bool quiet = count == 0 && follow->told == 0 && !first;
    follow->told = count;
    if (quiet)
        return;
    const uint32_t now_us = fw_now_us(instrument);
    const eits_packet_followed head = {.frame = drive->frame,
                                       .time_us = drive->time_us,
                                       .begun = follow->begun,
                                       .age_us = short_us(now_us - drive->end_us),
                                       .update_us = short_us(now_us - began_us),
                                       .drive = (uint16_t)number,
                                       .count = (uint16_t)count};
    (void)fw_tx_queue_send(&instrument->tx_queue, EITS_PACKET_FOLLOWED, &head, sizeof head, body,
                           count * sizeof body[0]);
}

static void look_at(fw_instrument *instrument, const fw_scan_drive *drive)
{
    fw_follow *follow = &instrument->follow;
    eits_fast *fast = instrument->engine.fast;
    const bool next =
        follow->running && drive->first == follow->next_first && drive->frame == follow->next_frame;
    const uint32_t began_us = fw_now_us(instrument);
    if (!next) {
        follow->running = drive->first == 0 && eits_fast_begin(fast) == EITS_OK;
        follow->begun = drive->frame;
        follow->told = follow->found_count = 0;
        follow->found_any = false;
    }
    const uint32_t number = number_of(instrument, drive);
    if (!follow->running || number == eits_fast_drives(fast)) {
        follow->running = false;
        return;
    }
    uint32_t count = 0;
    float volts[EITS_FAST_ROWS];
    take_volts(instrument, drive, eits_fast_rows(fast, number, &count), volts);
    (void)eits_fast_drive(fast, number, volts, count, drive->time_us);
    send(instrument, drive, number, began_us, !next);
    follow->next_first = drive->last ? 0 : drive->first + drive->count;
    follow->next_frame = drive->frame + drive->last;
    if (drive->last && !follow->at_frame) {
        follow->owed = true;
        follow->owed_frame = drive->frame;
    }
}

static void work(void *user)
{
    fw_instrument *instrument = user;
    fw_follow *follow = &instrument->follow;
    const fw_scan_drive *drive;
    if (follow->working)
        return;
    follow->working = true;
    while (!follow->held && !follow->owed && !instrument->tx_queue.busy &&
           (drive = fw_scan_next_drive(&instrument->scan)) != NULL) {
        if (wanted(instrument))
            look_at(instrument, drive);
        else
            follow->running = false;
        fw_scan_take_drive(&instrument->scan);
    }
    follow->working = false;
}

/* There may be drives to look at. */
static void go_on(void *user)
{
    const fw_instrument *instrument = user;
    const fw_board *board = instrument->board;
    if (fw_scan_next_drive(&instrument->scan) != NULL)
        board->system->later(board->system_ctx, work, user);
}

void fw_follow_init(fw_instrument *instrument)
{
    instrument->tx_queue.free = go_on;
    instrument->tx_queue.user = instrument;
    instrument->scan.user = instrument;
}

void fw_follow_hold(fw_instrument *instrument)
{
    instrument->follow.held = true;
}

void fw_follow_release(fw_instrument *instrument)
{
    instrument->follow.held = false;
    go_on(instrument);
}

void fw_follow_forget(fw_instrument *instrument)
{
    const bool on =
        (instrument->stream.what & EITS_STREAM_FOLLOWED) != 0 && fw_follow_possible(instrument);
    instrument->follow.running = instrument->follow.owed = false;
    instrument->scan.newest = on;
    instrument->scan.drive_done = on ? go_on : NULL;
}

void fw_follow_take(fw_instrument *instrument, bool taken)
{
    fw_follow *follow = &instrument->follow;
    follow->at_frame = taken;
    if (!taken && follow->owed) { /* it was a frame that is not aligned */
        follow->owed = false;
        go_on(instrument);
    }
}

const float *fw_follow_align(fw_instrument *instrument, fw_frame *frame)
{
    fw_follow *follow = &instrument->follow;
    fw_engine *engine = &instrument->engine;
    uint32_t state = 0;
    if (!follow->owed || follow->owed_frame != frame->number)
        return NULL;
    if (follow->found_any)
        (void)eits_fast_confirm(engine->fast, follow->found, follow->found_count);
    follow->found_any = false;
    const eits_status status =
        eits_fast_align(engine->fast, frame->volts, engine->model.n_rows, engine->aligned, &state);
    follow->owed = false;
    go_on(instrument);
    if (status != EITS_OK)
        return NULL;
    const bool trusted = (state & EITS_FAST_TRUSTED) != 0;
    frame->flags |= EITS_RAW_ALIGNED;
    frame->flags |= trusted ? EITS_RAW_TRUSTED : 0;
    return trusted ? engine->aligned : NULL;
}

void fw_follow_found(fw_instrument *instrument, const eits_touch *touches, uint32_t count,
                     eits_info *info)
{
    fw_follow *follow = &instrument->follow;
    memcpy(follow->found, touches, count * sizeof touches[0]);
    follow->found_count = count;
    follow->found_any = true;
    (void)eits_fast_name(instrument->engine.fast, info);
}
