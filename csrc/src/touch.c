/* Peaks of the image start discs; the discs are fitted to the reduced data off the grid; those that explain nothing go. */
#include "eitskin/touch.h"

#include "column.h"
#include "disc.h"
#include "examine.h"
#include "kernels.h"
#include "observed.h"
#include "stages.h"
#include "track.h"
#include "vec.h"

enum { STRENGTH_PASSES = 10, DROP_SWEEPS = 3 };

/* Relative deviation of the radius that strength suggests: contrasts of 3 to 10 make 2 (c - 1) / (c + 1) = 1.0 to 1.6, so
 * that the root of strength tells the radius to about 12 %. */
static const eits_real RADIUS_DEVIATION = R(0.12);
static const eits_real DAMPING = R(1e-3);
static const eits_real SETTLED_PIXELS = R(1.0 / 256.0);
static const eits_real MOST_RADIUS_STEP_PIXELS = R(0.5);
static const eits_real PI = R(3.14159265358979323846);

typedef struct fit {
    eits_disc disc[EITS_MAX_TOUCHES];
    eits_real explained[EITS_MAX_TOUCHES]; /* what leaving it out would add to |residual|^2, relative to |y|^2 */
    uint32_t count;
    uint64_t macs;
} fit;

static eits_real *atom_of(const eits_context *ctx, uint32_t k)
{
    return ctx->atoms + EITS_STRIDE(ctx->model->rank) * k;
}

static eits_real clamp(eits_real v, eits_real low, eits_real high)
{
    return v < low ? low : (v > high ? high : v);
}

/* ---- peaks ---- */

/* A pixel that none of its eight neighbours exceeds; of equal neighbours the first in order is the peak. */
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
static void seed(const eits_context *ctx, fit *f)
{
    const eits_model *model = ctx->model;
    const eits_options *o = &ctx->options;
    eits_real height[EITS_MAX_TOUCHES];
    const eits_real least = o->touch_threshold * eits_greatest(ctx, ctx->image, model->n_pixels, EITS_SIGN_BOTH);
    for (uint32_t j = 0; j < model->n_pixels; ++j) {
        const eits_real here = eits_fabs(ctx->image[j]);
        if (!(here > 0) || here < least || !is_peak(ctx, j))
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
            .x_mm = eits_fma((eits_real)model->pixel[j].ix + R(0.5), (eits_real)model->pixel_mm, (eits_real)model->origin_x_mm),
            .y_mm = eits_fma((eits_real)model->pixel[j].iy + R(0.5), (eits_real)model->pixel_mm, (eits_real)model->origin_y_mm),
            .radius_mm = o->touch_seed_radius_mm,
            .polarity = ctx->image[j] < 0 ? R(-1) : R(1),
        };
    }
}

/* ---- strengths ---- */

/* The change that explains `target` best along `atom`, of the disc's own sign. */
static eits_real best_change(const eits_context *ctx, const eits_disc *disc, const eits_real *atom, const eits_real *target)
{
    const uint32_t rank = ctx->model->rank;
    const eits_real energy = eits_dot(ctx, atom, atom, rank);
    const eits_real change = energy > 0 ? eits_dot(ctx, atom, target, rank) / energy : 0;
    return change * disc->polarity > 0 ? change : 0;
}

/* All strengths at once by coordinate descent; leaves what is unexplained in ctx->residual. */
static void fit_strengths(eits_context *ctx, fit *f)
{
    const uint32_t rank = ctx->model->rank;
    eits_copy(ctx->residual, ctx->y, EITS_STRIDE(rank));
    for (uint32_t k = 0; k < f->count; ++k) {
        f->macs += eits_disc_atom(ctx, &f->disc[k], atom_of(ctx, k), NULL);
        f->disc[k].change = 0;
    }
    for (int pass = 0; pass < STRENGTH_PASSES; ++pass) {
        for (uint32_t k = 0; k < f->count; ++k) {
            eits_disc *disc = &f->disc[k];
            eits_axpy(ctx, ctx->residual, disc->change, atom_of(ctx, k), rank);
            disc->change = best_change(ctx, disc, atom_of(ctx, k), ctx->residual);
            eits_axpy(ctx, ctx->residual, -disc->change, atom_of(ctx, k), rank);
            f->macs += 4u * rank;
        }
    }
}

/* ---- places and radii ---- */

/* Solve H s = g for the step, H symmetric: scaled to a unit diagonal, damped, Cholesky. A parameter that nothing depends
 * on, or that rounding makes dependent, does not move. */
