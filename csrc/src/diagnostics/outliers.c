/* Outliers: rows that disagree with their reciprocals, or with all the other folds. If too many
 * outliers share an electrode, the electrode is noisy.
 *
 * By reciprocity a row and the row with drive and measurement exchanged give the same voltage,
 * whatever the conductivity is (a symmetric linear network). If the two sides of a fold differ, one
 * reading is wrong, and no touch can cause that. Reciprocity does not show which side is wrong: the
 * prediction from all other folds decides that.
 *
 * The prediction is a ridge fit of the data by the model. P's rows are
 * orthogonal, scaled singular vectors of the Jacobian, so the fit is H = P' diag(shrink) P with
 * shrink_i = s_i^2 / (s_i^2 + nu s_1^2) / |P_i|^2 (range.shrink, model_mismatch.c). Leaving folds F
 * out of the fit needs no new fit: their errors are e = (I - H_FF)^-1 (d - H d)_F, exactly (Allen,
 * Technometrics 16 (1974) 125, for one; blockwise for several). So all flagged folds together cost
 * one product with P and a Cholesky factor of at most eight by eight.
 *
 * Without reciprocals only the prediction is available, and at most one fold is left out. If more
 * than eight folds are flagged, the cause is not a single reading but an electrode or channel that
 * nearly all of them share (find_noisy).
 *
 * In: frame.d, .reciprocity_error, .sides of the folded frame; the reference's noise; P. Out: bits
 * in rows.unusable, info. The caller folds the frame again if any row was marked. */
#include "diagnostics/diagnostics.h"

#include "base/cholesky.h"
#include "base/vec.h"
#include "kernels/column.h"

/* This finds a median without sorting, in linear time on average and without more memory. Equal
 * numbers are swapped, which keeps the two parts balanced if many numbers are equal, as with
 * quantised differences. */
eits_real eits_kth(eits_real *v, uint32_t n, uint32_t k)
{
    uint32_t low = 0, high = n - 1;
    while (low < high) { /* Hoare, Comm. ACM 4 (1961) 321 */
        const eits_real pivot = v[low + (high - low) / 2];
        uint32_t i = low, j = high;
        while (i <= j) {
            while (v[i] < pivot)
                ++i;
            while (pivot < v[j])
                --j;
            if (i <= j) {
                const eits_real other = v[i];
                v[i++] = v[j];
                v[j] = other;
                if (j == 0)
                    break;
                --j;
            }
        }
        if (k <= j)
            high = j;
        else if (k >= i)
            low = i;
        else
            break;
    }
    return v[k];
}

/* Limits of the difference between the two sides of a fold. */
typedef struct tolerance {
    /* the limit by the differences of all folds, used if no noise was learned; else 0 */
    eits_real robust;
    eits_real largest; /* fraction of the largest datum */
} tolerance;

/* Two readings of one quantity differ by root two times the noise of one. If data are ratios, the
 * noise of each row is divided by its own reference. */
static eits_real max_by_noise(const eits_context *ctx, uint32_t k)
{
    const eits_reference *b = &ctx->reference;
    if (ctx->model->data_kind != EITS_DATA_NORMALISED)
        return EITS_OUTLIER_NOISE * eits_sqrt(R(2.0)) * eits_fabs(b->gain) * b->noise_v *
               b->row_gain[ctx->model->fold[k].first];
    const eits_real first = b->noise_v / b->v0[ctx->model->fold[k].first],
                    second = b->noise_v / b->v0[ctx->model->fold[k].second];
    return EITS_OUTLIER_NOISE * eits_sqrt(eits_fma(first, first, second * second));
}

/* A fold is flagged if its difference exceeds all three limits: that of noise, a fraction of the
 * frame's greatest datum (a common-mode error scales with it), and a fraction of the fold's own
 * datum (the error of unequal channel gains scales with it). */
static int is_flagged(const eits_context *ctx, uint32_t k, tolerance tol)
{
    if (ctx->frame.sides[k] != EITS_SIDE_BOTH)
        return 0;
    const eits_real off = eits_fabs(ctx->frame.reciprocity_error[k]);
    if (!(off > (ctx->reference.noise_v > 0 ? max_by_noise(ctx, k) : tol.robust)) ||
        !(off > tol.largest))
        return 0;
    return off > EITS_OUTLIER_FRACTION * eits_fma(R(0.5), off, eits_fabs(ctx->frame.d[k]));
}

