/* Whitening for rows left out of a frame: F gives the reduction that the model would have had
 * without them, in the stored model's coordinates. With all rows in use, F is diagonal and gives
 * the reduction of a higher regularisation (regularisation.c).
 *
 * The builder makes P = diag(w) U' and S = diag(s w) V' with w = (s^2 + mu s_1^2)^-1/2
 * (docs/reference/eitm-format.md, "Reduction"). U_o has the rows of U that are in use, and U_o' U_o
 * + e I = R'R with R upper triangular. With G G' = R diag(s^2) R' + mu' s_1^2 I, F = G^-1 R
 * diag(1/w) and y = G^-1 R'^-1 diag(1/w) P_o d_o, |y - F S x|^2 is the residual that a reduction of
 * those rows with the regularisation mu' would have. F and G are upper triangular, too. */
#ifndef EITSKIN_WHITENING_H
#define EITSKIN_WHITENING_H

#include "context/context.h"

/* Read how the model was whitened, if it has eits_row_form. Otherwise the residual is minimised
 * over the rows left out (fold.c). Uses scratch->row[3]. */
void eits_whitening_init(eits_context *ctx, const eits_scratch *scratch);

/* Make the whitening for the folded rows that frame.sides has; sets whitening.form.
 * Returns the multiply-accumulates. */
uint64_t eits_whitening_build(eits_context *ctx, const eits_scratch *scratch);

/* ---- rows_out.c: taught models ---- */

/* Build F for a taught model without the rows left out, at most `rank` of them. Uses
 * scratch->index, row[3] and square; sets whitening.form. Returns the multiply-accumulates. */
uint64_t eits_fill_build(eits_context *ctx, const eits_scratch *scratch);

/* While such an F is in force, add to y = P d the values of the rows left out that are expected
 * from the `given` others, scratch->index and value; else do nothing. Uses scratch->square. */
uint64_t eits_fill_rows(eits_context *ctx, const eits_scratch *scratch, uint32_t given,
                        eits_real *y);

/* Returns lambda_noise for the rows in use. */
eits_real eits_lambda_noise(const eits_context *ctx);

/* Returns the detection threshold, the smallest max(S'y) of a frame or a touch that counts:
 * options.detection_factor times lambda_noise, or times the noise floor if that is larger. */
eits_real eits_detection_threshold(const eits_context *ctx);

/* While whitening.form is set, P d of the rows in use (stride numbers) becomes the data for F S x.
 */
uint64_t eits_whiten_data(eits_context *ctx, eits_real *v);

/* While whitening.form is EITS_WHITENING_TRIANGLE: compute the k-th of `rank` directions (stride
 * numbers) whose outer products sum up to the covariance of the data for white noise of variance 1
 * on the rows in use. Returns the multiply-accumulates. */
uint64_t eits_noise_direction(const eits_context *ctx, uint32_t k, eits_real *out);

/* v = F v (stride numbers); v is unchanged if F = 1. Returns the multiply-accumulates. */
uint64_t eits_whiten(const eits_context *ctx, eits_real *v);

/* out = y - Q F sx (stride numbers each); y is already projected. Returns the multiply-accumulates
 * of F and Q. */
uint64_t eits_residual(const eits_context *ctx, const eits_real *sx, eits_real *out);

/* v = Q F v, Q taking the basis' directions out. Returns the multiply-accumulates, also beforehand.
 */
uint64_t eits_forward(const eits_context *ctx, eits_real *v);
uint64_t eits_forward_macs(const eits_context *ctx);

/* Return F' v, in `room` (stride numbers), for a v that Q leaves unchanged; return v itself if F =
 * 1. */
const eits_real *eits_adjoint(const eits_context *ctx, const eits_real *v, eits_real *room);
uint64_t eits_adjoint_macs(const eits_context *ctx);

/* ---- regularisation.c ----
 *
 * The regularisation mu of the whitening is raised if the reference was noisy. The builder's w =
 * (s^2 + mu s_1^2)^-1/2 amplifies weak directions, and their noise. In a model with the
 * regularisation mu' > mu each row of P and S is multiplied by D_i = sqrt((s_i^2 + mu s_1^2) /
 * (s_i^2 + mu' s_1^2)), except for a common factor. So if no row is left out, the whitening is F =
 * D. */

/* Returns mu' with all rows in use: the model's, or regularisation_noise_factor times the noise
 * over the reference's rms if that is larger. */
eits_real eits_regularisation_of_all(const eits_context *ctx);

/* Returns mu' if the fraction `missing` of the folded rows is left out. */
eits_real eits_regularisation_of_rest(const eits_context *ctx, eits_real missing);

/* Returns the factor on the rows' noise in max(S'y) of the regularisation mu' against the model's,
 * with all rows in use; for models of the builder's form. */
eits_real eits_regularisation_noise(const eits_context *ctx, eits_real regularisation);

/* Computes D (stride numbers); returns the factor on the rows' noise in |y|^2 against the model's
 * regularisation. */
eits_real eits_regularisation_weights(const eits_context *ctx, eits_real regularisation,
                                      eits_real *weight);

#endif
