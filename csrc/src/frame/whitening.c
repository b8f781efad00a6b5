#include "frame/whitening.h"

#include "base/vec.h"
#include "context/projection.h"
#include "context/triangle.h"
#include "frame/constants.h"
#include "frame/reference.h"
#include "kernels/column.h"
#include "kernels/kernels.h"

/* |P|^2.
 *
 * This is the factor by which the energy of white noise grows from the folds to y. */
static eits_real energy_of(const eits_context *ctx, eits_real *copy)
{
    const eits_matrix *p = &ctx->model->reduction;
    eits_real sum = 0;
    for (uint32_t k = 0; k < p->cols; ++k) {
        const eits_real *column = eits_column(p, k, copy);
        sum += eits_dot(ctx->kernels, column, column, p->rows);
    }
    return sum;
}

void eits_whitening_init(eits_context *ctx, const eits_scratch *scratch)
{
    const eits_row_form *form = &ctx->model->row_form;
    ctx->whitening.energy = ctx->whitening.energy_stored = energy_of(ctx, scratch->row[3]);
    ctx->whitening.possible = form->scale != NULL;
    /* The numbers are converted to reals once: a core in double would otherwise convert them in
     * every frame. */
    for (uint32_t i = 0; ctx->whitening.possible && i < ctx->model->rank; ++i) {
        ctx->whitening.row_scale[i] = (eits_real)form->scale[i];
        ctx->whitening.row_strength[i] = (eits_real)form->strength[i];
    }
    ctx->whitening.s1 = (eits_real)form->s1;
    ctx->whitening.s1_square = (eits_real)form->s1_square;
    ctx->whitening.mu = (eits_real)form->mu;
}

static int in_use(const eits_context *ctx, uint32_t k)
{
    return ctx->frame.sides[k] != 0;
}

/* N = U_o' U_o + e I, summed over whichever rows are fewer, those left out or those in use.
 *
 * U = P'diag(1/w) has orthonormal columns over all rows, so the identity minus the sum over the
 * rows left out is the same matrix as the sum over the rows in use, U_o. The one with fewer terms
 * costs less and rounds less. The small e keeps a direction that no row sees from making the matrix
 * singular: such a direction is held near zero instead. */
static uint64_t sum_products(eits_context *ctx, const eits_scratch *scratch, uint32_t missing,
                             eits_real lost, eits_real *n)
{
    const eits_matrix *p = &ctx->model->reduction;
    const int by_missing = missing <= p->cols - missing;
    eits_real *u = scratch->row[3];
    eits_zero(n, EITS_PADDED_TRIANGLE(p->rows));
    for (uint32_t k = 0; k < p->cols; ++k) {
        if (in_use(ctx, k) == by_missing)
            continue;
        const eits_real *column = eits_column(p, k, u);
        for (uint32_t i = 0; i < p->rows; ++i)
            u[i] = column[i] * ctx->whitening.row_scale[i] * ctx->whitening.s1;
        for (uint32_t i = 0; i < p->rows; ++i)
            add_row(ctx, i, row_of(ctx, n, i), u[i], u);
    }
    for (uint32_t i = 0; i < p->rows; ++i) {
        eits_real *row = row_of(ctx, n, i);
        for (uint32_t j = i; by_missing && j < p->rows; ++j)
            row[j] = j == i ? 1 - row[j] : -row[j];
        row[i] += lost;
    }
    return (by_missing ? missing : p->cols - missing) * triangle_macs(ctx);
}

/* G G' = R diag(s^2) R' + regularisation I, from the last row up.
 *
 * G is upper triangular, although the product is G G': from the last row up, each row needs only
 * the rows below it. Therefore G^-1 R and F are upper triangular, too, which takes half the memory
 * and half the work of a full matrix in each iteration of a solver. */
static uint64_t factor_metric(eits_context *ctx, const eits_scratch *scratch,
                              eits_real regularisation, eits_real *r, eits_real *g)
{
    const uint32_t rank = ctx->model->rank;
    eits_real *scaled = scratch->row[3];
    uint64_t macs = 0;
    eits_zero(g, EITS_PADDED_TRIANGLE(rank));
    for (uint32_t i = rank; i-- > 0;) {
        eits_real *row = row_of(ctx, g, i);
        for (uint32_t k = first_of(i); k < rank; ++k)
            scaled[k] = row_of(ctx, r, i)[k] * ctx->whitening.row_strength[k];
        for (uint32_t j = rank; j-- > i;) {
            const eits_real product = dot_of_row(ctx, j, scaled, row_of(ctx, r, j));
            /* row[j] is still zero */
            const eits_real left = product - dot_of_row(ctx, j, row, row_of(ctx, g, j));
            if (j > i)
                row[j] = left / row_of(ctx, g, j)[j];
            else
                row[i] = eits_sqrt(left > 0 ? left + regularisation : regularisation);
            macs += 2u * (rank - j) - 1u;
        }
    }
    return macs;
}