/* The median of the folds' differences is 0 if reciprocal rows are copies; then no fold is flagged.
 *
 * A learned noise gives a limit for each row; otherwise the differences of this frame give one. A
 * difference that is small beside the greatest datum does no harm in the image. */
static tolerance find_tolerance(const eits_context *ctx, const eits_scratch *scratch)
{
    tolerance tol = {0, 0};
    uint32_t count = 0;
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        const eits_real datum = eits_fabs(ctx->frame.d[k]);
        tol.largest = eits_larger(datum, tol.largest);
        if (ctx->frame.sides[k] == EITS_SIDE_BOTH)
            scratch->value[count++] = eits_fabs(ctx->frame.reciprocity_error[k]);
    }
    tol.largest *= EITS_OUTLIER_LARGEST;
    if (!(ctx->reference.noise_v > 0) && count > 0) {
        const eits_real median = eits_kth(scratch->value, count, count / 2);
        tol.robust = EITS_OUTLIER_ROBUST * EITS_ROBUST * median;
        if (!(median > 0))
            tol.robust = R(INFINITY);
    }
    return tol;
}

/* A row that is left out for another reason keeps that reason, and is not counted twice. */
static void leave_row(eits_context *ctx, uint32_t row)
{
    if (row == EITS_FOLD_NONE || ctx->rows.unusable[row] != 0)
        return;
    eits_leave_outlier(ctx, row);
}

/* ---- prediction by the other folds ---- */

/* H is the fit's matrix for all folds; it is not valid if one is missing. */
static int all_known(const eits_context *ctx)
{
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        if (ctx->frame.sides[k] == 0)
            return 0;
    }
    return 1;
}

/* scratch->row[3] = shrink * P d, so that P_k'sz is the ridge fit of d_k. */
static void fit_all(eits_context *ctx, const eits_scratch *scratch, uint64_t *macs)
{
    eits_real *fit = scratch->row[3];
    const uint32_t rank = ctx->model->rank, folds = ctx->model->n_folded;
    for (uint32_t k = 0; k < folds; ++k)
        scratch->index[k] = k;
    ctx->kernels->mul(&ctx->model->reduction, scratch->index, ctx->frame.d, folds, fit);
    for (uint32_t i = 0; i < rank; ++i)
        fit[i] *= ctx->range.shrink[i];
    *macs += (uint64_t)folds * rank;
}

/* Predict each of the `n` flagged folds F from the other folds, into `out`. With H the ridge fit,
 * the error of d is e = (I - H_FF)^-1 (d - H d)_F. Returns 0 if the others do not determine these
 * folds. */
static int predict(eits_context *ctx, const eits_scratch *scratch, const uint32_t *flagged,
                   uint32_t n, eits_real *out, uint64_t *macs)
{
    eits_real *weighed = scratch->row[0], *copy = scratch->row[1], *fit = scratch->row[3];
    eits_real lower[EITS_LOWER_SIZE(EITS_OUTLIER_MAX)], e[EITS_OUTLIER_MAX];
    const uint32_t rank = ctx->model->rank;
    /* Leaving several folds out follows from one fit to all folds: (I - H_FF) e = (d - H d)_F.
     * There are at most EITS_OUTLIER_MAX folds in F, so this matrix is on the stack. */
    fit_all(ctx, scratch, macs);
    for (uint32_t a = 0; a < n; ++a) {
        const eits_real *column = eits_column(&ctx->model->reduction, flagged[a], copy);
        eits_real *row = eits_lower_row(lower, a);
        e[a] = ctx->frame.d[flagged[a]] - eits_dot(ctx->kernels, column, fit, rank);
        for (uint32_t i = 0; i < rank; ++i)
            weighed[i] = ctx->range.shrink[i] * column[i];
        for (uint32_t b = 0; b <= a; ++b) {
            const eits_real *other = eits_column(&ctx->model->reduction, flagged[b], copy);
            row[b] = (a == b ? R(1.0) : 0) - eits_dot(ctx->kernels, weighed, other, rank);
        }
        const eits_real pivot = eits_cholesky_row(lower, a);
        /* The fit follows this fold's own value: no other fold measures the same. */
        if (!(pivot > EITS_OUTLIER_PIVOT))
            return 0;
        row[a] = eits_sqrt(pivot);
    }
    *macs += (uint64_t)n * (n + 3u) / 2u * rank;
    eits_lower_solve(lower, n, e);
    eits_lower_solve_transposed(lower, n, e);
    for (uint32_t a = 0; a < n; ++a)
        out[a] = ctx->frame.d[flagged[a]] - e[a];
    return 1;
}

