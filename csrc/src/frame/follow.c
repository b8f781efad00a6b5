/* The reference follows the skin: all of it while nothing touches it, its size alone under a hand.
 *
 * A skin dries, warms and creeps, and an old reference shows that as touches. Between touches there
 * is nothing on it: so the reference may go after the frames then. What would be ruinous is to go
 * after a touch, which fades and leaves its negative behind. Hence, with N = reference_frames:
 *
 *   - N / 16 frames on end without any touch, reported, tentative or held, are averaged; where a
 *     touch comes or goes, all of them are let go, with as many more, in which it lands or a soft
 *     skin creeps back
 *   - the mean's difference to the reference must not look like a touch that is too light to be
 *     found: one column of S must not give nearly all of it. White noise and drift of a whole sheet
 *     spread over many
 *   - then the reference moves a sixteenth of the way (with N < 16: a frame at a time, 1 / N)
 *
 * So what a touch below the threshold can move it by until it is found is a sixteenth of the
 * threshold. A touch that grows by less than about half the detection threshold in 2.4 N frames is
 * below the noise of each mean, and is followed like drift: nothing tells it from a skin that
 * dries at one place.
 *
 * Under touches the reference keeps its pattern, however long. Only how large it is follows, and
 * only where the same number of touches has been there for N / 4 frames: of each mean the part
 * along the reference that no touch gives, u'y / u'u with u the reduced reference less its parts
 * along the touches' columns, is held where the first mean had it. So an even sheet that dries
 * under a resting hand changes its force by little; what dries unevenly, nothing can tell from the
 * hand.
 *
 * A reference that has moved is fitted to the model again, as a tare is: gain and row gains follow,
 * the noise stays. */
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
    return ctx->options.reference_frames / EITS_FOLLOW_PARTS;
}

int eits_follows(const eits_context *ctx)
{
    return ctx->options.reference_frames > 0 && ctx->reference.follow.seen > frames_apart(ctx);
}

void eits_follow_break(eits_context *ctx)
{
    eits_follow *f = &ctx->reference.follow;
    f->frames = f->open = f->means = 0;
    f->rest = frames_apart(ctx);
}

void eits_follow_add(eits_context *ctx, const eits_real *frame)
{
    eits_reference *b = &ctx->reference;
    if (ctx->options.reference_frames == 0)
        return;
    if (b->follow.open) /* nobody looked for touches in it */
        eits_follow_break(ctx);
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        const eits_real off = ctx->rows.unusable[i] ? R(NAN) : frame[i] - b->v0[i];
        b->m2[i] = b->follow.frames > 0 ? b->m2[i] + off : off;
    }
    b->follow.open = 1;
    b->follow.seen += b->follow.seen < UINT32_MAX;
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

/* How much of a frame's |y|^2 the one column of S gives that gives most, 0 to 1. */
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

/* Towards the mean of `count` frames, in m2, unless that looks like a touch. */
static int move(eits_context *ctx, const eits_scratch *scratch, uint32_t count, uint64_t *macs)
{
    eits_reference *b = &ctx->reference;
    const eits_real share = (eits_real)count / (eits_real)ctx->options.reference_frames,
                    weight = share < 1 ? share : 1;
    if (!(b->follow.level > 0))
        b->follow.level = ctx->info.lambda_max;
    if (best_match(ctx, scratch, b->m2, macs) > EITS_FOLLOW_TOUCH)
        return 0;
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i)
        b->v0[i] = eits_fma(weight, b->m2[i] - b->v0[i], b->v0[i]);
    return 1;
}

/* ---- under touches ---- */

/* out (stride numbers) = F times what S gives at a touch, linear between centres of pixels: steps
 * of the fit end on edges of pixels, where rounding would choose the nearest. */
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
        /* not another touch's, nor off the skin */
        known += (uint32_t)eits_add_direction(ctx, direction, known, EITS_FOLLOW_LEFT, macs);
    }
    return known;
}

/* By how much the frame in m2 is larger than the reference, beside what its touches give; 0 where
 * they may give all of it. Overwrites m2. */
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
    return left > EITS_FOLLOW_LEFT * whole ? eits_dot(ctx->kernels, u, y, rank) / left : 0;
}

/* The reference as much larger as the skin beside the touches has become. */
static int grow(eits_context *ctx, const eits_scratch *scratch, const eits_touch *touches,
                uint32_t count, uint32_t frames, uint64_t *macs)
{
    eits_reference *b = &ctx->reference;
    eits_follow *f = &b->follow;
    if (ctx->model->data_kind != EITS_DATA_DIFFERENCE) /* ratios know no size */
        return 0;
    const eits_real gain = gain_beside(ctx, scratch, touches, count, macs);
    if (f->means++ == 0)
        f->gain = gain;
    const eits_real by = gain - f->gain;
    if ((uint64_t)4 * f->means * frames <= ctx->options.reference_frames || by == 0 ||
        !(eits_fabs(by) < EITS_FOLLOW_GAIN))
        return 0;
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i)
        b->v0[i] = eits_fma(by, b->v0[i], b->v0[i]);
    return 1;
}

/* ---- one frame after the other ---- */

int eits_follow_end(eits_context *ctx, const eits_scratch *scratch, const eits_touch *touches,
                    uint32_t count, uint32_t followed, uint64_t *macs)
{
    eits_reference *b = &ctx->reference;
    eits_follow *f = &b->follow;
    if (!f->open)
        return 0;
    if (followed != f->touches)
        eits_follow_break(ctx);
    f->touches = followed;
    f->open = 0;
    if (f->rest > 0) {
        --f->rest;
        return 0;
    }
    const uint32_t frames = ++f->frames;
    if (frames < frames_apart(ctx))
        return 0;
    f->frames = 0;
    if (followed == EITS_FOLLOW_UNKNOWN)
        return 0;
    for (uint32_t i = 0; i < ctx->model->n_rows; ++i) {
        const eits_real off = b->m2[i] / (eits_real)frames;
        b->m2[i] = eits_is_finite(off) ? b->v0[i] + off : b->v0[i];
    }
    const int moved = followed == 0 ? move(ctx, scratch, frames, macs)
                                    : grow(ctx, scratch, touches, count, frames, macs);
    if (moved)
        b->ready = eits_fit_reference(ctx) == EITS_OK;
    return moved;
}
