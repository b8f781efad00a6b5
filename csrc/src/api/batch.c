/* Reconstruct many frames in one call, for a host that evaluates recordings: otherwise each frame
 * costs a call into C. Frames are independent of each other, so results do not depend on how a set
 * is divided into batches; a frame that fails has its own status and does not end the batch. */
#include "eitskin/batch.h"

#include "base/vec.h"
#include "context/context.h"
#include "eitskin/solve.h"
#include "eitskin/touch.h"

eits_status eits_reconstruct_batch(eits_context *ctx, const eits_real *frames, size_t length,
                                   size_t count, eits_real *images, eits_real *coefficients,
                                   eits_touch *touches, eits_result *results)
{
    if (ctx == NULL || frames == NULL || results == NULL)
        return EITS_E_ARGUMENT;
    const size_t pixels = ctx->model->n_pixels;
    const uint32_t follows = ctx->options.reference_frames;
    ctx->options.reference_frames =
        0; /* the frames are not consecutive, so none can update the reference */
    for (size_t k = 0; k < count; ++k) {
        eits_result *result = results + k;
        memset(result, 0, sizeof *result);
        /* The frames have nothing to do with each other: the solver must not start from the last
         * image. */
        eits_forget(ctx);
        result->status = eits_reconstruct(ctx, frames + k * length, length, NULL, NULL);
        if (result->status == EITS_OK && touches != NULL)
            (void)eits_find_touches(ctx, touches + k * EITS_MAX_TOUCHES, EITS_MAX_TOUCHES,
                                    &result->count);
        result->info = ctx->info;
        /* the image is copied for a frame that failed, too: eits_reconstruct has left zeros and no
         * older image */
        if (images != NULL)
            eits_copy(images + k * pixels, ctx->solver.image, pixels);
        if (coefficients != NULL)
            eits_copy(coefficients + k * pixels, ctx->solver.x, pixels);
    }
    ctx->options.reference_frames = follows;
    return EITS_OK;
}
