/* Find data that lie outside the model's range, and a reference that was taken with a touch on the
 * skin. */
#include "diagnostics/diagnostics.h"

#include "base/vec.h"
#include "context/projection.h"
#include "frame/reference.h"
#include "frame/whitening.h"
#include "kernels/column.h"

/* The rows of P are orthogonal, so |d|^2 - sum (P d)_i^2 / |P_i|^2 is the squared part of d outside
 * their range. `shrink` has the ridge weights s_i^2 / (s_i^2 + nu s_1^2) over |P_i|^2, so P' shrink
 * P d is the prediction of d. */
void eits_learn_range(eits_context *ctx)
{
    const eits_row_form *form = &ctx->model->row_form;
    const uint32_t rank = form->scale == NULL ? 0 : ctx->model->rank;
    eits_real max = 0;
    for (uint32_t i = 0; i < rank; ++i)
        max = (eits_real)form->square[i] > max ? (eits_real)form->square[i] : max;
    for (uint32_t i = 0; i < rank; ++i) {
        const eits_real squared = (eits_real)form->square[i];
        ctx->range.inverse[i] = 1 / (eits_real)form->energy[i];
        ctx->range.shrink[i] =
            squared / eits_fma(EITS_OUTLIER_RIDGE, max, squared) * ctx->range.inverse[i];
    }
    ctx->range.known = rank > 0 && eits_all_finite(ctx->range.shrink, rank);
}

/* Compute range.off_range, the part of gain drift outside the model's range: along - P' |P_i|^-2 P
 * along. The vector itself is computed, because a difference of squared sums would consist of
 * rounding.
 *
 * This is done once per basis. Gain drift moves the data along the reference, a part of which lies
 * outside the model's range. That part is not a fault of the frame. */
static uint64_t learn_off_range(eits_context *ctx, const eits_scratch *scratch)
{
    eits_real *copy = scratch->row[0], *seen = scratch->row[3];
    const uint32_t folds = ctx->model->n_folded, rank = ctx->model->rank;
    for (uint32_t k = 0; k < folds; ++k)
        scratch->index[k] = k;
    ctx->kernels->mul(&ctx->model->reduction, scratch->index, ctx->projection.gain_drift, folds,
                      seen);
    for (uint32_t i = 0; i < rank; ++i)
        seen[i] *= ctx->range.inverse[i];
    for (uint32_t k = 0; k < folds; ++k) {
        const eits_real *column = eits_column(&ctx->model->reduction, k, copy);
        ctx->range.off_range[k] =
            ctx->projection.gain_drift[k] - eits_dot(ctx->kernels, column, seen, rank);
    }
    ctx->range.off_range_build = ctx->projection.builds;
    return 2u * (uint64_t)folds * rank;
}

eits_real eits_fold_noise(const eits_context *ctx, uint32_t k)
{
    const eits_reference *b = &ctx->reference;
    const uint32_t i = ctx->frame.sides[k] == EITS_SIDE_SECOND ? ctx->model->fold[k].second
                                                               : ctx->model->fold[k].first;
    if (ctx->frame.sides[k] == EITS_SIDE_NONE) /* it may have no reference at all */
        return 0;
    const eits_real noise = ctx->model->data_kind == EITS_DATA_NORMALISED
                                ? b->noise_v / b->v0[i]
                                : b->gain * b->noise_v * b->row_gain[i],
                    each = noise * noise;
    return ctx->frame.sides[k] == EITS_SIDE_BOTH && ctx->frame.reciprocity_error[k] != 0
               ? R(0.5) * each
               : each;
}

eits_real eits_noise_energy(const eits_context *ctx)
{
    eits_real sum = 0;
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k)
        sum += eits_fold_noise(ctx, k);
    return sum;
}

eits_real eits_expected_noise(const eits_context *ctx)
{
    return eits_noise_energy(ctx) / (eits_real)ctx->model->n_folded * ctx->whitening.energy;
}

