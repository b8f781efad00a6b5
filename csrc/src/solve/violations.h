/* Which columns the active set is to take in. */
#ifndef EITSKIN_VIOLATIONS_H
#define EITSKIN_VIOLATIONS_H

#include "eitskin/context.h"

/* Columns that were active after one of a solve's steps, and those that show the pixels beside
 * theirs. */
typedef struct eits_nearby {
    uint32_t *column;
    uint8_t *marked; /* n_pixels: 1 for those listed, 2 where all around it are too */
    uint32_t count;
} eits_nearby;

/* None yet; the list is kept in what ctx->image and ctx->z point to. */
eits_nearby eits_nearby_none(const eits_context *ctx);

/* Add the active ones, and those beside them. */
void eits_nearby_add(const eits_context *ctx, eits_nearby *near);

/* ctx->gradient = S' F' ctx->residual for these columns, zero elsewhere; counts into ctx->info.
 * Uses ctx->list_value. */
void eits_take_gradient_nearby(eits_context *ctx, const eits_nearby *near);

/* List in ctx->list_index the columns whose correlation is beyond `min` and no less than that of
 * their up to eight neighbours in the image, greatest first; returns their number. ctx->gradient of
 * the active columns is zero. Of all columns, or with `near` of those, ctx->gradient being zero
 * elsewhere. Uses ctx->list_value. */
uint32_t eits_list_violations(const eits_context *ctx, eits_real min, const eits_nearby *near);

#endif
