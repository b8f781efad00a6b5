/* Choose the regularisation, which is the weight of the weak directions, for this board's noise and
 * this frame's rows.
 *
 * The builder's whitening divides each singular direction by sqrt(s_i^2 + mu s_1^2). A small mu
 * sharpens the image and amplifies noise in directions the electrodes hardly see. The model was
 * built with one mu. Two things change it here: a noisy reference raises it, in proportion to its
 * noise over its rms; rows left out lower it, since fewer directions are measured, down to the
 * limit of what float32 can solve.
 *
 * The result is D (whitening.h), `rank` weights applied to y and in each product: the stored
 * model stays as it is, in flash. Weights never exceed 1, so the step of FISTA stays valid. */
#include "frame/whitening.h"

#include "base/vec.h"
#include "frame/constants.h"

/* Return the regularisation that the noise requires.
 *
 * Noise over the reference's rms is the fraction of noise in the data of an untouched skin; the
 * factor was fitted to the noise that then shows in the image. Without a learned reference the
 * noise is unknown, and the result is 0. */
static eits_real asked_regularisation(const eits_context *ctx)
{
    const eits_reference *b = &ctx->reference;
    const eits_real by_noise =
        b->noise_v > 0 ? ctx->options.regularisation_noise_factor * (b->noise_v / b->v0_rms) : 0;
    /* an instrument that differs from the model gives frames that are right only in the strongest
     * directions */
    return !b->far && by_noise < EITS_MAX_REGULARISATION ? by_noise : EITS_MAX_REGULARISATION;
}

eits_real eits_regularisation_of_all(const eits_context *ctx)
{
    const eits_real asked = asked_regularisation(ctx);
    return asked > ctx->whitening.mu ? asked : ctx->whitening.mu;
}

eits_real eits_regularisation_of_rest(const eits_context *ctx, eits_real missing)
{
    const eits_real left = 1 - missing, cube = left * left * left,
                    lowered = cube > EITS_MIN_REGULARISATION_FRACTION
                                  ? cube
                                  : EITS_MIN_REGULARISATION_FRACTION;
    const eits_real of_model = lowered * ctx->whitening.mu,
                    asked = left * asked_regularisation(ctx),
                    wanted = asked > of_model ? asked : of_model;
    return wanted > EITS_MIN_REGULARISATION ? wanted : EITS_MIN_REGULARISATION;
}

/* Returns D_i, scaled so that the strongest direction keeps its weight. None exceeds 1, so the
 * model's Lipschitz constant holds, whatever rounding made of the stored matrices. */
static eits_real weight_of(const eits_context *ctx, eits_real regularisation, uint32_t i)
{
    const eits_real square = ctx->whitening.s1_square * (1 + regularisation) /
                             (ctx->whitening.row_strength[i] + regularisation);
    const eits_real weight = eits_sqrt(square) * ctx->whitening.row_scale[i];
    return weight < 1 ? weight : 1;
}

/* White noise on the rows has the covariance diag(w^2) in P d. Its mean square in S'D D P d, over
 * S's columns, is therefore the sum of |S_i|^2 w_i^2 D_i^4 = s_i^2 w_i^4 D_i^4.
 *
 * The result is the change of that noise by the regularisation. It is needed since lambda_noise was
 * learned with one whitening and is used with another. */
eits_real eits_regularisation_noise(const eits_context *ctx, eits_real regularisation)
{
    eits_real sum = 0, total = 0;
    if (!(regularisation > ctx->whitening.mu))
        return 1;
    for (uint32_t i = 0; i < ctx->model->rank; ++i) {
        const eits_real w2 = 1 / (ctx->whitening.row_scale[i] * ctx->whitening.row_scale[i]),
                        square = ctx->whitening.row_strength[i] * w2 * w2;
        const eits_real weight = weight_of(ctx, regularisation, i), w2_kept = weight * weight;
        total += square;
        sum = eits_fma(square * w2_kept, w2_kept, sum);
    }
    return eits_sqrt(sum / total);
}

eits_real eits_regularisation_weights(const eits_context *ctx, eits_real regularisation,
                                      eits_real *weight)
{
    eits_real energy = 0, total = 0;
    eits_zero(weight, EITS_STRIDE(ctx->model->rank));
    for (uint32_t i = 0; i < ctx->model->rank; ++i) {
        const eits_real w2 = 1 / (ctx->whitening.row_scale[i] * ctx->whitening.row_scale[i]);
        weight[i] = weight_of(ctx, regularisation, i);
        energy = eits_fma(weight[i] * weight[i], w2, energy);
        total += w2;
    }
    return energy / total;
}
