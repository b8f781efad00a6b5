/* The path of a frame from the scan to the host. */
#ifndef FW_STREAM_H
#define FW_STREAM_H

#include "app/acquire/frame.h"

typedef struct fw_host_link fw_host_link;

/* Check a frame, pass it to the tare or the solver, and send the streamed packets. */
void fw_stream_frame(fw_host_link *link, fw_frame *frame);

/* Stream nothing, as after a start. */
void fw_stream_reset(fw_host_link *link);

/* Call this after the reference has changed: fingers and faults of the old one are forgotten. */
void fw_reference_changed(fw_host_link *link);

#endif
