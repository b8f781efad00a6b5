/* Peaks of the image start discs; the discs are fitted to the reduced data off the grid; those that
 * explain nothing go.
 *
 * The image is a good detector and a poor ruler: it says that there is a touch and about where.
 * Place, radius and strength come from the data themselves, by a model with few unknowns
 * (disc_fit.c). The order of stages:
 *
 *   1. peaks of the image, at most max_touches, as discs of one radius; strengths. Or discs sought
 *      in the data (seek.c)
 *   2. places and radii, to log data where there are any; pruning
 *   3. merging, then the touches' interaction taken out of the data, and places again, in turn
 *   4. merging and splitting, in turn with 3
 *   5. a last fit to the data without interaction, with the radius's prior loosened; pruning
 *
 * Log data, v0 log(v / v0), are nearer to linear in the conductivity than differences are; strong
 * touches bend them less. They give the first places; the last fit is to the
 * differences, whose noise the whitening is made for.
 *
 * Each stage can be switched off (options.touch_fit, .touch_sweeps), for what it costs a board;
 * info.touch_macs counts. studies/results/levers.md has what each is worth. */
#include "touch/constants.h"
#include "touch/disc_fit.h"

#include "base/vec.h"
#include "kernels/kernels.h"
#include "solve/violations.h"
#include "touch/interaction.h"

/* ---- peaks ---- */

/* The greatest peaks, in descending order. */
static void seed(const eits_context *ctx, const eits_scratch *scratch, eits_fit *f)
{
    const eits_model *model = ctx->model;
    const eits_options *o = &ctx->options;
    eits_real height[EITS_MAX_TOUCHES], *size = scratch->pixel[0]; /* |image| */
    /* Peaks far below the greatest are the solver's ripple around it. */
    const eits_real min = o->touch_threshold * eits_greatest(ctx->kernels, ctx->solver.image,
                                                             model->n_pixels, EITS_SIGN_BOTH);
    for (uint32_t j = 0; j < model->n_pixels; ++j)
        size[j] = eits_fabs(ctx->solver.image[j]);
    for (uint32_t j = 0; j < model->n_pixels; ++j) {
        const eits_real here = size[j];
        if (!(here > 0) || here < min || !eits_is_peak(ctx, size, j))
            continue;
        uint32_t place = f->count;
        while (place > 0 && here > height[place - 1])
            --place;
        /* Full, and none of those kept is smaller. */
        if (place >= o->max_touches)
            continue;
        f->count += f->count < o->max_touches;
        /* Insertion: there are never many. */
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
            .polarity = ctx->solver.image[j] < 0 ? R(-1) : R(1),
        };
    }
}

/* ---- the touch fit ---- */

/* Later sweeps: few, for they begin near their end. */
static uint32_t later(const eits_context *ctx)
{
    return ctx->options.touch_sweeps < EITS_LATER_SWEEPS ? ctx->options.touch_sweeps
                                                         : EITS_LATER_SWEEPS;
}

/* From here on the discs are to explain the data less their interaction, as far as that is known.
 */
static void remove_interaction(eits_context *ctx, const eits_scratch *scratch, eits_fit *f)
{
    const eits_real *before = f->data;
    f->data = ctx->frame.y;
    if (f->count > 1 && eits_has_interaction(ctx)) {
        f->macs += eits_remove_interaction(ctx, scratch, f->disc, f->count, ctx->touch.y_separate);
        f->data = ctx->touch.y_separate;
    }
    if (f->data != before || f->data == ctx->touch.y_separate)
        eits_fit_restart(ctx, scratch, f);
}

/* Discs at the image's peaks, moved. They begin with the radius that their strength suggests
 * instead of the same one for all. */
static void start_at_peaks(eits_context *ctx, const eits_scratch *scratch, eits_fit *f)
{
    const eits_options *o = &ctx->options;
    seed(ctx, scratch, f);
    eits_fit_strengths(ctx, scratch, f);
    if (o->touch_change_s_per_m > 0) {
        for (uint32_t k = 0; k < f->count; ++k)
            f->disc[k].radius_mm = eits_expected_radius(o, &f->disc[k]);
        eits_fit_strengths(ctx, scratch, f);
    }
    eits_fit_move_all(ctx, scratch, f, o->touch_sweeps - later(ctx));
}

/* First places. They decide what the fit ends at, so they are fitted to data that strong touches
 * bend less, if there are any. */
static void begin(eits_context *ctx, const eits_scratch *scratch, eits_fit *f)
{
    const eits_options *o = &ctx->options;
    f->data = ctx->frame.has_y_log && o->touch_sweeps > 0 ? ctx->frame.y_log : ctx->frame.y;
    if (o->touch_seek && o->touch_sweeps > 0) {
        eits_fit_seek(ctx, scratch, f);
    } else {
        start_at_peaks(ctx, scratch, f);
    }
    eits_fit_prune(ctx, scratch, f);
}

/* The last stage: to the data less the discs' interaction, with the prior of the radius that it
 * asks for. */
static void finish(eits_context *ctx, const eits_scratch *scratch, eits_fit *f)
{
    f->radius_weight =
        ctx->options.touch_radius_weight * (eits_has_interaction(ctx) ? EITS_FINAL_RADIUS : 1);
    remove_interaction(ctx, scratch, f);
    eits_fit_move_all(ctx, scratch, f, later(ctx));
    eits_fit_prune(ctx, scratch, f);
}

