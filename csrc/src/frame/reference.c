/* The reference frame: its mean and noise over several frames, and how it fits the model.
 *
 * All later data are differences to the reference, so its errors are in every image: the noise of
 * one frame would be a fixed pattern, and the mean of n frames reduces it by root n. The same
 * frames show how much noise there is (noise_v); the regularisation, the detection threshold and
 * the outliers' limits follow from it.
 *
 * Mean and squared deviations are kept by Welford's recursion, one frame at a time: no frame is
 * stored, and no difference of large sums loses the small deviations in float32.
 *
 *     v0 += (v - v0_old) / n,    m2 += (v - v0_old) (v - v0_new),    noise^2 = mean m2 / (n - 1)
 *
 * Fit to the model: gain = |v_ref| / |v0| with the sign of their correlation, both over the folded
 * rows in use. Voltages may be of any size that is a number (a board in volts, a file in microvolts
 * or in converter steps): a scale is taken out before each square, so that it neither overflows nor
 * vanishes. NaN in v0 marks a row without a reference. */
#include "frame/reference.h"

#include "base/log.h"
#include "base/vec.h"
#include "frame/constants.h"

/* Check that a reference frame is whole: rows that cannot be used must be masked first. */
eits_status eits_check_reference_frame(const eits_context *ctx, const eits_real *frame,
                                       size_t length)
{
    if (length != ctx->model->n_rows)
        return EITS_E_FRAME_LENGTH;
    /* A row without a voltage here would lack a reference in all later frames. The user has to
     * decide that by masking it; a bad frame must not. */
    const eits_real limit = ctx->options.saturation_v;
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        if (!ctx->rows.masked[i] &&
            (!eits_is_finite(frame[i]) || (limit > 0 && eits_fabs(frame[i]) >= limit)))
            return EITS_E_FRAME_ROWS;
    }
    return EITS_OK;
}

/* Returns 1 if a row takes part in the reference: it is not masked now and was not when the
 * reference was taken. */
static int has_reference(const eits_context *ctx, uint32_t row)
{
    return row != EITS_FOLD_NONE && !ctx->rows.masked[row] &&
           eits_is_finite(ctx->reference.v0[row]);
}

/* Returns the reference on one folded row: the mean of both sides in use; 0 if neither is. */
static eits_real folded_reference(const eits_context *ctx, eits_fold fold)
{
    const eits_real *v0 = ctx->reference.v0;
    const int first = has_reference(ctx, fold.first), second = has_reference(ctx, fold.second);
    const eits_real turned = second ? (eits_real)fold.sign * v0[fold.second] : 0;
    return first && second ? R(0.5) * (v0[fold.first] + turned) : (first ? v0[fold.first] : turned);
}

/* Returns the gain that makes row i's reference the model's `expected`; 1 if their signs differ. */
static eits_real own_gain(const eits_context *ctx, uint32_t i, eits_real expected)
{
    const eits_real measured = ctx->reference.gain * ctx->reference.v0[i],
                    ratio = expected / measured;
    if (!(ratio > 0) || !eits_is_finite(ratio))
        return 1;
    return ratio > EITS_MAX_ROW_GAIN
               ? EITS_MAX_ROW_GAIN
               : (ratio < 1 / EITS_MAX_ROW_GAIN ? 1 / EITS_MAX_ROW_GAIN : ratio);
}

/* Measure the distance of the reference from the model and of its rows from their reciprocals, and
 * learn the shift of places from the gains (places.c). A fold without reference is taken as
 * modelled. */
static void measure_distance(eits_context *ctx)
{
    const eits_model *model = ctx->model;
    eits_reference *b = &ctx->reference;
    eits_real logs = 0, apart = 0;
    eits_place_sums sums = {{0}, {0}, {0}, {0}};
    uint32_t count = 0, pairs = 0;
    for (uint32_t k = 0; k < model->n_folded; ++k) {
        const eits_fold fold = model->fold[k];
        const int first = has_reference(ctx, fold.first), second = has_reference(ctx, fold.second);
        if (!first && !second)
            continue;
        const eits_real expected = (eits_real)model->v_ref[k],
                        gain = first ? own_gain(ctx, fold.first, expected)
                                     : own_gain(ctx, fold.second, (eits_real)fold.sign * expected),
                        log_gain = eits_log(gain);
        logs = eits_fma(log_gain, log_gain, logs);
        ++count;
        eits_add_log_gain(model, k, log_gain, &sums);
        if (!first || !second)
            continue;
        const eits_real difference =
            (b->v0[fold.first] - (eits_real)fold.sign * b->v0[fold.second]) / b->v0_rms;
        apart = eits_fma(difference, difference, apart);
        ++pairs;
    }
    b->distance = count > 0 ? eits_sqrt(logs / (eits_real)count) : 0;
    eits_learn_places(ctx, &sums);
    b->reciprocity = pairs > 0 ? eits_sqrt(apart / (eits_real)pairs) : 0;
}

