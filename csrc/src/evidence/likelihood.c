/* F, its linearisation about discs, and the discs that make it least.
 *
 * With columns C = R'^-1 dy/dparameter, what is left b = R'^-1 (y - answers) and prior precisions
 * H, F about the discs is |b - C s|^2 + (t + s)'H (t + s) for a step s from parameters that are t
 * off their prior's middle: A = C'C + H, s = A^-1 (C'b - H t). One inverse of A (at most 64 x 64)
 * tells the step, what F would be without each disc (a Schur complement), and how well each place
 * is known. */
#include "evidence/evidence.h"

#include "base/cholesky.h"
#include "base/vec.h"
#include "evidence/constants.h"
#include "kernels/kernels.h"

typedef eits_real block[EITS_LOWER_SIZE(EITS_SHAPE_PARAMETERS)];

/* 1 / deviation^2 of a parameter's prior. Strength and place have no prior. */
static eits_real precision(uint32_t parameter)
{
    if (parameter < EITS_PLACE_PARAMETERS - 1)
        return EITS_FREE_PRECISION;
    return parameter < EITS_EDGE_PARAMETERS ? EITS_SHAPE_PRECISION : EITS_DIPOLE_PRECISION;
}

/* The distance of a parameter from the middle of its prior. */
static eits_real offset(const eits_answer *answer, uint32_t k, uint32_t parameter)
{
    if (parameter < EITS_PLACE_PARAMETERS - 1)
        return 0;
    if (parameter == EITS_PLACE_PARAMETERS - 1)
        return answer->disc[k].radius_mm / answer->radius_mm[k] - 1;
    return answer->shape[k][parameter - EITS_PLACE_PARAMETERS];
}

/* The priors' part of F. It is summed touch by touch in the order of parameters, so that its bits
 * are the same on every target.
 */
static eits_real prior_of(const eits_answer *answer)
{
    eits_real sum = 0;
    for (uint32_t k = 0; k < answer->count; ++k) {
        for (uint32_t p = 0; p < answer->parameters; ++p) {
            const eits_real off = offset(answer, k, p);
            sum = eits_fma(precision(p) * off, off, sum);
        }
    }
    return sum;
}

/* Rows begin at a vector's boundary, as the kernels want them. */
static eits_real *row_of_square(const eits_scratch *scratch, uint32_t count, uint32_t i)
{
    return scratch->square + EITS_STRIDE(count) * i;
}

/* A in the square's lower triangle becomes L, A = L L'.
 *
 * Two discs at one place have the same columns, and their pivot is rounding: it is held up at a
 * fraction of the diagonal. The step along such a direction is then short instead of infinite. */
static void factor(const eits_context *ctx, const eits_scratch *scratch, uint32_t n)
{
    for (uint32_t i = 0; i < n; ++i) {
        eits_real *row = row_of_square(scratch, n, i);
        const eits_real diagonal = row[i];
        for (uint32_t j = 0; j < i; ++j) {
            const eits_real *above = row_of_square(scratch, n, j);
            row[j] = (row[j] - eits_dot(ctx->kernels, row, above, j)) / above[j];
        }
        const eits_real left = diagonal - eits_dot(ctx->kernels, row, row, i),
                        min = EITS_MIN_PIVOT * diagonal;
        row[i] = eits_sqrt(left > min ? left : min);
    }
}

