/* eitskin: from the image to touches in millimetres. */
#ifndef EITSKIN_TOUCH_H
#define EITSKIN_TOUCH_H

#include "eitskin/context.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The touches of the last reconstructed frame, strongest first, into `touches` (room for `room`;
 * may be NULL). Peaks of the image start discs, which are then fitted off the grid to the reduced
 * data, within a pixel of the image; one whose numbers would not be finite is left out. `count`
 * gets their number (also in info). Ids follow touches from call to call, so call it once a frame.
 * Errors: EITS_E_ARGUMENT. */
eits_status eits_find_touches(eits_context *ctx, eits_touch *touches, uint32_t room,
                              uint32_t *count);

#ifdef __cplusplus
}
#endif
#endif
