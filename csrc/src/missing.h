/* Which columns the active set is to take in. */
#ifndef EITSKIN_MISSING_H
#define EITSKIN_MISSING_H

#include "eitskin/context.h"

/* List in ctx->list_index the columns whose correlation is beyond `least` and no less than that of their up to eight neighbours
 * in the image, greatest first; returns their number. ctx->gradient of the columns held is zero. Uses ctx->list_value. With `marks`, of the
 * columns in marked panels only. */
uint32_t eits_list_missing(const eits_context *ctx, eits_real least, const uint8_t *marks);

/* ctx->gradient = S' F' ctx->residual for the columns in panels that show pixels beside those held, zero elsewhere;
 * `marks` is n_pixels bytes to write to. Returns the multiply-accumulates. */
uint64_t eits_gradient_nearby(eits_context *ctx, uint8_t *marks);

#endif
