/* Tracks touches if touches or events of each frame are streamed, and sends the touches after each
 * drive if the host asks for them (solve/tracker.h).
 *
 * Drives are tracked between the capture's interrupt and the main loop, so that a solve does not
 * delay them. While the main loop changes what the tracker reads, or while a packet is under way,
 * drives wait. */
#ifndef FW_TRACKS_H
#define FW_TRACKS_H

#include "app/acquire/frame.h"

typedef struct fw_host_link fw_host_link;

void fw_tracks_init(fw_host_link *link);

/* The bits of a stream that ask for touches. */
#define FW_TRACKED (EITS_STREAM_TOUCHES | EITS_STREAM_EVENTS | EITS_STREAM_DRIVE_TOUCHES)

/* Make drives wait until fw_tracks_release. */
void fw_tracks_hold(fw_host_link *link);
void fw_tracks_release(fw_host_link *link);

/* Restart tracking with the next frame, if the stream still asks for it. */
void fw_tracks_restart(fw_host_link *link);

/* Call this when the main loop has taken a frame, and when it is done with it. */
void fw_tracks_at_frame(fw_host_link *link, bool taken);

/* Returns the aligned voltages of the frame that was taken, or NULL if it was not aligned or must
 * not be solved. */
const float *fw_tracks_align(fw_host_link *link, fw_frame *frame);

/* Returns whether touches are tracked and the frame is the stream's first, with a scan that began
 * before the stream. Drives of the next scan may have found its touches before it is solved, and
 * the frame would give them other ids. */
bool fw_tracks_misses(fw_host_link *link, const fw_frame *frame);

#endif
