/* Columns of S that are in use, unpacked to floats and held together in the workspace: products
 * over few columns, again and again, then neither convert nor read flash. Inside the library. */
#ifndef EITSKIN_COLUMNS_H
#define EITSKIN_COLUMNS_H

#include "eitskin/context.h"

/* Nothing is held: for a fresh workspace. */
void eits_drop_columns(eits_context *ctx);

/* Hold all columns listed, each once; those of earlier calls give way where there is no room.
 * Returns 0, nothing changed, if the list is longer than the room. */
uint32_t eits_hold_columns(eits_context *ctx, const uint32_t *index, uint32_t count);

/* Where the listed columns, which are held, stand in the matrix below. `slot` may be `index`. */
void eits_slots_of(const eits_context *ctx, const uint32_t *index, uint32_t count, uint32_t *slot);

/* The held columns as a matrix without scales, of float storage. */
eits_matrix eits_held_columns(const eits_context *ctx);

#endif
