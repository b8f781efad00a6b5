/* eitskin: from boundary voltages to the solver's data.
 *
 * A frame is n_rows voltages in the order of the model's protocol table. The stages: unusable
 * channels are found, the difference to the reference frame is taken (eits_data_kind), reciprocal
 * rows are folded into their mean, P whitens, and the direction that drift of the gain takes, which
 * carries no news, is projected away.
 *
 * Rows left out: of a reciprocal pair the other row stands for both. Where both are out, what is
 * left is whitened again: the solver then meets the data by F S instead of S, as the reduction
 * would have had it without those rows (csrc/src/frame/whitening.h has the formulas), the
 * regularisation lower the fewer rows there are; lambda_noise grows with the noise that this lets
 * through. That needs a model of the builder's form, P's rows orthogonal and S whitened by them,
 * which its section WHIT says. Of any other model, the rows' values are minimised over: the span of
 * their columns of P is projected away, too, which loses much of what the rows left know.
 *
 * Noise: a regularisation that suits 60 dB lets too much of it through at 40. What the tare learned
 * raises it (regularisation_noise_factor): with no row out F is a weight for each row of S then
 * (csrc/src/frame/whitening.h). Else there is no F, and no cost.
 */
#ifndef EITSKIN_FRAME_H
#define EITSKIN_FRAME_H

#include "eitskin/context.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Take one frame as the reference; noise and lambda_noise stay unknown (0), so nothing is below a
 * threshold. Errors: EITS_E_ARGUMENT, EITS_E_FRAME_LENGTH, EITS_E_FRAME_CHANNELS,
 * EITS_E_FRAME_ZERO. The old reference then stays. */
eits_status eits_reference_set(eits_context *ctx, const eits_real *frame, size_t length);

/* Learn reference and noise from `count` >= 4 reference frames: begin, add each, finish. The first
 * half gives a first mean; the second half also gives lambda_noise, the greatest max(S'y) that a
 * reference frame showed, told as with the model's own regularisation; the mean of all is the
 * reference. Until finish returns EITS_OK there is no reference. Single readings that neither their
 * reciprocals nor the other frames bear out are left out of it, and counted (reference.outliers).
 * Errors as above; EITS_E_REFERENCE_SHORT if frames are missing, EITS_E_NOT_FINITE if S'y of a
 * frame would not be finite. A frame that is refused does not count. */
eits_status eits_reference_begin(eits_context *ctx, uint32_t count);
eits_status eits_reference_add(eits_context *ctx, const eits_real *frame, size_t length);
eits_status eits_reference_finish(eits_context *ctx);

/* Leave row `row` of the protocol out of every frame (masked = 1) or use it again (0). A row that
 * was left out while the reference was taken has none, and stays out until the next reference.
 * Errors: EITS_E_ARGUMENT. */
eits_status eits_mask_row(eits_context *ctx, uint32_t row, int masked);

/* The frame stage alone: reduced data for eits_solve, row and electrode states, and in `masked` the
 * number of rows left out, in `macs` the multiply-accumulates. Errors: EITS_E_ARGUMENT,
 * EITS_E_NO_REFERENCE, EITS_E_FRAME_LENGTH, EITS_E_FRAME_CHANNELS, EITS_E_FRAME_ZERO,
 * EITS_E_NOT_FINITE. */
eits_status eits_frame_stage(eits_context *ctx, const eits_real *frame, size_t length,
                             uint32_t *masked, uint64_t *macs);

/* The diagnostics of a frame that is not to be solved: info as far as the frame stage fills it in.
 * Frames that are solved get the bits that they would have got without it. Errors: as
 * eits_frame_stage. */
eits_status eits_examine(eits_context *ctx, const eits_real *frame, size_t length);

#ifdef __cplusplus
}
#endif
#endif
