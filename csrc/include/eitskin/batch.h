/* eitskin: many independent frames in one call.
 *
 * For hosts that solve recorded or simulated frames: Python makes one call for thousands of frames.
 * Threads can share the work, each with its own context on the same model. Each frame starts cold,
 * so that its result depends neither on the others nor on how they are divided among threads. A
 * stream, in which touches are tracked, calls eits_reconstruct and eits_find_touches instead. */
#ifndef EITSKIN_BATCH_H
#define EITSKIN_BATCH_H

#include "eitskin/context.h"

#ifdef __cplusplus
extern "C" {
#endif

/* One frame's result. Ids number the touches of this frame alone, since touches are not tracked. */
typedef struct eits_result {
    /* status of eits_reconstruct; if it is not EITS_OK, there are no touches and the image is zero
     */
    eits_status status;
    uint32_t count; /* number of touches; 0 if `touches` was NULL */
    eits_info info;
} eits_result;

/* Call eits_forget, eits_reconstruct and eits_find_touches for each of `count` frames of `length`
 * voltages. `images` and `coefficients` (count x n_pixels) may be NULL. `touches` (count x
 * EITS_MAX_TOUCHES) may be NULL too; then no touches are looked for. A frame that is rejected has
 * its status in its result, and the next ones are solved all the same. Errors: EITS_E_ARGUMENT. */
eits_status eits_reconstruct_batch(eits_context *ctx, const eits_real *frames, size_t length,
                                   size_t count, eits_real *images, eits_real *coefficients,
                                   eits_touch *touches, eits_result *results);

#ifdef __cplusplus
}
#endif
#endif
