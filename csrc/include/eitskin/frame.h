/* eitskin: from boundary voltages to the solver's data.
 *
 * A frame is n_rows voltages in the order of the model's protocol table. The frame stage
 *
 *   1. finds the rows that cannot be used;
 *   2. takes the difference from the reference frame (eits_data_kind);
 *   3. folds reciprocal rows into their mean;
 *   4. whitens with the model's matrix P: the reduced data y, of `rank` numbers;
 *   5. projects away the direction in y that drift of the gain takes.
 *
 * Rows that are left out. If one row of a reciprocal pair is left out, the other stands for both.
 * If both are left out, the rest is whitened again: the solver then uses F S instead of S, which is
 * what the reduction would have been without these rows (csrc/src/frame/whitening.h has the
 * formulas). The regularisation is lower the fewer rows there are, and lambda_noise grows with the
 * noise that this lets through. This needs a model in the builder's form: P's rows orthogonal and S
 * whitened by them, as its section WHIT states. For a taught model the rows are filled in from the
 * others (csrc/src/frame/rows_out.c). For any other model the span of their columns of P is
 * projected away too, which loses much of the information in the remaining rows.
 *
 * Noise. A regularisation that suits 60 dB lets too much noise through at 40 dB. The noise that the
 * tare measured raises it (regularisation_noise_factor). If no row is left out, F is then one
 * weight for each row of S. If the regularisation is not raised, there is no F and no cost.
 */
#ifndef EITSKIN_FRAME_H
#define EITSKIN_FRAME_H

#include "eitskin/context.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Take one frame as the reference. Noise and lambda_noise stay unknown (0), so that no touch is
 * below the detection threshold. Errors: EITS_E_ARGUMENT, EITS_E_FRAME_LENGTH,
 * EITS_E_FRAME_ROWS, EITS_E_FRAME_ZERO; the old reference then stays. */
eits_status eits_reference_set(eits_context *ctx, const eits_real *frame, size_t length);

/* Learn reference and noise from `count` >= 4 frames of the untouched skin: begin, add each,
 * finish. The mean of all frames is the reference. The first half gives a first mean. Against it,
 * the second half gives lambda_noise: the greatest max(S'y) of one of its frames, with the model's
 * own regularisation. Until eits_reference_finish returns EITS_OK there is no reference. Single
 * readings that agree neither with their reciprocals nor with the other frames are left out, and
 * counted (eits_reference_info.outliers). Errors as above; EITS_E_REFERENCE_SHORT if frames are
 * missing, EITS_E_NOT_FINITE if S'y of a frame would not be finite. A frame that is rejected does
 * not count. eits_reference_add returns EITS_E_ARGUMENT without eits_reference_begin before it, and
 * after `count` frames. eits_reference_finish returns EITS_E_REFERENCE_TOUCHED if a touch landed,
 * moved or lifted meanwhile; this needs reciprocal rows and the diagnostic STALE_REFERENCE. */
eits_status eits_reference_begin(eits_context *ctx, uint32_t count);
eits_status eits_reference_add(eits_context *ctx, const eits_real *frame, size_t length);
eits_status eits_reference_finish(eits_context *ctx);

/* Leave row `row` of the protocol out of every frame (masked = 1) or use it again (0). A row that
 * was left out while the reference was taken has no reference, and stays out until the next one.
 * Errors: EITS_E_ARGUMENT. */
eits_status eits_mask_row(eits_context *ctx, uint32_t row, int masked);

/* The frame stage alone: it leaves reduced data for eits_solve, and row and electrode states.
 * `masked` gets the number of rows left out, `macs` the multiply-accumulates. Errors:
 * EITS_E_ARGUMENT, EITS_E_NO_REFERENCE, EITS_E_FRAME_LENGTH, EITS_E_FRAME_ROWS,
 * EITS_E_FRAME_ZERO, EITS_E_NOT_FINITE. */
eits_status eits_frame_stage(eits_context *ctx, const eits_real *frame, size_t length,
                             uint32_t *masked, uint64_t *macs);

/* The diagnostics of a frame that is not solved: fills in info as far as the frame stage does.
 * Later frames give the same bits as if it had not been called. Errors: as eits_frame_stage. */
eits_status eits_examine(eits_context *ctx, const eits_real *frame, size_t length);

#ifdef __cplusplus
}
#endif
#endif
