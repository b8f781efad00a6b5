/* The solvers, each from ctx->x and ctx->sx (both zero, or a warm start's). `gradient_known`: x is
 * zero and ctx->gradient holds S'y. Each leaves x, sx and how it went in ctx->info; where stop is
 * EITS_STOP_DIVERGED, x is of no use. */
#ifndef EITSKIN_SOLVERS_H
#define EITSKIN_SOLVERS_H

#include "eitskin/context.h"

/* FISTA on every column or on a working set, as the options say: until the count or the gap; a rise
 * of the objective above its start halves the step and starts over from zero. */
void eits_run_fista(eits_context *ctx, eits_real lambda, int gradient_known);

/* Coordinate descent: sweeps until the count, the gap, or until nothing moves. */
void eits_run_coordinate(eits_context *ctx, eits_real lambda, int gradient_known);

/* Active set: rounds until the count, the gap, or until no column is missing; where its factor
 * breaks down, coordinate descent goes on from where it came to. */
void eits_run_active_set(eits_context *ctx, eits_real lambda, int gradient_known);

#endif
