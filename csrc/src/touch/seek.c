/* Discs from the data themselves, for models and instruments whose image misleads.
 *
 * A taught model errs in proportion to a press, so that its sparse image shows either ripple around
 * a strong touch or nothing of a weak one beside it, whatever lambda. Here touches are added one
 * after the other where what is left answers most (matching pursuit), all fitted off the grid each
 * time. A first disc between two touches would keep its place: so each is then taken out and sought
 * again beside the others, and stays where that leaves less (exchange, as in subset selection). The
 * last one added stays if each disc explains touch_min_fraction of |y|^2.
 *
 * On sums of two presses of a hydrogel skin this finds as many as the best of all pairs of pixels
 * (studies/results/teaching.md). A candidate costs S'v, an exchange one a disc.
 *
 * An instrument that is far from the model errs by as much as a touch gives. A disc then fits the
 * errors, near the rim where a small one can be of any strength. One regularised step from the
 * skin as it was,
 *
 *     image = D S'y,    D the column weights, |J_j|^-1/2: NOSER (Cheney and others, Int. J. Imaging
 *                       Syst. Technol. 2 (1990) 66), by the regularisation of such instruments
 *
 * averages over all rows: its blob is wide, but lies where the touch is. */
#include "touch/constants.h"
#include "touch/disc_fit.h"

#include "base/vec.h"
#include "context/products.h"
#include "frame/whitening.h"
#include "kernels/kernels.h"

/* S' of `data` (stride numbers), where it is seen. */
static eits_real *answer_to(eits_context *ctx, const eits_scratch *scratch, const eits_real *data,
                            eits_fit *f)
{
    eits_apply_t(ctx, eits_adjoint(ctx, data, scratch->row[6]), scratch->pixel[0]);
    f->macs += (uint64_t)ctx->model->n_pixels * ctx->model->rank + eits_adjoint_macs(ctx);
    return scratch->pixel[0];
}

/* The pixel that answers most, of a sign that is looked for; the first where none does. */
static uint32_t greatest_pixel(const eits_context *ctx, const eits_real *answer)
{
    const eits_sign sign = ctx->options.sign;
    eits_real greatest = 0;
    uint32_t at = 0;
    for (uint32_t j = 0; j < ctx->model->n_pixels; ++j) {
        const eits_real size = sign == EITS_SIGN_INCREASE   ? answer[j]
                               : sign == EITS_SIGN_DECREASE ? -answer[j]
                                                            : eits_fabs(answer[j]);
        if (size > greatest) {
            greatest = size;
            at = j;
        }
    }
    return at;
}

/* A disc without strength at the pixel that answers most. */
static eits_disc candidate(eits_context *ctx, const eits_scratch *scratch, eits_fit *f)
{
    const eits_model *model = ctx->model;
    const eits_real *answer = answer_to(ctx, scratch, f->residual, f);
    const uint32_t at = greatest_pixel(ctx, answer);
    return (eits_disc){
        .x_mm = eits_fma((eits_real)model->pixel[at].ix + R(0.5), (eits_real)model->pixel_mm,
                         (eits_real)model->origin_x_mm),
        .y_mm = eits_fma((eits_real)model->pixel[at].iy + R(0.5), (eits_real)model->pixel_mm,
                         (eits_real)model->origin_y_mm),
        .radius_mm = ctx->options.touch_seed_radius_mm,
        .polarity = answer[at] < 0 ? R(-1) : R(1),
    };
}

static void add(eits_context *ctx, const eits_scratch *scratch, eits_fit *f)
{
    f->disc[f->count] = candidate(ctx, scratch, f);
    ++f->count;
    eits_fit_strengths(ctx, scratch, f);
    eits_fit_move_all(ctx, scratch, f, EITS_SEEK_SWEEPS);
}

/* Each disc sought again beside the others; 1 where any is better elsewhere. */
static int exchange(eits_context *ctx, const eits_scratch *scratch, eits_fit *f)
{
    int any = 0;
    for (uint32_t k = 0; k < f->count && eits_fit_may_go_on(ctx, f); ++k) {
        const eits_fit_kept before = eits_fit_keep(ctx, f);
        --f->count;
        for (uint32_t l = k; l < f->count; ++l)
            f->disc[l] = f->disc[l + 1u];
        eits_fit_strengths(ctx, scratch, f);
        add(ctx, scratch, f);
        if (eits_fit_left(ctx, f) < EITS_SEEK_GAIN * before.left)
            any = 1;
        else
            eits_fit_undo(ctx, scratch, f, &before);
    }
    return any;
}

