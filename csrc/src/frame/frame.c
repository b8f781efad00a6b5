/* The frame stage: unusable channels, difference, fold, whitening, projection. */
#include "eitskin/frame.h"

#include "base/log.h"
#include "base/vec.h"
#include "diagnostics/diagnostics.h"
#include "frame/projection.h"
#include "frame/whitening.h"
#include "kernels/kernels.h"

/* Why each row of this frame cannot be used, as far as the row itself tells. */
static void find_unusable(eits_context *ctx, const eits_real *frame)
{
    const eits_real limit = ctx->options.saturation_v;
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        const unsigned masked =
            ctx->masked[i] || !eits_is_finite(ctx->reference.v0[i]) ? EITS_ROW_MASKED : 0;
        const unsigned unknown = !eits_is_finite(frame[i]) ? EITS_ROW_UNKNOWN : 0;
        const unsigned saturated =
            limit > 0 && eits_fabs(frame[i]) >= limit ? EITS_ROW_SATURATED : 0;
        ctx->unusable[i] = (uint8_t)(masked | unknown | saturated);
        ctx->info.saturated += masked == 0 && saturated != 0;
    }
    if (ctx->info.saturated > 0 && eits_wants(ctx, EITS_DIAGNOSTIC_SATURATED))
        ctx->info.diagnostics |= EITS_DIAGNOSTIC_SATURATED;
}

static uint32_t count_unusable(const eits_context *ctx)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i)
        count += ctx->unusable[i] != 0;
    return count;
}

static void clear_diagnostics(eits_context *ctx)
{
    eits_info *info = &ctx->info;
    info->diagnostics = info->saturated = info->outliers = 0;
    info->open_electrodes = info->bridged_electrodes = info->noisy_electrodes = 0;
    info->model_mismatch = info->unexplained = 0;
    memset(ctx->electrode, 0, sizeof ctx->electrode);
}

/* A frame of nothing but zeros is a dead front end, not an untouched skin. */
static int is_dead(const eits_context *ctx, const eits_real *frame)
{
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        if (!ctx->unusable[i] && frame[i] != 0)
            return 0;
    }
    return 1;
}

/* v0 log(v / v0): beyond a ratio of 16 either way it is no touch; and the logarithm must not meet
 * zero or a turned sign. */
static eits_real log_datum(const eits_context *ctx, eits_real v, eits_real v0)
{
    const eits_real q = v / v0, low = R(1.0 / 16.0), high = R(16.0);
    return ctx->reference.gain * v0 * eits_log(q < low ? low : (q > high ? high : q));
}

/* The datum of one row from its voltage and its reference, in model volts (or without unit where
 * normalised). */
static eits_real datum(const eits_context *ctx, eits_real v, eits_real v0)
{
    switch (ctx->model->data_kind) {
    case EITS_DATA_DIFFERENCE:
        break;
    case EITS_DATA_NORMALISED:
        return (v - v0) / v0;
    case EITS_DATA_LOG_RATIO:
        return log_datum(ctx, v, v0);
    }
    return ctx->reference.gain * (v - v0);
}

/* Rows whose reference is all but zero say nothing as a ratio. */
static int ratio_undefined(const eits_context *ctx, eits_real v0)
{
    return ctx->model->data_kind != EITS_DATA_DIFFERENCE &&
           eits_fabs(v0) < R(1e-6) * ctx->reference.v0_rms;
}

/* A row and its reciprocal that differ by less than rounding of their references agree: quantised
 * voltages often do. */
static int exceeds_rounding(const eits_context *ctx, eits_real difference, eits_real v0)
{
    const eits_real rounding = sizeof(eits_real) == 4 ? R(0x1p-20) : R(0x1p-49);
    return eits_fabs(difference) > rounding * (ctx->model->data_kind == EITS_DATA_NORMALISED
                                                   ? 1
                                                   : eits_fabs(ctx->reference.gain * v0));
}

/* d_k: the mean of a row and its reciprocal, or whichever is usable; reciprocity_error_k: their
 * difference. Sets basis_for, and says whether any of it changed. */
static int fold_data(eits_context *ctx, const eits_real *frame)
{
    const eits_real *v0 = ctx->reference.v0;
    int changed = 0;
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        const eits_fold fold = ctx->model->fold[k];
        const uint32_t rows[2] = {fold.first, fold.second};
        eits_real sum = 0, difference = 0;
        uint8_t used = EITS_SIDE_NONE;
        for (int side = 0; side < 2; ++side) {
            const uint32_t i = rows[side];
            if (i == EITS_FOLD_NONE || ctx->unusable[i] || ratio_undefined(ctx, v0[i]))
                continue;
            /* a ratio has no sign to turn: only the differences of a reciprocal measured the other
             * way round do */
            const int turn =
                side == 1 && fold.sign < 0 && ctx->model->data_kind != EITS_DATA_NORMALISED;
            const eits_real measured = datum(ctx, frame[i], v0[i]),
                            value = turn ? -measured : measured;
            difference = sum - value;
            sum += value;
            used |= (uint8_t)(side == 0 ? EITS_SIDE_FIRST : EITS_SIDE_SECOND);
        }
        ctx->d[k] = used == EITS_SIDE_BOTH ? R(0.5) * sum : sum;
        ctx->reciprocity_error[k] =
            used == EITS_SIDE_BOTH && exceeds_rounding(ctx, difference, v0[fold.first]) ? difference
                                                                                        : 0;
        changed |= used != ctx->basis_for[k];
        ctx->basis_for[k] = used;
    }
    return changed;
}

