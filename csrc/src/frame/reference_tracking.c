/* Reference tracking: the reference follows the skin. While nothing touches the skin, all of the
 * reference follows; under a touch, only its size.
 *
 * A skin dries, warms and creeps, and an old reference shows that as touches. The reference may
 * therefore move while nothing touches the skin. It must never move towards a touch: the touch
 * would fade, and leave its negative behind. With N = reference_frames:
 *
 *   - N / 16 consecutive frames without any touch are averaged. When a touch comes or goes, these
 *     frames are dropped, and so are as many after it, in which the touch lands or a soft skin
 *     creeps back.
 *   - The mean's difference from the reference must not look like a touch too light to be detected:
 *     no single column of S may explain nearly all of it. White noise, and drift of a whole sheet,
 *     spread over many columns.
 *   - Then the reference moves a sixteenth of the way (with N < 16: one frame at a time, by 1 / N).
 *
 * A touch below the detection threshold can thus move the reference by at most a sixteenth of the
 * threshold before it is detected. A touch that grows by less than about half the threshold in 2.4
 * N frames is below the noise of each mean, and the reference follows it like drift: it cannot be
 * distinguished from a skin that dries in one place.
 *
 * Under touches the reference keeps its pattern, for however long. Only its size follows, and only
 * after the same number of touches has been there for N / 4 frames. Of each mean this takes the
 * part along the reference that no touch can explain, u'y / u'u, where u is the reduced reference
 * without its parts along the touches' columns, and holds it where the first mean had it. So an
 * even sheet that dries under a resting hand changes its force by little. Uneven drying cannot be
 * distinguished from the hand.
 *
 * A reference that has moved is fitted to the model again, as a tare is: gain and row gains are
 * found again, the noise stays. */
#include "frame/reference.h"

#include "base/vec.h"
#include "context/products.h"
#include "context/projection.h"
#include "frame/constants.h"
#include "frame/fold.h"
#include "frame/whitening.h"
#include "kernels/column.h"

static uint32_t frames_apart(const eits_context *ctx)
{
    return ctx->options.reference_frames / EITS_REFERENCE_TRACKING_PARTS;
}

int eits_tracks_reference(const eits_context *ctx)
{
    return ctx->options.reference_frames > 0 && ctx->reference.tracking.seen > frames_apart(ctx);
}

void eits_reference_tracking_break(eits_context *ctx)
{
    eits_reference_tracking *f = &ctx->reference.tracking;
    f->frames = f->open = f->means = 0;
    f->rest = frames_apart(ctx);
}

void eits_reference_tracking_add(eits_context *ctx, const eits_real *frame)
{
    eits_reference *b = &ctx->reference;
    if (ctx->options.reference_frames == 0)
        return;
    if (b->tracking.open) /* eits_find_touches was not called for the last frame */
        eits_reference_tracking_break(ctx);
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        const eits_real off = ctx->rows.unusable[i] ? R(NAN) : frame[i] - b->v0[i];
        b->m2[i] = b->tracking.frames > 0 ? b->m2[i] + off : off;
    }
    b->tracking.open = 1;
    b->tracking.seen += b->tracking.seen < UINT32_MAX;
}

/* out = the data of `frame`, reduced and whitened, not projected. */
static void reduce(eits_context *ctx, const eits_scratch *scratch, const eits_real *frame,
                   eits_real *out, uint64_t *macs)
{
    uint32_t count = 0;
    eits_fold_data(ctx, frame);
    for (uint32_t k = 0; k < ctx->model->n_folded; ++k) {
        scratch->index[count] = k;
        scratch->value[count] = ctx->frame.d[k];
        count += ctx->frame.sides[k] != EITS_SIDE_NONE;
    }
    *macs += eits_reduce_whole(ctx, scratch, count, out);
}

/* out (stride numbers) += factor S_j. */
static void add_column(const eits_context *ctx, const eits_scratch *scratch, uint32_t j,
                       eits_real factor, eits_real *out)
{
    const eits_matrix *s = &ctx->model->sensitivity;
    eits_axpy(ctx->kernels, out, factor * eits_column_scale(s, j),
              eits_column(s, j, scratch->row[7]), ctx->model->rank);
}

/* ---- untouched ---- */

