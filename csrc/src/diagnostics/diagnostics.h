/* The diagnostics of a frame, before and after it is solved, and of reference frames. */
#ifndef EITSKIN_EXAMINE_H
#define EITSKIN_EXAMINE_H

#include "context/context.h"
#include "diagnostics/constants.h"

/* Return 1 if options.diagnostics asks for this diagnostic. */
static inline int eits_wants(const eits_context *ctx, eits_diagnostic diagnostic)
{
    return (ctx->options.diagnostics & (uint32_t)diagnostic) != 0;
}

/* Return 1 if the two electrodes at `two` are e and f, in either order. */
int eits_is_pair(const uint8_t *two, uint32_t e, uint32_t f);

/* Leave row i, which is in use so far, out of this frame as an outlier, and count it. */
void eits_leave_outlier(eits_context *ctx, uint32_t i);

/* Name the electrodes of rows.electrode in info. */
void eits_name_electrodes(eits_context *ctx);

/* Leave out all rows that use an electrode in `state`, for the reason given. */
void eits_leave_electrodes(eits_context *ctx, eits_electrode_state state, eits_row_state why);

/* Find open electrodes and bridged pairs, from rows that are dead or whose sign has turned. Sets
 * rows.electrode, rows.unusable and info. On entry rows.unusable must hold the faults that each row
 * shows by itself. Returns 0 if no electrode shows any signal: then the front end is at fault, not
 * the electrodes. */
int eits_find_electrodes(eits_context *ctx, const eits_real *frame);

/* Find single rows that disagree with their reciprocals, and noisy electrodes, and mark them in
 * rows.unusable. On entry frame.d holds the folded data, frame.reciprocity_error the difference of
 * each fold's two sides (0 if it has only one), and frame.sides the sides in use. Returns 1 if it
 * marked any row. */
int eits_find_outliers(eits_context *ctx, const eits_scratch *scratch, uint64_t *macs);

/* The same for frames whose reciprocals are missing or copied: at most one fold is an outlier, the
 * one that the others predict worst, if its error stands out of all prediction errors. On entry
 * frame.y is P d, before projection, with no fold left out; range.known must be 1. */
int eits_find_unpaired_outlier(eits_context *ctx, const eits_scratch *scratch, uint64_t *macs);

/* Compare the reference frame `newer` with `older`. Returns the number of folds that do not agree,
 * 0 if they are too many to be outliers. Sets `bit` in scratch->index for these folds and clears it
 * for the others; the bits stay there until scratch->index is used for something else. */
uint32_t eits_reference_compare(eits_context *ctx, const eits_scratch *scratch,
                                const eits_real *newer, const eits_real *older, uint8_t bit);

/* Mark the readings of a reference frame that disagree with the mean so far, with EITS_MASKED_NOW
 * in rows.masked. Returns their number. eits_reference_unmask removes the marks. */
uint32_t eits_reference_mask_outliers(eits_context *ctx, const eits_scratch *scratch,
                                      const eits_real *frame);
void eits_reference_unmask(eits_context *ctx);

/* The first two reference frames are in v0 and m2, the third is `frame`. A reading of one of the
 * two that disagrees with both other frames is replaced by the other's. Returns the number of
 * these. */
uint32_t eits_reference_weigh_second(eits_context *ctx, const eits_scratch *scratch,
                                     const eits_real *frame);

/* Compute the numbers from P and S that mismatch and prediction need. eits_init calls it once.
 */
void eits_learn_range(eits_context *ctx);

/* Set info.model_mismatch, the fraction of frame.d that no change of the model's skin can explain.
 * Returns 1 if it is too large. On entry frame.y is P d, before projection, with no fold left out;
 * projection.gain_drift is the direction of gain drift (zeros: it is not ignored); range.known must
 * be 1. */
int eits_check_model_mismatch(eits_context *ctx, const eits_scratch *scratch, uint64_t *macs);

/* Set STALE_REFERENCE, and range.against, if the change has a sign that touches cannot have.
 * `gradient` is S'y; info.lambda_max must be known. */
void eits_check_stale_reference(eits_context *ctx, const eits_real *gradient);

/* Clear STALE_REFERENCE if touches explain the frame: with few electrodes a touch has lobes of the
 * other sign. info.unexplained must be known, and there must be at least one touch. */
void eits_recheck_stale_reference(eits_context *ctx);

/* Set STALE_REFERENCE if the frame has another scale than the reference. On entry rows.unusable
 * marks all rows that are left out. */
void eits_check_scale(eits_context *ctx, const eits_real *frame);

/* For taught models with reference tracking: return 1 if the touches of this frame are in fact a
 * change of the skin itself, because they explain too little of the data. info.lambda_max and
 * info.unexplained must be known. */
int eits_check_drift(eits_context *ctx);

/* Set UNLIKE_MODEL if the reference is further from the model's than that of an uneven skin. */
void eits_check_unlike_model(eits_context *ctx);

/* Return the variance that the learned noise gives to fold k: that of its row, or half of it if two
 * rows were averaged. A pair that agrees to the last bit was copied and not measured twice, so it
 * has the variance of one row. 0 for a fold that is left out. */
eits_real eits_fold_noise(const eits_context *ctx, uint32_t k);

/* Return their sum: the |d|^2 that noise alone would give. */
eits_real eits_noise_energy(const eits_context *ctx);

/* Return the part of |y|^2 that this noise causes. */
eits_real eits_expected_noise(const eits_context *ctx);

/* Return 1 if max(S'y) may be noise: then no frame is crowded. */
int eits_is_faint(const eits_context *ctx);

/* Set CROWDED if `count` touches are more than can be separated. info.unexplained must be known. */
void eits_check_crowd(eits_context *ctx, const eits_touch *touches, uint32_t count);

/* second_moment.c: return 1 if a lower triangle of section UNCE is positive semidefinite up to
 * rounding. Overwrites the scratch's square and row 5. */
int eits_is_covariance(const eits_context *ctx, const eits_scratch *scratch, const float *triangle);

/* Return the k-th smallest of n numbers. Changes their order. */
eits_real eits_kth(eits_real *v, uint32_t n, uint32_t k);

#endif