/* P e_k for one folded row. */
static void reduction_column(const eits_context *ctx, uint32_t k, eits_real *out)
{
    const eits_real one = 1;
    ctx->kernels->mul(&ctx->model->reduction, &k, &one, 1, out);
}

/* Add `candidate` to the basis unless it lies in its span: Gram-Schmidt, twice for accuracy in
 * float32. */
static uint64_t extend_basis(eits_context *ctx, eits_real *candidate)
{
    const uint32_t rank = ctx->model->rank;
    const size_t stride = EITS_STRIDE(rank);
    const eits_real before = eits_dot(ctx, candidate, candidate, rank);
    uint64_t macs = 0;
    if (ctx->basis_count == rank || !(before > 0))
        return 0;
    for (int pass = 0; pass < 2; ++pass)
        macs += eits_project(ctx, candidate);
    const eits_real after = eits_dot(ctx, candidate, candidate, rank);
    if (!(after > R(1e-6) * before))
        return macs;
    const eits_real scale = 1 / eits_sqrt(after);
    eits_real *slot = ctx->basis + stride * ctx->basis_count++;
    for (uint32_t i = 0; i < rank; ++i)
        slot[i] = scale * candidate[i];
    return macs + 2u * rank;
}

/* The reduced direction along which drift of the gain moves the data: the reference, folded as the
 * data are. */
static uint64_t drift_direction(eits_context *ctx, eits_real *out)
{
    const eits_model *model = ctx->model;
    for (uint32_t k = 0; k < model->n_folded; ++k) {
        const eits_fold fold = model->fold[k];
        const uint8_t used = ctx->basis_for[k];
        const eits_real first = used & EITS_SIDE_FIRST ? ctx->reference.v0[fold.first] : 0;
        const eits_real second =
            used & EITS_SIDE_SECOND ? (eits_real)fold.sign * ctx->reference.v0[fold.second] : 0;
        const eits_real along =
            ctx->reference.gain *
            (used == EITS_SIDE_BOTH ? R(0.5) * (first + second) : first + second);
        ctx->list_index[k] = k;
        ctx->gain_drift[k] =
            used != EITS_SIDE_NONE && model->data_kind == EITS_DATA_NORMALISED ? 1 : along;
    }
    ctx->kernels->mul(&model->reduction, ctx->list_index, ctx->gain_drift, model->n_folded, out);
    return (uint64_t)model->n_folded * model->rank;
}

static uint64_t rebuild_basis(eits_context *ctx)
{
    uint64_t macs = eits_whitening_build(ctx);
    ctx->basis_count = 0;
    eits_zero(ctx->gain_drift, ctx->model->n_folded);
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        if (ctx->masked_whitening || ctx->basis_for[k] != EITS_SIDE_NONE)
            continue;
        reduction_column(ctx, k, ctx->residual);
        macs += ctx->model->rank + extend_basis(ctx, ctx->residual);
    }
    if (ctx->options.project_reference) {
        macs += drift_direction(ctx, ctx->residual);
        macs += ctx->masked_whitening ? eits_whiten_data(ctx, ctx->residual) : 0;
        macs += extend_basis(ctx, ctx->residual);
    }
    ctx->basis_stale = 0;
    ctx->off_range_stale = 1;
    return macs;
}

/* y = P d of the folds in use, not yet projected; returns their number. */
static uint32_t reduce(eits_context *ctx, uint64_t *macs)
{
    uint32_t count = 0;
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        ctx->list_index[count] = k;
        ctx->list_value[count] = ctx->d[k];
        count += ctx->basis_for[k] != EITS_SIDE_NONE;
    }
    ctx->kernels->mul(&ctx->model->reduction, ctx->list_index, ctx->list_value, count, ctx->y);
    *macs += (uint64_t)count * ctx->model->rank;
    return count;
}

/* y_log: the same of v0 log(v / v0), for the first places of touches. Rows whose reference is
 * all but zero stay differences. */
