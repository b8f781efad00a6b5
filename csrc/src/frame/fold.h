/* Turn one frame from voltages into reduced data. The order is fold, basis (if it is stale),
 * reduce. */
#ifndef EITSKIN_FOLD_H
#define EITSKIN_FOLD_H

#include "context/context.h"

/* Compute frame.d, .reciprocity_error and .sides from the rows in use. If other sides are in use
 * than before, the basis becomes stale. */
void eits_fold_data(eits_context *ctx, const eits_real *frame);

/* Build the whitening, the directions to ignore and the gain drift for frame.sides and the
 * reference. Returns the multiply-accumulates, as do all functions that follow. */
uint64_t eits_build_basis(eits_context *ctx, const eits_scratch *scratch);

/* Compute frame.y = P d from the folds in use, neither whitened again nor projected; returns their
 * number. */
uint32_t eits_reduce_frame(eits_context *ctx, const eits_scratch *scratch, uint64_t *macs);

/* Compute frame.y_log from v0 log(v / v0), whitened and projected as frame.y will be. */
uint64_t eits_reduce_log(eits_context *ctx, const eits_scratch *scratch, const eits_real *frame);

/* out (stride numbers) = P of the `count` folds in scratch->index with the data in scratch->value,
 * whitened and projected as the frame's data are. */
uint64_t eits_reduce(eits_context *ctx, const eits_scratch *scratch, uint32_t count,
                     eits_real *out);

/* Does the same without the projection. */
uint64_t eits_reduce_whole(eits_context *ctx, const eits_scratch *scratch, uint32_t count,
                           eits_real *out);

#endif