/* The fraction of a frame's |y|^2 that the best single column of S explains, 0 to 1. */
static eits_real best_match(eits_context *ctx, const eits_scratch *scratch, const eits_real *frame,
                            uint64_t *macs)
{
    const eits_model *model = ctx->model;
    eits_real *y = scratch->row[5], *column = scratch->row[6], *match = scratch->pixel[0];
    uint32_t best = 0;
    reduce(ctx, scratch, frame, y, macs);
    *macs += eits_project(ctx, y) + (uint64_t)model->rank * model->n_pixels;
    eits_apply_t(ctx, eits_adjoint(ctx, y, scratch->row[4]), match);
    for (uint32_t j = 1; j < model->n_pixels; ++j)
        best = eits_fabs(match[j]) > eits_fabs(match[best]) ? j : best;
    if (!(eits_fabs(match[best]) > eits_lambda_noise_floor(ctx))) /* rounding */
        return 0;
    eits_zero(column, EITS_STRIDE(model->rank));
    add_column(ctx, scratch, best, 1, column);
    *macs += eits_whiten(ctx, column) + eits_project(ctx, column);
    return match[best] * match[best] /
           (eits_dot(ctx->kernels, y, y, model->rank) *
            eits_dot(ctx->kernels, column, column, model->rank));
}

/* Move the reference towards the mean of `count` frames, in m2, unless the mean looks like a touch.
 * Returns 1 if it moved. */
static int move(eits_context *ctx, const eits_scratch *scratch, uint32_t count, uint64_t *macs)
{
    eits_reference *b = &ctx->reference;
    const eits_real share = (eits_real)count / (eits_real)ctx->options.reference_frames,
                    weight = share < 1 ? share : 1;
    if (!(b->tracking.level > 0))
        b->tracking.level = ctx->info.lambda_max;
    if (best_match(ctx, scratch, b->m2, macs) > EITS_REFERENCE_TRACKING_TOUCH)
        return 0;
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i)
        b->v0[i] = eits_fma(weight, b->m2[i] - b->v0[i], b->v0[i]);
    return 1;
}

/* ---- under touches ---- */

/* out (stride numbers) = F times S at a touch's place, interpolated between the centres of pixels.
 * The nearest pixel alone would not do: steps of the fit end on edges of pixels, where rounding
 * would choose between two. */
static void read_place(const eits_context *ctx, const eits_scratch *scratch,
                       const eits_touch *touch, eits_real *out, uint64_t *macs)
{
    const eits_model *m = ctx->model;
    const eits_real x = (touch->x_mm - (eits_real)m->origin_x_mm) / (eits_real)m->pixel_mm - R(0.5),
                    y = (touch->y_mm - (eits_real)m->origin_y_mm) / (eits_real)m->pixel_mm - R(0.5);
    eits_zero(out, EITS_STRIDE(m->rank));
    for (uint32_t k = 0; k < m->nx * m->ny; ++k) {
        const uint32_t j = ctx->cell[k];
        const eits_real across = 1 - eits_fabs((eits_real)(k % m->nx) - x),
                        along = 1 - eits_fabs((eits_real)(k / m->nx) - y);
        if (j == EITS_NO_PIXEL || !(across > 0 && along > 0) || m->column_weight[j] == 0.0f)
            continue;
        add_column(ctx, scratch, j, across * along / (eits_real)m->column_weight[j], out);
        *macs += m->rank;
    }
    *macs += eits_whiten(ctx, out);
}

/* Orthonormal directions that the touches' columns span, stride apart; returns their number. */
static uint32_t span_touches(const eits_context *ctx, const eits_scratch *scratch,
                             const eits_touch *touches, uint32_t count, eits_real *direction,
                             uint64_t *macs)
{
    const uint32_t rank = ctx->model->rank;
    uint32_t known = 0;
    for (uint32_t k = 0; k < count && known < rank; ++k) {
        read_place(ctx, scratch, &touches[k], direction + known * EITS_STRIDE(rank), macs);
        /* 0 for a touch off the skin, and for one whose column the others span already */
        known +=
            (uint32_t)eits_add_direction(ctx, direction, known, EITS_REFERENCE_TRACKING_LEFT, macs);
    }
    return known;
}

/* Returns the growth of the frame in m2 over the reference, apart from the parts that its touches
 * explain; 0 if they may explain all of it. Overwrites m2. */
