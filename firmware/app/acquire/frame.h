/* Types that the scan shares with other modules: settings, tables, frames and drives. */
#ifndef FW_FRAME_H
#define FW_FRAME_H

#include <stdbool.h>
#include <stdint.h>

/* volts at the electrodes: amplitude times cosine and sine of the phase */
typedef struct fw_iq {
    float i, q;
} fw_iq;

typedef struct fw_scan_settings {
    uint32_t excitation_millihz, sample_rate_hz;
    uint32_t samples, settle_us;
    /* 1: every frame is full; n > 1: reciprocal-unique, every n-th full; 0: never full */
    uint32_t check_every;
    uint32_t frame_period_us; /* 0: as fast as possible */
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
    float *volts;             /* n_rows, and directly behind it: */
    uint8_t *quality;         /* n_rows */
} fw_frame;

/* The rows that are measured: all rows of a protocol, or one row of each reciprocal pair. */
typedef struct fw_scan_table {
    const uint8_t *protocol; /* n_rows x 4 */
    uint32_t n_rows;
    const uint16_t *order;  /* n_rows, in the order of measurement; NULL: the protocol's order */
    const uint16_t *unique; /* n_unique rows, in the order of measurement */
    uint32_t n_unique;
} fw_scan_table;

/* The measured rows of one drive: positions `first` to `first + count - 1` of its frame. */
typedef struct fw_scan_drive {
    uint32_t frame, first, count;
    uint32_t time_us; /* the middle of the drive, if no measurement was repeated */
    uint32_t end_us;
    const fw_iq *z; /* of the frame */
    const uint8_t *quality;
    bool last; /* of the frame */
} fw_scan_drive;

#endif
