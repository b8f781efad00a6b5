/* Discs from the data themselves, for models whose image misleads.
 *
 * A taught model errs in proportion to a press, so that its sparse image shows either ripple around
 * a strong touch or nothing of a weak one beside it, whatever lambda. Here touches are added one
 * after the other where what is left answers most (matching pursuit), all fitted off the grid each
 * time. A first disc between two touches would keep its place: so each is then taken out and sought
 * again beside the others, and stays where that leaves less (exchange, as in subset selection). The
 * last one added stays if each disc explains touch_min_fraction of |y|^2.
 *
 * On sums of two presses of a hydrogel skin this finds as many as the best of all pairs of pixels
 * (docs/results/teaching.md). A candidate costs S'v, an exchange one a disc. */
#include "touch/constants.h"
#include "touch/disc_fit.h"

#include "base/vec.h"
#include "context/products.h"
#include "frame/whitening.h"

/* A disc without strength at the pixel that answers most, of a sign that is looked for. */
static eits_disc candidate(eits_context *ctx, const eits_scratch *scratch, eits_fit *f)
{
    const eits_model *model = ctx->model;
    const eits_sign sign = ctx->options.sign;
    eits_real *answer = scratch->pixel[0], greatest = 0;
    uint32_t at = 0;
    eits_apply_t(ctx, eits_adjoint(ctx, f->residual, scratch->row[6]), answer);
    f->macs += (uint64_t)model->n_pixels * model->rank + eits_adjoint_macs(ctx);
    for (uint32_t j = 0; j < model->n_pixels; ++j) {
        const eits_real size = sign == EITS_SIGN_INCREASE   ? answer[j]
                               : sign == EITS_SIGN_DECREASE ? -answer[j]
                                                            : eits_fabs(answer[j]);
        if (size > greatest) {
            greatest = size;
            at = j;
        }
    }
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
    for (uint32_t k = 0; k < f->count; ++k) {
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
    while (f->count < ctx->options.max_touches) {
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