static uint64_t reduce_log(eits_context *ctx, const eits_real *frame)
{
    const eits_real *v0 = ctx->reference.v0, min = R(1e-6) * ctx->reference.v0_rms;
    uint32_t count = 0;
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        const eits_fold fold = ctx->model->fold[k];
        const uint8_t used = ctx->basis_for[k];
        eits_real sum = 0;
        for (uint32_t side = 0; side < 2; ++side) {
            const uint32_t i = side == 0 ? fold.first : fold.second;
            if (!(used & (side == 0 ? EITS_SIDE_FIRST : EITS_SIDE_SECOND)))
                continue;
            const eits_real value = eits_fabs(v0[i]) < min ? datum(ctx, frame[i], v0[i])
                                                           : log_datum(ctx, frame[i], v0[i]);
            sum += side == 1 && fold.sign < 0 ? -value : value;
        }
        ctx->list_index[count] = k;
        ctx->list_value[count] = used == EITS_SIDE_BOTH ? R(0.5) * sum : sum;
        count += used != EITS_SIDE_NONE;
    }
    return eits_reduce(ctx, count, ctx->y_log);
}

/* What reduced data tell of the frame: 1 where a row was marked, so that it is to be folded anew.
 */
static int examine_reduced(eits_context *ctx, uint64_t *macs)
{
    if (!ctx->range_known || !eits_check_model_mismatch(ctx, macs))
        return 0;
    /* by turned rows: then it is no single fold */
    const int known = (ctx->info.diagnostics & EITS_DIAGNOSTIC_MODEL_MISMATCH) != 0;
    if (!known && eits_wants(ctx, EITS_DIAGNOSTIC_OUTLIER) &&
        eits_find_unpaired_outlier(ctx, macs)) {
        ctx->info.model_mismatch = 0;
        return 1;
    }
    if (eits_wants(ctx, EITS_DIAGNOSTIC_MODEL_MISMATCH))
        ctx->info.diagnostics |= EITS_DIAGNOSTIC_MODEL_MISMATCH;
    return 0;
}

static eits_status check_rows(const eits_context *ctx, const eits_real *frame, uint32_t *masked)
{
    *masked = count_unusable(ctx);
    if (*masked > ctx->options.max_masked)
        return EITS_E_FRAME_CHANNELS;
    return *masked < ctx->model->n_rows && is_dead(ctx, frame) ? EITS_E_FRAME_ZERO : EITS_OK;
}

eits_status eits_frame_data(eits_context *ctx, const eits_real *frame, uint32_t *masked,
                            uint64_t *macs)
{
    const eits_model *model = ctx->model;
    /* without a reference there is nothing to judge by */
    const int judged = ctx->reference.ready != 0;
    *macs = 0;
    clear_diagnostics(ctx);
    find_unusable(ctx, frame);
    const int dead = judged && !eits_find_electrodes(ctx, frame);
    eits_status status = check_rows(ctx, frame, masked);
    if (status == EITS_OK && dead)
        status = EITS_E_FRAME_ZERO;
    if (status != EITS_OK)
        return status;
    int changed = fold_data(ctx, frame);
    if (judged && eits_find_outliers(ctx, macs)) {
        status = check_rows(ctx, frame, masked);
        if (status != EITS_OK)
            return status;
        changed |= fold_data(ctx, frame);
    }
    if (changed || ctx->basis_stale)
        *macs += rebuild_basis(ctx);
    uint32_t count = reduce(ctx, macs);
    if (count == model->n_folded && judged && examine_reduced(ctx, macs)) {
        status = check_rows(ctx, frame, masked);
        if (status != EITS_OK)
            return status;
        if (fold_data(ctx, frame))
            *macs += rebuild_basis(ctx);
        count = reduce(ctx, macs);
    }
    *macs += ctx->masked_whitening ? eits_whiten_data(ctx, ctx->y) : 0;
    *macs += eits_project(ctx, ctx->y);
    ctx->has_y_log = judged && model->data_kind == EITS_DATA_DIFFERENCE &&
                     (ctx->options.touch_fit & EITS_TOUCH_FIT_LOG_DATA) != 0;
    *macs += ctx->has_y_log ? reduce_log(ctx, frame) : 0;
    const uint32_t directions = ctx->masked_whitening && count < model->rank ? count : model->rank;
    if (ctx->basis_count >= directions) /* no direction is left: what is there is rounding */
        eits_zero(ctx->y, model->rank);
    return eits_is_finite(eits_dot(ctx, ctx->y, ctx->y, model->rank)) ? EITS_OK : EITS_E_NOT_FINITE;
}

eits_status eits_frame_stage(eits_context *ctx, const eits_real *frame, size_t length,
                             uint32_t *masked, uint64_t *macs)
{
    if (ctx == NULL || frame == NULL || masked == NULL || macs == NULL)
        return EITS_E_ARGUMENT;
    if (!ctx->reference.ready)
        return EITS_E_NO_REFERENCE;
    if (length != ctx->model->n_rows)
        return EITS_E_FRAME_LENGTH;
    return eits_frame_data(ctx, frame, masked, macs);
}

eits_status eits_mask_row(eits_context *ctx, uint32_t row, int masked)
{
    if (ctx == NULL || row >= ctx->model->n_rows)
        return EITS_E_ARGUMENT;
    ctx->masked[row] = masked != 0;
    return EITS_OK;
}
