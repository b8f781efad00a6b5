/* The frame stage: from voltages to reduced data frame.y for any solver, with diagnostics on the
 * way.
 *
 * Finding faults and computing data depend on each other. The order is therefore:
 *
 *   1. faults that a row shows by itself (not a number, saturated);
 *   2. faults of electrodes, from all their rows;
 *   3. fold; outliers, from folded pairs; fold again without them;
 *   4. reduce; model mismatch, from reduced data; fold and reduce again without a fold that it
 * names.
 *
 * Each step back happens at most once, so that the time per frame is bounded whatever is wrong with
 * the frame.
 *
 * In: the voltages, the reference. Out: frame.*, rows.*, the diagnostics in info, the number of
 * rows left out in `masked`, and `macs`. Errors are returned for frames that have no image: too
 * many rows are left out (max_masked), all voltages are zero, or the data overflow. */
#include "api/stages.h"
#include "eitskin/frame.h"

#include "base/vec.h"
#include "context/projection.h"
#include "diagnostics/diagnostics.h"
#include "frame/fold.h"
#include "frame/whitening.h"

/* Find the rows of this frame that cannot be used, as far as each row shows this by itself.
 *
 * A row whose reference is NaN was masked in the tare: there is nothing to compare it with, even if
 * its mask was lifted since. Saturated rows that are masked are not counted: the user who masked
 * them knows about them. */
static void find_unusable(eits_context *ctx, const eits_real *frame)
{
    const eits_real limit = ctx->options.saturation_v;
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        const unsigned masked =
            ctx->rows.masked[i] || !eits_is_finite(ctx->reference.v0[i]) ? EITS_ROW_MASKED : 0;
        const unsigned unknown = !eits_is_finite(frame[i]) ? EITS_ROW_UNKNOWN : 0;
        const unsigned saturated =
            limit > 0 && eits_fabs(frame[i]) >= limit ? EITS_ROW_SATURATED : 0;
        ctx->rows.unusable[i] = (uint8_t)(masked | unknown | saturated);
        ctx->info.saturated += masked == 0 && saturated != 0;
    }
    if (ctx->info.saturated > 0 && eits_wants(ctx, EITS_DIAGNOSTIC_SATURATED))
        ctx->info.diagnostics |= EITS_DIAGNOSTIC_SATURATED;
}

static uint32_t count_unusable(const eits_context *ctx)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i)
        count += ctx->rows.unusable[i] != 0;
    return count;
}

static void clear_diagnostics(eits_context *ctx)
{
    eits_info *info = &ctx->info;
    info->diagnostics = info->saturated = info->outliers = 0;
    info->open_electrodes = info->bridged_electrodes = info->noisy_electrodes = 0;
    info->model_mismatch = info->unexplained = 0;
    memset(ctx->rows.electrode, 0, sizeof ctx->rows.electrode);
}

/* A frame of zeros only comes from a dead front end, not from an untouched skin. */
static int is_dead(const eits_context *ctx, const eits_real *frame)
{
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        if (!ctx->rows.unusable[i] && frame[i] != 0)
            return 0;
    }
    return 1;
}

/* Examine the reduced data. Returns 1 if a row was marked, so that the frame has to be folded
 * again. */
