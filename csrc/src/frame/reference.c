/* The reference frame and its noise, from one frame or learned from many untouched ones. */
#include "eitskin/frame.h"

#include "base/vec.h"
#include "diagnostics/diagnostics.h"
#include "frame/projection.h"
#include "frame/whitening.h"
#include "kernels/kernels.h"

enum { MIN_REFERENCE_FRAMES = 4 };

/* A reference frame must be whole: rows that cannot be used are to be masked first. */
static eits_status check_reference_frame(const eits_context *ctx, const eits_real *frame,
                                         size_t length)
{
    if (length != ctx->model->n_rows)
        return EITS_E_FRAME_LENGTH;
    const eits_real limit = ctx->options.saturation_v;
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        if (!ctx->masked[i] &&
            (!eits_is_finite(frame[i]) || (limit > 0 && eits_fabs(frame[i]) >= limit)))
            return EITS_E_FRAME_CHANNELS;
    }
    return EITS_OK;
}

/* Whether a row takes part in the reference: not masked, neither now nor when the reference was
 * taken. */
static int has_reference(const eits_context *ctx, uint32_t row)
{
    return row != EITS_FOLD_NONE && !ctx->masked[row] && eits_is_finite(ctx->reference.v0[row]);
}

/* The reference on one folded row: the mean of both sides in use; 0 where neither is. */
static eits_real folded_reference(const eits_context *ctx, eits_fold fold)
{
    const eits_real *v0 = ctx->reference.v0;
    const int first = has_reference(ctx, fold.first), second = has_reference(ctx, fold.second);
    const eits_real turned = second ? (eits_real)fold.sign * v0[fold.second] : 0;
    return first && second ? R(0.5) * (v0[fold.first] + turned) : (first ? v0[fold.first] : turned);
}

/* Set gain, correlation and v0_rms from v0; a scale is taken out first so that squares neither
 * overflow nor vanish. */
static eits_status fit_to_model(eits_context *ctx)
{
    const eits_model *model = ctx->model;
    eits_reference *b = &ctx->reference;
    eits_real largest = 0, largest_ref = 0;
    for (uint32_t k = 0; k < model->n_folded; ++k) {
        const eits_real v = eits_fabs(folded_reference(ctx, model->fold[k])),
                        r = eits_fabs((eits_real)model->v_ref[k]);
        largest = v > largest ? v : largest;
        largest_ref = r > largest_ref ? r : largest_ref;
    }
    if (!(largest > 0) || !(largest_ref > 0) || !eits_is_finite(1 / largest) ||
        !eits_is_finite(1 / largest_ref))
        return EITS_E_FRAME_ZERO;
    eits_real vv = 0, rr = 0, vr = 0;
    uint32_t used = 0;
    for (uint32_t k = 0; k < model->n_folded; ++k) {
        const eits_fold fold = model->fold[k];
        if (!has_reference(ctx, fold.first) && !has_reference(ctx, fold.second))
            continue;
        const eits_real v = folded_reference(ctx, fold) / largest,
                        r = (eits_real)model->v_ref[k] / largest_ref;
        vv = eits_fma(v, v, vv);
        rr = eits_fma(r, r, rr);
        vr = eits_fma(v, r, vr);
        ++used;
    }
    if (!(vv > 0) || !(rr > 0))
        return EITS_E_FRAME_ZERO;
    b->correlation = vr / (eits_sqrt(vv) * eits_sqrt(rr));
    b->v0_rms = largest * eits_sqrt(vv / (eits_real)used);
    b->gain = largest_ref / largest * (eits_sqrt(rr) / eits_sqrt(vv));
    if (b->correlation < 0)
        b->gain = -b->gain;
    ctx->basis_stale = 1;
    ctx->warm = 0;
    return eits_is_finite(b->gain) && b->gain != 0 ? EITS_OK : EITS_E_FRAME_ZERO;
}

eits_status eits_reference_set(eits_context *ctx, const eits_real *frame, size_t length)
{
    if (ctx == NULL || frame == NULL)
        return EITS_E_ARGUMENT;
    eits_status status = check_reference_frame(ctx, frame, length);
    if (status != EITS_OK)
        return status;
    eits_reference *b = &ctx->reference;
    eits_real *old = b->m2; /* keeps the old reference until the new one is known to be good */
    b->wanted = 0;          /* learning, if any was under way, ends here */
    eits_copy(old, b->v0, length);
    eits_copy(b->v0, frame, length);
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        if (ctx->masked[i])
            b->v0[i] = R(NAN);
    }
    status = fit_to_model(ctx);
    if (status != EITS_OK) {
        eits_copy(b->v0, old, length);
        if (b->ready)
            (void)fit_to_model(ctx);
    } else {
        b->ready = 1;
        b->count = 1;
        b->noise_v = 0;
        b->lambda_noise = 0;
        b->outliers = b->second_waits = 0;
    }
    eits_zero(b->m2, length);
    return status;
}

eits_status eits_reference_begin(eits_context *ctx, uint32_t count)
{
    if (ctx == NULL || count < MIN_REFERENCE_FRAMES)
        return EITS_E_ARGUMENT;
    eits_reference *b = &ctx->reference;
    eits_zero(b->v0, ctx->model->n_rows);
    eits_zero(b->m2, ctx->model->n_rows);
    b->wanted = count;
    b->count = 0;
    b->ready = 0;
    b->lambda_noise = 0;
    b->noise_v = 0;
    b->outliers = b->second_waits = 0;
    return EITS_OK;
}