/* Move a disc from its peak's pixel to the middle of the image within a seed's radius of it, along
 * either axis; the disc gets the strength of that part of the image. */
static void centre(const eits_context *ctx, eits_disc *disc)
{
    const eits_model *model = ctx->model;
    const eits_real pixel = (eits_real)model->pixel_mm, seed_mm = ctx->options.touch_seed_radius_mm,
                    pi = R(3.14159265358979323846);
    const uint32_t reach = seed_mm > pixel ? (uint32_t)(seed_mm / pixel) : 1u,
                   x = (uint32_t)((disc->x_mm - (eits_real)model->origin_x_mm) / pixel),
                   y = (uint32_t)((disc->y_mm - (eits_real)model->origin_y_mm) / pixel);
    eits_real sum = 0, along_x = 0, along_y = 0;
    for (uint32_t iy = y > reach ? y - reach : 0; iy <= y + reach && iy < model->ny; ++iy) {
        for (uint32_t ix = x > reach ? x - reach : 0; ix <= x + reach && ix < model->nx; ++ix) {
            const uint32_t j = ctx->cell[(size_t)iy * model->nx + ix];
            const eits_real height =
                j == EITS_NO_PIXEL ? 0 : eits_larger(disc->polarity * ctx->solver.image[j], 0);
            sum += height;
            along_x = eits_fma(height, (eits_real)ix - (eits_real)x, along_x);
            along_y = eits_fma(height, (eits_real)iy - (eits_real)y, along_y);
        }
    }
    disc->x_mm = eits_fma(pixel, along_x / sum, disc->x_mm);
    disc->y_mm = eits_fma(pixel, along_y / sum, disc->y_mm);
    disc->change = disc->polarity * sum * pixel * pixel / (pi * seed_mm * seed_mm);
}

void eits_fit_peaks(eits_context *ctx, const eits_scratch *scratch, eits_fit *f)
{
    seed(ctx, scratch, f);
    for (uint32_t k = 0; k < f->count; ++k)
        centre(ctx, &f->disc[k]);
}

void eits_fit_touches(eits_context *ctx, const eits_scratch *scratch, eits_fit *f)
{
    const int interacts = eits_has_interaction(ctx),
              linear = ctx->frame.has_y_log || ctx->model->data_kind == EITS_DATA_LOG_RATIO;
    const int splits_merges =
        (ctx->options.touch_fit & EITS_TOUCH_FIT_SPLIT_MERGE) != 0 && (linear || interacts);
    f->radius_weight = ctx->options.touch_radius_weight * (interacts ? EITS_EARLY_RADIUS : 1);
    begin(ctx, scratch, f);
    f->settled = 1;
    /* Peaks and strengths only, as asked. */
    if (ctx->options.touch_sweeps == 0)
        return;
    /* Merging comes first: two halves of one touch are no two dipoles in each other's field. */
    if (splits_merges)
        (void)eits_fit_merge(ctx, scratch, f);
    if (interacts && f->count > 1) {
        remove_interaction(ctx, scratch, f);
        eits_fit_move_all(ctx, scratch, f, later(ctx));
    }
    for (int round = 0; splits_merges && round < EITS_ROUNDS; ++round) {
        const int merged = eits_fit_merge(ctx, scratch, f), split = eits_fit_split(ctx, scratch, f);
        if (!merged && !split)
            break;
        remove_interaction(ctx, scratch, f);
        eits_fit_move_all(ctx, scratch, f, later(ctx));
        eits_fit_prune(ctx, scratch, f);
    }
    finish(ctx, scratch, f);
}

void eits_fit_settle(eits_context *ctx, const eits_scratch *scratch, eits_fit *f)
{
    f->settled = 1;
    eits_fit_strengths(ctx, scratch, f);
    finish(ctx, scratch, f);
}

/* ---- the report ---- */

/* mm^2: of the pixels that the fit covered, or of the joint fit's disc. */
static eits_real area_of(const eits_context *ctx, const eits_fit *f, const eits_disc *disc)
{
    const eits_real pi = R(3.14159265358979323846);
    return f->joint ? pi * disc->radius_mm * disc->radius_mm : eits_disc_area(ctx, disc);
}

/* Returns how many there are: those whose numbers are finite. */
uint32_t eits_report_touches(const eits_context *ctx, const eits_fit *f, eits_touch *out)
{
    uint32_t count = 0;
    for (uint32_t k = 0; k < f->count; ++k) {
        const eits_disc *disc = &f->disc[k];
        const eits_touch touch = {
            .x_mm = disc->x_mm,
            .y_mm = disc->y_mm,
            .radius_mm = disc->radius_mm,
            .strength_s_per_m_mm2 = disc->change * area_of(ctx, f, disc),
            .explained = f->explained[k] < 1 ? f->explained[k] : 1,
            .confidence = f->tested ? f->confidence[k] : 0,
            .x_variance_mm2 = f->place_mm2[k][0],
            .xy_covariance_mm2 = f->place_mm2[k][1],
            .y_variance_mm2 = f->place_mm2[k][2],
            .long_x_mm = f->tested ? f->long_mm[k][0] : 0,
            .long_y_mm = f->tested ? f->long_mm[k][1] : 0,
            .radius_sd_mm = f->joint ? f->radius_sd_mm[k] : 0,
        };
        const eits_real numbers[] = {
            touch.x_mm,      touch.y_mm,      touch.radius_mm, touch.strength_s_per_m_mm2,
            f->explained[k], touch.long_x_mm, touch.long_y_mm, touch.radius_sd_mm};
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
