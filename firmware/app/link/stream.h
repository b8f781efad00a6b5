/* What becomes of a frame: checked, given to the tare or to the solver, and sent. */
#ifndef FW_STREAM_H
#define FW_STREAM_H

#include "app/instrument.h"

/* Judge a frame, give it to the tare or the solver, and send what is streamed. */
void fw_process_frame(fw_instrument *instrument, fw_frame *frame);

#endif
