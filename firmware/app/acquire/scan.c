#include "app/acquire/scan.h"

#include "app/clock.h"
#include "eitskin/link.h"

void fw_scan_init(fw_scan *scan, const fw_board *board, fw_demodulator *demodulator)
{
    *scan = (fw_scan){.board = board, .demodulator = demodulator};
}

bool fw_can_join(const fw_board *board, uint32_t electrodes)
{
    uint32_t four[4];
    for (uint32_t k = 0; k < 4; ++k) {
        four[k] = electrodes >> 8 * k & 0xFFu;
        if (four[k] >= board->multiplexers.electrodes)
            return false;
    }
    return four[0] != four[1] && four[2] != four[3];
}

static fw_status join(const fw_scan *scan, uint32_t electrodes)
{
    const fw_multiplexers *multiplexers = &scan->board->multiplexers;
    return multiplexers->ops->join(multiplexers->ctx, electrodes);
}

static fw_status all_off(const fw_scan *scan)
{
    const fw_multiplexers *multiplexers = &scan->board->multiplexers;
    return multiplexers->ops->all_off(multiplexers->ctx);
}

uint32_t fw_burst_us(const fw_scan_settings *s)
{
    return (uint32_t)(((uint64_t)s->samples * 1000000u + s->sample_rate_hz - 1) /
                      s->sample_rate_hz);
}

uint32_t fw_slot_us(const fw_scan_settings *s)
{
    const uint32_t min = fw_burst_us(s) + s->settle_us + FW_SWITCH_US;
    for (uint32_t us = min; us <= min + min / 4; ++us) {
        if ((uint64_t)us * s->excitation_millihz % 1000000000u == 0)
            return us;
    }
    return min;
}

uint32_t fw_scan_rows(const fw_scan_settings *settings, const fw_scan_table *table)
{
    return settings->check_every == 0 ? table->n_unique : table->n_rows;
}

uint32_t fw_scan_next_rows(const fw_scan *scan)
{
    return scan->next_full ? scan->table.n_rows : scan->table.n_unique;
}

static uint32_t row_at(const fw_scan *scan, bool full, uint32_t position)
{
    const uint16_t *order = full ? scan->table.order : scan->table.unique;
    return order == NULL ? position : order[position];
}

uint32_t fw_scan_row_at(const fw_scan *scan, uint32_t position)
{
    return row_at(scan, scan->next_full, position);
}

static const uint8_t *electrodes_of(const fw_scan *scan, uint32_t row)
{
    return scan->table.protocol + 4 * (size_t)row;
}

static bool same_drive(const fw_scan *scan, uint32_t row, uint32_t other)
{
    const uint8_t *a = electrodes_of(scan, row), *b = electrodes_of(scan, other);
    return a[0] == b[0] && a[1] == b[1];
}

/* Return the row at `position` of a frame. */
static fw_scan_row find_row(const fw_scan *scan, bool full, uint32_t position)
{
    const uint32_t rows = full ? scan->table.n_rows : scan->table.n_unique;
    fw_scan_row found = {.position = position, .row = row_at(scan, full, position)};
    found.last = position + 1 == rows;
    found.ends_drive = found.last || !same_drive(scan, found.row, row_at(scan, full, position + 1));
    const uint8_t *four = electrodes_of(scan, found.row);
    found.electrodes =
        four[0] | (uint32_t)four[1] << 8 | (uint32_t)four[2] << 16 | (uint32_t)four[3] << 24;
    found.valid = fw_can_join(scan->board, found.electrodes);
    return found;
}

static bool is_full(const fw_scan *scan, uint32_t number)
{
    const uint32_t every = scan->settings.check_every;
    return every != 0 && number % every == 0;
}

/* Look up the row after `now` in advance, so that the switch to it is not delayed. */
static void prepare(fw_scan *scan)
{
    const bool last = scan->now.last;
    scan->next = find_row(scan, last ? is_full(scan, scan->next_number + 1) : scan->next_full,
                          last ? 0 : scan->now.position + 1);
}

/* Select a row; `switched` says whether that worked. */
static void switch_to(fw_scan *scan, const fw_scan_row *row)
{
    scan->switched = row->valid && join(scan, row->electrodes) == FW_OK;
    scan->switched_us = fw_now_us(scan->board);
}

