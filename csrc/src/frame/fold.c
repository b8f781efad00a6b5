/* Turn voltages into reduced data: take the difference from the reference, fold, and project on the
 * directions in use.
 *
 * A frame has one voltage per row; the solver needs `rank` numbers with all of the frame's
 * information about the conductivity. Three linear steps make them, in this order:
 *
 *   datum   gain (v - v0), or its ratio or logarithm as the model was built. The difference removes
 *           what contacts, shape and amplifier have in common with the reference; the gain scales
 *           the board's volts to the model's.
 *   fold    the mean of a row and its reciprocal: half the numbers, less noise by root two, and
 *           a difference that checks itself (diagnostics/outliers.c).
 *   reduce  y = P d, folds x rank multiply-accumulates: the whitened singular directions.
 *
 * A row that cannot be used is not replaced by a guess. If its reciprocal can be used, that stands
 * for both. Else the fold is left out of P d, and then either F whitens the rest
 * (frame/whitening.h), or the direction P e_k along which the fold would have moved y is ignored:
 * it is projected out of y and of every F S x alike. The same is done with P v0, the direction of
 * gain drift, along which temperature and supply move all data at once.
 *
 * The basis of ignored directions depends on the sides in use and on the reference, not on the
 * frame, so it is built again only when one of these changes (projection.stale): a frame with
 * unchanged rows costs only P d and the projection. */
#include "frame/fold.h"

#include "base/log.h"
#include "base/vec.h"
#include "context/projection.h"
#include "frame/constants.h"
#include "frame/whitening.h"
#include "kernels/kernels.h"

/* Returns v0 log(v / v0). The ratio is limited to EITS_MAX_RATIO either way: beyond that it is not
 * a touch, and the logarithm must not meet zero or a changed sign. */
static eits_real log_datum(const eits_context *ctx, eits_real v, eits_real v0)
{
    const eits_real q = v / v0, low = 1 / EITS_MAX_RATIO, high = EITS_MAX_RATIO;
    return ctx->reference.gain * v0 * eits_log(q < low ? low : (q > high ? high : q));
}

/* Returns the datum of row i from its voltage, in model volts (or without unit if the model is
 * normalised). */
static eits_real datum(const eits_context *ctx, uint32_t i, eits_real v)
{
    const eits_real v0 = ctx->reference.v0[i], own = ctx->reference.row_gain[i];
    switch (ctx->model->data_kind) {
    case EITS_DATA_DIFFERENCE:
        break;
    case EITS_DATA_NORMALISED:
        return (v - v0) / v0;
    case EITS_DATA_LOG_RATIO:
        return own * log_datum(ctx, v, v0);
    }
    return own * (ctx->reference.gain * (v - v0));
}

/* Returns 1 for a row whose reference is so close to zero that a ratio to it has no meaning. */
static int ratio_undefined(const eits_context *ctx, eits_real v0)
{
    return ctx->model->data_kind != EITS_DATA_DIFFERENCE &&
           eits_fabs(v0) < EITS_RATIO_DEFINED * ctx->reference.v0_rms;
}

/* Returns 1 if a row and its reciprocal differ by more than rounding of their references. Smaller
 * differences are common with quantised voltages and count as none. */
static int exceeds_rounding(const eits_context *ctx, eits_real difference, uint32_t i)
{
    const eits_real in_model_volts =
        ctx->reference.gain * ctx->reference.v0[i] * ctx->reference.row_gain[i];
    return eits_fabs(difference) >
           EITS_FOLD_ROUNDING *
               (ctx->model->data_kind == EITS_DATA_NORMALISED ? 1 : eits_fabs(in_model_volts));
}

/* Compute d_k, the mean of a row and its reciprocal or the usable one of them, and
 * reciprocity_error_k, their difference. If other sides are in use than before, the basis has to be
 * built again. */
