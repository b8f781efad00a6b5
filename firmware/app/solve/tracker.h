/* Tracks touches after each drive of a scan and of whole frames (eitskin/fast.h).
 *
 * The tracker reads the reference while frames are solved, so the reference must not change. At the
 * end of a frame, drives wait until the main loop has aligned it, that is, corrected its rows to
 * one instant. */
#ifndef FW_TRACKER_H
#define FW_TRACKER_H

#include "app/acquire/frame.h"
#include "eitskin/eitskin.h"

typedef struct fw_solve fw_solve;

typedef struct fw_track_update {
    uint32_t drive; /* of the protocol, in the order of first rows */
    uint32_t begun; /* the frame with which the tracker began */
    bool first;     /* since it began */
    uint32_t count;
    eits_fast_touch touches[EITS_FAST_TOUCHES];
} fw_track_update;

/* Returns whether the open model, the board and the settings of the scan allow that drives are
 * tracked. */
bool fw_tracker_possible(const fw_solve *solve);

/* Restart the tracker with the next frame. */
void fw_tracker_forget(fw_solve *solve);

/* After a change of the reference: forget all touches. Call this while no drives are tracked. */
void fw_tracker_new_reference(fw_solve *solve);

/* Returns whether drives can be tracked now, that is, there is a reference and no tare. */
bool fw_tracker_ready(const fw_solve *solve);

/* Returns whether drives must wait until the main loop has aligned a frame. */
bool fw_tracker_waits(const fw_solve *solve);

/* Take the next drive. Returns false if there is nothing to report. */
bool fw_tracker_take(fw_solve *solve, const fw_scan_drive *drive, fw_track_update *update);

/* Leave a drive out, and restart the tracker with the next frame. */
void fw_tracker_skip(fw_solve *solve);

/* Call this when the main loop has taken a frame, and when it is done with it. Returns whether
 * drives need not wait any longer, because the frame was not aligned. */
bool fw_tracker_at_frame(fw_solve *solve, bool taken);

/* Align the frame that was taken, and mark it by its flags. `volts` gets its aligned voltages, or
 * NULL if it must not be solved. Returns whether drives need not wait any longer. */
bool fw_tracker_align(fw_solve *solve, fw_frame *frame, const float **volts);

/* Take the touches that the solver found in a frame; the tracker uses those of an aligned frame at
 * the end of the next one. `touches`, which has room for EITS_MAX_TOUCHES, gets the touches that
 * are reported, and their number is returned. Diagnostics that must not be reported are removed
 * from `info`. */
uint32_t fw_tracker_note(fw_solve *solve, bool aligned, eits_touch *touches, uint32_t count,
                         eits_info *info);

/* Get the touches of a frame that was aligned and not solved. Returns their number. */
uint32_t fw_tracker_report(fw_solve *solve, eits_touch *touches);

#endif