/* F = G^-1 R diag(fraction / w) in R's place, from the last row up.
 *
 * The system is solved in place, row by row from below, because row i of G^-1 R needs the rows
 * below it. Scaling by 1 / w comes last, because it scales columns. */
static uint64_t finish_whitening(const eits_context *ctx, eits_real fraction, eits_real *g,
                                 eits_real *r)
{
    const uint32_t rank = ctx->model->rank;
    uint64_t macs = 0;
    for (uint32_t i = rank; i-- > 0;) {
        eits_real *row = row_of(ctx, r, i);
        const eits_real *weight = row_of(ctx, g, i), inverse = 1 / weight[i];
        for (uint32_t k = i + 1; k < rank; ++k) {
            add_row(ctx, k, row, -weight[k], row_of(ctx, r, k));
            macs += rank - k;
        }
        for (uint32_t k = i; k < rank; ++k)
            row[k] *= inverse;
    }
    for (uint32_t i = 0; i < rank; ++i) {
        for (uint32_t k = i; k < rank; ++k)
            row_of(ctx, r, i)[k] *= fraction * ctx->whitening.row_scale[k];
    }
    return macs;
}

/* Noise in S'F'y, over that in S'y with all rows. White noise on the rows has the covariance
 * (G'G)^-1 in y; its mean square over S's columns is the trace of S'F' (G'G)^-1 F S, found by
 * EITS_NOISE_PROBES sign vectors that are orthogonal within each EITS_NOISE_PROBES directions. If
 * rows are left out, the maximum over the columns grows faster than their mean; the exponent was
 * fitted on masks of one row to three electrodes. */
static uint64_t measure_noise(eits_context *ctx, const eits_scratch *scratch)
{
    const uint32_t rank = ctx->model->rank;
    eits_real *v = scratch->row[3], sum = 0, total = 0;
    for (uint32_t p = 0; p < EITS_NOISE_PROBES; ++p) {
        for (uint32_t i = 0; i < rank; ++i) {
            /* The signs are fixed, the rows of a Hadamard matrix: the bits are the same on every
             * target, and all probes differ. */
            const uint32_t both = i & p, odd = (both ^ both >> 1 ^ both >> 2) & 1u;
            const eits_real size =
                eits_sqrt(ctx->whitening.row_strength[i]) / ctx->whitening.row_scale[i];
            v[i] = odd ? -size : size;
        }
        (void)eits_whiten(ctx, v);
        eits_triangle_solve_transposed(ctx, ctx->whitening.metric, v);
        sum += eits_dot(ctx->kernels, v, v, rank);
    }
    for (uint32_t i = 0; i < rank; ++i) {
        const eits_real w2 = 1 / (ctx->whitening.row_scale[i] * ctx->whitening.row_scale[i]);
        total = eits_fma(ctx->whitening.row_strength[i] * w2, w2, total);
    }
    const eits_real of_all = eits_regularisation_noise(ctx, eits_regularisation_of_all(ctx));
    const eits_real ratio =
        eits_sqrt(ctx->whitening.square * sum / (EITS_NOISE_PROBES * total)) / of_all;
    ctx->whitening.noise_ratio = of_all * (ratio * eits_sqrt(eits_sqrt(ratio)));
    return EITS_NOISE_PROBES * 2u * triangle_macs(ctx);
}

eits_real eits_lambda_noise(const eits_context *ctx)
{
    return ctx->whitening.noise_ratio * ctx->reference.lambda_noise;
}

/* A single reference frame shows no noise, but its rounding is known. */
eits_real eits_detection_threshold(const eits_context *ctx)
{
    const eits_real least = eits_lambda_noise_floor(ctx), learned = ctx->reference.lambda_noise;
    return ctx->options.detection_factor * ctx->whitening.noise_ratio * eits_larger(learned, least);
}

/* Raise the regularisation if the noise asks for it; no row is left out here.
 *
 * With all rows in use the directions do not mix: F is one weight per direction and costs almost
 * nothing. */
static void raise_regularisation(eits_context *ctx)
{
    const eits_real regularisation = eits_regularisation_of_all(ctx),
                    noise = eits_regularisation_noise(ctx, regularisation);
    /* a model's rows may be of any size */
    if (!(regularisation > ctx->whitening.mu) || !(noise > 0) || !eits_is_finite(noise))
        return;
    ctx->whitening.form = EITS_WHITENING_DIAGONAL;
    ctx->whitening.mu_in_force = regularisation;
    ctx->whitening.noise_ratio = noise;
    ctx->whitening.energy = ctx->whitening.energy_stored *
                            eits_regularisation_weights(ctx, regularisation, ctx->whitening.map);
}

