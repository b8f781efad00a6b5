/* Which columns the active set adds next: those at zero that violate the KKT conditions most. */
#ifndef EITSKIN_VIOLATIONS_H
#define EITSKIN_VIOLATIONS_H

#include "context/context.h"

/* The columns that were active after some step of this solve, and those of the pixels beside
 * theirs. */
typedef struct eits_nearby {
    uint32_t *column;
    uint8_t *marked; /* n_pixels: 1 for those listed, 2 where all around it are too */
    uint32_t count;
} eits_nearby;

/* 1 if v[j] (of n_pixels numbers) is the greatest among its neighbours in the image; of equal ones,
 * the first. Neighbours beyond the image's edge, or off the skin, do not count. */
int eits_is_peak(const eits_context *ctx, const eits_real *v, uint32_t j);

/* An empty list. Its memory is that of solver.image and solver.z. */
eits_nearby eits_nearby_none(const eits_context *ctx);

/* Add the active columns, and those beside them. */
void eits_nearby_add(const eits_context *ctx, eits_nearby *near);

/* solver.gradient = S' F' solver.residual for these columns, zero elsewhere; counts into
 * info. */
void eits_take_gradient_nearby(eits_context *ctx, const eits_scratch *scratch,
                               const eits_nearby *near);

/* List in scratch->index the columns whose correlation is beyond `min` and no less than that of
 * their up to eight neighbours in the image, greatest first; returns their number.
 * solver.gradient of the active columns is zero. Of all columns, or with `near` of those,
 * solver.gradient being zero elsewhere. */
uint32_t eits_list_violations(const eits_context *ctx, const eits_scratch *scratch, eits_real min,
                              const eits_nearby *near);

#endif
