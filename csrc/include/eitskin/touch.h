/* eitskin: from the image to touches in millimetres.
 *
 * The image's pixels are 6 mm wide on the shipped model; a touch is placed to a fraction of that. A
 * touch is a disc whose conductivity changed evenly, with a soft edge one pixel wide. Each peak of
 * the image starts one; places, radii and strengths are then fitted to the reduced data by damped
 * Gauss-Newton steps, one disc after another, for options.touch_sweeps rounds. options.touch_fit
 * (options.h) chooses three refinements: the first places come from log data, in which strong
 * touches are more nearly linear; discs are merged or split if that explains the data better; and
 * the interaction of touches (each changes the field at the others) is taken out of the data.
 *
 * A disc that explains too little of the data beside the others is dropped. eits_fast_report
 * (fast.h) follows touches from frame to frame, so that each keeps its id.
 */
#ifndef EITSKIN_TOUCH_H
#define EITSKIN_TOUCH_H

#include "eitskin/context.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The touches of the last reconstructed frame, strongest first, into `touches` (room for `room`;
 * may be NULL). Lengths are in mm, strengths in S mm^2/m. A touch whose numbers would not be finite
 * is left out. `count` gets their number, which may exceed `room`. Ids number the touches of this
 * frame alone, from 1. Call it exactly once per frame if the reference is tracked. Sets
 * info.touches, info.touch_macs, info.unexplained and the diagnostic CROWDED; with
 * options.second_pass it solves the frame again, and image and info are then those of the second
 * solve. Errors: EITS_E_ARGUMENT. */
eits_status eits_find_touches(eits_context *ctx, eits_touch *touches, uint32_t room,
                              uint32_t *count);

/* Draw `count` touches into `image` (n_pixels, S/m): each pixel gets the fraction of it that the
 * discs and ellipses cover, with a soft edge one pixel wide, times one height for all touches, and
 * minus that for a touch whose strength is negative. The height is the change that the model
 * expects of a touch (defaults.touch_change_s_per_m); a model that expects none, as a taught one,
 * gives the mean change of these touches. Touches that were not found in the frame (`explained` 0)
 * are not drawn. info.shown says whether this image or the solver's shows the frame. The touches
 * may come from eits_find_touches or from a packet TOUCHES; the same numbers give the same bits.
 * Errors: EITS_E_ARGUMENT. */
eits_status eits_draw_touches(const eits_model *model, const eits_touch *touches, uint32_t count,
                              eits_real *image);

#ifdef __cplusplus
}
#endif
#endif
