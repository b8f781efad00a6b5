/* The steps for a frame: check it, and then solve it or only examine it. */
#ifndef FW_FRAMES_H
#define FW_FRAMES_H

#include "app/acquire/frame.h"
#include "app/solve/quality.h"
#include "eitskin/link.h"

typedef struct fw_solve fw_solve;

typedef struct fw_solved {
    eits_status status;
    uint32_t count; /* touches */
    eits_touch touches[EITS_MAX_TOUCHES];
    eits_packet_solved head; /* complete but for count and age_us */
} fw_solved;

/* Turn amplitudes and phases into volts, mark rows that must not be used, and report the faults
 * that the scan itself shows. Call this first. Returns whether the frame belongs to a tare. */
bool fw_frame_check(fw_solve *solve, fw_frame *frame, fw_quality *quality);

/* Examine a frame that is neither solved nor part of a tare, so that faults are reported even if
 * nothing is streamed. */
void fw_frame_examine(fw_solve *solve, const fw_frame *frame, const fw_quality *quality);

/* Solve a frame. `volts` has its voltages, or the aligned ones (tracker.h). Touches are fitted if
 * `touches` is true. */
void fw_frame_solve(fw_solve *solve, const fw_frame *frame, const float *volts,
                    const fw_quality *quality, bool touches, fw_solved *out);

/* Fill in the touches that drives follow, for a frame that must not be solved. */
void fw_frame_follow(fw_solve *solve, const fw_frame *frame, fw_solved *out);

/* Forget the results of reciprocal rows in earlier frames. */
void fw_frames_forget(fw_solve *solve);

#endif
