/* Save in the caller's memory what a tare takes time to learn.
 *
 * A board that swaps models or runs the self-test needs this, since it must not ask the user to
 * take the hands off the skin again. The bytes have the layout of this build: they are for the same
 * program and the same model, not for a file. The size is a macro as well as a function, so that
 * memory can be static; the assertion below keeps the two together. */
#include "context/context.h"

#include "base/vec.h"
#include "frame/reference.h"

/* v0 and the masked rows follow this struct in memory. The pointers in `reference` have no meaning
 * in it.
 *
 * The struct has only data that cannot be computed again from the model and a frame; the basis is
 * built again, which costs MACs once. */
typedef struct saved {
    eits_options options;
    uint32_t count, ready, outliers;
    eits_real v0_rms, gain, correlation, noise_v, lambda_noise;
} saved;

_Static_assert(EITS_ALIGN16(sizeof(saved)) + 2 * 16 == EITS_SAVED_SIZE(1),
               "EITS_SAVED_SIZE is not what there is to save");

static int has_room(const eits_context *ctx, const void *memory, size_t size)
{
    return (uintptr_t)memory % 16 == 0 && size >= eits_saved_size(ctx->model);
}

size_t eits_saved_size(const eits_model *model)
{
    return model == NULL ? 0 : EITS_SAVED_SIZE(model->n_rows);
}

eits_status eits_save(const eits_context *ctx, void *memory, size_t size)
{
    if (ctx == NULL || memory == NULL)
        return EITS_E_ARGUMENT;
    if (!has_room(ctx, memory, size))
        return EITS_E_WORKSPACE;
    const eits_reference *r = &ctx->reference;
    const size_t rows = ctx->model->n_rows;
    const saved head = {ctx->options, r->count,       r->ready,   r->outliers,    r->v0_rms,
                        r->gain,      r->correlation, r->noise_v, r->lambda_noise};
    uint8_t *to = memory;
    memcpy(to, &head, sizeof head);
    to += EITS_ALIGN16(sizeof head);
    memcpy(to, r->v0, rows * sizeof r->v0[0]);
    /* The masked rows belong to the reference: v0 is NaN where a row was masked. */
    memcpy(to + EITS_REALS(rows), ctx->rows.masked, rows);
    return EITS_OK;
}

eits_status eits_restore(eits_context *ctx, const void *memory, size_t size)
{
    if (ctx == NULL || memory == NULL)
        return EITS_E_ARGUMENT;
    if (!has_room(ctx, memory, size))
        return EITS_E_WORKSPACE;
    eits_reference *r = &ctx->reference;
    const size_t rows = ctx->model->n_rows;
    const uint8_t *from = memory;
    saved head;
    memcpy(&head, from, sizeof head);
    from += EITS_ALIGN16(sizeof head);
    ctx->options = head.options;
    /* The deviations m2 belong to a tare under way. None is under way here, so they are not saved.
     */
    *r = (eits_reference){.v0 = r->v0,
                          .m2 = r->m2,
                          .row_gain = r->row_gain,
                          .count = head.count,
                          .ready = head.ready,
                          .outliers = head.outliers,
                          .v0_rms = head.v0_rms,
                          .gain = head.gain,
                          .correlation = head.correlation,
                          .noise_v = head.noise_v,
                          .lambda_noise = head.lambda_noise};
    memcpy(r->v0, from, rows * sizeof r->v0[0]);
    memcpy(ctx->rows.masked, from + EITS_REALS(rows), rows);
    /* Row gains follow from v0 and the model, as at the tare. */
    eits_learn_row_gains(ctx);
    eits_forget(ctx);
    return EITS_OK;
}
