/* Included by most tests of the application: the bench of a test program, and steps that tests
 * share. */
#ifndef FW_TEST_STEPS_H
#define FW_TEST_STEPS_H

#include "bench.h"
#include "check.h"

#include <math.h>
#include <string.h>

static bench b;

#define TAKEN(reply)                CHECK_EQUAL((reply).status, EITS_REPLY_OK)
#define STREAM(what, every, frames) TAKEN(host_stream(&b.host, what, every, frames))
#define TARE(frames)                TAKEN(host_tare(&b.host, frames))

static inline eits_packet_reply scan_with(eits_command_scan scan)
{
    return host_command(&b.host, EITS_PACKET_SCAN, &scan, sizeof scan);
}

/* Measure both rows of each fold in every so many-th scan. */
static inline void check_each(uint16_t scans)
{
    eits_command_scan scan = host_default_scan();
    scan.check_every = scans;
    TAKEN(scan_with(scan));
}

/* Run for so many milliseconds; earlier packets are forgotten. */
static inline void hear(uint32_t ms)
{
    host_forget(&b.host);
    host_run(&b.host, ms);
}

static inline eits_packet_reply mask_row(uint16_t row, uint16_t masked)
{
    eits_command_mask_row c = {.row = row, .masked = masked};
    return host_command(&b.host, EITS_PACKET_MASK_ROW, &c, sizeof c);
}

static inline void detach(uint32_t electrode, bool off)
{
    b.sheet.detached[electrode] = off;
    sheet_solve(&b.sheet);
}

static inline void touch(double x, double y, double factor)
{
    sheet_touch(&b.sheet, x, y, 1.6, factor);
    sheet_solve(&b.sheet);
}

/* The voltage and the quality of row i in a RAW packet. */
static inline float raw_volts(const host_packet *packet, uint32_t i)
{
    float volts;
    memcpy(&volts, packet->payload + sizeof(eits_packet_raw) + 4 * (size_t)i, 4);
    return volts;
}

static inline uint8_t raw_quality(const host_packet *packet, uint32_t i)
{
    return packet->payload[sizeof(eits_packet_raw) + 4 * (size_t)b.open.n_rows + i];
}

/* The largest difference between a row's voltage and `share` times the sheet's, in steps of the
 * converter. */
static inline double raw_steps_off(const host_packet *packet, double share)
{
    double worst = 0;
    for (uint32_t i = 0; i < b.open.n_rows; ++i)
        worst = fmax(worst, fabs((double)raw_volts(packet, i) - share * bench_volts(&b, i)));
    for (uint32_t i = 0; i < b.open.n_rows; ++i) /* fmax ignores NaN */
        worst = isnan(raw_volts(packet, i)) ? INFINITY : worst;
    return worst / fake_lsb_v(&b.board);
}

#endif
