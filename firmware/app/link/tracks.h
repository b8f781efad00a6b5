/* Touches after each drive of a scan, beside the whole frames (eitskin/fast.h).
 *
 * A drive's rows are looked at between the capture's interrupt and the main loop, so that a solve
 * does not hold them up. What the main loop shares with that, it holds meanwhile: the state, the
 * link. At the end of a frame drives wait until the main loop has brought it to one instant. */
#ifndef FW_FOLLOW_H
#define FW_FOLLOW_H

#include "app/instrument.h"

void fw_follow_init(fw_instrument *instrument);

/* Whether the open model, the board and the scan have drives that can be followed. */
bool fw_follow_possible(const fw_instrument *instrument);

/* The main loop is at what drives share with it, until the release. */
void fw_follow_hold(fw_instrument *instrument);
void fw_follow_release(fw_instrument *instrument);

/* Begin again with the next frame, if the stream still wants it. */
void fw_follow_forget(fw_instrument *instrument);

/* The main loop has taken a frame, or is done with it. */
void fw_follow_take(fw_instrument *instrument, bool taken);

/* The judged voltages of the frame that was taken, brought to one instant, with the frame's flags;
 * NULL: it is not to be solved. */
const float *fw_follow_align(fw_instrument *instrument, fw_frame *frame);

/* What was found in that frame; drives hear of it at the end of the next one. `info` keeps what may
 * be reported of it. */
void fw_follow_found(fw_instrument *instrument, const eits_touch *touches, uint32_t count,
                     eits_info *info);

#endif
