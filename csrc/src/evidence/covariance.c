/* The covariance of what the model cannot explain, and its Cholesky factor.
 *
 *     Sigma_ij = sigma^2 |P_i|^2 [i = j] + share |d|^2 (P E P')_ij (+ (P D P')_ij)
 *
 * P's rows are orthogonal (eits_row_form), so that white noise stays uncorrelated. Where the
 * regularisation is raised for this frame, the reduced data are F y with F diagonal, and so is
 * Sigma's: F Sigma F. Rows left out make F a triangle; such frames are not tested.
 *
 * The gain's drift is projected out of y and of all answers; in the metric of Sigma it is once
 * more, so that it costs nothing to explain.
 *
 * Costs rank^3 / 6 multiply-accumulates for the factor, rank^2 / 2 for each vector. */
#include "evidence/evidence.h"

#include "base/log.h"
#include "base/vec.h"
#include "diagnostics/diagnostics.h"
#include "evidence/constants.h"
#include "kernels/kernels.h"

/* The mean variance of a fold in use, in model volts^2. */
static eits_real noise_variance(const eits_context *ctx)
{
    const eits_real least = EITS_ERROR_MIN_NOISE * eits_fabs(ctx->reference.gain) *
                            ctx->reference.v0_rms,
                    learned = eits_noise_energy(ctx) / (eits_real)ctx->model->n_folded;
    return learned > least * least ? learned : least * least;
}

/* |d|^2 of the folds in use, less the gain's drift. */
static eits_real data_energy(const eits_context *ctx)
{
    const uint32_t folds = ctx->model->n_folded;
    const eits_real *d = ctx->frame.d, *gain = ctx->projection.gain_drift;
    const eits_real total = eits_dot(ctx->kernels, d, d, folds),
                    drift = eits_dot(ctx->kernels, gain, gain, folds),
                    along = eits_dot(ctx->kernels, d, gain, folds);
    const eits_real left = drift > 0 ? total - along * along / drift : total;
    return left < 0 ? 0 : left; /* of a frame that only drifts, rounding is left, of either sign */
}

static eits_real *row_of_factor(const eits_context *ctx, uint32_t i)
{
    return ctx->evidence.factor + EITS_STRIDE(ctx->model->rank) * i;
}

/* Row i of Sigma up to its diagonal; zeros behind it. */
static void covariance_row(const eits_context *ctx, uint32_t i, eits_real errors, eits_real drift,
                           eits_real noise)
{
    const eits_uncertainty *u = &ctx->model->uncertainty;
    const size_t first = (size_t)i * (i + 1u) / 2u;
    const eits_real *weight =
        ctx->whitening.form == EITS_WHITENING_DIAGONAL ? ctx->whitening.map : NULL;
    eits_real *row = row_of_factor(ctx, i);
    eits_zero(row, EITS_STRIDE(ctx->model->rank));
    for (uint32_t j = 0; j <= i; ++j)
        row[j] = eits_fma(errors, (eits_real)u->errors[first + j],
                          drift * (eits_real)u->drift[first + j]);
    row[i] = eits_fma(noise, (eits_real)ctx->model->row_form.energy[i], row[i]);
    for (uint32_t j = 0; weight != NULL && j <= i; ++j)
        row[j] *= weight[i] * weight[j];
}

/* Cholesky's factor of the rows, each from those above it. Returns log det Sigma; NaN where that is
 * out of range (volts or errors at the ends of it). */
static eits_real factor(const eits_context *ctx)
{
    eits_real log_determinant = 0;
    for (uint32_t i = 0; i < ctx->model->rank; ++i) {
        eits_real *row = row_of_factor(ctx, i);
        const eits_real diagonal = row[i];
        for (uint32_t j = 0; j < i; ++j) {
            const eits_real *above = row_of_factor(ctx, j);
            row[j] = (row[j] - eits_dot(ctx->kernels, row, above, j)) / above[j];
        }
        const eits_real left = diagonal - eits_dot(ctx->kernels, row, row, i),
                        min = EITS_MIN_PIVOT * diagonal, pivot = left > min ? left : min;
        if (!(pivot > 0) || !eits_is_finite(pivot))
            return R(NAN);
        row[i] = eits_sqrt(pivot);
        log_determinant += eits_log(pivot);
    }
    return log_determinant;
}

int eits_factor_covariance(eits_context *ctx, int drift, eits_real *log_determinant, uint64_t *macs)
{
    const uint32_t rank = ctx->model->rank;
    if (ctx->model->uncertainty.errors == NULL || ctx->whitening.form == EITS_WHITENING_TRIANGLE ||
        ctx->projection.count > 1 || !ctx->options.touch_test)
        return 0;
    const eits_real errors = EITS_ERROR_SHARE * data_energy(ctx), noise = noise_variance(ctx);
    for (uint32_t i = 0; i < rank; ++i)
        covariance_row(ctx, i, errors, drift ? 1 : 0, noise);
    *log_determinant = factor(ctx);
    *macs += (uint64_t)rank * rank * rank / 6u;
    if (!eits_is_finite(*log_determinant))
        return 0;
    eits_copy(ctx->evidence.gain_drift, ctx->projection.basis, EITS_STRIDE(rank));
    ctx->evidence.drifts = 0;
    if (ctx->projection.count == 1) {
        *macs += eits_whiten_errors(ctx, ctx->evidence.gain_drift);
        const eits_real size = eits_sqrt(
            eits_dot(ctx->kernels, ctx->evidence.gain_drift, ctx->evidence.gain_drift, rank));
        for (uint32_t i = 0; i < rank; ++i)
            ctx->evidence.gain_drift[i] /= size;
        ctx->evidence.drifts = 1;
    }
    return 1;
}

uint64_t eits_whiten_errors(const eits_context *ctx, eits_real *v)
{
    const uint32_t rank = ctx->model->rank;
    for (uint32_t i = 0; i < rank; ++i) {
        const eits_real *row = row_of_factor(ctx, i);
        v[i] = (v[i] - eits_dot(ctx->kernels, row, v, i)) / row[i];
    }
    if (ctx->evidence.drifts)
        eits_axpy(ctx->kernels, v, -eits_dot(ctx->kernels, ctx->evidence.gain_drift, v, rank),
                  ctx->evidence.gain_drift, rank);
    return (uint64_t)rank * (rank + 1u) / 2u + (ctx->evidence.drifts ? 2u * rank : 0u);
}
