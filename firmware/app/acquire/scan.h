/* The scan: measures the rows of a protocol table slot by slot, from the capture's interrupt, into
 * one of two frames.
 *
 * In each interrupt the multiplexers are switched for the next row first, and the burst of the last
 * is demodulated while they settle. A row whose switch came too late is measured again. While both
 * frames are full, the scan waits. */
#ifndef FW_SCAN_H
#define FW_SCAN_H

#include "app/acquire/demodulate.h"
#include "drivers/adg1206.h"
#include "hal/hal.h"

#include <stdatomic.h>

#define FW_SWITCH_US   3u /* allowance in a slot for interrupt latency and break before make */
#define FW_MAX_TRIES   8u /* of one row, before it is given up as unsettled */
#define FW_MIN_RATE_HZ 1000u
#define FW_MAX_RATE_HZ 5000000u

typedef struct fw_scan_settings {
    uint32_t excitation_millihz, sample_rate_hz;
    uint32_t samples, settle_us;
    /* 1: every frame is full; n > 1: reciprocal-unique, every n-th full; 0: never full */
    uint32_t check_every;
    uint32_t frame_period_us; /* 0: as fast as it goes */
} fw_scan_settings;

#define FW_SCAN_DEFAULT               \
    {.excitation_millihz = 50000000u, \
     .sample_rate_hz = 1000000u,      \
     .samples = 80,                   \
     .settle_us = 16,                 \
     .check_every = 1}

typedef struct fw_frame {
    uint32_t number, time_us; /* when its first burst began */
    uint32_t scan_us;         /* until its last burst ended */
    uint32_t end_us;          /* time_us + scan_us */
    uint32_t busy_us;         /* spent in the interrupt */
    uint32_t bus_errors;      /* multiplexers that could not be switched */
    uint16_t flags;           /* EITS_RAW_RECIPROCAL or EITS_RAW_CHECK */
    fw_iq *z;                 /* n_rows */
    float *volts;             /* n_rows, and right behind it: */
    uint8_t *quality;         /* n_rows */
} fw_frame;

/* What is measured: rows of a protocol, and those that are left when reciprocals are taken as
 * known. */
typedef struct fw_scan_table {
    const uint8_t *protocol; /* n_rows x 4 */
    uint32_t n_rows;
    const uint16_t *order;  /* n_rows, as they are measured; NULL: as they stand */
    const uint16_t *unique; /* n_unique rows, as they are measured */
    uint32_t n_unique;
} fw_scan_table;

/* The rows of a drive, measured; they are the places `first` on of its frame. */
typedef struct fw_scan_drive {
    uint32_t frame, first, count;
    uint32_t time_us; /* the middle, were no measurement repeated */
    uint32_t end_us;
    const fw_iq *z; /* of the frame */
    const uint8_t *quality;
    bool last; /* of the frame */
} fw_scan_drive;
#define FW_SCAN_DRIVES 32u

typedef struct fw_scan {
    const fw_board *board;
    const fw_demodulator *demodulator;
    fw_adg1206 mux;
    fw_scan_table table;
    fw_scan_settings settings;
    uint32_t slot_us, burst_us;
    fw_frame *frames; /* two */
    bool running;
    /* of the interrupt, while running */
    fw_frame *frame;   /* being filled; NULL: between frames */
    uint32_t position; /* in the list of rows */
    uint32_t tries;
    uint32_t switched_us;
    uint32_t next_due_us;
    bool switched; /* the row at `position` is selected */
    bool due_known, next_full;
    uint32_t next_number;
    /* of both */
    _Atomic uint32_t filled, taken; /* frames since the scan was started */
    _Atomic uint32_t bursts, slots_repeated, frames_scanned;
    uint32_t watched_bursts, watched_us; /* of fw_scan_stalled */
    /* of each drive that is measured, where somebody wants to know */
    void (*drive_done)(void *user);
    void *user;
    bool newest; /* both frames full: the one that waits goes, and the scan goes on */
    fw_scan_drive drive[FW_SCAN_DRIVES];
    uint32_t drive_from; /* where the drive under way began */
    _Atomic uint32_t drives, drives_taken;
} fw_scan;

void fw_scan_init(fw_scan *scan, const fw_board *board, const fw_demodulator *demodulator);

/* Length of a burst, and of a slot: burst, settling and switching, and where that costs at most a
 * quarter more, made a whole number of excitation periods. */
uint32_t fw_burst_us(const fw_scan_settings *settings);
uint32_t fw_slot_us(const fw_scan_settings *settings);

/* Rows of the next frame, and which one is measured at `position`, slot by slot. */
uint32_t fw_scan_next_rows(const fw_scan *scan);
uint32_t fw_scan_row_at(const fw_scan *scan, uint32_t position);

/* Rows measured in the longest frame. */
uint32_t fw_scan_rows(const fw_scan_settings *settings, const fw_scan_table *table);

/* Set the stopped capture up for these settings. Errors: those of the capture. */
fw_status fw_scan_configure(fw_scan *scan, const fw_scan_settings *settings);

/* Begin to scan `table` into frames[0] and frames[1], which belong to the scan until fw_scan_stop.
 * The demodulator is set up. Errors: those of the capture and the lines; nothing runs then. */
fw_status fw_scan_start(fw_scan *scan, const fw_scan_settings *settings, const fw_scan_table *table,
                        fw_frame *frames);

/* Stop, all electrodes off; frames that were not taken are lost. Errors: those of the lines. */
fw_status fw_scan_stop(fw_scan *scan);

/* The oldest full frame, or NULL; it stays the caller's until fw_scan_release. */
fw_frame *fw_scan_take(fw_scan *scan);
void fw_scan_release(fw_scan *scan);

/* The oldest drive that was not taken; NULL: there is none. After FW_SCAN_DRIVES that nobody took,
 * the next ones are left out. */
const fw_scan_drive *fw_scan_next_drive(const fw_scan *scan);
void fw_scan_take_drive(fw_scan *scan);

/* Whether no burst has come for four slots and 20 ms although the scan runs. */
bool fw_scan_stalled(fw_scan *scan, uint32_t now_us);

#endif