static void damped_step(const eits_real h[4][4], const eits_real g[4], eits_real step[4])
{
    eits_real scale[4], l[4][4] = {{0}}, w[4];
    for (int i = 0; i < 4; ++i)
        scale[i] = h[i][i] > 0 ? 1 / eits_sqrt(h[i][i]) : 0;
    for (int i = 0; i < 4; ++i) {
        for (int j = 0; j <= i; ++j) {
            eits_real sum = i == j ? 1 + DAMPING : h[i][j] * scale[i] * scale[j];
            for (int k = 0; k < j; ++k)
                sum = eits_fma(-l[i][k], l[j][k], sum);
            if (i == j)
                l[i][i] = eits_sqrt(sum > DAMPING * R(0.1) ? sum : DAMPING * R(0.1));
            else
                l[i][j] = sum / l[j][j];
        }
    }
    for (int i = 0; i < 4; ++i) {
        eits_real sum = g[i] * scale[i];
        for (int k = 0; k < i; ++k)
            sum = eits_fma(-l[i][k], w[k], sum);
        w[i] = sum / l[i][i];
    }
    for (int i = 3; i >= 0; --i) {
        eits_real sum = w[i];
        for (int k = i + 1; k < 4; ++k)
            sum = eits_fma(-l[k][i], w[k], sum);
        w[i] = sum / l[i][i];
        step[i] = w[i] * scale[i];
    }
}

/* The radius that is expected: what strength suggests where the change is known, else the seed's. */
static eits_real expected_radius(const eits_options *o, const eits_disc *disc)
{
    if (!(o->touch_change_s_per_m > 0))
        return o->touch_seed_radius_mm;
    const eits_real area_ratio = disc->change * disc->polarity / o->touch_change_s_per_m;
    return clamp(disc->radius_mm * eits_sqrt(area_ratio), o->touch_min_radius_mm, o->touch_max_radius_mm);
}

/* |target - change atom|^2, target being what the other touches leave. */
static eits_real misfit(const eits_context *ctx, const eits_real *target, eits_real change, const eits_real *atom)
{
    const uint32_t rank = ctx->model->rank;
    eits_real *difference = ctx->sx;
    for (uint32_t i = 0; i < rank; ++i)
        difference[i] = eits_fma(-change, atom[i], target[i]);
    return eits_dot(ctx, difference, difference, rank);
}

/* One damped Gauss-Newton step of one disc, others held; halved up to twice until the misfit falls. Returns how far it
 * went, mm. ctx->residual is what all discs leave, before and after. */
static eits_real move_disc(eits_context *ctx, fit *f, uint32_t k)
{
    const uint32_t rank = ctx->model->rank;
    const eits_options *o = &ctx->options;
    eits_disc *disc = &f->disc[k];
    eits_real *atom = atom_of(ctx, k), *trial_atom = ctx->sx_next, *left = ctx->sz, *target = ctx->residual;
    eits_axpy(ctx, target, disc->change, atom, rank);
    f->macs += eits_disc_atom(ctx, disc, atom, ctx->slope);
    disc->change = best_change(ctx, disc, atom, target);
    for (uint32_t i = 0; i < rank; ++i)
        left[i] = eits_fma(-disc->change, atom[i], target[i]);
    const eits_real energy = disc->change * disc->change * eits_dot(ctx, atom, atom, rank);
    const eits_real expected = expected_radius(o, disc), deviation = RADIUS_DEVIATION * expected;
    const eits_real weight = o->touch_radius_weight * energy / (deviation * deviation);
    const eits_real *column[4] = {ctx->slope[0], ctx->slope[1], ctx->slope[2], atom};
    eits_real h[4][4], g[4], step[4];
    for (int i = 0; i < 4; ++i) {
        const eits_real by_change = disc->change * disc->change; /* the fourth parameter is the change, relatively */
        for (int j = 0; j <= i; ++j)
            h[i][j] = h[j][i] = by_change * eits_dot(ctx, column[i], column[j], rank);
        g[i] = disc->change * eits_dot(ctx, column[i], left, rank);
    }
    h[2][2] += weight;
    g[2] = eits_fma(weight, expected - disc->radius_mm, g[2]);
    f->macs += 17u * rank;
    damped_step((const eits_real(*)[4])h, g, step);
    const eits_real reach = (eits_real)ctx->model->pixel_mm, radius_reach = MOST_RADIUS_STEP_PIXELS * reach;
    const eits_real off = disc->radius_mm - expected;
    const eits_real cost = eits_dot(ctx, left, left, rank) + weight * off * off;
    eits_real moved = 0, share = 1;
    for (int attempt = 0; attempt < 3; ++attempt, share *= R(0.5)) {
        eits_disc trial = *disc;
        trial.x_mm += share * clamp(step[0], -reach, reach);
        trial.y_mm += share * clamp(step[1], -reach, reach);
        trial.radius_mm = clamp(disc->radius_mm + share * clamp(step[2], -radius_reach, radius_reach), o->touch_min_radius_mm,
                                o->touch_max_radius_mm);
        if (!eits_disc_on_skin(ctx, &trial))
            continue;
        f->macs += eits_disc_atom(ctx, &trial, trial_atom, NULL) + 3u * rank;
        trial.change = best_change(ctx, &trial, trial_atom, target);
        const eits_real trial_off = trial.radius_mm - expected;
        if (!(misfit(ctx, target, trial.change, trial_atom) + weight * trial_off * trial_off < cost))
            continue;
        const eits_real dx = eits_fabs(trial.x_mm - disc->x_mm), dy = eits_fabs(trial.y_mm - disc->y_mm);
        const eits_real dr = eits_fabs(trial.radius_mm - disc->radius_mm);
        moved = dx > dy ? dx : dy;
        moved = dr > moved ? dr : moved;
        *disc = trial;
        eits_copy(atom, trial_atom, rank);
        break;
    }
    eits_axpy(ctx, target, -disc->change, atom, rank);
    return moved;
}