/* L in the lower triangle becomes A^-1, whole. First L^-1 in its place, then L^-T L^-1. */
static void invert(const eits_context *ctx, const eits_scratch *scratch, uint32_t n)
{
    for (uint32_t i = 0; i < n; ++i) {
        eits_real *row = row_of_square(scratch, n, i);
        const eits_real pivot = 1 / row[i];
        /* row i of L^-1 = -(row i of L) L^-1 / L_ii, from the rows above, which are done */
        eits_real out[EITS_EVIDENCE_COLUMNS] = {0};
        for (uint32_t j = 0; j < i; ++j)
            eits_axpy(ctx->kernels, out, -row[j], row_of_square(scratch, n, j), j + 1u);
        for (uint32_t j = 0; j < i; ++j)
            row[j] = out[j] * pivot;
        row[i] = pivot;
        eits_zero(row + i + 1, EITS_STRIDE(n) - i - 1u);
    }
    /* A^-1_ij = sum over k >= i of M_ki M_kj, M = L^-1, j <= i: from the top, each needs rows that
     * are still M's. */
    for (uint32_t i = 0; i < n; ++i) {
        eits_real *row = row_of_square(scratch, n, i), out[EITS_EVIDENCE_COLUMNS] = {0};
        for (uint32_t k = i; k < n; ++k) {
            const eits_real *below = row_of_square(scratch, n, k);
            eits_axpy(ctx->kernels, out, below[i], below, i + 1u);
        }
        eits_copy(row, out, i + 1u);
    }
    for (uint32_t i = 0; i < n; ++i) {
        for (uint32_t j = i + 1; j < n; ++j)
            row_of_square(scratch, n, i)[j] = row_of_square(scratch, n, j)[i];
    }
}

int eits_may_make(eits_context *ctx, uint32_t columns)
{
    const uint32_t made = ctx->evidence.columns_made, most = ctx->evidence.columns_most;
    const int may = made <= most && columns <= most - made;
    ctx->evidence.spent |= !may;
    return may;
}

uint64_t eits_linearise(eits_context *ctx, const eits_scratch *scratch, const eits_answer *answer,
                        eits_likelihood *out)
{
    const uint32_t rank = ctx->model->rank, n = answer->count * answer->parameters;
    const size_t stride = EITS_STRIDE(rank);
    eits_real gradient[EITS_EVIDENCE_COLUMNS];
    uint64_t macs = 0;
    out->count = n;
    out->at_hand = 1;
    ctx->evidence.columns_made += n;
    eits_copy(ctx->evidence.left, ctx->evidence.data, stride);
    for (uint32_t k = 0; k < answer->count; ++k)
        macs += eits_shape_columns(ctx, scratch, answer, k);
    out->here =
        eits_dot(ctx->kernels, ctx->evidence.left, ctx->evidence.left, rank) + prior_of(answer);
    for (uint32_t i = 0; i < n; ++i) {
        const uint32_t k = i / answer->parameters, p = i % answer->parameters;
        const eits_real *column = ctx->evidence.column + stride * i, off = offset(answer, k, p);
        eits_real *row = row_of_square(scratch, n, i);
        ctx->kernels->rows_dot(ctx->evidence.column, stride, i + 1u, stride, column, row);
        row[i] += precision(p);
        gradient[i] =
            eits_fma(-precision(p), off, eits_dot(ctx->kernels, column, ctx->evidence.left, rank));
    }
    factor(ctx, scratch, n);
    invert(ctx, scratch, n);
    out->least = out->here;
    for (uint32_t i = 0; i < n; ++i) {
        out->step[i] = eits_dot(ctx->kernels, row_of_square(scratch, n, i), gradient, n);
        out->least = eits_fma(-gradient[i], out->step[i], out->least);
    }
    return macs + (uint64_t)n * (n + 1u) / 2u * rank + (uint64_t)n * n * n / 2u;
}

/* The block of A^-1 of disc k's parameters, as L L', and w = L^-1 q, q how far these are from where
 * there is no such disc: no strength, and radius and shape as their priors like them best. Returns
 * |w|^2 = q'B^-1 q: what the least F rises by with the parameters held there. */
static eits_real hold(const eits_scratch *scratch, const eits_answer *answer,
                      const eits_likelihood *likelihood, uint32_t k, block l, eits_real *w)
{
    const uint32_t p = answer->parameters, n = likelihood->count, first = k * p;
    eits_real rise = 0;
    for (uint32_t i = 0; i < p; ++i) {
        const eits_real *row = row_of_square(scratch, n, first + i) + first;
        const eits_real held = i == 0 ? -1 : -offset(answer, k, i);
        eits_copy(eits_lower_row(l, i), row, i + 1u);
        const eits_real pivot = eits_cholesky_row(l, i), min = EITS_MIN_PIVOT * row[i];
        eits_lower_row(l, i)[i] = eits_sqrt(pivot > min ? pivot : min);
        w[i] = likelihood->step[first + i] - held;
    }
    eits_lower_solve(l, p, w);
    for (uint32_t i = 0; i < p; ++i)
        rise = eits_fma(w[i], w[i], rise);
    return rise;
}

