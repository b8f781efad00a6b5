#ifndef EITSKIN_PROJECTION_H
#define EITSKIN_PROJECTION_H

#include "context/context.h"

/* Subtract from v (stride numbers) its parts along `count` orthonormal directions, one every stride
 * numbers. Returns the multiply-accumulates. */
uint64_t eits_take_out(const eits_context *ctx, const eits_real *directions, uint32_t count,
                       eits_real *v);

/* Make the vector behind `count` directions a further direction. Returns 0 if at most `least` of
 * its square is outside the others. */
int eits_add_direction(const eits_context *ctx, eits_real *directions, uint32_t count,
                       eits_real least, uint64_t *macs);

/* Take the basis' directions out of v; returns the multiply-accumulates. */
uint64_t eits_project(const eits_context *ctx, eits_real *v);

#endif