/* Report that the drive which ends with the row at `position` has been measured. */
static void report_drive(fw_scan *scan, uint32_t position, uint32_t start_us, bool last)
{
    const uint32_t first = scan->drive_from, count = position + 1 - first;
    const uint32_t reported = atomic_load_explicit(&scan->drives, memory_order_relaxed);
    scan->drive_from = last ? 0 : position + 1;
    if (scan->drive_done == NULL)
        return;
    if (reported - atomic_load_explicit(&scan->drives_taken, memory_order_acquire) <
        FW_SCAN_DRIVES) {
        const fw_frame *frame = scan->frame;
        scan->drive[reported % FW_SCAN_DRIVES] =
            (fw_scan_drive){.frame = frame->number,
                            .first = first,
                            .count = count,
                            .time_us = frame->time_us + first * scan->slot_us +
                                       ((count - 1) * scan->slot_us + scan->burst_us) / 2,
                            .end_us = start_us + scan->burst_us,
                            .z = frame->z,
                            .quality = frame->quality,
                            .last = last};
        atomic_store_explicit(&scan->drives, reported + 1, memory_order_release);
    }
    scan->drive_done(scan->user);
}

/* Decide whether the next frame measures all rows. */
static void plan_frame(fw_scan *scan)
{
    scan->next_full = is_full(scan, scan->next_number);
}

/* Begin a free frame with the burst that began at start_us. Returns false if no frame is free, or
 * if it is not due yet. */
static bool begin_frame(fw_scan *scan, uint32_t start_us)
{
    uint32_t filled = atomic_load_explicit(&scan->filled, memory_order_relaxed);
    if (filled - atomic_load_explicit(&scan->taken, memory_order_acquire) >= 2) {
        if (!scan->newest)
            return false;
        /* the main loop has taken the other one, and not this one */
        atomic_store_explicit(&scan->filled, --filled, memory_order_release);
    }
    const uint32_t period = scan->settings.frame_period_us;
    if (period != 0) {
        const int32_t late = (int32_t)(start_us - scan->next_due_us);
        if (scan->due_known && late < 0)
            return false;
        const bool on_time = scan->due_known && (uint32_t)late < period;
        scan->next_due_us = (on_time ? scan->next_due_us : start_us) + period;
        scan->due_known = true;
    }
    fw_frame *frame = &scan->frames[filled % 2u];
    frame->number = scan->next_number;
    frame->time_us = start_us;
    frame->busy_us = 0;
    frame->bus_errors = 0;
    frame->flags = scan->settings.check_every == 1
                       ? 0
                       : (scan->next_full ? EITS_RAW_CHECK : EITS_RAW_RECIPROCAL);
    scan->frame = frame;
    return true;
}

static void end_frame(fw_scan *scan, uint32_t start_us)
{
    fw_frame *frame = scan->frame;
    frame->scan_us = start_us + scan->burst_us - frame->time_us;
    frame->end_us = start_us + scan->burst_us;
    scan->frame = NULL;
    atomic_fetch_add_explicit(&scan->frames_scanned, 1, memory_order_relaxed);
    atomic_fetch_add_explicit(&scan->filled, 1, memory_order_release);
}

/* The burst of a slot is complete: called from the capture's interrupt. */
static void on_burst(void *user, const fw_burst *burst)
{
    fw_scan *scan = user;
    atomic_fetch_add_explicit(&scan->bursts, 1, memory_order_relaxed);
    /* the clock is read after the switch and rounded down: hence >, not >= */
    const bool settled = scan->switched && (int32_t)(burst->start_us - scan->switched_us) >
                                               (int32_t)scan->settings.settle_us;
    const bool good = settled && !burst->lost;
    if (!good && scan->tries < FW_MAX_TRIES) {
        ++scan->tries;
        atomic_fetch_add_explicit(&scan->slots_repeated, 1, memory_order_relaxed);
        if (!scan->switched) {
            if (scan->frame != NULL)
                ++scan->frame->bus_errors;
            switch_to(scan, &scan->now);
        }
        return;
    }
    if (scan->frame == NULL && !begin_frame(scan, burst->start_us))
        return;
    const bool bus_error = !scan->switched;
    switch_to(scan, &scan->next);
    const fw_scan_row measured = scan->now;
    fw_frame *frame = scan->frame;
    if (measured.last) {
        ++scan->next_number;
        plan_frame(scan);
    }
    scan->now = scan->next;
    prepare(scan);
    scan->tries = 0;
    frame->bus_errors += bus_error;
    if (good) {
        const bool saturated = fw_demodulate(scan->demodulator, burst->samples, burst->start_us,
                                             &frame->z[measured.row]);
        frame->quality[measured.row] = saturated ? EITS_QUALITY_SATURATED : 0;
    } else {
        frame->z[measured.row] = (fw_iq){0, 0};
        frame->quality[measured.row] = EITS_QUALITY_UNSETTLED;
    }
    frame->busy_us += fw_now_us(scan->board) - burst->entered_us;
    if (measured.ends_drive)
        report_drive(scan, measured.position, burst->start_us, measured.last);
    if (measured.last)
        end_frame(scan, burst->start_us);
}