static void move_all(eits_context *ctx, fit *f, uint32_t sweeps)
{
    for (uint32_t sweep = 0; sweep < sweeps; ++sweep) {
        eits_real farthest = 0;
        for (uint32_t k = 0; k < f->count; ++k) {
            const eits_real moved = move_disc(ctx, f, k);
            farthest = moved > farthest ? moved : farthest;
        }
        if (farthest < SETTLED_PIXELS * (eits_real)ctx->model->pixel_mm)
            break;
    }
}

/* ---- which to keep ---- */

/* What each disc alone explains: change^2 / (G^-1)_kk of the atoms' Gram matrix G, by Cholesky and its inverse. */
static void judge(eits_context *ctx, fit *f)
{
    const uint32_t rank = ctx->model->rank, n = f->count;
    eits_real l[EITS_MAX_TOUCHES][EITS_MAX_TOUCHES] = {{0}}, norm[EITS_MAX_TOUCHES];
    const eits_real whole = eits_dot(ctx, ctx->y, ctx->y, rank);
    for (uint32_t i = 0; i < n; ++i) {
        norm[i] = eits_sqrt(eits_dot(ctx, atom_of(ctx, i), atom_of(ctx, i), rank));
        for (uint32_t j = 0; j <= i; ++j) {
            const eits_real both = norm[i] * norm[j];
            eits_real sum = i == j ? 1 + R(1e-5) : (both > 0 ? eits_dot(ctx, atom_of(ctx, i), atom_of(ctx, j), rank) / both : 0);
            for (uint32_t k = 0; k < j; ++k)
                sum = eits_fma(-l[i][k], l[j][k], sum);
            if (i == j)
                l[i][i] = eits_sqrt(sum > R(1e-6) ? sum : R(1e-6));
            else
                l[i][j] = sum / l[j][j];
        }
    }
    f->macs += (uint64_t)n * (n + 1) / 2 * rank;
    for (uint32_t k = 0; k < n; ++k) { /* column k of L^-1; its squared norm is (G^-1)_kk */
        eits_real column[EITS_MAX_TOUCHES] = {0}, squared = 0;
        for (uint32_t i = k; i < n; ++i) {
            eits_real sum = i == k ? 1 : 0;
            for (uint32_t j = k; j < i; ++j)
                sum = eits_fma(-l[i][j], column[j], sum);
            column[i] = sum / l[i][i];
            squared = eits_fma(column[i], column[i], squared);
        }
        const eits_real size = f->disc[k].change * norm[k];
        f->explained[k] = whole > 0 ? size * size / (squared * whole) : 0;
    }
}

/* Whether the disc stands out of the noise by the same test as the whole frame: S_j'(y - other discs) at its pixel. */
static int stands_out(eits_context *ctx, fit *f, uint32_t k)
{
    const eits_real least = ctx->options.gate_factor * eits_lambda_noise(ctx);
    const uint32_t rank = ctx->model->rank;
    if (!(least > 0))
        return 1;
    const eits_disc *disc = &f->disc[k];
    const eits_real *atom = eits_adjoint(ctx, atom_of(ctx, k), ctx->slope[0]);
    const eits_real *residual = eits_adjoint(ctx, ctx->residual, ctx->slope[1]);
    eits_real best = 0;
    f->macs += 2u * eits_adjoint_macs(ctx);
    for (uint32_t j = 0; j < ctx->model->n_pixels; ++j) {
        const eits_pixel at = ctx->model->pixel[j];
        const eits_real pixel = (eits_real)ctx->model->pixel_mm;
        const eits_real dx = eits_fma((eits_real)at.ix + R(0.5), pixel, (eits_real)ctx->model->origin_x_mm) - disc->x_mm;
        const eits_real dy = eits_fma((eits_real)at.iy + R(0.5), pixel, (eits_real)ctx->model->origin_y_mm) - disc->y_mm;
        if (eits_fabs(dx) > pixel || eits_fabs(dy) > pixel)
            continue;
        const eits_real *column = eits_column(&ctx->model->sensitivity, j, ctx->sx), scale = eits_column_scale(&ctx->model->sensitivity, j);
        const eits_real seen = scale * eits_fma(disc->change, eits_dot(ctx, column, atom, rank), eits_dot(ctx, column, residual, rank));
        f->macs += 2u * rank;
        best = seen * disc->polarity > best ? seen * disc->polarity : best;
    }
    return best >= least;
}

