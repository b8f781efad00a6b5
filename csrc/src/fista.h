/* FISTA, on every column or on a working set. Inside the library; solve.h says what is minimised. */
#ifndef EITSKIN_FISTA_H
#define EITSKIN_FISTA_H

#include "eitskin/context.h"

/* residual = Q (y - sx), with y projected already; returns the multiply-accumulates. */
uint64_t eits_take_residual(eits_context *ctx, const eits_real *sx);

/* From ctx->x and ctx->sx (both zero, or a warm start's) iterate until the count or the gap; a rise of the objective above
 * its start halves the step and starts over from zero. `gradient_known`: x is zero and ctx->gradient holds S'y. Leaves x, sx
 * and how it went in ctx->info; where stop is EITS_STOP_DIVERGED, x is of no use. */
void eits_run_fista(eits_context *ctx, eits_real lambda, int gradient_known);

/* ---- the working set: see working_set.c ---- */

/* List the columns of ctx->x that are not zero and keep x for these only, so that ctx->x[k] is that of ctx->working[k]. */
void eits_working_set_begin(eits_context *ctx);

/* Choose anew from ctx->gradient, that of every column at z: those where x or z is not zero, and those that the step would
 * move. Compacts x, z and gradient likewise. */
void eits_working_set_choose(eits_context *ctx, eits_real lambda);

/* Leave out the columns at rest, by ctx->gradient, that of the working set at z: the same rule, no look at the others. */
void eits_working_set_prune(eits_context *ctx, eits_real lambda);

/* Spread ctx->x over all columns again. */
void eits_working_set_end(eits_context *ctx);

#endif
