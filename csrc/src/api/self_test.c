/* The golden frame that each model carries.
 *
 * A board with a wrong compiler flag or damaged flash may give images that look
 * plausible. The model carries a reference, a frame, and the image that the float32 core
 * made of them when it was built; since every sum has one order, the same bits must come out here
 * (difference 0; within rounding in float64). In: the section GOLD. Out: the greatest deviation
 * over the image's peak. It replaces the reference: a caller saves its own before (eits_save). */
#include "base/vec.h"
#include "context/context.h"
#include "eitskin/frame.h"
#include "eitskin/solve.h"

eits_status eits_self_test(eits_context *ctx, eits_real *difference)
{
    if (ctx == NULL || difference == NULL)
        return EITS_E_ARGUMENT;
    const eits_model *model = ctx->model;
    /* n_rows numbers that a single reference frame leaves unused
     *
     * Room for a frame without asking the caller for it; squares of deviations are zero again
     * afterwards, as eits_reference_set leaves them. */
    eits_real *frame = ctx->reference.m2;
    *difference = 0;
    for (uint32_t i = 0; i < model->n_rows; ++i)
        ctx->reference.v0[i] = (eits_real)model->golden.reference[i];
    eits_status status = eits_reference_set(ctx, ctx->reference.v0, model->n_rows);
    if (status != EITS_OK)
        return status;
    for (uint32_t i = 0; i < model->n_rows; ++i)
        frame[i] = (eits_real)model->golden.frame[i];
    status = eits_reconstruct(ctx, frame, model->n_rows, NULL, NULL);
    eits_real largest = 0, peak = 0;
    for (uint32_t j = 0; j < model->n_pixels; ++j) {
        const eits_real expected = (eits_real)model->golden.image[j],
                        off = eits_fabs(ctx->solver.image[j] - expected);
        largest = off > largest ? off : largest;
        peak = eits_fabs(expected) > peak ? eits_fabs(expected) : peak;
    }
    *difference = peak > 0 ? largest / peak : largest;
    eits_zero(frame, model->n_rows);
    return status;
}
