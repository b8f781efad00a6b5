#include "context/column_cache.h"

#include "kernels/kernels.h"

#include <string.h>

static uint32_t room_of(const eits_context *ctx)
{
    return (uint32_t)EITS_CACHED(ctx->model->n_pixels);
}

void eits_clear_column_cache(eits_context *ctx)
{
    for (uint32_t j = 0; j < ctx->model->n_pixels; ++j)
        ctx->cache_slot[j] = EITS_NO_PIXEL;
    for (uint32_t slot = 0; slot < room_of(ctx); ++slot)
        ctx->cache_column[slot] = EITS_NO_PIXEL;
    ctx->cache_next = 0;
}

/* A column that is asked for is marked in cache_wanted while the request runs, so that it does not
 * give way to another. */
uint32_t eits_cache_columns(eits_context *ctx, const uint32_t *index, uint32_t count)
{
    const uint32_t room = room_of(ctx);
    const eits_matrix *s = &ctx->model->sensitivity;
    if (count > room)
        return 0;
    uint32_t absent = 0;
    for (uint32_t k = 0; k < count; ++k)
        absent += ctx->cache_slot[index[k]] == EITS_NO_PIXEL;
    if (absent == 0)
        return 1;
    memset(ctx->cache_wanted, 0, room);
    for (uint32_t k = 0; k < count; ++k) {
        if (ctx->cache_slot[index[k]] != EITS_NO_PIXEL)
            ctx->cache_wanted[ctx->cache_slot[index[k]]] = 1;
    }
    uint32_t slot = ctx->cache_next;
    for (uint32_t k = 0; k < count; ++k) {
        if (ctx->cache_slot[index[k]] != EITS_NO_PIXEL)
            continue;
        while (ctx->cache_wanted[slot])
            slot = slot + 1 < room ? slot + 1 : 0;
        if (ctx->cache_column[slot] != EITS_NO_PIXEL)
            ctx->cache_slot[ctx->cache_column[slot]] = EITS_NO_PIXEL;
        ctx->cache_column[slot] = (uint16_t)index[k];
        ctx->cache_slot[index[k]] = (uint16_t)slot;
        ctx->cache_wanted[slot] = 1;
        ctx->kernels->unpack(s, (size_t)s->stride * index[k], s->stride,
                             ctx->cache + (size_t)s->stride * slot);
    }
    ctx->cache_next = slot;
    return 1;
}

void eits_cache_slots(const eits_context *ctx, const uint32_t *index, uint32_t count,
                      uint32_t *slot)
{
    for (uint32_t k = 0; k < count; ++k)
        slot[k] = ctx->cache_slot[index[k]];
}

eits_matrix eits_cached_columns(const eits_context *ctx)
{
    eits_matrix cached = ctx->model->sensitivity;
    cached.data = ctx->cache;
    cached.scale = NULL;
    cached.storage = EITS_STORAGE_F32;
    cached.cols = room_of(ctx);
    return cached;
}