fw_status fw_scan_configure(fw_scan *scan, const fw_scan_settings *settings)
{
    const fw_capture *capture = &scan->board->capture;
    const fw_capture_setup setup = {settings->sample_rate_hz, settings->samples,
                                    fw_slot_us(settings)};
    return capture->ops->configure(capture->ctx, &setup, on_burst, scan);
}

fw_status fw_scan_start(fw_scan *scan, const fw_scan_settings *settings, const fw_scan_table *table,
                        fw_frame *frames)
{
    const fw_capture *capture = &scan->board->capture;
    (void)fw_scan_stop(scan);
    scan->settings = *settings;
    scan->table = *table;
    scan->frames = frames;
    scan->burst_us = fw_burst_us(settings);
    scan->slot_us = fw_slot_us(settings);
    scan->frame = NULL;
    scan->tries = 0;
    scan->drive_from = 0;
    scan->due_known = false;
    atomic_store(&scan->filled, 0);
    atomic_store(&scan->taken, 0);
    fw_status status = fw_scan_configure(scan, settings);
    if (status != FW_OK)
        return status;
    plan_frame(scan);
    scan->now = find_row(scan, scan->next_full, 0);
    switch_to(scan, &scan->now);
    prepare(scan);
    scan->watched_us = fw_now_us(scan->board);
    scan->watched_bursts = atomic_load(&scan->bursts);
    status = scan->switched ? capture->ops->start(capture->ctx) : FW_E_BUS;
    scan->running = status == FW_OK;
    if (!scan->running)
        (void)all_off(scan);
    return status;
}

fw_status fw_scan_stop(fw_scan *scan)
{
    if (scan->running)
        scan->board->capture.ops->stop(scan->board->capture.ctx);
    scan->running = false;
    atomic_store(&scan->filled, 0);
    atomic_store(&scan->taken, 0);
    return all_off(scan);
}

fw_frame *fw_scan_take(fw_scan *scan)
{
    const uint32_t taken = atomic_load_explicit(&scan->taken, memory_order_relaxed);
    if (atomic_load_explicit(&scan->filled, memory_order_acquire) == taken)
        return NULL;
    return &scan->frames[taken % 2u];
}

void fw_scan_release(fw_scan *scan)
{
    atomic_fetch_add_explicit(&scan->taken, 1, memory_order_release);
}

const fw_scan_drive *fw_scan_next_drive(const fw_scan *scan)
{
    const uint32_t taken = atomic_load_explicit(&scan->drives_taken, memory_order_relaxed);
    if (atomic_load_explicit(&scan->drives, memory_order_acquire) == taken)
        return NULL;
    return &scan->drive[taken % FW_SCAN_DRIVES];
}

void fw_scan_take_drive(fw_scan *scan)
{
    atomic_fetch_add_explicit(&scan->drives_taken, 1, memory_order_release);
}

bool fw_scan_stalled(fw_scan *scan, uint32_t now)
{
    const uint32_t bursts = atomic_load_explicit(&scan->bursts, memory_order_relaxed);
    if (!scan->running || bursts != scan->watched_bursts) {
        scan->watched_bursts = bursts;
        scan->watched_us = now;
        return false;
    }
    return now - scan->watched_us > 4 * scan->slot_us + 20000u;
}