eits_real eits_linear_rise(const eits_scratch *scratch, const eits_answer *answer,
                           const eits_likelihood *likelihood, uint32_t k)
{
    block l;
    eits_real w[EITS_SHAPE_PARAMETERS];
    return hold(scratch, answer, likelihood, k, l, w);
}

/* Rows and columns from..from + count - 1 go from the inverse and the step; rows from the
 * columns. */
static void close_up(eits_context *ctx, const eits_scratch *scratch, eits_likelihood *likelihood,
                     uint32_t from, uint32_t count)
{
    const uint32_t n = likelihood->count, left = n - count, after = left - from;
    const size_t stride = EITS_STRIDE(ctx->model->rank);
    for (uint32_t i = 0; i < left; ++i) { /* each to a place at or before its own */
        const eits_real *row = row_of_square(scratch, n, i < from ? i : i + count);
        eits_real *to = row_of_square(scratch, left, i);
        eits_copy(to, row, from);
        eits_copy(to + from, row + from + count, after);
    }
    eits_real *column = ctx->evidence.column + stride * from, *step = likelihood->step + from;
    eits_copy(column, column + stride * count, stride * after);
    eits_copy(step, step + count, after);
    likelihood->count = left;
}

/* With W = L^-1 times the block's rows of A^-1, the others' inverse is A^-1 - W'W and their step
 * s - W'w (Schur's complement). W takes the place of the disc's columns. */
uint64_t eits_linear_drop(eits_context *ctx, const eits_scratch *scratch, eits_answer *answer,
                          eits_likelihood *likelihood, uint32_t k)
{
    const uint32_t p = answer->parameters, n = likelihood->count, first = k * p,
                   rank = ctx->model->rank;
    const size_t stride = EITS_STRIDE(rank);
    eits_real w[EITS_SHAPE_PARAMETERS], *of_block = ctx->evidence.column + stride * first;
    block l;
    likelihood->least += hold(scratch, answer, likelihood, k, l, w);
    for (uint32_t i = 0; i < p; ++i) {
        eits_real *row = of_block + stride * i;
        eits_axpy(ctx->kernels, ctx->evidence.left, eits_shape_part(answer, k, i), row, rank);
        eits_copy(row, row_of_square(scratch, n, first + i), n);
        for (uint32_t m = 0; m < i; ++m)
            eits_axpy(ctx->kernels, row, -eits_lower_row(l, i)[m], of_block + stride * m, n);
        for (uint32_t j = 0; j < n; ++j)
            row[j] /= eits_lower_row(l, i)[i];
    }
    for (uint32_t i = 0; i < p; ++i) {
        const eits_real *row = of_block + stride * i;
        eits_axpy(ctx->kernels, likelihood->step, -w[i], row, n);
        for (uint32_t j = 0; j < n; ++j)
            eits_axpy(ctx->kernels, row_of_square(scratch, n, j), -row[j], row, n);
    }
    close_up(ctx, scratch, likelihood, first, p);
    eits_leave_out(answer, k);
    likelihood->here =
        eits_dot(ctx->kernels, ctx->evidence.left, ctx->evidence.left, rank) + prior_of(answer);
    return (uint64_t)p * (n * (n + p) + 2u * rank);
}

/* The factor by which a step is longer than the linearisation holds; it is at least 1. */
static eits_real too_long(const eits_context *ctx, const eits_answer *from, const eits_real *step)
{
    const eits_real radius = EITS_MAX_RADIUS_MOVE * (eits_real)ctx->model->pixel_mm;
    eits_real over = 1;
    for (uint32_t k = 0; k < from->count; ++k) {
        const eits_real *s = step + k * from->parameters,
                        part[] = {s[0] / EITS_LEAST_CHANGE, s[0] / EITS_MOST_CHANGE,
                                  eits_fabs(s[1]) / EITS_MAX_MOVE, eits_fabs(s[2]) / EITS_MAX_MOVE,
                                  eits_fabs(from->radius_mm[k] * s[3]) / radius};
        for (size_t i = 0; i < sizeof part / sizeof part[0]; ++i)
            over = part[i] > over ? part[i] : over;
    }
    return over;
}