/* Keep the side that is clearly nearer to the prediction; if neither is, leave both out.
 *
 * Without one side a fold only has more noise; without both sides a measurement is lost. */
static void choose_sides(eits_context *ctx, const eits_scratch *scratch, const uint32_t *flagged,
                         uint32_t n, uint64_t *macs)
{
    eits_real predicted[EITS_OUTLIER_MAX];
    const int known =
        ctx->range.known && all_known(ctx) && predict(ctx, scratch, flagged, n, predicted, macs);
    for (uint32_t a = 0; a < n; ++a) {
        const eits_fold fold = ctx->model->fold[flagged[a]];
        const eits_real d = ctx->frame.d[flagged[a]],
                        half = R(0.5) * ctx->frame.reciprocity_error[flagged[a]];
        const eits_real first = known ? eits_fabs(d + half - predicted[a]) : 1,
                        second = known ? eits_fabs(d - half - predicted[a]) : 1;
        /* If neither is clearly nearer, it is unknown which one is wrong. */
        if (!(first <= EITS_OUTLIER_NEARER * second))
            leave_row(ctx, fold.first);
        if (!(second <= EITS_OUTLIER_NEARER * first))
            leave_row(ctx, fold.second);
    }
}

/* ---- too many to be outliers ---- */

/* If the flagged folds share one pair, its channel is at fault: the rows that are measured across
 * the pair are left out, and their reciprocals stay. */
static void leave_channel(eits_context *ctx, uint32_t e, uint32_t f)
{
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        if (eits_is_pair(eits_row(ctx, i) + 2, e, f))
            ctx->rows.unusable[i] |= EITS_ROW_NOISY;
    }
}

/* Return 1 if each flagged fold drives across (e, f) on one side and measures across it on the
 * other.
 */
static int is_channel(const eits_context *ctx, uint32_t e, uint32_t f, tolerance tol)
{
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        if (!is_flagged(ctx, k, tol))
            continue;
        const uint8_t *row = eits_row(ctx, ctx->model->fold[k].first);
        if (!eits_is_pair(row, e, f) && !eits_is_pair(row + 2, e, f))
            return 0;
    }
    return 1;
}

/* Find the electrodes that nearly all flagged folds use.
 *
 * There are more flagged folds than single wrong readings would cause, so the cause is something
 * that they share: one electrode, or two (a pair, perhaps one channel). If they share nothing, the
 * cause is not a bad contact. */
static void find_noisy(eits_context *ctx, uint32_t count, tolerance tol)
{
    uint16_t shared[EITS_MAX_ELECTRODES] = {0};
    uint32_t found[2] = {0}, any = 0;
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        if (!is_flagged(ctx, k, tol))
            continue;
        for (uint32_t p = 0; p < 4; ++p)
            ++shared[eits_row(ctx, ctx->model->fold[k].first)[p]];
    }
    for (uint32_t e = 0; e < ctx->model->n_electrodes; ++e) {
        if (!((eits_real)shared[e] >= EITS_NOISY_FRACTION * (eits_real)count))
            continue;
        found[any < 2 ? any : 1] = e;
        ++any;
    }
    if (any == 0) { /* no reciprocal network gives such data */
        ctx->info.diagnostics |=
            eits_wants(ctx, EITS_DIAGNOSTIC_MODEL_MISMATCH) ? EITS_DIAGNOSTIC_MODEL_MISMATCH : 0;
        return;
    }
    if (!eits_wants(ctx, EITS_DIAGNOSTIC_ELECTRODE_NOISY))
        return;
    for (uint32_t e = 0; e < ctx->model->n_electrodes; ++e)
        ctx->rows.electrode[e] |= (eits_real)shared[e] >= EITS_NOISY_FRACTION * (eits_real)count
                                      ? EITS_ELECTRODE_NOISY
                                      : 0;
    ctx->info.diagnostics |= EITS_DIAGNOSTIC_ELECTRODE_NOISY;
    eits_name_electrodes(ctx);
    /* With a faulty amplifier channel, unlike a bad electrode, only measurements are wrong and
     * drives are right. */
    if (any == 2 && is_channel(ctx, found[0], found[1], tol))
        leave_channel(ctx, found[0], found[1]);
    else
        eits_leave_electrodes(ctx, EITS_ELECTRODE_NOISY, EITS_ROW_NOISY);
}

