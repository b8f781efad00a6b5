/* Peaks of the image start discs; the discs are fitted to the reduced data off the grid; those that
 * explain nothing go. */
#include "eitskin/touch.h"
#include "eitskin/force.h"

#include "base/vec.h"
#include "diagnostics/diagnostics.h"
#include "frame/projection.h"
#include "kernels/kernels.h"
#include "touch/disc_fit.h"
#include "touch/interaction.h"
#include "touch/tracker.h"

/* The radius that strength suggests counts for more while it is open which discs there are, and for
 * less once the discs' interaction is known and the data are right to a thousandth. */
static const eits_real EARLY_RADIUS = R(2.0), FINAL_RADIUS = R(0.4);
enum { ROUNDS = 2, LATER_SWEEPS = 2 };

/* ---- peaks ---- */

/* A pixel that none of its eight neighbours exceeds; of equal neighbours the first in order is the
 * peak. */
static int is_peak(const eits_context *ctx, uint32_t j)
{
    const eits_model *model = ctx->model;
    const eits_pixel at = model->pixel[j];
    const eits_real here = eits_fabs(ctx->image[j]);
    for (uint32_t iy = at.iy > 0 ? at.iy - 1u : 0; iy <= at.iy + 1u && iy < model->ny; ++iy) {
        for (uint32_t ix = at.ix > 0 ? at.ix - 1u : 0; ix <= at.ix + 1u && ix < model->nx; ++ix) {
            const uint32_t other = ctx->cell[(size_t)iy * model->nx + ix];
            if (other == EITS_NO_PIXEL || other == j)
                continue;
            const eits_real there = eits_fabs(ctx->image[other]);
            if (there > here || (there == here && other < j))
                return 0;
        }
    }
    return 1;
}

/* The greatest peaks, in descending order. */
static void seed(const eits_context *ctx, eits_fit *f)
{
    const eits_model *model = ctx->model;
    const eits_options *o = &ctx->options;
    eits_real height[EITS_MAX_TOUCHES];
    const eits_real min =
        o->touch_threshold * eits_greatest(ctx, ctx->image, model->n_pixels, EITS_SIGN_BOTH);
    for (uint32_t j = 0; j < model->n_pixels; ++j) {
        const eits_real here = eits_fabs(ctx->image[j]);
        if (!(here > 0) || here < min || !is_peak(ctx, j))
            continue;
        uint32_t place = f->count;
        while (place > 0 && here > height[place - 1])
            --place;
        if (place >= o->max_touches)
            continue;
        f->count += f->count < o->max_touches;
        for (uint32_t k = f->count - 1; k > place; --k) {
            height[k] = height[k - 1];
            f->disc[k] = f->disc[k - 1];
        }
        height[place] = here;
        f->disc[place] = (eits_disc){
            .x_mm = eits_fma((eits_real)model->pixel[j].ix + R(0.5), (eits_real)model->pixel_mm,
                             (eits_real)model->origin_x_mm),
            .y_mm = eits_fma((eits_real)model->pixel[j].iy + R(0.5), (eits_real)model->pixel_mm,
                             (eits_real)model->origin_y_mm),
            .radius_mm = o->touch_seed_radius_mm,
            .polarity = ctx->image[j] < 0 ? R(-1) : R(1),
        };
    }
}

/* ---- the touch fit ---- */

/* Later sweeps: few, for they begin near their end. */
static uint32_t later(const eits_context *ctx)
{
    return ctx->options.touch_sweeps < LATER_SWEEPS ? ctx->options.touch_sweeps : LATER_SWEEPS;
}

/* From here on the discs are to explain the data less their interaction, as far as that is known.
 */
static void remove_interaction(eits_context *ctx, eits_fit *f)
{
    const eits_real *before = f->data;
    f->data = ctx->y;
    if (f->count > 1 && eits_has_interaction(ctx)) {
        f->macs += eits_remove_interaction(ctx, f->disc, f->count, ctx->y_separate);
        f->data = ctx->y_separate;
    }
    if (f->data != before || f->data == ctx->y_separate)
        eits_fit_restart(ctx, f);
}

/* First places: to data that strong touches bend less, if there are any. */
static void begin(eits_context *ctx, eits_fit *f)
{
    const eits_options *o = &ctx->options;
    f->data = ctx->has_y_log && o->touch_sweeps > 0 ? ctx->y_log : ctx->y;
    seed(ctx, f);
    eits_fit_strengths(ctx, f);
    if (o->touch_change_s_per_m > 0) {
        for (uint32_t k = 0; k < f->count; ++k)
            f->disc[k].radius_mm = eits_expected_radius(o, &f->disc[k]);
        eits_fit_strengths(ctx, f);
    }
    eits_fit_move_all(ctx, f, o->touch_sweeps - later(ctx));
    eits_fit_prune(ctx, f);
}