/* The answer moved by a step. A step that is too long is shortened as a whole: near discs give to
 * and take from each other, and if the parts of a step were bounded one by one they would no longer
 * make up for each other. A place off the skin is refused; strength and shape still move. */
static eits_answer moved(const eits_context *ctx, const eits_answer *from, const eits_real *step,
                         eits_real fraction)
{
    const eits_options *o = &ctx->options;
    const eits_real pixel = (eits_real)ctx->model->pixel_mm,
                    part = fraction / too_long(ctx, from, step);
    eits_answer to = *from;
    for (uint32_t k = 0; k < to.count; ++k) {
        const eits_real *s = step + k * to.parameters;
        eits_disc *disc = &to.disc[k];
        disc->change *= eits_fma(part, s[0], 1);
        eits_disc there = *disc;
        there.x_mm += part * pixel * s[1];
        there.y_mm += part * pixel * s[2];
        there.radius_mm = eits_clamp(disc->radius_mm + part * to.radius_mm[k] * s[3],
                                     o->touch_min_radius_mm, o->touch_max_radius_mm);
        if (eits_disc_on_skin(ctx, &there))
            *disc = there;
        for (uint32_t p = EITS_PLACE_PARAMETERS; p < to.parameters; ++p)
            to.shape[k][p - EITS_PLACE_PARAMETERS] += part * s[p];
    }
    return to;
}

/* F of an answer alone, without slopes. */
static uint64_t misfit_of(eits_context *ctx, const eits_scratch *scratch, const eits_answer *answer,
                          eits_real *misfit)
{
    const uint32_t rank = ctx->model->rank;
    eits_real *left = scratch->row[4];
    const uint64_t macs = eits_shape_residual(ctx, scratch, answer, left);
    ctx->evidence.columns_made += EITS_TRIAL_COLUMNS * answer->count;
    *misfit = eits_dot(ctx->kernels, left, left, rank) + prior_of(answer);
    return macs + rank;
}

uint64_t eits_refit(eits_context *ctx, const eits_scratch *scratch, eits_answer *answer,
                    eits_likelihood *likelihood, eits_real enough, eits_real hopeless)
{
    const uint32_t columns = answer->count * answer->parameters,
                   trial_columns = EITS_TRIAL_COLUMNS * answer->count;
    uint64_t macs = 0;
    if (answer->count == 0) {
        likelihood->at_hand = 0;
        answer->misfit =
            eits_dot(ctx->kernels, ctx->evidence.data, ctx->evidence.data, ctx->model->rank);
        return ctx->model->rank;
    }
    if (!likelihood->at_hand && !eits_may_make(ctx, columns)) {
        answer->misfit = R(INFINITY);
        return 0;
    }
    if (!likelihood->at_hand)
        macs += eits_linearise(ctx, scratch, answer, likelihood);
    eits_real fraction = 1;
    for (int step = 0; step < EITS_REFIT_STEPS && likelihood->here > enough; ++step) {
        /* what stands is linearised by whom it concerns, if need be: that is left over */
        const uint32_t again = likelihood->at_hand ? 0 : columns;
        if (!eits_may_make(ctx, again + trial_columns + columns))
            break;
        if (!likelihood->at_hand)
            macs += eits_linearise(ctx, scratch, answer, likelihood);
        if (likelihood->here - likelihood->least < EITS_SETTLED_MISFIT ||
            likelihood->least > hopeless)
            break;
        const eits_answer trial = moved(ctx, answer, likelihood->step, fraction);
        eits_real misfit;
        macs += misfit_of(ctx, scratch, &trial, &misfit);
        /* Only a better answer is taken, so that no refit makes an answer worse. Otherwise a
         * shorter step from the same linearisation is tried. */
        if (misfit < likelihood->here) {
            *answer = trial;
            likelihood->here = misfit;
            likelihood->at_hand = 0;
            fraction = 1;
        } else {
            fraction *= EITS_SHORTER;
        }
    }
    answer->misfit = likelihood->here;
    return macs;
}
