/* The covariance of what the model cannot explain, and its Cholesky factor R, Sigma = R'R.
 *
 *     Sigma_ij = sigma^2 |P_i|^2 [i = j] + share |d|^2 (P E P')_ij (+ (P D P')_ij)
 *
 * P's rows are orthogonal (eits_row_form), so that white noise stays uncorrelated. Where the
 * regularisation is raised for this frame, the reduced data are F y with F diagonal, and so is
 * Sigma's: F Sigma F. Rows left out make F a triangle: F (errors) F', and the noise of the rows
 * that are left (frame/whitening.c).
 *
 * The gain's drift is projected out of y and of all answers. It is projected out once more in the
 * metric of Sigma, so that explaining it costs nothing.
 *
 * The factor costs rank^3 / 6 multiply-accumulates, and each vector costs rank^2 / 2. */
#include "evidence/evidence.h"

#include "base/log.h"
#include "base/vec.h"
#include "context/triangle.h"
#include "diagnostics/diagnostics.h"
#include "evidence/constants.h"
#include "frame/whitening.h"
#include "kernels/kernels.h"

/* The mean variance of a fold in use, in model volts^2. */
static eits_real noise_variance(const eits_context *ctx)
{
    const eits_real min = EITS_ERROR_MIN_NOISE * ctx->reference.gain * ctx->reference.v0_rms;
    uint32_t used = 0;
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k)
        used += ctx->frame.sides[k] != EITS_SIDE_NONE;
    const eits_real learned = eits_noise_energy(ctx) / (eits_real)(used > 0 ? used : 1u);
    return learned > min * min ? learned : min * min;
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

/* Row i of R: its columns from first_of(i) on, zeros before i. */
static eits_real *row_of_factor(const eits_context *ctx, uint32_t i)
{
    return ctx->evidence.factor + EITS_STRIDE(ctx->model->rank) * i;
}

/* The factors of the three parts of which Sigma is the sum: the model's errors, the sheet's drift
 * and white noise. */
typedef struct shares {
    eits_real errors, drift, noise;
} shares;

/* Element j of row i of the errors' part, j <= i. */
static inline eits_real error_at(const eits_context *ctx, shares of, uint32_t i, uint32_t j)
{
    const eits_uncertainty *u = &ctx->model->uncertainty;
    const size_t at = (size_t)i * (i + 1u) / 2u + j;
    const eits_real error = of.errors * (eits_real)u->errors[at];
    return of.drift > 0 ? eits_fma(of.drift, (eits_real)u->drift[at], error) : error;
}

/* Sigma's rows from their diagonals on, where F is 1 or diagonal. */
static void covariance(const eits_context *ctx, shares of)
{
    const size_t stride = EITS_STRIDE(ctx->model->rank);
    const eits_uncertainty *u = &ctx->model->uncertainty;
    const eits_real *weight =
        ctx->whitening.form == EITS_WHITENING_DIAGONAL ? ctx->whitening.map : NULL;
    const float *error = u->errors, *drift = u->drift; /* triangles row after row */
    for (uint32_t i = 0; i < ctx->model->rank; error += i + 1u, drift += i + 1u, ++i) {
        eits_real *column = ctx->evidence.factor + i;
        for (uint32_t j = 0; j <= i; ++j)
            column[stride * j] = of.errors * (eits_real)error[j];
        for (uint32_t j = 0; of.drift > 0 && j <= i; ++j)
            column[stride * j] = eits_fma(of.drift, (eits_real)drift[j], column[stride * j]);
        column[stride * i] =
            eits_fma(of.noise, (eits_real)ctx->model->row_form.energy[i], column[stride * i]);
        for (uint32_t j = 0; weight != NULL && j <= i; ++j)
            column[stride * j] *= weight[i] * weight[j];
    }
}

/* The same where rows are left out: F M F' with F a triangle, and noise by its directions. */
static uint64_t covariance_of_rest(const eits_context *ctx, const eits_scratch *scratch, shares of)
{
    const uint32_t rank = ctx->model->rank;
    const size_t stride = EITS_STRIDE(rank);
    eits_real *product = scratch->square, *row_of_errors = scratch->row[1];
    uint64_t macs = (uint64_t)rank * rank * rank;
    eits_zero(product, rank * stride);
    for (uint32_t k = 0; k < rank; ++k) {
        eits_zero(row_of_errors, stride);
        for (uint32_t j = 0; j < rank; ++j)
            row_of_errors[j] = j <= k ? error_at(ctx, of, k, j) : error_at(ctx, of, j, k);
        for (uint32_t i = 0; i <= k; ++i)
            eits_axpy(ctx->kernels, product + stride * i, row_of(ctx, ctx->whitening.map, i)[k],
                      row_of_errors, rank);
    }
    for (uint32_t i = 0; i < rank; ++i) {
        eits_real *row = row_of_factor(ctx, i);
        for (uint32_t j = i; j < rank; ++j)
            row[j] = dot_of_row(ctx, j, product + stride * i, row_of(ctx, ctx->whitening.map, j));
    }
    for (uint32_t k = 0; k < rank; ++k) {
        macs += eits_noise_direction(ctx, k, row_of_errors);
        for (uint32_t i = 0; i < rank; ++i)
            add_row(ctx, i, row_of_factor(ctx, i), of.noise * row_of_errors[i], row_of_errors);
    }
    return macs + (uint64_t)rank * rank * rank / 2u;
}

