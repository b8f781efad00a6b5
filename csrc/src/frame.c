/* The frame stage: unusable channels, difference, fold, whitening, projection. */
#include "eitskin/frame.h"

#include "kernels.h"
#include "log.h"
#include "observed.h"
#include "stages.h"
#include "vec.h"

/* Mark rows that cannot be used in this frame; returns their number. */
static uint32_t find_unusable(eits_context *ctx, const eits_real *frame)
{
    const eits_real limit = ctx->options.saturation_v;
    uint32_t count = 0;
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        const int saturated = limit > 0 && eits_fabs(frame[i]) >= limit;
        const int unknown = !eits_is_finite(frame[i]) || !eits_is_finite(ctx->baseline.v0[i]);
        ctx->unusable[i] = (uint8_t)(ctx->bad[i] || unknown || saturated);
        count += ctx->unusable[i];
    }
    return count;
}

/* A frame of nothing but zeros is a dead front end, not a quiet skin. */
static int is_dead(const eits_context *ctx, const eits_real *frame)
{
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        if (!ctx->unusable[i] && frame[i] != 0)
            return 0;
    }
    return 1;
}

/* The datum of one row from its voltage and its reference, in model volts (or without unit where normalised). */
static eits_real datum(const eits_context *ctx, eits_real v, eits_real v0)
{
    switch (ctx->model->data_kind) {
    case EITS_DATA_DIFFERENCE: break;
    case EITS_DATA_NORMALISED: return (v - v0) / v0;
    case EITS_DATA_LOG_RATIO: {
        /* beyond a ratio of 16 either way it is no touch; and the logarithm must not meet zero or a turned sign */
        const eits_real q = v / v0, low = R(1.0 / 16.0), high = R(16.0);
        return ctx->baseline.gain * v0 * eits_log(q < low ? low : (q > high ? high : q));
    }
    }
    return ctx->baseline.gain * (v - v0);
}

/* Rows whose reference is all but zero say nothing as a ratio. */
static int ratio_undefined(const eits_context *ctx, eits_real v0)
{
    return ctx->model->data_kind != EITS_DATA_DIFFERENCE && eits_fabs(v0) < R(1e-6) * ctx->baseline.v0_rms;
}

/* Which rows of a fold are in use, as bits; none: the fold is left out, and other files take it for zero. */
enum { LEFT_OUT = 0, FIRST = 1, SECOND = 2, BOTH = FIRST | SECOND };

