/* These functions read a context for its users. The struct is private so that its members can
 * change without a change of the interface. Pointers stay valid as long as the context; the numbers
 * behind them are those of the last frame and change with the next. */
#include "base/arithmetic.h"
#include "context/context.h"

const eits_model *eits_get_model(const eits_context *ctx)
{
    return ctx->model;
}

const eits_options *eits_get_options(const eits_context *ctx)
{
    return &ctx->options;
}

const eits_info *eits_get_info(const eits_context *ctx)
{
    return &ctx->info;
}

/* The image is zero if the last frame was rejected, so that a caller who overlooks the status shows
 * nothing. */
const eits_real *eits_get_image(const eits_context *ctx)
{
    return ctx->solver.image;
}

/* The image before the column weights; a warm start begins from these coefficients. */
const eits_real *eits_get_coefficients(const eits_context *ctx)
{
    return ctx->solver.x;
}

const eits_real *eits_get_reduced_data(const eits_context *ctx)
{
    return ctx->frame.y;
}

const uint8_t *eits_get_row_states(const eits_context *ctx)
{
    return ctx->rows.unusable;
}

const uint8_t *eits_get_electrode_states(const eits_context *ctx)
{
    return ctx->rows.electrode;
}

/* Returns 1 for a row that the user masked. The row states name the rows that a frame could not use
 * besides these. */
int eits_is_masked(const eits_context *ctx, uint32_t row)
{
    return ctx->rows.masked[row] != 0;
}

eits_status eits_get_reference(const eits_context *ctx, eits_reference_info *reference)
{
    if (ctx == NULL || reference == NULL)
        return EITS_E_ARGUMENT;
    /* numbers are copied; v0 points into the context and changes with the next tare */
    const eits_reference *r = &ctx->reference;
    *reference =
        (eits_reference_info){r->v0,          r->count,   r->ready,        r->v0_rms,  r->gain,
                              r->correlation, r->noise_v, r->lambda_noise, r->outliers};
    return EITS_OK;
}

const char *eits_kernels_name(const eits_context *ctx)
{
    return ctx == NULL ? "" : ctx->kernels->name;
}
