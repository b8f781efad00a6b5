/* eitskin: many frames that have nothing to do with each other, in one call.
 *
 * For hosts that solve recorded or simulated frames: one call from Python for thousands of frames
 * costs nothing in between, and threads share the work where each has a context of its own on the
 * same model. Each frame starts cold, so that its result does not depend on the others, nor on how
 * they are divided among threads. A stream, where touches are followed, calls eits_reconstruct and
 * eits_find_touches instead. */
#ifndef EITSKIN_BATCH_H
#define EITSKIN_BATCH_H

#include "eitskin/context.h"

#ifdef __cplusplus
extern "C" {
#endif

/* One frame's result. Ids count on through the batch, as a frame's touches follow none. */
typedef struct eits_result {
    /* of eits_reconstruct; where it is not EITS_OK there are no touches and the image is zero */
    eits_status status;
    uint32_t count; /* touches; 0 where they were not looked for */
    eits_info info;
} eits_result;

/* eits_forget, eits_reconstruct and eits_find_touches for each of `count` frames of `length`
 * numbers. `images` and `coefficients` (count x n_pixels) may be NULL; `touches` (count x
 * EITS_MAX_TOUCHES) too: then they are not looked for. A frame that is refused says so in its
 * result; the others are done. Errors: EITS_E_ARGUMENT. */
eits_status eits_reconstruct_batch(eits_context *ctx, const eits_real *frames, size_t length,
                                   size_t count, eits_real *images, eits_real *coefficients,
                                   eits_touch *touches, eits_result *results);

#ifdef __cplusplus
}
#endif
#endif