void eits_fold_data(eits_context *ctx, const eits_real *frame)
{
    const eits_real *v0 = ctx->reference.v0;
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        const eits_fold fold = ctx->model->fold[k];
        const uint32_t rows[2] = {fold.first, fold.second};
        eits_real sum = 0, difference = 0;
        uint8_t used = EITS_SIDE_NONE;
        for (int side = 0; side < 2; ++side) {
            const uint32_t i = rows[side];
            if (i == EITS_FOLD_NONE || ctx->rows.unusable[i] || ratio_undefined(ctx, v0[i]))
                continue;
            /* a reciprocal that was measured the other way round has differences of opposite sign;
             * a ratio has not */
            const int turn =
                side == 1 && fold.sign < 0 && ctx->model->data_kind != EITS_DATA_NORMALISED;
            const eits_real measured = datum(ctx, i, frame[i]), value = turn ? -measured : measured;
            difference = sum - value;
            sum += value;
            used |= (uint8_t)(side == 0 ? EITS_SIDE_FIRST : EITS_SIDE_SECOND);
        }
        ctx->frame.d[k] = used == EITS_SIDE_BOTH ? R(0.5) * sum : sum;
        ctx->frame.reciprocity_error[k] =
            used == EITS_SIDE_BOTH && exceeds_rounding(ctx, difference, fold.first) ? difference
                                                                                    : 0;
        ctx->projection.stale |= used != ctx->frame.sides[k];
        ctx->frame.sides[k] = used;
    }
}

/* out = P e_k for one folded row. */
static void reduction_column(const eits_context *ctx, uint32_t k, eits_real *out)
{
    const eits_real one = 1;
    ctx->kernels->mul(&ctx->model->reduction, &k, &one, 1, out);
}

/* Add `candidate` to the basis unless it lies in its span: Gram-Schmidt, twice for accuracy in
 * float32.
 *
 * A second pass is needed since rounding in the first leaves parts of the basis that are as large
 * as the rest of a nearly dependent direction ("twice is enough": Parlett, The Symmetric Eigenvalue
 * Problem, section 6.9). */
static uint64_t extend_basis(eits_context *ctx, eits_real *candidate)
{
    const uint32_t rank = ctx->model->rank;
    const size_t stride = EITS_STRIDE(rank);
    const eits_real before = eits_dot(ctx->kernels, candidate, candidate, rank);
    uint64_t macs = 0;
    if (ctx->projection.count == rank || !(before > 0))
        return 0;
    for (int pass = 0; pass < 2; ++pass)
        macs += eits_project(ctx, candidate);
    const eits_real after = eits_dot(ctx->kernels, candidate, candidate, rank);
    /* The rest is rounding: the direction is already in the basis. */
    if (!(after > EITS_BASIS_TOLERANCE * before))
        return macs;
    const eits_real scale = 1 / eits_sqrt(after);
    eits_real *slot = ctx->projection.basis + stride * ctx->projection.count++;
    for (uint32_t i = 0; i < rank; ++i)
        slot[i] = scale * candidate[i];
    return macs + 2u * rank;
}

/* Returns row i's reference times its own gain. */
static eits_real scaled_reference(const eits_context *ctx, uint32_t i)
{
    return ctx->reference.row_gain[i] * ctx->reference.v0[i];
}

/* Compute the reduced direction along which gain drift moves the data: the reference, folded as the
 * data are. */
static uint64_t drift_direction(eits_context *ctx, const eits_scratch *scratch, eits_real *out)
{
    const eits_model *model = ctx->model;
    for (uint32_t k = 0; k < model->n_folded; ++k) {
        const eits_fold fold = model->fold[k];
        const uint8_t used = ctx->frame.sides[k];
        const eits_real first = used & EITS_SIDE_FIRST ? scaled_reference(ctx, fold.first) : 0;
        const eits_real second =
            used & EITS_SIDE_SECOND ? (eits_real)fold.sign * scaled_reference(ctx, fold.second) : 0;
        const eits_real along =
            ctx->reference.gain *
            (used == EITS_SIDE_BOTH ? R(0.5) * (first + second) : first + second);
        scratch->index[k] = k;
        ctx->projection.gain_drift[k] =
            used != EITS_SIDE_NONE && model->data_kind == EITS_DATA_NORMALISED ? 1 : along;
    }
    /* The direction is kept unreduced as well: the test for off-range data also leaves gain drift
     * out. */
    ctx->kernels->mul(&model->reduction, scratch->index, ctx->projection.gain_drift,
                      model->n_folded, out);
    for (uint32_t k = 0; k < model->n_folded; ++k)
        scratch->value[k] = ctx->projection.gain_drift[k];
    return (uint64_t)model->n_folded * model->rank +
           eits_fill_rows(ctx, scratch, model->n_folded, out);
}

