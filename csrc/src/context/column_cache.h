/* Columns of S that are in use, unpacked to floats and kept together in the workspace: products
 * over few columns, again and again, then neither convert nor read flash. Inside the library. */
#ifndef EITSKIN_COLUMN_CACHE_H
#define EITSKIN_COLUMN_CACHE_H

#include "eitskin/context.h"

/* Nothing is cached: for a fresh workspace. */
void eits_clear_column_cache(eits_context *ctx);

/* Hold all columns listed, each once; those of earlier calls give way where there is no room.
 * Returns 0, nothing changed, if the list is longer than the room. */
uint32_t eits_cache_columns(eits_context *ctx, const uint32_t *index, uint32_t count);

/* Where the listed columns, which are cached, stand in the matrix below. `slot` may be `index`. */
void eits_cache_slots(const eits_context *ctx, const uint32_t *index, uint32_t count,
                      uint32_t *slot);

/* The cached columns as a matrix without scales, of float storage. */
eits_matrix eits_cached_columns(const eits_context *ctx);

#endif
