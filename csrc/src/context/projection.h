#ifndef EITSKIN_PROJECTION_H
#define EITSKIN_PROJECTION_H

#include "context/context.h"

/* v (stride numbers) less its parts along `count` orthonormal directions, stride apart; returns the
 * multiply-accumulates. */
uint64_t eits_take_out(const eits_context *ctx, const eits_real *directions, uint32_t count,
                       eits_real *v);

/* The vector behind `count` directions becomes one more; 0 where these have all of its square but
 * `least`. */
int eits_add_direction(const eits_context *ctx, eits_real *directions, uint32_t count,
                       eits_real least, uint64_t *macs);

/* Take the basis' directions out of v; returns the multiply-accumulates. */
uint64_t eits_project(const eits_context *ctx, eits_real *v);

#endif
