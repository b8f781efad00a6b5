/* What a tare costs time to learn, put by in the caller's memory.
 *
 * For a board that swaps models or runs the self-test, and must not ask the user to take hands off
 * the skin again. The bytes are those of this build: they are for the same program and the same
 * model, not for a file. The size is a macro as well as a function, so that memory can be static;
 * the assertion below keeps the two together. */
#include "context/context.h"

#include "base/vec.h"
#include "frame/reference.h"

/* Followed by v0 and by the masked rows. The reference's pointers are of no use in it.
 *
 * Only what cannot be found again from the model and a frame; the basis is built again, which
 * costs MACs once. Followed touches are not in it: by the time that it is restored they have
 * moved. */
typedef struct saved {
    eits_options options;
    uint32_t next_id;
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
    const saved head = {
        ctx->options, ctx->tracker.next_id, r->count,   r->ready,       r->outliers, r->v0_rms,
        r->gain,      r->correlation,       r->noise_v, r->lambda_noise};
    uint8_t *to = memory;
    memcpy(to, &head, sizeof head);
    to += EITS_ALIGN16(sizeof head);
    memcpy(to, r->v0, rows * sizeof r->v0[0]);
    /* They belong to the reference: where a row was masked v0 is no number. */
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
    ctx->tracker.next_id = head.next_id;
    /* The deviations m2 are of a tare under way, and none is: they are not among what is saved. */
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
    /* They follow from v0 and the model, as at the tare. Touches of before would be other fingers.
     */
    eits_learn_row_gains(ctx);
    eits_forget(ctx);
    return EITS_OK;
}
