/* The reference frame and its noise, from one frame or learned from many.
 *
 * Learning takes one frame after the other and stores none. The first half of the frames makes a
 * mean. The second half is compared with it as later frames will be. The greatest max |S'y| of the
 * second half is lambda_noise: the largest value that the untouched skin shows, in the unit of the
 * detection threshold and of lambda. A threshold needs this maximum rather than an rms, and it
 * grows only slowly with the number of frames.
 *
 * Outliers are left out on the way (diagnostics/reference_outliers.c). After an error,
 * eits_reference_set keeps the previous reference; once learning has begun there is no reference
 * (ready = 0) until it is finished. */
#include "eitskin/frame.h"

#include "api/constants.h"
#include "api/stages.h"
#include "base/vec.h"
#include "context/products.h"
#include "diagnostics/diagnostics.h"
#include "frame/reference.h"
#include "frame/whitening.h"

/* Fit the new reference to the model. Coefficients for another reference are not a valid start, so
 * they are dropped. */
static eits_status fit(eits_context *ctx)
{
    ctx->solver.warm = 0;
    return eits_fit_reference(ctx);
}

/* A single frame does not show the noise. Everything that needs it (detection threshold, raised
 * regularisation, tests against noise) stays off until a reference is learned from several frames.
 */
eits_status eits_reference_set(eits_context *ctx, const eits_real *frame, size_t length)
{
    if (ctx == NULL || frame == NULL)
        return EITS_E_ARGUMENT;
    eits_status status = eits_check_reference_frame(ctx, frame, length);
    if (status != EITS_OK)
        return status;
    eits_reference *b = &ctx->reference;
    /* The new frame may turn out to be useless; the previous reference must survive that. */
    eits_real *old = b->m2; /* keeps the old reference until the new one is known to be good */
    b->wanted = 0;          /* learning, if any was under way, ends here */
    eits_copy(old, b->v0, length);
    eits_copy(b->v0, frame, length);
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        if (ctx->rows.masked[i])
            /* NaN and not 0: if the mask is lifted later, this row was still never measured and
             * must stay unused */
            b->v0[i] = R(NAN);
    }
    status = fit(ctx);
    if (status != EITS_OK) {
        eits_copy(b->v0, old, length);
        if (b->ready)
            (void)fit(ctx);
    } else {
        b->ready = 1;
        b->count = 1;
        b->noise_v = 0;
        b->lambda_noise = 0;
        b->outliers = b->second_waits = 0;
        b->tracking = (eits_reference_tracking){0};
    }
    eits_zero(b->m2, length);
    return status;
}

eits_status eits_reference_begin(eits_context *ctx, uint32_t count)
{
    if (ctx == NULL || count < EITS_MIN_REFERENCE_FRAMES)
        return EITS_E_ARGUMENT;
    eits_reference *b = &ctx->reference;
    eits_zero(b->v0, ctx->model->n_rows);
    eits_zero(b->m2, ctx->model->n_rows);
    b->wanted = count;
    b->count = 0;
    /* Frames are rejected until learning is finished: half a mean would show false touches. */
    b->ready = 0;
    b->lambda_noise = 0;
    b->noise_v = 0;
    b->outliers = b->second_waits = 0;
    b->tracking = (eits_reference_tracking){0};
    b->still = (eits_stillness){0};
    return EITS_OK;
}

/* Take max |S'y| of a reference frame, compared with the mean so far, into lambda_noise. */
static eits_status learn_lambda_noise(eits_context *ctx, const eits_scratch *scratch,
                                      const eits_real *frame)
{
    uint32_t masked;
    uint64_t macs;
    const eits_status status = eits_frame_data(ctx, scratch, frame, &masked, &macs);
    if (status != EITS_OK)
        return status;
    eits_apply_t(ctx, eits_adjoint(ctx, ctx->frame.y, scratch->row[4]), scratch->pixel[0]);
    if (!eits_all_finite(scratch->pixel[0], ctx->model->n_pixels))
        return EITS_E_NOT_FINITE;
    /* The value is divided by this whitening's gain for noise, so that it serves for other rows and
     * regularisations. */
    const eits_real seen =
        eits_greatest(ctx->kernels, scratch->pixel[0], ctx->model->n_pixels, EITS_SIGN_BOTH) /
        ctx->whitening.noise_ratio;
    if (seen > ctx->reference.lambda_noise)
        ctx->reference.lambda_noise = seen;
    return EITS_OK;
}

eits_status eits_reference_add(eits_context *ctx, const eits_real *frame, size_t length)
{
    if (ctx == NULL || frame == NULL || ctx->reference.count >= ctx->reference.wanted)
        return EITS_E_ARGUMENT;
    eits_reference *b = &ctx->reference;
    eits_status status = eits_check_reference_frame(ctx, frame, length);
    if (status != EITS_OK)
        return status;
    const int judged = eits_wants(ctx, EITS_DIAGNOSTIC_OUTLIER);
    /* If two frames differ in a reading, the third frame decides which one is wrong. From then on
     * frames are compared with the mean. */
    if (b->count == 1 && judged) {
        eits_compare_stillness(ctx, frame);
        eits_keep_second_frame(ctx, frame);
        return EITS_OK;
    }
    if (b->second_waits) {
        ctx->reference.outliers += eits_reference_weigh_second(ctx, &ctx->scratch, frame);
        eits_take_second_frame(ctx);
    }
    const uint32_t left =
        b->count >= 2 && judged ? eits_reference_mask_outliers(ctx, &ctx->scratch, frame) : 0;
    if (b->count > 0)
        eits_compare_stillness(ctx, frame);
    /* The second half is compared with the mean of the first: a frame compared with a mean that
     * contains it would show too little noise. noise_v of the frames so far is enough to raise the
     * regularisation as it will be raised for later frames. */
    if (b->count == b->wanted / 2) {
        status = fit(ctx);
        /* lambda_noise is learned with the regularisation that it asks for */
        b->noise_v = eits_reference_noise(ctx);
    }
    if (status == EITS_OK && b->count >= b->wanted / 2)
        status = learn_lambda_noise(ctx, &ctx->scratch, frame);
    if (status == EITS_OK) {
        if (b->count == 0)
            b->m2_unit = eits_reference_unit(ctx, frame);
        eits_take_reference_frame(ctx, frame);
        b->outliers += left;
    }
    /* The readings were left out of this frame only. */
    eits_reference_unmask(ctx);
    return status;
}

eits_status eits_reference_finish(eits_context *ctx)
{
    if (ctx == NULL)
        return EITS_E_ARGUMENT;
    eits_reference *b = &ctx->reference;
    if (b->count < EITS_MIN_REFERENCE_FRAMES || b->count != b->wanted)
        return EITS_E_REFERENCE_SHORT;
    if (eits_wants(ctx, EITS_DIAGNOSTIC_STALE_REFERENCE) && eits_reference_moved(ctx))
        return EITS_E_REFERENCE_TOUCHED;
    const eits_status status = fit(ctx);
    if (status != EITS_OK)
        return status;
    /* A tare of equal frames has no noise, and then any difference would be a touch. The lower
     * limit is the noise that rounding and a converter's steps leave. */
    const eits_real noise_v = eits_reference_noise(ctx), floor_v = eits_noise_floor_v(ctx),
                    lambda_floor = eits_lambda_noise_floor(ctx);
    b->noise_v = eits_larger(noise_v, floor_v);
    b->lambda_noise = eits_larger(b->lambda_noise, lambda_floor);
    b->ready = 1;
    return EITS_OK;
}