static void fit_touches(eits_context *ctx, eits_fit *f)
{
    const int interacts = eits_has_interaction(ctx),
              linear = ctx->has_y_log || ctx->model->data_kind == EITS_DATA_LOG_RATIO;
    const int splits_merges =
        (ctx->options.touch_fit & EITS_TOUCH_FIT_SPLIT_MERGE) != 0 && (linear || interacts);
    f->radius_weight = ctx->options.touch_radius_weight * (interacts ? EARLY_RADIUS : 1);
    begin(ctx, f);
    if (ctx->options.touch_sweeps == 0)
        return;
    if (splits_merges)
        (void)eits_fit_merge(ctx, f);
    for (int round = 0; interacts && f->count > 1 && round < ROUNDS; ++round) {
        remove_interaction(ctx, f);
        eits_fit_move_all(ctx, f, later(ctx));
    }
    for (int round = 0; splits_merges && round < ROUNDS; ++round) {
        const int merged = eits_fit_merge(ctx, f), split = eits_fit_split(ctx, f);
        if (!merged && !split)
            break;
        remove_interaction(ctx, f);
        eits_fit_move_all(ctx, f, later(ctx));
        eits_fit_prune(ctx, f);
    }
    f->radius_weight = ctx->options.touch_radius_weight * (interacts ? FINAL_RADIUS : 1);
    remove_interaction(ctx, f);
    eits_fit_move_all(ctx, f, later(ctx));
    eits_fit_prune(ctx, f);
}

/* ---- the report ---- */

/* Returns how many there are: those whose numbers are finite. */
static uint32_t report(const eits_context *ctx, const eits_fit *f, eits_touch *out)
{
    uint32_t count = 0;
    for (uint32_t k = 0; k < f->count; ++k) {
        const eits_disc *disc = &f->disc[k];
        const eits_touch touch = {
            .x_mm = disc->x_mm,
            .y_mm = disc->y_mm,
            .radius_mm = disc->radius_mm,
            .strength_s_per_m_mm2 = disc->change * eits_disc_area(ctx, disc),
            .confidence = f->explained[k] < 1 ? f->explained[k] : 1,
        };
        const eits_real numbers[] = {touch.x_mm, touch.y_mm, touch.radius_mm,
                                     touch.strength_s_per_m_mm2, f->explained[k]};
        /* weights or volts at the ends of the range */
        if (!eits_all_finite(numbers, sizeof numbers / sizeof numbers[0]))
            continue;
        uint32_t place = count++;
        while (place > 0 && eits_fabs(touch.strength_s_per_m_mm2) >
                                eits_fabs(out[place - 1].strength_s_per_m_mm2)) {
            out[place] = out[place - 1];
            --place;
        }
        out[place] = touch;
    }
    return count;
}

eits_status eits_find_touches(eits_context *ctx, eits_touch *touches, uint32_t room,
                              uint32_t *count)
{
    if (ctx == NULL || (touches == NULL && room > 0))
        return EITS_E_ARGUMENT;
    eits_fit f = {.total = eits_dot(ctx, ctx->y, ctx->y, ctx->model->rank),
                  .noise = eits_expected_noise(ctx)};
    eits_touch found[EITS_MAX_TOUCHES];
    const eits_stop stop = ctx->info.stop;
    const int looked =
        stop != EITS_STOP_BELOW_THRESHOLD && stop != EITS_STOP_ZERO && stop != EITS_STOP_DIVERGED;
    if (looked)
        fit_touches(ctx, &f);
    const uint32_t finite = report(ctx, &f, found);
    ctx->info.touch_macs = f.macs;
    eits_check_crowd(ctx, looked, found, finite);
    const uint32_t reported = eits_track(ctx, found, finite);
    ctx->info.touches = reported;
    for (uint32_t k = 0; k < reported; ++k)
        found[k].force_n =
            eits_force_n(ctx->model, found[k].x_mm, found[k].y_mm, found[k].strength_s_per_m_mm2);
    if (ctx->options.second_pass && ctx->options.mac_limit == 0 && f.count > 1 &&
        f.data == ctx->y_separate)
        eits_solve_again(ctx, ctx->y_separate);
    for (uint32_t k = 0; k < reported && k < room; ++k)
        touches[k] = found[k];
    if (count != NULL)
        *count = reported;
    return EITS_OK;
}
