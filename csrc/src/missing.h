/* Which columns the active set is to take in. */
#ifndef EITSKIN_MISSING_H
#define EITSKIN_MISSING_H

#include "eitskin/context.h"

/* List in ctx->list_index the columns whose correlation is beyond `least` and no less than that of their up to eight neighbours
 * in the image, greatest first; returns their number. ctx->gradient of the columns held is zero. Uses ctx->list_value. */
uint32_t eits_list_missing(const eits_context *ctx, eits_real least);

#endif