/* The order is N of the rows in use, its factor R, then G from R, then F from both. R and F share
 * one triangle; before them, N uses the place of the other. If any number overflows, the stored
 * whitening is used, and the rows that are left out are projected out (frame/fold.c), which is less
 * accurate but always defined. */
static uint64_t build_triangle(eits_context *ctx, const eits_scratch *scratch,
                               eits_real regularisation, uint32_t missing)
{
    const eits_real lost = EITS_LOST * regularisation;
    ctx->whitening.square =
        EITS_STEP_MARGIN * ctx->whitening.s1_square * (1 + regularisation) / (1 + lost);
    eits_real *f = ctx->whitening.map, *g = ctx->whitening.metric;
    uint64_t macs = sum_products(ctx, scratch, missing, lost, f);
    macs += eits_triangle_factor(ctx, lost, f);
    macs += factor_metric(ctx, scratch, regularisation, f, g);
    macs += finish_whitening(ctx, eits_sqrt(ctx->whitening.square), g, f);
    ctx->whitening.form = eits_all_finite(f, 2u * EITS_PADDED_TRIANGLE(ctx->model->rank))
                              ? EITS_WHITENING_TRIANGLE
                              : EITS_WHITENING_STORED;
    if (ctx->whitening.form)
        macs += measure_noise(ctx, scratch);
    if (!(ctx->whitening.noise_ratio > 0) || !eits_is_finite(ctx->whitening.noise_ratio)) {
        ctx->whitening.form = EITS_WHITENING_STORED;
        ctx->whitening.noise_ratio = 1;
    }
    ctx->whitening.mu_in_force = ctx->whitening.form ? regularisation : ctx->whitening.mu;
    return macs;
}

/* Build the cheapest whitening that the frame needs: none, weights or triangles. This is called
 * when the sides, the reference or the options have changed, not for every frame. */
uint64_t eits_whitening_build(eits_context *ctx, const eits_scratch *scratch)
{
    const uint32_t folded = ctx->model->n_folded;
    uint32_t missing = 0;
    for (uint32_t k = 0; k < folded; ++k)
        missing += !in_use(ctx, k);
    ctx->whitening.form = EITS_WHITENING_STORED;
    ctx->whitening.noise_ratio = 1;
    if (!ctx->whitening.possible) {
        const uint32_t rank = ctx->model->rank, spare = folded > rank ? folded - rank : 0;
        /* if fewer rows than directions are in use, projecting loses nothing */
        return missing > 0 && missing <= (rank < spare ? rank : spare) &&
                       ctx->model->precision != NULL
                   ? eits_fill_build(ctx, scratch)
                   : 0;
    }
    ctx->whitening.mu_in_force = ctx->whitening.mu;
    ctx->whitening.energy = ctx->whitening.energy_stored;
    if (missing > 0)
        return build_triangle(
            ctx, scratch, eits_regularisation_of_rest(ctx, (eits_real)missing / (eits_real)folded),
            missing);
    raise_regularisation(ctx);
    return 0;
}

/* R'^-1 follows from the triangles that are kept: R = G F diag(w) except for F's scale, so y = G^-1
 * G'^-1 F'^-1 diag(1/w^2) P_o d_o. */
uint64_t eits_whiten_data(eits_context *ctx, eits_real *v)
{
    if (ctx->whitening.form == EITS_WHITENING_DIAGONAL)
        return eits_whiten(ctx, v);
    if (!ctx->whitening.possible) { /* a taught model: the rows left out have been filled in */
        eits_triangle_solve_transposed(ctx, ctx->whitening.map, v);
        return triangle_macs(ctx);
    }
    for (uint32_t i = 0; i < ctx->model->rank; ++i)
        v[i] *= ctx->whitening.square * ctx->whitening.row_scale[i] * ctx->whitening.row_scale[i];
    eits_triangle_solve_transposed(ctx, ctx->whitening.map, v);
    eits_triangle_solve_transposed(ctx, ctx->whitening.metric, v);
    eits_triangle_solve(ctx, ctx->whitening.metric, v);
    return 3u * triangle_macs(ctx);
}

/* y = sqrt(square) G^-1 R'^-1 U_o' d_o / s_1, and U_o' U_o = R'R except for e. So white noise of
 * variance 1 has the covariance square / s_1^2 G^-1 G'^-1. */
uint64_t eits_noise_direction(const eits_context *ctx, uint32_t k, eits_real *out)
{
    const uint32_t rank = ctx->model->rank;
    eits_zero(out, EITS_STRIDE(rank));
    out[k] = eits_sqrt(ctx->whitening.square) / ctx->whitening.s1;
    eits_triangle_solve(ctx, ctx->whitening.metric, out);
    return triangle_macs(ctx);
}