/* Learn the row gains, which make the reference equal to the model's, row by row.
 *
 * An uneven sheet changes the field of each drive and measuring pair alike for the reference and
 * for the signal of a touch. So the ratio in the reference is, to first order, the ratio in the
 * data, and dividing it out leaves data of the modelled sheet. This does not hold if the instrument
 * differs from the model (another order of rows, gains of single channels, contacts). */
void eits_learn_row_gains(eits_context *ctx)
{
    const eits_model *model = ctx->model;
    eits_reference *b = &ctx->reference;
    measure_distance(ctx);
    b->far = model->uncertainty.errors != NULL && model->data_kind != EITS_DATA_NORMALISED &&
             (b->distance > EITS_MAX_DISTANCE || b->reciprocity > EITS_MAX_RECIPROCITY);
    b->row_gains = ctx->options.row_gains != 0 && model->uncertainty.row_gains != 0 &&
                   model->data_kind != EITS_DATA_NORMALISED && !b->far;
    for (uint32_t i = 0; i < model->n_rows; ++i)
        b->row_gain[i] = 1;
    for (uint32_t k = 0; b->row_gains && k < model->n_folded; ++k) {
        const eits_fold fold = model->fold[k];
        const eits_real expected = (eits_real)model->v_ref[k];
        if (has_reference(ctx, fold.first))
            b->row_gain[fold.first] = own_gain(ctx, fold.first, expected);
        if (has_reference(ctx, fold.second))
            b->row_gain[fold.second] = own_gain(ctx, fold.second, (eits_real)fold.sign * expected);
    }
    ctx->projection.stale = 1;
}

/* Set gain, correlation and v0_rms from v0; a scale is taken out first so that squares neither
 * overflow nor vanish. */
eits_status eits_fit_reference(eits_context *ctx)
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
    /* The sign belongs to the wiring: a board that swaps V+ and V- measures as well as any other.
     */
    if (b->correlation < 0)
        b->gain = -b->gain;
    ctx->projection.stale = 1;
    if (!eits_is_finite(b->gain) || b->gain == 0)
        return EITS_E_FRAME_ZERO;
    eits_learn_row_gains(ctx);
    return EITS_OK;
}

/* Returns the greatest power of two up to the greatest voltage in use, limited to numbers that have
 * an inverse.
 *
 * It is a power of two so that dividing by it rounds nothing. */
eits_real eits_reference_unit(const eits_context *ctx, const eits_real *frame)
{
    eits_real largest = 0, unit = 1;
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i)
        largest =
            !ctx->rows.masked[i] && eits_fabs(frame[i]) > largest ? eits_fabs(frame[i]) : largest;
    while (unit <= R(0.5) * largest)
        unit *= 2;
    while (unit > largest && unit > R(0x1p-125))
        unit *= R(0.5);
    return unit;
}

/* Returns the rms over rows of the frames' deviation so far; 0 if it is out of range.
 *
 * One number serves for all rows, since the front end's noise is white. With few frames, an
 * estimate per row would itself be noise. */
eits_real eits_reference_noise(const eits_context *ctx)
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

/* Frames that were rounded, or measured in steps without noise, may repeat to the last bit: that
 * does not show a noiseless front end. */
eits_real eits_noise_floor_v(const eits_context *ctx)
{
    const eits_real rounding = EITS_NOISE_ROUNDING * ctx->reference.v0_rms;
    return ctx->options.noise_floor_v > rounding ? ctx->options.noise_floor_v : rounding;
}

eits_real eits_lambda_noise_floor(const eits_context *ctx)
{
    const eits_real noise = ctx->model->data_kind == EITS_DATA_NORMALISED
                                ? eits_noise_floor_v(ctx) / ctx->reference.v0_rms
                                : eits_noise_floor_v(ctx) * eits_fabs(ctx->reference.gain);
    return EITS_MAX_OF_NOISE * (eits_real)ctx->model->noise_gain * noise;
}

/* Take one more frame into the mean and the squares; rows that were masked lose their reference. */
void eits_take_reference_frame(eits_context *ctx, const eits_real *frame)
{
    eits_reference *b = &ctx->reference;
    ++b->count;
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) { /* Welford, Technometrics 4 (1962) 419 */
        if (ctx->rows.masked[i] == EITS_MASKED_NOW)
            continue;
        if (ctx->rows.masked[i])
            b->v0[i] = R(NAN);
        if (!eits_is_finite(b->v0[i]))
            continue;
        /* Deviations are in units of m2_unit, since the square of a microvolt vanishes in float32
         * beside that of a volt. */
        const eits_real delta = frame[i] - b->v0[i];
        b->v0[i] += delta / (eits_real)b->count;
        b->m2[i] = eits_fma(delta / b->m2_unit, (frame[i] - b->v0[i]) / b->m2_unit, b->m2[i]);
    }
}

/* The second frame waits in m2 until a third one decides which of the two is right where they
 * differ. */
