/* What is done with a frame: check it, and then solve it or only examine it. */
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

/* From amplitudes and phases to volts; marks rows that must not be used, and reports what the scan
 * itself shows. Call this before anything else. Returns whether the frame belongs to a tare. */
bool fw_frame_check(fw_solve *solve, fw_frame *frame, fw_quality *quality);

/* For a frame that is neither solved nor part of a tare: diagnostics, so that faults are reported
 * whether anything is streamed or not. */
void fw_frame_examine(fw_solve *solve, const fw_frame *frame, const fw_quality *quality);

/* `volts`: the frame's, or its aligned ones (tracker.h). Touches are fitted if `touches`. */
void fw_frame_solve(fw_solve *solve, const fw_frame *frame, const float *volts,
                    const fw_quality *quality, bool touches, fw_solved *out);

/* For a frame that must not be solved: the touches that drives follow. */
void fw_frame_follow(fw_solve *solve, const fw_frame *frame, fw_solved *out);

/* Reciprocal rows are judged from the next frame on, whatever earlier ones showed. */
void fw_frames_forget(fw_solve *solve);

#endif
