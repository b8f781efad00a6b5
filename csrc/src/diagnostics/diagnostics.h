/* What the stages ask of a frame before and after it is solved: electrodes.c, outliers.c,
 * model_mismatch.c, reference_outliers.c. */
#ifndef EITSKIN_EXAMINE_H
#define EITSKIN_EXAMINE_H

#include "context/context.h"
#include "diagnostics/constants.h"

/* Whether a diagnostic is looked for. */
static inline int eits_wants(const eits_context *ctx, eits_diagnostic diagnostic)
{
    return (ctx->options.diagnostics & (uint32_t)diagnostic) != 0;
}

/* Whether the two electrodes at `two` are e and f, either way round. */
int eits_is_pair(const uint8_t *two, uint32_t e, uint32_t f);

/* Leave row i, which is in use so far, out of this frame as an outlier, and count it. */
void eits_leave_outlier(eits_context *ctx, uint32_t i);

/* info names the electrodes in rows.electrode. */
void eits_name_electrodes(eits_context *ctx);

/* Leave out all rows that use an electrode in `state`, for the reason given. */
void eits_leave_electrodes(eits_context *ctx, eits_electrode_state state, eits_row_state why);

/* Open electrodes and bridged pairs, by rows that are dead; rows whose sign has turned. Sets
 * rows.electrode, rows.unusable and info. rows.unusable must hold what the rows
 * themselves tell. Returns 0 where no electrode shows any signal: it is not the electrodes then,
 * but the front end.
 */
int eits_find_electrodes(eits_context *ctx, const eits_real *frame);

/* Single rows that their reciprocals do not bear out, and noisy electrodes. frame.d holds the
 * folded data, frame.reciprocity_error what each fold's two sides differ by (0 where it has
 * one), frame.sides which sides are in use. Marks rows.unusable; returns 1 where it
 * marked any row. */
int eits_find_outliers(eits_context *ctx, const eits_scratch *scratch, uint64_t *macs);

/* The same for frames that have no reciprocals, or copied ones: the one fold that the others
 * predict worst, if it stands out of their prediction errors. frame.y is P d, not yet
 * projected, no fold left out, range.known. */
int eits_find_unpaired_outlier(eits_context *ctx, const eits_scratch *scratch, uint64_t *macs);

/* The reference frame `newer` against `older`: how many folds do not agree (0 where they are too
 * many to be outliers); sets `bit` in scratch->index of those, clears it in the others. The bits
 * stay in scratch->index until it is used for something else. */
uint32_t eits_reference_compare(eits_context *ctx, const eits_scratch *scratch,
                                const eits_real *newer, const eits_real *older, uint8_t bit);

/* Mark the readings of a reference frame that the mean so far does not bear out with
 * EITS_MASKED_NOW; returns their number. */
uint32_t eits_reference_mask_outliers(eits_context *ctx, const eits_scratch *scratch,
                                      const eits_real *frame);
void eits_reference_unmask(eits_context *ctx);

/* Of the first two reference frames, in v0 and m2: readings that neither the other nor the third
 * bears out become the other's. Returns their number. */
uint32_t eits_reference_weigh_second(eits_context *ctx, const eits_scratch *scratch,
                                     const eits_real *frame);

/* What mismatch and prediction need to know of P and S, as the model says it; once, at the start.
 */
void eits_learn_range(eits_context *ctx);

/* How much of frame.d the model cannot give, into info; returns 1 where that stands out.
 * frame.y is P d, not yet projected, no fold left out; projection.gain_drift is the drift
 * of the gain (zeros: it is not ignored); range.known. */
int eits_check_model_mismatch(eits_context *ctx, const eits_scratch *scratch, uint64_t *macs);

/* Whether the change goes the way touches cannot; `gradient` is S'y, info.lambda_max
 * known. */
void eits_check_stale_reference(eits_context *ctx, const eits_real *gradient);

/* While the reference follows the skin: whether what the touches of this frame explain says that
 * they are the skin's own change, in a taught model; info.lambda_max and .unexplained known. */
int eits_check_drift(eits_context *ctx);

/* Whether the reference is further from the model's than an uneven skin's. */
void eits_check_unlike_model(eits_context *ctx);

/* The variance of a fold's datum by the noise that was learned, summed over the folds in use;
 * copied reciprocals are one measurement. */
eits_real eits_noise_energy(const eits_context *ctx);

/* What of |y|^2 that noise gives. */
eits_real eits_expected_noise(const eits_context *ctx);

/* Whether `count` touches are more than can be told apart, into info; info.unexplained is known. */
void eits_check_crowd(eits_context *ctx, const eits_touch *touches, uint32_t count);

/* The k-th smallest of n numbers, which are put in another order. */
eits_real eits_kth(eits_real *v, uint32_t n, uint32_t k);

#endif