static int examine_reduced(eits_context *ctx, const eits_scratch *scratch, uint64_t *macs)
{
    if (!ctx->range.known || !eits_check_model_mismatch(ctx, scratch, macs))
        return 0;
    /* the mismatch comes from rows with reversed sign, so no single fold explains it */
    const int known = (ctx->info.diagnostics & EITS_DIAGNOSTIC_MODEL_MISMATCH) != 0;
    if (!known && eits_wants(ctx, EITS_DIAGNOSTIC_OUTLIER) &&
        eits_find_unpaired_outlier(ctx, scratch, macs)) {
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
        return EITS_E_FRAME_ROWS;
    /* If every row is left out, which max_masked allowed, no reading is left that could be zero. */
    return *masked < ctx->model->n_rows && is_dead(ctx, frame) ? EITS_E_FRAME_ZERO : EITS_OK;
}

eits_status eits_frame_data(eits_context *ctx, const eits_scratch *scratch, const eits_real *frame,
                            uint32_t *masked, uint64_t *macs)
{
    const eits_model *model = ctx->model;
    /* without a reference there is nothing to compare the frame with */
    const int judged = ctx->reference.ready != 0;
    *macs = 0;
    clear_diagnostics(ctx);
    find_unusable(ctx, frame);
    /* Electrodes are checked first: otherwise each of their rows would be counted as an outlier. */
    const int dead = judged && !eits_find_electrodes(ctx, frame);
    eits_status status = check_rows(ctx, frame, masked);
    if (status == EITS_OK && dead)
        status = EITS_E_FRAME_ZERO;
    if (status != EITS_OK)
        return status;
    eits_fold_data(ctx, frame);
    if (judged && eits_find_outliers(ctx, scratch, macs)) {
        status = check_rows(ctx, frame, masked);
        if (status != EITS_OK)
            return status;
        eits_fold_data(ctx, frame);
    }
    if (ctx->projection.stale)
        *macs += eits_build_basis(ctx, scratch);
    /* The model's range can be tested only for a frame without left-out rows: with rows left out, P
     * d is no longer a projection on that range. */
    uint32_t count = eits_reduce_frame(ctx, scratch, macs);
    if (count == model->n_folded && judged && examine_reduced(ctx, scratch, macs)) {
        status = check_rows(ctx, frame, masked);
        if (status != EITS_OK)
            return status;
        eits_fold_data(ctx, frame);
        if (ctx->projection.stale)
            *macs += eits_build_basis(ctx, scratch);
        count = eits_reduce_frame(ctx, scratch, macs);
    }
    if (judged)
        eits_check_scale(ctx, frame);
    *macs += ctx->whitening.form ? eits_whiten_data(ctx, ctx->frame.y) : 0;
    *macs += eits_project(ctx, ctx->frame.y);
    ctx->frame.has_y_log = judged && model->data_kind == EITS_DATA_DIFFERENCE &&
                           (ctx->options.touch_fit & EITS_TOUCH_FIT_LOG_DATA) != 0;
    *macs += ctx->frame.has_y_log ? eits_reduce_log(ctx, scratch, frame) : 0;
    /* If there are fewer folds than directions, the triangle fills the remaining directions from e,
     * which is not data. */
    const uint32_t directions = ctx->whitening.form && count < model->rank ? count : model->rank;
    if (ctx->projection.count >=
        directions) /* no direction is left: the numbers are rounding errors */
        eits_zero(ctx->frame.y, model->rank);
    /* The square is tested and not each number: solvers square y, so a frame whose square overflows
     * is as useless as an infinite one. */
    return eits_is_finite(eits_dot(ctx->kernels, ctx->frame.y, ctx->frame.y, model->rank))
               ? EITS_OK
               : EITS_E_NOT_FINITE;
}

static eits_status check_call(const eits_context *ctx, const eits_real *frame, size_t length)
{
    if (ctx == NULL || frame == NULL)
        return EITS_E_ARGUMENT;
    if (!ctx->reference.ready)
        return EITS_E_NO_REFERENCE;
    return length == ctx->model->n_rows ? EITS_OK : EITS_E_FRAME_LENGTH;
}

eits_status eits_frame_stage(eits_context *ctx, const eits_real *frame, size_t length,
                             uint32_t *masked, uint64_t *macs)
{
    if (masked == NULL || macs == NULL)
        return EITS_E_ARGUMENT;
    const eits_status status = check_call(ctx, frame, length);
    return status == EITS_OK ? eits_frame_data(ctx, &ctx->scratch, frame, masked, macs) : status;
}

/* The sides in use decide when the next solved frame builds its basis again, and so its MACs.
 * Examining a frame must not change this, so the sides are restored. */
eits_status eits_examine(eits_context *ctx, const eits_real *frame, size_t length)
{
    eits_status status = check_call(ctx, frame, length);
    if (status != EITS_OK)
        return status;
    const size_t folds = ctx->model->n_folded;
    const uint32_t stale = ctx->projection.stale;
    uint64_t macs;
    memcpy(ctx->frame.kept_sides, ctx->frame.sides, folds);
    ctx->info = (eits_info){0};
    status = eits_frame_data(ctx, &ctx->scratch, frame, &ctx->info.masked, &macs);
    ctx->projection.stale |=
        stale | (memcmp(ctx->frame.kept_sides, ctx->frame.sides, folds) != 0 ? 1u : 0u);
    memcpy(ctx->frame.sides, ctx->frame.kept_sides, folds);
    return status;
}

eits_status eits_mask_row(eits_context *ctx, uint32_t row, int masked)
{
    if (ctx == NULL || row >= ctx->model->n_rows)
        return EITS_E_ARGUMENT;
    ctx->rows.masked[row] = masked != 0;
    return EITS_OK;
}