/* d_k: the mean of a row and its reciprocal, or whichever is usable; sets basis_for, and says whether any of it changed. */
static int fold_data(eits_context *ctx, const eits_real *frame)
{
    const eits_real *v0 = ctx->baseline.v0;
    int changed = 0;
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        const eits_fold fold = ctx->model->fold[k];
        const uint32_t rows[2] = {fold.first, fold.second};
        eits_real sum = 0;
        uint8_t used = LEFT_OUT;
        for (int side = 0; side < 2; ++side) {
            const uint32_t i = rows[side];
            if (i == EITS_FOLD_NONE || ctx->unusable[i] || ratio_undefined(ctx, v0[i]))
                continue;
            /* a ratio has no sign to turn: only the differences of a reciprocal measured the other way round do */
            const int turn = side == 1 && fold.sign < 0 && ctx->model->data_kind != EITS_DATA_NORMALISED;
            const eits_real value = datum(ctx, frame[i], v0[i]);
            sum += turn ? -value : value;
            used |= (uint8_t)(side == 0 ? FIRST : SECOND);
        }
        ctx->d[k] = used == BOTH ? R(0.5) * sum : sum;
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

/* Add `candidate` to the basis unless it lies in its span: Gram-Schmidt, twice for accuracy in float32. */
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

/* The reduced direction along which drift of the gain moves the data: the reference, folded as the data are. */
static uint64_t drift_direction(eits_context *ctx, eits_real *out)
{
    const eits_model *model = ctx->model;
    for (uint32_t k = 0; k < model->n_folded; ++k) {
        const eits_fold fold = model->fold[k];
        const uint8_t used = ctx->basis_for[k];
        const eits_real first = used & FIRST ? ctx->baseline.v0[fold.first] : 0;
        const eits_real second = used & SECOND ? (eits_real)fold.sign * ctx->baseline.v0[fold.second] : 0;
        const eits_real along = ctx->baseline.gain * (used == BOTH ? R(0.5) * (first + second) : first + second);
        ctx->list_index[k] = k;
        ctx->list_value[k] = used != LEFT_OUT && model->data_kind == EITS_DATA_NORMALISED ? 1 : along;
    }
    ctx->kernels->mul(&model->reduction, ctx->list_index, ctx->list_value, model->n_folded, out);
    return (uint64_t)model->n_folded * model->rank;
}

static uint64_t rebuild_basis(eits_context *ctx)
{
    uint64_t macs = eits_observed_build(ctx);
    ctx->basis_count = 0;
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        if (ctx->rewhitened || ctx->basis_for[k] != LEFT_OUT)
            continue;
        reduction_column(ctx, k, ctx->residual);
        macs += ctx->model->rank + extend_basis(ctx, ctx->residual);
    }
    if (ctx->options.project_baseline) {
        macs += drift_direction(ctx, ctx->residual);
        macs += ctx->rewhitened ? eits_observed_data(ctx, ctx->residual) : 0;
        macs += extend_basis(ctx, ctx->residual);
    }
    ctx->basis_stale = 0;
    return macs;
}

eits_status eits_frame_data(eits_context *ctx, const eits_real *frame, uint32_t *masked, uint64_t *macs)
{
    const eits_model *model = ctx->model;
    *masked = find_unusable(ctx, frame);
    *macs = 0;
    if (*masked > ctx->options.max_masked)
        return EITS_E_FRAME_CHANNELS;
    if (*masked < model->n_rows && is_dead(ctx, frame))
        return EITS_E_FRAME_ZERO;
    if (fold_data(ctx, frame) || ctx->basis_stale)
        *macs += rebuild_basis(ctx);
    uint32_t count = 0;
    for (uint32_t k = 0; k < model->n_folded; ++k) {
        ctx->list_index[count] = k;
        ctx->list_value[count] = ctx->d[k];
        count += ctx->basis_for[k] != LEFT_OUT;
    }
    ctx->kernels->mul(&model->reduction, ctx->list_index, ctx->list_value, count, ctx->y);
    *macs += (uint64_t)count * model->rank;
    *macs += ctx->rewhitened ? eits_observed_data(ctx, ctx->y) : 0;
    *macs += eits_project(ctx, ctx->y);
    const uint32_t directions = ctx->rewhitened && count < model->rank ? count : model->rank;
    if (ctx->basis_count >= directions) /* no direction is left: what is there is rounding */
        eits_zero(ctx->y, model->rank);
    return eits_is_finite(eits_dot(ctx, ctx->y, ctx->y, model->rank)) ? EITS_OK : EITS_E_NOT_FINITE;
}

eits_status eits_frame_stage(eits_context *ctx, const eits_real *frame, size_t length, uint32_t *masked, uint64_t *macs)
{
    if (ctx == NULL || frame == NULL || masked == NULL || macs == NULL)
        return EITS_E_ARGUMENT;
    if (!ctx->baseline.ready)
        return EITS_E_NO_BASELINE;
    if (length != ctx->model->n_rows)
        return EITS_E_FRAME_LENGTH;
    return eits_frame_data(ctx, frame, masked, macs);
}

eits_status eits_mask_row(eits_context *ctx, uint32_t row, int bad)
{
    if (ctx == NULL || row >= ctx->model->n_rows)
        return EITS_E_ARGUMENT;
    ctx->bad[row] = bad != 0;
    return EITS_OK;
}