/* Sigma = R'R in the rows' place: of each row all above it at once, in the order in which one after
 * the other would be taken. Returns log det Sigma; NaN where that is out of range (volts
 * or errors at the ends of it). */
static eits_real factor(const eits_context *ctx, eits_real *minus)
{
    const uint32_t rank = ctx->model->rank;
    const size_t stride = EITS_STRIDE(rank);
    eits_real log_determinant = 0;
    for (uint32_t i = 0; i < rank; ++i) {
        eits_real *row = row_of_factor(ctx, i);
        const eits_real diagonal = row[i];
        const uint32_t first = first_of(i);
        for (uint32_t k = 0; k < i; ++k)
            minus[k] = -row_of_factor(ctx, k)[i];
        ctx->kernels->rows_add(ctx->evidence.factor + first, stride, i, stride - first, minus,
                               row + first);
        const eits_real min = EITS_MIN_PIVOT * diagonal, pivot = row[i] > min ? row[i] : min,
                        root = eits_sqrt(pivot), inverse = 1 / root;
        if (!(pivot > 0) || !eits_is_finite(pivot))
            return R(NAN);
        log_determinant += eits_log(pivot);
        eits_zero(row + first, i - first);
        eits_zero(row + rank, stride - rank);
        row[i] = root;
        for (uint32_t j = i + 1; j < rank; ++j)
            row[j] *= inverse;
    }
    return log_determinant;
}

int eits_factor_covariance(eits_context *ctx, const eits_scratch *scratch, int drift,
                           eits_real *log_determinant, uint64_t *macs)
{
    const uint32_t rank = ctx->model->rank;
    if (ctx->model->uncertainty.errors == NULL || ctx->projection.count > 1 ||
        !ctx->options.touch_test)
        return 0;
    const shares of = {EITS_ERROR_SHARE * data_energy(ctx), drift ? 1 : 0, noise_variance(ctx)};
    if (ctx->whitening.form == EITS_WHITENING_TRIANGLE)
        *macs += covariance_of_rest(ctx, scratch, of);
    else
        covariance(ctx, of);
    *log_determinant = factor(ctx, scratch->row[2]);
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

/* Eight numbers of R'^-1 v in the place of v's; and what they take from the rest of v, the other
 * way round, in `minus`. */
static void solve_eight(const eits_real *restrict rows, size_t stride, eits_real *restrict eight,
                        eits_real *restrict minus)
{
    eits_real left[8];
    for (uint32_t j = 0; j < 8; ++j)
        left[j] = eight[j];
    for (uint32_t i = 0; i < 8; ++i, rows += stride) {
        eight[i] = left[i] / rows[i];
        minus[i] = -eight[i];
        for (uint32_t j = 0; j < 8; ++j) /* those up to i have done their part */
            left[j] = eits_fma(minus[i], rows[j], left[j]);
    }
}

uint64_t eits_whiten_errors(const eits_context *ctx, eits_real *v)
{
    const uint32_t rank = ctx->model->rank;
    const size_t stride = EITS_STRIDE(rank);
    uint32_t i = 0;
    for (; i + 8 <= rank; i += 8) {
        const eits_real *rows = row_of_factor(ctx, i) + i;
        eits_real minus[8];
        solve_eight(rows, stride, v + i, minus);
        ctx->kernels->rows_add(rows + 8, stride, 8, stride - i - 8, minus, v + i + 8);
    }
    for (; i < rank; ++i) {
        const eits_real *row = row_of_factor(ctx, i), known = v[i] / row[i];
        add_row(ctx, i, v, -known, row);
        v[i] = known;
    }
    if (ctx->evidence.drifts)
        eits_axpy(ctx->kernels, v, -eits_dot(ctx->kernels, ctx->evidence.gain_drift, v, rank),
                  ctx->evidence.gain_drift, rank);
    return (uint64_t)rank * (rank + 1u) / 2u + (ctx->evidence.drifts ? 2u * rank : 0u);
}
