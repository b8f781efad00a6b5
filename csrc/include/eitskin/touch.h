/* eitskin: from the image to touches in millimetres.
 *
 * The image's pixels are 6 mm wide on the shipped model; a touch is placed to a fraction of that. A
 * touch is a disc whose conductivity changed evenly, with a soft edge one pixel wide. Each peak of
 * the image starts one; places, radii and strengths are then fitted to the reduced data by damped
 * Gauss-Newton steps, one disc after another, for options.touch_sweeps rounds. Three parts refine
 * that, chosen by options.touch_fit (context.h): first places come from log data, which strong
 * touches bend less; discs are merged and split where that explains the data better; and what
 * touches do to each other's field is taken out of the data.
 *
 * A disc that explains too little of the data beside the others is dropped. Touches are followed
 * from frame to frame, for ids and, where options.track_smooth asks for it, for steadier places.
 */
#ifndef EITSKIN_TOUCH_H
#define EITSKIN_TOUCH_H

#include "eitskin/context.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The touches of the last reconstructed frame, strongest first, into `touches` (room for `room`;
 * may be NULL). Peaks of the image start discs, which are then fitted off the grid to the reduced
 * data, within a pixel of the image; one whose numbers would not be finite is left out. `count`
 * gets their number (also in info), which may exceed `room`. Ids follow touches from call to call,
 * so call it once a frame. Costs info.touch_macs, and sets info.touches, info.unexplained and the
 * diagnostic CROWDED; with options.second_pass also image and info as solved again.
 * Errors: EITS_E_ARGUMENT. */
eits_status eits_find_touches(eits_context *ctx, eits_touch *touches, uint32_t room,
                              uint32_t *count);

#ifdef __cplusplus
}
#endif
#endif
