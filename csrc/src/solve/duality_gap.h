/* What all solvers fraction: the gradient of every column, the duality gap, and whether a step is
 * still to be had for the MACs. */
#ifndef EITSKIN_DUALITY_GAP_H
#define EITSKIN_DUALITY_GAP_H

#include "eitskin/context.h"

typedef struct eits_duality_gap {
    eits_real gap;
    eits_real objective;
    eits_real residual_squared;
} eits_duality_gap;

/* Where a solver keeps its coefficients: ctx->x[j] for each column, or ctx->x[k] for column
 * ctx->working[k]. */
typedef enum eits_layout { EITS_LAYOUT_FULL = 0, EITS_LAYOUT_WORKING = 1 } eits_layout;

/* residual = Q (y - F sx), with y projected already and F as in whitening.h; returns the
 * multiply-accumulates. */
uint64_t eits_take_residual(eits_context *ctx, const eits_real *sx);

/* ctx->residual = Q (y - F sx), ctx->gradient = S' F' residual, of every column; counts into
 * ctx->info. */
void eits_take_gradient(eits_context *ctx, const eits_real *sx);

/* Objective and gap at ctx->x from ctx->residual and ctx->gradient as eits_take_gradient leaves
 * them. */
eits_duality_gap eits_duality_gap_of(const eits_context *ctx, eits_real lambda, eits_layout layout);

/* Both in one. */
eits_duality_gap eits_find_duality_gap(eits_context *ctx, eits_real lambda, eits_layout layout);

/* The same at x = 0, of what info knows: no product is needed. */
eits_duality_gap eits_duality_gap_at_zero(const eits_context *ctx, eits_real lambda);

/* Multiply-accumulates of eits_take_gradient, ctx->sx being known. */
uint64_t eits_gradient_macs(const eits_context *ctx);

/* 1 where `macs` more stay within the limit, or there is none. */
int eits_affords(const eits_context *ctx, uint64_t macs);

/* What the objective may not exceed, with room for rounding: that of x = 0. Above it nothing was
 * won. */
eits_real eits_ceiling(const eits_context *ctx);

/* Gap and residual into ctx->info. */
void eits_report_duality_gap(eits_context *ctx, eits_duality_gap c);

#endif
