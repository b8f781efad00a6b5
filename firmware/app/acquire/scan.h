/* The scan measures the rows of a protocol table slot by slot, in the capture's interrupt, into one
 * of two frames.
 *
 * Each interrupt first switches the multiplexers to the next row, which the interrupt before has
 * looked up, and demodulates the burst of the last row while they settle. If a switch came too
 * late, its row is measured again. While both frames are full, the scan waits. */
#ifndef FW_SCAN_H
#define FW_SCAN_H

#include "app/acquire/demodulate.h"
#include "app/acquire/frame.h"
#include "hal/hal.h"

#include <stdatomic.h>

#define FW_SWITCH_US   3u /* allowance in a slot for interrupt latency and break before make */
#define FW_MAX_TRIES   8u /* of one row; after them it is marked as unsettled */
#define FW_MIN_RATE_HZ 1000u
#define FW_MAX_RATE_HZ 5000000u

#define FW_SCAN_DRIVES 32u

/* The row that the scan measures in a slot, and how. */
typedef struct fw_scan_row {
    uint32_t electrodes; /* as fw_multiplexers_ops takes them, if `valid` */
    uint32_t position;   /* in the list of rows */
    uint32_t row;
    bool valid, last; /* row of its frame */
    bool ends_drive;  /* the next row has another drive, or is of the next frame */
} fw_scan_row;

typedef struct fw_scan {
    const fw_board *board;
    fw_demodulator *demodulator;
    fw_scan_table table;
    fw_scan_settings settings;
    uint32_t slot_us, burst_us;
    fw_frame *frames; /* two */
    bool running;
    /* used by the interrupt while the scan runs */
    fw_frame *frame; /* being filled; NULL: between frames */
    fw_scan_row now, next;
    uint32_t tries;
    uint32_t switched_us;
    uint32_t next_due_us;
    bool switched; /* the row `now` is selected */
    bool due_known, next_full;
    uint32_t next_number;
    /* used by both the interrupt and the main loop */
    _Atomic uint32_t filled, taken; /* frames since the scan was started */
    _Atomic uint32_t bursts, slots_repeated, frames_scanned;
    uint32_t watched_bursts, watched_us; /* for fw_scan_stalled */
    /* called from the interrupt after each drive; NULL: not */
    void (*drive_done)(void *user);
    void *user;
    bool newest; /* if both frames are full, the one that waits is scanned again */
    fw_scan_drive drive[FW_SCAN_DRIVES];
    uint32_t drive_from; /* the position at which the present drive began */
    _Atomic uint32_t drives, drives_taken;
} fw_scan;

void fw_scan_init(fw_scan *scan, const fw_board *board, fw_demodulator *demodulator);

/* Return whether the board can join these electrodes: I+, I-, V+, V- of 8 bits each, I+ lowest. */
bool fw_can_join(const fw_board *board, uint32_t electrodes);

/* Return the length of a burst, and of a slot. A slot holds burst, settling and switching. If that
 * makes it at most a quarter longer, it is rounded up to a whole number of excitation periods. */
uint32_t fw_burst_us(const fw_scan_settings *settings);
uint32_t fw_slot_us(const fw_scan_settings *settings);

/* Return the number of rows in the next frame, and the row that is measured at `position` of it. */
uint32_t fw_scan_next_rows(const fw_scan *scan);
uint32_t fw_scan_row_at(const fw_scan *scan, uint32_t position);

/* Return the number of rows that the longest frame measures. */
uint32_t fw_scan_rows(const fw_scan_settings *settings, const fw_scan_table *table);

/* Set up the capture, which must have been stopped. Errors: those of the capture. */
fw_status fw_scan_configure(fw_scan *scan, const fw_scan_settings *settings);

/* Begin to scan `table` into frames[0] and frames[1], which belong to the scan until fw_scan_stop.
 * The demodulator must have been set up. Errors: those of the capture and the lines; nothing runs
 * then. */
fw_status fw_scan_start(fw_scan *scan, const fw_scan_settings *settings, const fw_scan_table *table,
                        fw_frame *frames);

/* Stop, and disconnect all electrodes. Frames that were not taken are lost. Errors: those of the
 * lines. */
fw_status fw_scan_stop(fw_scan *scan);

/* Return the oldest full frame, or NULL. It belongs to the caller until fw_scan_release. */
fw_frame *fw_scan_take(fw_scan *scan);
void fw_scan_release(fw_scan *scan);

/* Return the oldest drive that was not taken, or NULL. While FW_SCAN_DRIVES of them wait, further
 * ones are left out. */
const fw_scan_drive *fw_scan_next_drive(const fw_scan *scan);
void fw_scan_take_drive(fw_scan *scan);

/* Return whether the scan runs but no burst has come for four slots and 20 ms. */
bool fw_scan_stalled(fw_scan *scan, uint32_t now_us);

#endif
