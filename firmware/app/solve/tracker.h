/* Tracks touches after each drive of a scan and of whole frames (eitskin/fast.h).
 *
 * The tracker reads the reference while frames are solved, so the reference must not change. At the
 * end of a frame, drives wait until the main loop has aligned it: brought it to one instant. */
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

/* Whether the open model, the board and the settings of the scan allow that drives are tracked. */
bool fw_tracker_possible(const fw_solve *solve);

/* Begin again with the next frame. */
void fw_tracker_forget(fw_solve *solve);

/* The reference is another: forget all touches. Call it while no drives are tracked. */
void fw_tracker_new_reference(fw_solve *solve);

/* Whether drives can be tracked now: there is a reference, and no tare. */
bool fw_tracker_ready(const fw_solve *solve);

/* Whether drives must wait for the main loop to align a frame. */
bool fw_tracker_waits(const fw_solve *solve);

/* Take the next drive. Returns false if there is nothing to report. */
bool fw_tracker_take(fw_solve *solve, const fw_scan_drive *drive, fw_track_update *update);

/* Leave a drive out: begin again with the next frame. */
void fw_tracker_skip(fw_solve *solve);

/* The main loop has taken a frame, or is done with it. Returns whether drives need no longer wait:
 * the frame was not aligned. */
bool fw_tracker_at_frame(fw_solve *solve, bool taken);

/* Align the frame that was taken, and mark it by its flags. `volts`: its aligned voltages, or NULL
 * if it must not be solved. Returns whether drives need no longer wait. */
bool fw_tracker_align(fw_solve *solve, fw_frame *frame, const float **volts);

/* The touches that the solver found in a frame; those of an aligned one are used by the tracker at
 * the end of the next. They become those that are reported, whose number is returned; `touches` has
 * room for EITS_MAX_TOUCHES. What must not be reported is removed from `info`. */
uint32_t fw_tracker_note(fw_solve *solve, bool aligned, eits_touch *touches, uint32_t count,
                         eits_info *info);

/* The touches of a frame that was aligned and not solved. Returns their number. */
uint32_t fw_tracker_report(fw_solve *solve, eits_touch *touches);

#endif
