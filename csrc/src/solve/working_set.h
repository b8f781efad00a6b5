/* FISTA's working set, and what coordinate descent and active set use of it. */
#ifndef EITSKIN_WORKING_SET_H
#define EITSKIN_WORKING_SET_H

#include "eitskin/context.h"

/* List the columns of ctx->x that are not zero and keep x for these only, so that ctx->x[k] is that
 * of ctx->working[k]. */
void eits_working_set_begin(eits_context *ctx);

/* Choose anew from ctx->gradient, that of every column at z: those where x or z is not zero, and
 * those that the step would move. Compacts x, z and gradient likewise. */
void eits_working_set_choose(eits_context *ctx, eits_real lambda);

/* Leave out the columns at rest, by ctx->gradient, that of the working set at z: the same rule, no
 * look at the others. */
void eits_working_set_prune(eits_context *ctx, eits_real lambda);

/* Spread ctx->x over all columns again. */
void eits_working_set_end(eits_context *ctx);

/* 1 where a column at rest with this gradient would move. */
int eits_moves(eits_real gradient, eits_real lambda, eits_sign sign);

#endif