static eits_real gain_beside(eits_context *ctx, const eits_scratch *scratch,
                             const eits_touch *touches, uint32_t count, uint64_t *macs)
{
    eits_reference *b = &ctx->reference;
    const uint32_t rank = ctx->model->rank;
    eits_real *y = scratch->row[5], *u = scratch->row[6];
    reduce(ctx, scratch, b->m2, y, macs);
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i)
        b->m2[i] = 2 * b->v0[i];
    reduce(ctx, scratch, b->m2, u, macs);
    const eits_real whole = eits_dot(ctx->kernels, u, u, rank);
    const uint32_t known = span_touches(ctx, scratch, touches, count, scratch->square, macs);
    *macs += eits_take_out(ctx, scratch->square, known, u);
    const eits_real left = eits_dot(ctx->kernels, u, u, rank);
    return left > EITS_REFERENCE_TRACKING_LEFT * whole ? eits_dot(ctx->kernels, u, y, rank) / left
                                                       : 0;
}

/* Scale the reference by as much as the skin beside the touches has grown. Returns 1 if it did. */
static int grow(eits_context *ctx, const eits_scratch *scratch, const eits_touch *touches,
                uint32_t count, uint32_t frames, uint64_t *macs)
{
    eits_reference *b = &ctx->reference;
    eits_reference_tracking *f = &b->tracking;
    if (ctx->model->data_kind != EITS_DATA_DIFFERENCE) /* ratios are the same at any size */
        return 0;
    const eits_real gain = gain_beside(ctx, scratch, touches, count, macs);
    if (f->means++ == 0)
        f->gain = gain;
    const eits_real by = gain - f->gain;
    if ((uint64_t)4 * f->means * frames <= ctx->options.reference_frames || by == 0 ||
        !(eits_fabs(by) < EITS_REFERENCE_TRACKING_GAIN))
        return 0;
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i)
        b->v0[i] = eits_fma(by, b->v0[i], b->v0[i]);
    return 1;
}

/* ---- one frame after the other ---- */

/* Whether each touch was there in the frame before, within options.follow_mm. */
static int were_there(const eits_context *ctx, const eits_touch *touches, uint32_t count)
{
    const eits_reference_tracking *f = &ctx->reference.tracking;
    const eits_real reach = ctx->options.follow_mm;
    for (uint32_t k = 0; k < count; ++k) {
        int there = 0;
        for (uint32_t l = 0; l < count && !there; ++l) {
            const eits_real dx = touches[k].x_mm - f->at[l][0], dy = touches[k].y_mm - f->at[l][1];
            there = eits_fma(dx, dx, dy * dy) <= reach * reach;
        }
        if (!there)
            return 0;
    }
    return 1;
}

/* Keep the touches of a frame, and drop the mean under way where they are other touches than those
 * of the frame before. */
static void keep_touches(eits_context *ctx, const eits_touch *touches, uint32_t count, int known)
{
    eits_reference_tracking *f = &ctx->reference.tracking;
    const uint32_t now = known ? count : EITS_TOUCHES_UNKNOWN;
    if (now != f->touches || (known && !were_there(ctx, touches, count)))
        eits_reference_tracking_break(ctx);
    f->touches = now;
    for (uint32_t k = 0; k < count; ++k) {
        f->at[k][0] = touches[k].x_mm;
        f->at[k][1] = touches[k].y_mm;
    }
}

int eits_reference_tracking_end(eits_context *ctx, const eits_scratch *scratch,
                                const eits_touch *touches, uint32_t count, int known,
                                uint64_t *macs)
{
    eits_reference *b = &ctx->reference;
    eits_reference_tracking *f = &b->tracking;
    if (!f->open)
        return 0;
    keep_touches(ctx, touches, count, known);
    f->open = 0;
    if (f->rest > 0) {
        --f->rest;
        return 0;
    }
    const uint32_t frames = ++f->frames;
    if (frames < frames_apart(ctx))
        return 0;
    f->frames = 0;
    if (!known)
        return 0;
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        const eits_real off = b->m2[i] / (eits_real)frames;
        b->m2[i] = eits_is_finite(off) ? b->v0[i] + off : b->v0[i];
    }
    const int moved = count == 0 ? move(ctx, scratch, frames, macs)
                                 : grow(ctx, scratch, touches, count, frames, macs);
    if (moved)
        b->ready = eits_fit_reference(ctx) == EITS_OK;
    return moved;
}