static void drop(eits_context *ctx, fit *f, uint32_t k)
{
    const uint32_t rank = ctx->model->rank;
    eits_axpy(ctx, ctx->residual, f->disc[k].change, atom_of(ctx, k), rank);
    --f->count;
    for (uint32_t l = k; l < f->count; ++l) {
        f->disc[l] = f->disc[l + 1];
        eits_copy(atom_of(ctx, l), atom_of(ctx, l + 1), EITS_STRIDE(rank));
    }
}

/* Drop the weakest while it explains too little or does not stand out of the noise; the others take up what it leaves. */
static void keep_real(eits_context *ctx, fit *f)
{
    while (f->count > 0) {
        judge(ctx, f);
        uint32_t weakest = 0;
        for (uint32_t k = 1; k < f->count; ++k)
            weakest = f->explained[k] < f->explained[weakest] ? k : weakest;
        const int alone = f->count == 1;
        const int enough = alone ? f->explained[0] > 0 : f->explained[weakest] >= ctx->options.touch_share;
        if (enough && stands_out(ctx, f, weakest))
            return;
        drop(ctx, f, weakest);
        move_all(ctx, f, ctx->options.touch_sweeps < DROP_SWEEPS ? ctx->options.touch_sweeps : DROP_SWEEPS);
    }
}

/* A disc's covers (disc.h) add up to pi (radius^2 + pixel^2 / 12), averaged over its places, where the radius is at least half
 * a pixel: that is the area its change was fitted with. Returns how many there are: those whose numbers are finite. */
static uint32_t report(const fit *f, eits_real pixel_mm, eits_touch *out)
{
    const eits_real soft_edge = pixel_mm * pixel_mm / 12;
    uint32_t count = 0;
    for (uint32_t k = 0; k < f->count; ++k) {
        const eits_disc *disc = &f->disc[k];
        const eits_touch touch = {
            .x_mm = disc->x_mm,
            .y_mm = disc->y_mm,
            .radius_mm = disc->radius_mm,
            .strength_s_per_m_mm2 = disc->change * PI * eits_fma(disc->radius_mm, disc->radius_mm, soft_edge),
            .confidence = f->explained[k] < 1 ? f->explained[k] : 1,
        };
        const eits_real numbers[] = {touch.x_mm, touch.y_mm, touch.radius_mm, touch.strength_s_per_m_mm2, f->explained[k]};
        if (!eits_all_finite(numbers, sizeof numbers / sizeof numbers[0])) /* weights or volts at the ends of the range */
            continue;
        uint32_t place = count++;
        while (place > 0 && eits_fabs(touch.strength_s_per_m_mm2) > eits_fabs(out[place - 1].strength_s_per_m_mm2)) {
            out[place] = out[place - 1];
            --place;
        }
        out[place] = touch;
    }
    return count;
}

eits_status eits_find_touches(eits_context *ctx, eits_touch *touches, uint32_t room, uint32_t *count)
{
    if (ctx == NULL || (touches == NULL && room > 0))
        return EITS_E_ARGUMENT;
    fit f = {.count = 0};
    eits_touch found[EITS_MAX_TOUCHES];
    const eits_stop stop = ctx->info.stop;
    const int looked = stop != EITS_STOP_GATE && stop != EITS_STOP_ZERO && stop != EITS_STOP_DIVERGED;
    if (looked) {
        seed(ctx, &f);
        fit_strengths(ctx, &f);
        if (ctx->options.touch_change_s_per_m > 0) {
            for (uint32_t k = 0; k < f.count; ++k)
                f.disc[k].radius_mm = expected_radius(&ctx->options, &f.disc[k]);
            fit_strengths(ctx, &f);
        }
        move_all(ctx, &f, ctx->options.touch_sweeps);
        keep_real(ctx, &f);
    }
    const uint32_t finite = report(&f, (eits_real)ctx->model->pixel_mm, found);
    ctx->info.touch_macs = f.macs;
    eits_judge_crowd(ctx, looked, found, finite);
    const uint32_t told = eits_track(ctx, found, finite);
    ctx->info.touches = told;
    for (uint32_t k = 0; k < told && k < room; ++k)
        touches[k] = found[k];
    if (count != NULL)
        *count = told;
    return EITS_OK;
}