int eits_check_model_mismatch(eits_context *ctx, const eits_scratch *scratch, uint64_t *macs)
{
    eits_real *weighed = scratch->row[3];
    const uint32_t folds = ctx->model->n_folded, rank = ctx->model->rank;
    /* A model that keeps every direction has no data outside its range. Without a known noise, no
     * limit can be set. */
    if (rank >= folds || !(ctx->reference.noise_v > 0))
        return 0;
    const eits_real drift =
        eits_dot(ctx->kernels, ctx->projection.gain_drift, ctx->projection.gain_drift, folds);
    if (drift > 0 && ctx->range.off_range_build != ctx->projection.builds)
        *macs += learn_off_range(ctx, scratch);
    for (uint32_t i = 0; i < rank; ++i)
        weighed[i] = ctx->range.inverse[i] * ctx->frame.y[i];
    eits_real total = eits_dot(ctx->kernels, ctx->frame.d, ctx->frame.d, folds),
              off = total - eits_dot(ctx->kernels, weighed, ctx->frame.y, rank);
    if (drift > 0) { /* the amount of drift is not part of the mismatch */
        const eits_real along =
                            eits_dot(ctx->kernels, ctx->frame.d, ctx->projection.gain_drift, folds),
                        along_off_range =
                            eits_dot(ctx->kernels, ctx->frame.d, ctx->range.off_range, folds);
        const eits_real off_range =
            eits_dot(ctx->kernels, ctx->range.off_range, ctx->range.off_range, folds);
        total -= along * along / drift;
        off -= off_range > 0 ? along_off_range * along_off_range / off_range : 0;
    }
    /* The noise outside the range is the fraction of the folds' noise that belongs to the
     * dimensions outside it. */
    const eits_real noise = eits_noise_energy(ctx) * (eits_real)(folds - rank) / (eits_real)folds;
    if (!(off > noise) || !(total > 0))
        return 0;
    /* The result is relative to the data: 0.05 means five per cent of the change, for a touch of
     * any strength. */
    const eits_real fraction = eits_sqrt((off - noise) / total);
    ctx->info.model_mismatch = fraction < 1 ? fraction : 1;
    return fraction > EITS_MISMATCH_FRACTION &&
           off > EITS_MISMATCH_NOISE * EITS_MISMATCH_NOISE * noise;
}

void eits_check_stale_reference(eits_context *ctx, const eits_real *gradient)
{
    const eits_sign sign = ctx->options.sign;
    ctx->range.against = 0;
    if (sign == EITS_SIGN_BOTH || !eits_wants(ctx, EITS_DIAGNOSTIC_STALE_REFERENCE))
        return;
    const eits_sign other = sign == EITS_SIGN_INCREASE ? EITS_SIGN_DECREASE : EITS_SIGN_INCREASE;
    /* Touches have one sign. If the change is greater with the other sign, a touch that was on the
     * skin during the tare has been removed. */
    const eits_real against = eits_greatest(ctx->kernels, gradient, ctx->model->n_pixels, other);
    const eits_real min = EITS_STALE_NOISE * ctx->info.lambda_noise;
    if (!(min > 0 && against > EITS_STALE_RATIO * ctx->info.lambda_max && against > min))
        return;
    /* If a different scale has raised the diagnostic before, it stays: touches do not explain that.
     */
    ctx->range.against = (ctx->info.diagnostics & EITS_DIAGNOSTIC_STALE_REFERENCE) == 0;
    ctx->info.diagnostics |= EITS_DIAGNOSTIC_STALE_REFERENCE;
}

void eits_recheck_stale_reference(eits_context *ctx)
{
    if (ctx->range.against != 0 && ctx->info.unexplained < EITS_STALE_EXPLAINED)
        ctx->info.diagnostics &= ~(uint32_t)EITS_DIAGNOSTIC_STALE_REFERENCE;
}

/* The direction of gain drift is ignored. A frame of many times the reference's size would
 * therefore lose its touches without a report, because their data are compared with that size. The
 * scale is a ratio of sums and not of squares, so that no single row dominates, and only numbers
 * that are far too large overflow. */
void eits_check_scale(eits_context *ctx, const eits_real *frame)
{
    const eits_real *v0 = ctx->reference.v0;
    eits_real along = 0, size = 0;
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        if (ctx->rows.unusable[i] != 0)
            continue;
        along += v0[i] < 0 ? -frame[i] : frame[i];
        size += eits_fabs(v0[i]);
    }
    const int alike = along >= size / EITS_STALE_SCALE && along / EITS_STALE_SCALE <= size;
    if (size > 0 && !alike && eits_wants(ctx, EITS_DIAGNOSTIC_STALE_REFERENCE))
        ctx->info.diagnostics |= EITS_DIAGNOSTIC_STALE_REFERENCE;
}

/* A taught model has the metric of the noise, in which touches explain nearly all of a press but
 * less of a drift. Without this check the first false touch would stop reference tracking for good.
 * A clearer touch may leave more unexplained, and a change far above the noise is a touch, whatever
 * its shape. Models from physics use the touch test instead (evidence/). */
int eits_check_drift(eits_context *ctx)
{
    const eits_real level = ctx->info.lambda_noise > 0 ? eits_detection_threshold(ctx)
                                                       : ctx->reference.tracking.level,
                    clear = level > 0 ? ctx->info.lambda_max / level : EITS_DRIFT_CLEAR;
    if (!eits_tracks_reference(ctx) || ctx->model->precision == NULL ||
        !eits_wants(ctx, EITS_DIAGNOSTIC_STALE_REFERENCE) || clear > EITS_DRIFT_CLEAR ||
        !(ctx->info.unexplained > EITS_DRIFT_UNEXPLAINED * (1 + clear)))
        return 0;
    ctx->info.diagnostics |= EITS_DIAGNOSTIC_STALE_REFERENCE;
    return 1;
}

void eits_check_unlike_model(eits_context *ctx)
{
    if (ctx->reference.far && eits_wants(ctx, EITS_DIAGNOSTIC_UNLIKE_MODEL))
        ctx->info.diagnostics |= EITS_DIAGNOSTIC_UNLIKE_MODEL;
}
