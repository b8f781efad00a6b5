#include "app/solve/tracker.h"

#include "app/acquire/acquire.h"
#include "app/solve/state.h"

#include <math.h>
#include <string.h>

bool fw_tracker_possible(const fw_solve *solve)
{
    return eits_fast_drives(solve->engine.fast) > 0 && !solve->board->frames_given &&
           eits_get_options(solve->engine.ctx)->reference_frames == 0 &&
           fw_acquire_settings(solve->acquire)->check_every == 1 &&
           solve->board->system->later != NULL;
}

bool fw_tracker_ready(const fw_solve *solve)
{
    return solve->engine.tared && !solve->tare.active;
}

void fw_tracker_forget(fw_solve *solve)
{
    solve->tracker.running = solve->tracker.owed = false;
}

void fw_tracker_new_reference(fw_solve *solve)
{
    fw_tracker_forget(solve);
    eits_fast_forget_all(solve->engine.fast);
}

bool fw_tracker_waits(const fw_solve *solve)
{
    return solve->tracker.owed;
}

void fw_tracker_skip(fw_solve *solve)
{
    solve->tracker.running = false;
}

/* Return the model's drive that has exactly these rows, or the number of drives if there is none.
 */
static uint32_t number_of(const fw_solve *solve, const fw_scan_drive *drive)
{
    const fw_engine *engine = &solve->engine;
    const uint32_t row = fw_acquire_row_at(solve->acquire, drive->first);
    const uint32_t number = engine->drive_of[row];
    uint32_t count = 0;
    const uint16_t *rows = eits_fast_rows(engine->fast, number, &count);
    return rows[0] == row && count == drive->count ? number : eits_fast_drives(engine->fast);
}

static void take_volts(const fw_engine *engine, const fw_scan_drive *drive, const uint16_t *rows,
                       float *volts)
{
    for (uint32_t k = 0; k < drive->count; ++k) {
        const uint32_t row = rows[k];
        const fw_iq z = drive->z[row];
        const bool use = drive->quality[row] == 0 && !eits_is_masked(engine->ctx, row);
        volts[k] = use ? z.i * engine->cosine + z.q * engine->sine : (float)NAN;
    }
}

static void begin(fw_solve *solve, const fw_scan_drive *drive)
{
    fw_tracker *tracker = &solve->tracker;
    tracker->running = drive->first == 0 && eits_fast_begin(solve->engine.fast) == EITS_OK;
    tracker->begun = drive->frame;
    tracker->count = 0;
    tracker->noted = false;
}

bool fw_tracker_take(fw_solve *solve, const fw_scan_drive *drive, fw_track_update *update)
{
    fw_tracker *tracker = &solve->tracker;
    eits_fast *fast = solve->engine.fast;
    const bool next = tracker->running && drive->first == tracker->next_first &&
                      drive->frame == tracker->next_frame;
    if (!next)
        begin(solve, drive);
    const uint32_t number = number_of(solve, drive);
    if (!tracker->running || number == eits_fast_drives(fast)) {
        tracker->running = false;
        return false;
    }
    uint32_t count = 0;
    float volts[EITS_FAST_ROWS];
    take_volts(&solve->engine, drive, eits_fast_rows(fast, number, &count), volts);
    (void)eits_fast_drive(fast, number, volts, count, drive->time_us);
    update->drive = number;
    update->begun = tracker->begun;
    update->first = !next;
    update->count = 0;
    (void)eits_fast_touches(fast, update->touches, EITS_FAST_TOUCHES, &update->count);
    tracker->next_first = drive->last ? 0 : drive->first + drive->count;
    tracker->next_frame = drive->frame + drive->last;
    if (drive->last && !tracker->at_frame) {
        tracker->owed = true;
        tracker->owed_frame = drive->frame;
    }
    return true;
}

bool fw_tracker_at_frame(fw_solve *solve, bool taken)
{
    fw_tracker *tracker = &solve->tracker;
    tracker->at_frame = taken;
    if (taken || !tracker->owed)
        return false;
    tracker->owed = false;
    return true;
}

bool fw_tracker_align(fw_solve *solve, fw_frame *frame, const float **volts)
{
    fw_tracker *tracker = &solve->tracker;
    fw_engine *engine = &solve->engine;
    uint32_t state = 0;
    *volts = NULL;
    if (!tracker->owed || tracker->owed_frame != frame->number)
        return false;
    if (tracker->noted)
        (void)eits_fast_confirm(engine->fast, tracker->touches, tracker->count);
    tracker->noted = false;
    const eits_status status =
        eits_fast_align(engine->fast, frame->volts, engine->model.n_rows, engine->aligned, &state);
    tracker->owed = false;
    if (status != EITS_OK)
        return true;
    frame->flags |= EITS_RAW_ALIGNED;
    if (tracker->begun == frame->number)
        frame->flags |= EITS_RAW_BEGUN;
    if ((state & EITS_FAST_TRUSTED) != 0) {
        frame->flags |= EITS_RAW_TRUSTED;
        *volts = engine->aligned;
    }
    return true;
}

uint32_t fw_tracker_note(fw_solve *solve, bool aligned, eits_touch *touches, uint32_t count,
                         eits_info *info)
{
    fw_tracker *tracker = &solve->tracker;
    eits_fast *fast = solve->engine.fast;
    eits_touch reported[EITS_MAX_TOUCHES];
    uint32_t reports = 0, found = 0;
    if (fast == NULL) /* there was no room for it: ids number the touches of each frame */
        return count;
    (void)eits_fast_report(fast, touches, count, reported, &reports);
    if (aligned) {
        memcpy(tracker->touches, touches, count * sizeof touches[0]);
        tracker->count = count;
        tracker->noted = true;
        (void)eits_fast_name(fast, info);
    }
    for (uint32_t k = 0; k < reports; ++k)
        found += reported[k].explained > 0;
    if (found < count) /* the touches' image would lack one */
        info->shown = EITS_SHOWN_SOLVER;
    info->touches = reports;
    memcpy(touches, reported, reports * sizeof touches[0]);
    return reports;
}

uint32_t fw_tracker_report(fw_solve *solve, eits_touch *touches)
{
    uint32_t count = 0;
    (void)eits_fast_report(solve->engine.fast, NULL, 0, touches, &count);
    return count;
}
