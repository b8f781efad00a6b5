/* The columns that the active set adds next: those at zero that violate the KKT conditions most. */
#ifndef EITSKIN_VIOLATIONS_H
#define EITSKIN_VIOLATIONS_H

#include "context/context.h"

/* The columns that were active after some step of this solve, and those of the pixels beside
 * theirs. */
typedef struct eits_nearby {
    uint32_t *column;
    uint8_t
        *marked; /* n_pixels: 1 for a listed column, 2 if all of its neighbours are listed, too */
    uint32_t count;
} eits_nearby;

/* Return 1 if v[j] (of n_pixels numbers) is the greatest among its neighbours in the image; among
 * equal ones, the first. Neighbours beyond the image's edge, or off the skin, do not count. */
int eits_is_peak(const eits_context *ctx, const eits_real *v, uint32_t j);

/* Return an empty list. It uses the memory of solver.image and solver.z. */
eits_nearby eits_nearby_none(const eits_context *ctx);

/* Add the active columns and their neighbours. */
void eits_nearby_add(const eits_context *ctx, eits_nearby *near);

/* solver.gradient = S' F' solver.residual for these columns, and zero for the others. Adds the cost
 * to info. */
void eits_take_gradient_nearby(eits_context *ctx, const eits_scratch *scratch,
                               const eits_nearby *near);

/* List in scratch->index the columns whose correlation exceeds `min` and is not less than that of
 * their up to eight neighbours in the image, greatest first. Returns their number. solver.gradient
 * must be zero for the active columns. `near` is NULL to examine all columns; otherwise only its
 * columns are examined, and solver.gradient must be zero for the others. */
uint32_t eits_list_violations(const eits_context *ctx, const eits_scratch *scratch, eits_real min,
                              const eits_nearby *near);

#endif
