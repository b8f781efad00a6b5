#include "context/column_cache.h"

#include "kernels/kernels.h"

#include <string.h>

static uint32_t room_of(const eits_context *ctx)
{
    return (uint32_t)EITS_HELD(ctx->model->n_pixels);
}

void eits_drop_columns(eits_context *ctx)
{
    for (uint32_t j = 0; j < ctx->model->n_pixels; ++j)
        ctx->held_at[j] = EITS_NO_PIXEL;
    for (uint32_t slot = 0; slot < room_of(ctx); ++slot)
        ctx->held_column[slot] = EITS_NO_PIXEL;
    ctx->held_next = 0;
}

/* A column that is asked for is marked in held_wanted while the request runs, so that it does not
 * give way to another. */
uint32_t eits_hold_columns(eits_context *ctx, const uint32_t *index, uint32_t count)
{
    const uint32_t room = room_of(ctx);
    const eits_matrix *s = &ctx->model->sensitivity;
    if (count > room)
        return 0;
    uint32_t absent = 0;
    for (uint32_t k = 0; k < count; ++k)
        absent += ctx->held_at[index[k]] == EITS_NO_PIXEL;
    if (absent == 0)
        return 1;
    memset(ctx->held_wanted, 0, room);
    for (uint32_t k = 0; k < count; ++k) {
        if (ctx->held_at[index[k]] != EITS_NO_PIXEL)
            ctx->held_wanted[ctx->held_at[index[k]]] = 1;
    }
    uint32_t slot = ctx->held_next;
    for (uint32_t k = 0; k < count; ++k) {
        if (ctx->held_at[index[k]] != EITS_NO_PIXEL)
            continue;
        while (ctx->held_wanted[slot])
            slot = slot + 1 < room ? slot + 1 : 0;
        if (ctx->held_column[slot] != EITS_NO_PIXEL)
            ctx->held_at[ctx->held_column[slot]] = EITS_NO_PIXEL;
        ctx->held_column[slot] = (uint16_t)index[k];
        ctx->held_at[index[k]] = (uint16_t)slot;
        ctx->held_wanted[slot] = 1;
        ctx->kernels->unpack(s, (size_t)s->stride * index[k], s->stride,
                             ctx->held + (size_t)s->stride * slot);
    }
    ctx->held_next = slot;
    return 1;
}

void eits_slots_of(const eits_context *ctx, const uint32_t *index, uint32_t count, uint32_t *slot)
{
    for (uint32_t k = 0; k < count; ++k)
        slot[k] = ctx->held_at[index[k]];
}

eits_matrix eits_held_columns(const eits_context *ctx)
{
    eits_matrix held = ctx->model->sensitivity;
    held.data = ctx->held;
    held.scale = NULL;
    held.storage = EITS_STORAGE_F32;
    held.cols = room_of(ctx);
    return held;
}
