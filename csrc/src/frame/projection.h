/* What the stages (reference, frame, solve, touch) fraction inside the library. */
#ifndef EITSKIN_STAGES_H
#define EITSKIN_STAGES_H

#include "eitskin/context.h"

/* Take the basis' directions out of v (stride numbers); returns the multiply-accumulates. */
uint64_t eits_project(const eits_context *ctx, eits_real *v);

/* out (stride numbers) = P of the `count` folds in ctx->list_index with the data in
 * ctx->list_value, whitened and projected as the frame's data are. Returns the
 * multiply-accumulates. */
uint64_t eits_reduce(eits_context *ctx, uint32_t count, eits_real *out);

/* eits_frame_stage without its checks; the reference need not be finished. */
eits_status eits_frame_data(eits_context *ctx, const eits_real *frame, uint32_t *masked,
                            uint64_t *macs);

/* Solve once more, from zero, for the data `y` (stride numbers); ctx->y is then `y`. Adds to what
 * info counts; where nothing comes of it, the frame's own data are solved again. */
void eits_solve_again(eits_context *ctx, const eits_real *y);

/* 1 where each of the values is finite. */
int eits_all_finite(const eits_real *values, size_t count);

#endif
