/* Compute an image from a frame or from its reduced data.
 *
 * The frame stage runs first, then the solver. If the frame stage rejects a frame, the state is
 * still defined: the image is zero and info says why, so that a caller that goes on after an error
 * shows no old image. */
#include "eitskin/frame.h"
#include "eitskin/solve.h"

#include "api/stages.h"
#include "base/vec.h"
#include "context/context.h"
#include "frame/reference.h"
#include "solve/solve.h"

eits_status eits_solve(eits_context *ctx, const eits_real *y)
{
    if (ctx == NULL)
        return EITS_E_ARGUMENT;
    /* if y is NULL, the data of the last frame stage are solved */
    if (y != NULL) {
        eits_copy(ctx->frame.y, y, ctx->model->rank);
        ctx->frame.has_y_log = 0; /* it belongs to another frame */
    }
    ctx->info = (eits_info){0};
    return eits_solve_frame(ctx, &ctx->scratch, ctx->options.warm_start != 0);
}

eits_status eits_reconstruct(eits_context *ctx, const eits_real *frame, size_t length,
                             eits_real *image, eits_info *info)
{
    if (ctx == NULL || frame == NULL)
        return EITS_E_ARGUMENT;
    ctx->info = (eits_info){0};
    eits_status status = eits_frame_stage(ctx, frame, length, &ctx->info.masked, &ctx->info.macs);
    if (status == EITS_OK) {
        status = eits_solve_frame(ctx, &ctx->scratch, ctx->options.warm_start != 0);
        eits_reference_tracking_add(ctx, frame);
    } else {
        eits_answer_zero(ctx, EITS_STOP_BELOW_THRESHOLD);
        eits_reference_tracking_break(ctx);
    }
    if (image != NULL)
        eits_copy(image, ctx->solver.image, ctx->model->n_pixels);
    if (info != NULL)
        *info = ctx->info;
    return status;
}

/* Solve from zero. The solver adds to the counts of iterations and step halvings in info, so these
 * are reset first. */
static void solve_from_zero(eits_context *ctx, const eits_scratch *scratch)
{
    ctx->info.iterations = ctx->info.step_halvings = 0;
    (void)eits_solve_frame(ctx, scratch, 0);
}

void eits_solve_again(eits_context *ctx, const eits_scratch *scratch, const eits_real *y)
{
    const eits_info before = ctx->info;
    const size_t stride = EITS_STRIDE(ctx->model->rank);
    eits_copy(ctx->frame.y_log, ctx->frame.y, stride); /* no longer needed */
    ctx->frame.has_y_log = 0;
    eits_copy(ctx->frame.y, y, stride);
    solve_from_zero(ctx, scratch);
    /* The interaction is an estimate. It was wrong if it leaves nothing of a frame with two touches
     * or gives a result that is not finite; then the frame's own data are solved again. */
    if (!ctx->solver.warm) {
        eits_copy(ctx->frame.y, ctx->frame.y_log, stride);
        solve_from_zero(ctx, scratch);
    }
    ctx->info.iterations += before.iterations;
    ctx->info.step_halvings += before.step_halvings;
    ctx->info.diagnostics = before.diagnostics; /* keep those of the measured frame */
}