/* ---- without reciprocals ---- */

/* Without reciprocals only the model can check a reading: an outlier is the fold that the others
 * predict worst. At most one is left out, and only if its error is far above the other prediction
 * errors, because a touch of an unknown shape is predicted badly as well. */
int eits_find_unpaired_outlier(eits_context *ctx, const eits_scratch *scratch, uint64_t *macs)
{
    eits_real *copy = scratch->row[0], *fit = scratch->row[3], *error = scratch->value;
    const uint32_t folds = ctx->model->n_folded, rank = ctx->model->rank;
    for (uint32_t k = 0; k < folds; ++k) {
        if (ctx->frame.sides[k] == EITS_SIDE_BOTH && ctx->frame.reciprocity_error[k] != 0)
            return 0;
    }
    for (uint32_t i = 0; i < rank; ++i)
        fit[i] = ctx->range.shrink[i] * ctx->frame.y[i];
    eits_real worst = 0, energy = 0;
    uint32_t at = 0;
    for (uint32_t k = 0; k < folds; ++k) {
        const eits_real *column = eits_column(&ctx->model->reduction, k, copy);
        eits_real leverage = 0;
        const eits_real off =
            eits_fabs(ctx->frame.d[k] - eits_dot(ctx->kernels, column, fit, rank));
        for (uint32_t i = 0; i < rank; ++i)
            leverage = eits_fma(ctx->range.shrink[i] * column[i], column[i], leverage);
        const eits_real left = 1 - leverage;
        energy = eits_fma(off, off, energy);
        error[k] = left > EITS_OUTLIER_PIVOT ? off / eits_sqrt(left) : 0;
        if (error[k] > worst) {
            worst = error[k];
            at = k;
        }
    }
    *macs += 2u * (uint64_t)folds * rank;
    /* The fold must have half of the energy and an error far above the others: the errors of a
     * touch whose shape the model lacks are spread over many folds. */
    if (!(worst * worst > EITS_OUTLIER_ENERGY * energy) ||
        !(worst > EITS_OUTLIER_UNPAIRED * EITS_ROBUST * eits_kth(error, folds, folds / 2)))
        return 0;
    leave_row(ctx, ctx->model->fold[at].first);
    leave_row(ctx, ctx->model->fold[at].second);
    return 1;
}

/* The data must be folded. A few flagged folds are single wrong readings; many have a common cause.
 */
int eits_find_outliers(eits_context *ctx, const eits_scratch *scratch, uint64_t *macs)
{
    uint32_t flagged[EITS_OUTLIER_MAX], count = 0;
    const tolerance tol = find_tolerance(ctx, scratch);
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        if (!is_flagged(ctx, k, tol))
            continue;
        if (count < EITS_OUTLIER_MAX)
            flagged[count] = k;
        ++count;
    }
    if (count == 0)
        return 0;
    if (count > EITS_OUTLIER_MAX)
        find_noisy(ctx, count, tol);
    else if (eits_wants(ctx, EITS_DIAGNOSTIC_OUTLIER))
        choose_sides(ctx, scratch, flagged, count, macs);
    return (ctx->info.diagnostics & (EITS_DIAGNOSTIC_OUTLIER | EITS_DIAGNOSTIC_ELECTRODE_NOISY)) !=
           0;
}