/* Folds are added first, then gain drift: if directions run out, the unmeasured folds must be
 * ignored, while drift only should be. */
uint64_t eits_build_basis(eits_context *ctx, const eits_scratch *scratch)
{
    eits_real *direction = scratch->row[0];
    /* If F accounts for the folds left out, their directions need not be ignored. */
    uint64_t macs = eits_whitening_build(ctx, scratch);
    ctx->projection.count = 0;
    eits_zero(ctx->projection.gain_drift, ctx->model->n_folded);
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        if (ctx->whitening.form || ctx->frame.sides[k] != EITS_SIDE_NONE)
            continue;
        reduction_column(ctx, k, direction);
        macs += ctx->model->rank + extend_basis(ctx, direction);
    }
    if (ctx->options.project_reference) {
        macs += drift_direction(ctx, scratch, direction);
        macs += ctx->whitening.form ? eits_whiten_data(ctx, direction) : 0;
        macs += extend_basis(ctx, direction);
    }
    ctx->projection.stale = 0;
    ++ctx->projection.builds;
    return macs;
}

/* Compute y = P d from the folds in use, not yet projected; returns their number. */
uint32_t eits_reduce_frame(eits_context *ctx, const eits_scratch *scratch, uint64_t *macs)
{
    uint32_t count = 0;
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        scratch->index[count] = k;
        scratch->value[count] = ctx->frame.d[k];
        count += ctx->frame.sides[k] != EITS_SIDE_NONE;
    }
    ctx->kernels->mul(&ctx->model->reduction, scratch->index, scratch->value, count, ctx->frame.y);
    *macs += (uint64_t)count * ctx->model->rank + eits_fill_rows(ctx, scratch, count, ctx->frame.y);
    return count;
}

uint64_t eits_reduce_whole(eits_context *ctx, const eits_scratch *scratch, uint32_t count,
                           eits_real *out)
{
    ctx->kernels->mul(&ctx->model->reduction, scratch->index, scratch->value, count, out);
    const uint64_t filled = eits_fill_rows(ctx, scratch, count, out);
    return filled + (ctx->whitening.form ? eits_whiten_data(ctx, out) : 0) +
           (uint64_t)count * ctx->model->rank;
}

uint64_t eits_reduce(eits_context *ctx, const eits_scratch *scratch, uint32_t count, eits_real *out)
{
    const uint64_t macs = eits_reduce_whole(ctx, scratch, count, out);
    return macs + eits_project(ctx, out);
}

/* Compute y_log, the same from v0 log(v / v0), for the first places of touches. Rows whose
 * reference is close to zero stay differences. */
uint64_t eits_reduce_log(eits_context *ctx, const eits_scratch *scratch, const eits_real *frame)
{
    const eits_real *v0 = ctx->reference.v0, min = EITS_RATIO_DEFINED * ctx->reference.v0_rms;
    uint32_t count = 0;
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        const eits_fold fold = ctx->model->fold[k];
        const uint8_t used = ctx->frame.sides[k];
        eits_real sum = 0;
        for (uint32_t side = 0; side < 2; ++side) {
            const uint32_t i = side == 0 ? fold.first : fold.second;
            if (!(used & (side == 0 ? EITS_SIDE_FIRST : EITS_SIDE_SECOND)))
                continue;
            const eits_real value = eits_fabs(v0[i]) < min ? datum(ctx, i, frame[i])
                                                           : ctx->reference.row_gain[i] *
                                                                 log_datum(ctx, frame[i], v0[i]);
            sum += side == 1 && fold.sign < 0 ? -value : value;
        }
        scratch->index[count] = k;
        scratch->value[count] = used == EITS_SIDE_BOTH ? R(0.5) * sum : sum;
        count += used != EITS_SIDE_NONE;
    }
    return eits_reduce(ctx, scratch, count, ctx->frame.y_log);
}
