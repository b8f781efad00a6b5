/* Columns of S, unpacked from their storage type to floats, in fast memory.
 *
 * A board keeps S in flash as halves or bytes; unpacking a number costs as much as multiplying it
 * (kernels/m7.c has counts). The working set and the discs of a fit use the same few columns over
 * and over, so these are kept. The direct maps slot[column] and column[slot] find a column without
 * a search; EITS_NO_PIXEL marks an empty entry. After a request either all requested columns are
 * cached, or nothing has changed and the caller reads S itself: no product mixes columns of both
 * kinds.
 *
 * Only speed depends on the cache. Unpacking is exact, so results have the same bits without it. */
#include "context/column_cache.h"
#include "base/arithmetic.h"

#include <string.h>

void eits_clear_column_cache(eits_columns *c)
{
    for (uint32_t j = 0; j < c->s->cols; ++j)
        c->slot[j] = EITS_NO_PIXEL;
    for (uint32_t slot = 0; slot < c->room; ++slot)
        c->column[slot] = EITS_NO_PIXEL;
    c->next = 0;
}

uint32_t eits_cache_columns(eits_columns *c, const eits_kernels *kernels, const uint32_t *index,
                            uint32_t count)
{
    const uint32_t room = c->room;
    const eits_matrix *s = c->s;
    if (count > room)
        return 0;
    uint32_t absent = 0;
    for (uint32_t k = 0; k < count; ++k)
        absent += c->slot[index[k]] == EITS_NO_PIXEL;
    if (absent == 0)
        return 1;
    memset(c->wanted, 0, room);
    for (uint32_t k = 0; k < count; ++k) {
        if (c->slot[index[k]] != EITS_NO_PIXEL)
            c->wanted[c->slot[index[k]]] = 1;
    }
    /* The slots are reused in turn, so the oldest columns are replaced first, without a record of
     * their use. */
    uint32_t slot = c->next;
    for (uint32_t k = 0; k < count; ++k) {
        if (c->slot[index[k]] != EITS_NO_PIXEL)
            continue;
        while (c->wanted[slot])
            slot = slot + 1 < room ? slot + 1 : 0;
        if (c->column[slot] != EITS_NO_PIXEL)
            c->slot[c->column[slot]] = EITS_NO_PIXEL;
        c->column[slot] = (uint16_t)index[k];
        c->slot[index[k]] = (uint16_t)slot;
        c->wanted[slot] = 1;
        kernels->unpack(s, (size_t)s->stride * index[k], s->stride,
                        c->data + (size_t)s->stride * slot);
    }
    c->next = slot;
    return 1;
}

void eits_cache_slots(const eits_columns *c, const uint32_t *index, uint32_t count, uint32_t *slot)
{
    for (uint32_t k = 0; k < count; ++k)
        slot[k] = c->slot[index[k]];
}

/* The matrix has the same form as S, so the same kernels read it. It has no scales: unpacking
 * leaves them out, and callers include them in their values. */
eits_matrix eits_cached_columns(const eits_columns *c)
{
    eits_matrix cached = *c->s;
    cached.data = c->data;
    cached.scale = NULL;
    cached.storage = EITS_STORAGE_F32;
    cached.cols = c->room;
    return cached;
}