/* How far a reference frame reaches above nothing: max |S'y| against the mean so far. */
static eits_status learn_lambda_noise(eits_context *ctx, const eits_real *frame)
{
    uint32_t masked;
    uint64_t macs;
    const eits_status status = eits_frame_data(ctx, frame, &masked, &macs);
    if (status != EITS_OK)
        return status;
    eits_apply_t(ctx, eits_adjoint(ctx, ctx->y, ctx->adjoint), ctx->gradient);
    if (!eits_all_finite(ctx->gradient, ctx->model->n_pixels))
        return EITS_E_NOT_FINITE;
    const eits_real seen =
        eits_greatest(ctx, ctx->gradient, ctx->model->n_pixels, EITS_SIGN_BOTH) / ctx->noise_ratio;
    if (seen > ctx->reference.lambda_noise)
        ctx->reference.lambda_noise = seen;
    return EITS_OK;
}

/* The greatest power of two up to the greatest voltage in use, within what has an inverse. */
static eits_real unit_for(const eits_context *ctx, const eits_real *frame)
{
    eits_real largest = 0, unit = 1;
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i)
        largest = !ctx->masked[i] && eits_fabs(frame[i]) > largest ? eits_fabs(frame[i]) : largest;
    while (unit <= R(0.5) * largest)
        unit *= 2;
    while (unit > largest && unit > R(0x1p-125))
        unit *= R(0.5);
    return unit;
}

/* The rms over rows of the frames' deviation, so far; 0 where it is out of range. */
static eits_real noise_so_far(const eits_context *ctx)
{
    const eits_reference *b = &ctx->reference;
    eits_real sum = 0;
    uint32_t used = 0;
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        if (has_reference(ctx, i)) {
            sum += b->m2[i];
            ++used;
        }
    }
    const eits_real noise_v =
        used > 0 ? b->m2_unit * eits_sqrt(sum / ((eits_real)used * (eits_real)(b->count - 1))) : 0;
    return eits_is_finite(noise_v) ? noise_v : 0;
}

/* Take one more frame into the mean and the squares; rows that were masked lose their reference. */
static void take_in(eits_context *ctx, const eits_real *frame)
{
    eits_reference *b = &ctx->reference;
    ++b->count;
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) { /* Welford, Technometrics 4 (1962) 419 */
        if (ctx->masked[i] == EITS_MASKED_NOW)
            continue;
        if (ctx->masked[i])
            b->v0[i] = R(NAN);
        if (!eits_is_finite(b->v0[i]))
            continue;
        const eits_real delta = frame[i] - b->v0[i];
        b->v0[i] += delta / (eits_real)b->count;
        b->m2[i] = eits_fma(delta / b->m2_unit, (frame[i] - b->v0[i]) / b->m2_unit, b->m2[i]);
    }
}

/* The second frame waits in m2 until a third tells which of them is right where they differ. */
static void keep_second(eits_context *ctx, const eits_real *frame)
{
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        if (ctx->masked[i])
            ctx->reference.v0[i] = R(NAN);
    }
    eits_copy(ctx->reference.m2, frame, ctx->model->n_rows);
    ctx->reference.count = 2;
    ctx->reference.second_waits = 1;
}

static void weigh_second(eits_context *ctx, const eits_real *frame)
{
    eits_reference *b = &ctx->reference;
    b->outliers += eits_reference_weigh_second(ctx, frame);
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) { /* as take_in */
        const eits_real delta = b->m2[i] - b->v0[i], second = b->m2[i];
        b->m2[i] = 0;
        if (!eits_is_finite(b->v0[i]))
            continue;
        b->v0[i] += delta / 2;
        b->m2[i] = eits_fma(delta / b->m2_unit, (second - b->v0[i]) / b->m2_unit, 0);
    }
    b->second_waits = 0;
}

eits_status eits_reference_add(eits_context *ctx, const eits_real *frame, size_t length)
{
    if (ctx == NULL || frame == NULL || ctx->reference.count >= ctx->reference.wanted)
        return EITS_E_ARGUMENT;
    eits_reference *b = &ctx->reference;
    eits_status status = check_reference_frame(ctx, frame, length);
    if (status != EITS_OK)
        return status;
    const int judged = eits_wants(ctx, EITS_DIAGNOSTIC_OUTLIER);
    if (b->count == 1 && judged) {
        keep_second(ctx, frame);
        return EITS_OK;
    }
    if (b->second_waits)
        weigh_second(ctx, frame);
    const uint32_t left = b->count >= 2 && judged ? eits_reference_mask_outliers(ctx, frame) : 0;
    if (b->count == b->wanted / 2) {
        status = fit_to_model(ctx);
        /* lambda_noise is learned with the regularisation that it asks for */
        b->noise_v = noise_so_far(ctx);
    }
    if (status == EITS_OK && b->count >= b->wanted / 2)
        status = learn_lambda_noise(ctx, frame);
    if (status == EITS_OK) {
        if (b->count == 0)
            b->m2_unit = unit_for(ctx, frame);
        take_in(ctx, frame);
        b->outliers += left;
    }
    eits_reference_unmask(ctx);
    return status;
}

eits_status eits_reference_finish(eits_context *ctx)
{
    if (ctx == NULL)
        return EITS_E_ARGUMENT;
    eits_reference *b = &ctx->reference;
    if (b->count < MIN_REFERENCE_FRAMES || b->count != b->wanted)
        return EITS_E_REFERENCE_SHORT;
    const eits_status status = fit_to_model(ctx);
    if (status != EITS_OK)
        return status;
    b->noise_v = noise_so_far(ctx);
    b->ready = 1;
    return EITS_OK;
}
