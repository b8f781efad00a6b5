/* Generator, multiplexers and converter: starts and stops them together, and gives frames and
 * drives. Nothing starts unless the safety module allows current. */
#ifndef FW_ACQUIRE_H
#define FW_ACQUIRE_H

#include "app/acquire/frame.h"
#include "app/acquire/probe.h"
#include "hal/hal.h"

typedef struct fw_acquire fw_acquire;
typedef struct fw_safety fw_safety;

#define FW_RETRY_US 500000u /* between attempts after a failed start */

void fw_acquire_init(fw_acquire *acquire, const fw_board *board, fw_safety *safety);

/* ---- settings ---- */
const fw_scan_settings *fw_acquire_settings(const fw_acquire *acquire);

/* Stop the scan, and use these settings from the next start on. Errors: those of the capture; the
 * old settings then stay. */
fw_status fw_acquire_set(fw_acquire *acquire, const fw_scan_settings *settings);

/* Returns the shortest period of a frame with these settings and this table. */
uint64_t fw_acquire_min_period_us(const fw_scan_settings *settings, const fw_scan_table *table);

/* If the period is too short for this table, scan as fast as possible from now on. */
void fw_acquire_fit_period(fw_acquire *acquire, const fw_scan_table *table);

/* Returns the noise that the converter's steps alone cause with these settings, in volts; 0 if
 * another instrument gives the frames. */
float fw_acquire_noise_floor_v(const fw_acquire *acquire);

/* ---- start and stop ---- */
/* Open the multiplexers and stop the converter. Errors: those of the lines; the multiplexers may
 * then still be closed. */
fw_status fw_acquire_stop(fw_acquire *acquire);

typedef struct fw_started {
    fw_status status; /* status of the start; if it is not OK, BUS or SCAN_STALLED is raised */
    bool new_phase;   /* the generator was started, so it has another phase */
} fw_started;

/* After fw_acquire_stop, which returned `stopped`: start the generator and the scan of `table` into
 * two frames, if current is allowed. Otherwise, with no table, or after a stop that failed, the
 * generator goes into reset. */
fw_started fw_acquire_start(fw_acquire *acquire, fw_status stopped, const fw_scan_table *table,
                            fw_frame *frames);

bool fw_acquire_running(const fw_acquire *acquire);

/* Returns whether the scan runs but the converter has delivered nothing for too long. */
bool fw_acquire_stalled(fw_acquire *acquire);

/* Returns whether nothing runs, current is allowed, and the last attempt was long enough ago for
 * another one. */
bool fw_acquire_retry_due(const fw_acquire *acquire);

/* Stop the scan and the generator, before a reset of the board. */
void fw_acquire_shut_down(fw_acquire *acquire);

/* ---- a fixed row ---- */
/* Take one burst as `setup` describes; the scan must have been stopped. Errors: as fw_probe_start;
 * FW_E_ARGUMENT if `setup` joins electrodes and runs the generator although no current is allowed.
 */
fw_status fw_acquire_probe(fw_acquire *acquire, const fw_probe_setup *setup);

/* Returns the burst that is under way or done, or NULL if there is none. fw_acquire_stop ends it.
 */
const fw_probe *fw_acquire_probed(const fw_acquire *acquire);

/* ---- what is measured ---- */
/* Returns the oldest full frame, or NULL. It belongs to the caller until fw_acquire_release. */
fw_frame *fw_acquire_take(fw_acquire *acquire);
void fw_acquire_release(fw_acquire *acquire);

/* From now on call `done` from the interrupt after each drive and, if both frames are full, scan
 * the newer one again. With NULL neither is done. */
void fw_acquire_report_drives(fw_acquire *acquire, void (*done)(void *user), void *user);

/* Returns the oldest drive that was not taken, or NULL. */
const fw_scan_drive *fw_acquire_next_drive(const fw_acquire *acquire);
void fw_acquire_take_drive(fw_acquire *acquire);

/* Returns the row that is measured at a position of a frame. */
uint32_t fw_acquire_row_at(const fw_acquire *acquire, uint32_t position);

/* Returns the number of frames that were scanned since the board was started. */
uint32_t fw_acquire_frames_scanned(const fw_acquire *acquire);
uint32_t fw_acquire_slots_repeated(const fw_acquire *acquire);

#endif
