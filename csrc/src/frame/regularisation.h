/* The regularisation mu of the whitening, raised where the reference was noisy. The builder's w =
 * (s^2 + mu s_1^2)^-1/2 lets weak directions speak, and with them the noise. A model of the
 * regularisation mu' > mu has each row of P and S multiplied by D_i = sqrt((s_i^2 + mu s_1^2) /
 * (s_i^2 + mu' s_1^2)), but for a common factor: the whitening F = D of whitening.h, where no row
 * is left out. */
#ifndef EITSKIN_REGULARISATION_H
#define EITSKIN_REGULARISATION_H

#include "context/context.h"

/* mu' with all rows in use: the model's, or regularisation_noise_factor times the noise over the
 * reference's rms where that is more. */
eits_real eits_regularisation_of_all(const eits_context *ctx);

/* mu' where the fraction `missing` of the folded rows is left out. */
eits_real eits_regularisation_of_rest(const eits_context *ctx, eits_real missing);

/* How much noise of the rows max(S'y) has with the regularisation mu' and all rows, over that with
 * the model's; for models of the builder's form. */
eits_real eits_regularisation_noise(const eits_context *ctx, eits_real regularisation);

/* D (stride numbers); returns how much noise of the rows |y|^2 has so, over that with the model's
 * regularisation. */
eits_real eits_regularisation_weights(const eits_context *ctx, eits_real regularisation,
                                      eits_real *weight);

#endif