/* Whether the discs are better than those before the last was added. */
static int is_worth_it(eits_context *ctx, eits_fit *f, eits_real left_before)
{
    const eits_real least = ctx->options.touch_min_fraction;
    eits_fit_explain(ctx, f);
    for (uint32_t k = 0; k < f->count; ++k) {
        if (!(f->explained[k] > 0) || (f->count > 1u && f->explained[k] < least))
            return 0;
    }
    return f->count == 1u || left_before - eits_fit_left(ctx, f) >= least * f->total;
}

void eits_fit_seek(eits_context *ctx, const eits_scratch *scratch, eits_fit *f)
{
    f->count = 0;
    eits_fit_restart(ctx, scratch, f);
    while (f->count < ctx->options.max_touches && eits_fit_may_go_on(ctx, f)) {
        const eits_fit_kept before = eits_fit_keep(ctx, f);
        add(ctx, scratch, f);
        for (int round = 0;
             f->count > 1u && f->count <= EITS_SEEK_EXCHANGED && round < EITS_SEEK_ROUNDS;
             ++round) {
            if (!exchange(ctx, scratch, f))
                break;
        }
        if (!is_worth_it(ctx, f, before.left)) {
            eits_fit_undo(ctx, scratch, f, &before);
            return;
        }
    }
}

/* ---- the one touch of an instrument that is far from the model ---- */

/* Middle (x, y) and second moments about it (xx, xy, yy) of the blob about pixel `at`, in pixels:
 * what is at least CENTRE_SHARE of the image there. A pixel is as wide as it is. */
static void moments_of_blob(const eits_model *model, const eits_real *image, uint32_t at,
                            eits_real middle[2], eits_real second[3])
{
    const eits_real peak = image[at], inverse = 1 / peak;
    eits_real total = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;
    for (uint32_t j = 0; j < model->n_pixels; ++j) {
        const eits_real share = image[j] * inverse;
        if (!(share >= EITS_CENTRE_SHARE))
            continue;
        /* from the peak: small numbers, whose squares lose nothing */
        const eits_real dx = (eits_real)model->pixel[j].ix - (eits_real)model->pixel[at].ix,
                        dy = (eits_real)model->pixel[j].iy - (eits_real)model->pixel[at].iy;
        total += share;
        x = eits_fma(share, dx, x);
        y = eits_fma(share, dy, y);
        xx = eits_fma(share * dx, dx, xx);
        xy = eits_fma(share * dx, dy, xy);
        yy = eits_fma(share * dy, dy, yy);
    }
    x /= total;
    y /= total;
    middle[0] = (eits_real)model->pixel[at].ix + R(0.5) + x;
    middle[1] = (eits_real)model->pixel[at].iy + R(0.5) + y;
    second[0] = eits_fma(-x, x, xx / total) + R(1.0) / 12;
    second[1] = eits_fma(-x, y, xy / total);
    second[2] = eits_fma(-y, y, yy / total) + R(1.0) / 12;
}

void eits_fit_centre(eits_context *ctx, const eits_scratch *scratch, eits_fit *f)
{
    const eits_model *model = ctx->model;
    if (!ctx->reference.far || !f->tested || f->count != 1 ||
        !(f->confidence[0] < EITS_CENTRE_SURE))
        return;
    eits_real *image = answer_to(ctx, scratch, ctx->frame.y, f), middle[2], second[3];
    for (uint32_t j = 0; j < model->n_pixels; ++j)
        image[j] *= (eits_real)model->column_weight[j];
    if (!(eits_greatest(ctx->kernels, image, model->n_pixels, ctx->options.sign) > 0))
        return;
    const uint32_t at = greatest_pixel(ctx, image);
    moments_of_blob(model, image, at, middle, second);
    if (!eits_all_finite(middle, 2) || !eits_all_finite(second, 3))
        return;
    const eits_fit_kept before = eits_fit_keep(ctx, f);
    const eits_real *data = f->data, pixel = (eits_real)model->pixel_mm;
    f->data = ctx->frame.y; /* it may lack what other discs did to each other */
    f->disc[0] = (eits_disc){
        .x_mm = eits_fma(middle[0], pixel, (eits_real)model->origin_x_mm),
        .y_mm = eits_fma(middle[1], pixel, (eits_real)model->origin_y_mm),
        .radius_mm = ctx->options.touch_seed_radius_mm,
        .polarity = image[at] < 0 ? R(-1) : R(1),
    };
    eits_fit_strengths(ctx, scratch, f);
    eits_fit_explain(ctx, f);
    if (!(f->explained[0] > 0)) { /* a blob of two halves may be of neither */
        f->data = data;
        eits_fit_undo(ctx, scratch, f, &before);
        eits_fit_explain(ctx, f);
        return;
    }
    for (int i = 0; i < 3; ++i)
        f->place_mm2[0][i] = EITS_CENTRE_SPREAD * pixel * pixel * second[i];
}