void eits_keep_second_frame(eits_context *ctx, const eits_real *frame)
{
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        if (ctx->rows.masked[i])
            ctx->reference.v0[i] = R(NAN);
    }
    eits_copy(ctx->reference.m2, frame, ctx->model->n_rows);
    ctx->reference.count = 2;
    ctx->reference.second_waits = 1;
}

void eits_take_second_frame(eits_context *ctx)
{
    eits_reference *b = &ctx->reference;
    for (uint32_t i = 0; i < ctx->model->n_rows;
         ++i) { /* the same recursion as in eits_take_reference_frame */
        const eits_real delta = b->m2[i] - b->v0[i], second = b->m2[i];
        b->m2[i] = 0;
        if (!eits_is_finite(b->v0[i]))
            continue;
        b->v0[i] += delta / 2;
        b->m2[i] = eits_fma(delta / b->m2_unit, (second - b->v0[i]) / b->m2_unit, 0);
    }
    b->second_waits = 0;
}

/* ---- stillness ----
 *
 * Whether the skin stayed untouched while a reference was learned.
 *
 * Noise, mains hum and single bad readings change a row and its reciprocal independently of each
 * other. A touch that lands, moves or lifts changes both alike. So each frame is compared with the
 * mean so far, pair by pair, and two energies are summed: that of the common part of a pair's
 * changes, and that of their difference. Without a touch they are equal up to chance. The common
 * part along the reference itself is left out, because the gain may drift without a touch.
 *
 * A frame whose pairs agree to the last bit was measured by half, and shows nothing. Protocols
 * without reciprocals, and references from a single frame, are not examined. */

/* Returns 1 if both rows of the fold are in use. */
static int is_pair(const eits_context *ctx, eits_fold fold)
{
    const eits_real *v0 = ctx->reference.v0;
    return fold.first != EITS_FOLD_NONE && fold.second != EITS_FOLD_NONE &&
           !ctx->rows.masked[fold.first] && !ctx->rows.masked[fold.second] &&
           eits_is_finite(v0[fold.first]) && eits_is_finite(v0[fold.second]);
}

static int measured_in_full(const eits_context *ctx, const eits_real *frame)
{
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        const eits_fold fold = ctx->model->fold[k];
        if (is_pair(ctx, fold) && frame[fold.first] != (eits_real)fold.sign * frame[fold.second])
            return 1;
    }
    return 0;
}

/* The parts of fold k's reference and change, in units of m2_unit; returns 0 if the fold is no pair
 * in use. */
static int parts(const eits_context *ctx, uint32_t k, const eits_real *frame, eits_real *reference,
                 eits_real *common, eits_real *apart)
{
    const eits_reference *b = &ctx->reference;
    const eits_fold fold = ctx->model->fold[k];
    if (!is_pair(ctx, fold))
        return 0;
    const eits_real sign = (eits_real)fold.sign,
                    first = (frame[fold.first] - b->v0[fold.first]) / b->m2_unit,
                    second = sign * (frame[fold.second] - b->v0[fold.second]) / b->m2_unit;
    *reference = (b->v0[fold.first] + sign * b->v0[fold.second]) / b->m2_unit;
    *common = first + second;
    *apart = first - second;
    return 1;
}

void eits_compare_stillness(eits_context *ctx, const eits_real *frame)
{
    eits_reference *b = &ctx->reference;
    eits_real size = 0, along = 0, reference, common, apart;
    if (!measured_in_full(ctx, frame))
        return;
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        if (!parts(ctx, k, frame, &reference, &common, &apart))
            continue;
        size = eits_fma(reference, reference, size);
        along = eits_fma(reference, common, along);
    }
    const eits_real slope = size > 0 ? along / size : 0;
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        if (!parts(ctx, k, frame, &reference, &common, &apart))
            continue;
        const eits_real rest = eits_fma(-slope, reference, common);
        b->still.common = eits_fma(rest, rest, b->still.common);
        b->still.apart = eits_fma(apart, apart, b->still.apart);
        ++b->still.pairs;
    }
    b->still.size += size;
}

int eits_reference_moved(const eits_context *ctx)
{
    const eits_stillness *still = &ctx->reference.still;
    if (still->pairs == 0)
        return 0;
    /* Each energy is that of `pairs` normal numbers: its relative deviation is sqrt(2 / pairs), and
     * that of the ratio sqrt(4 / pairs). */
    const eits_real pairs = (eits_real)still->pairs,
                    limit = 1 + EITS_MOVED_DEVIATIONS * 2 / eits_sqrt(pairs),
                    fraction = EITS_MOVED_FRACTION * EITS_MOVED_FRACTION * still->size;
    /* Without noise a converter rounds a row and its reciprocal alike. */
    const eits_real step = EITS_MOVED_STEPS * ctx->options.noise_floor_v / ctx->reference.m2_unit,
                    rounding = step * step * pairs;
    return still->common > limit * still->apart &&
           still->common - still->apart > eits_larger(fraction, rounding);
}
