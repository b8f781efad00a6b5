/* Discs' strengths, places and radii: nonlinear least squares in reduced space.
 *
 *     minimise |data - sum_k change_k atom(x_k, y_k, r_k)|^2 + sum_k weight_k (r_k - expected_k)^2
 *
 * with change_k of the sign of its peak. The image cannot give these numbers: its lambda makes it
 * sparse, so its peaks are narrower and weaker than the touch and lie on pixels.
 *
 * Method: Gauss and Newton's steps with Levenberg and Marquardt's damping (Marquardt, J. Soc.
 * Indust. Appl. Math. 11 (1963) 431, doi 10.1137/0111030), one disc at a time, the others held.
 * Strength is a linear parameter and is set to its best value at every trial place, so the step
 * chooses only among places and radii. A trial that does not lower the cost is not taken: the fit
 * never ends worse than it began.
 *
 * The term of the radius: the data know change times area far better than either, because a wider,
 * weaker disc looks alike from the rim. Contrasts are known within limits, so strength suggests a
 * radius, and the term holds it there as firmly as the touch's energy or the noise warrants.
 *
 * Invariant: f->residual = data - sum of all discs' answers, kept by adding and taking away single
 * atoms; eits_fit_restart makes it exact again after discs or data were exchanged.
 *
 * The k-th disc's atom is available (eits_atom) wherever it stands.
 *
 * Costs per move of one disc: three slopes, at most three trial atoms, 17 dots.
 */
#include "touch/disc_fit.h"

#include "base/cholesky.h"
#include "base/vec.h"
#include "diagnostics/diagnostics.h"
#include "kernels/kernels.h"
#include "touch/constants.h"

eits_fit eits_fit_none(const eits_context *ctx, const eits_scratch *scratch)
{
    return (eits_fit){.data = ctx->frame.y,
                      .residual = scratch->row[0],
                      .total = eits_dot(ctx->kernels, ctx->frame.y, ctx->frame.y, ctx->model->rank),
                      .noise = eits_expected_noise(ctx)};
}

eits_real eits_fit_left(const eits_context *ctx, const eits_fit *f)
{
    return eits_dot(ctx->kernels, f->residual, f->residual, ctx->model->rank);
}

/* The projection of `target` on the atom. A projection of the wrong sign is not a touch. */
eits_real eits_best_change(const eits_context *ctx, const eits_disc *disc, const eits_real *atom,
                           const eits_real *target)
{
    const uint32_t rank = ctx->model->rank;
    const eits_real energy = eits_dot(ctx->kernels, atom, atom, rank);
    const eits_real change = energy > 0 ? eits_dot(ctx->kernels, atom, target, rank) / energy : 0;
    return change * disc->polarity > 0 ? change : 0;
}

/* The strengths begin at zero each time: strengths of an earlier set of discs are not a good start,
 * and ten passes over at most sixteen atoms cost less than one atom. */
void eits_fit_strengths(eits_context *ctx, const eits_scratch *scratch, eits_fit *f)
{
    const uint32_t rank = ctx->model->rank;
    eits_copy(f->residual, f->data, EITS_STRIDE(rank));
    for (uint32_t k = 0; k < f->count; ++k) {
        f->macs += eits_disc_atom(ctx, scratch, &f->disc[k], eits_atom(ctx, k), NULL);
        f->disc[k].change = 0;
    }
    /* Few discs that overlap little: a few rounds, each disc after the other, are as good as a
     * solve of all at once, and keep every sign. */
    for (int pass = 0; pass < EITS_STRENGTH_PASSES; ++pass) {
        for (uint32_t k = 0; k < f->count; ++k) {
            eits_disc *disc = &f->disc[k];
            eits_axpy(ctx->kernels, f->residual, disc->change, eits_atom(ctx, k), rank);
            disc->change = eits_best_change(ctx, disc, eits_atom(ctx, k), f->residual);
            eits_axpy(ctx->kernels, f->residual, -disc->change, eits_atom(ctx, k), rank);
            f->macs += 4u * rank;
        }
    }
}

void eits_fit_restart(eits_context *ctx, const eits_scratch *scratch, eits_fit *f)
{
    const uint32_t rank = ctx->model->rank;
    eits_copy(f->residual, f->data, EITS_STRIDE(rank));
    for (uint32_t k = 0; k < f->count; ++k) {
        f->macs += eits_disc_atom(ctx, scratch, &f->disc[k], eits_atom(ctx, k), NULL) + rank;
        eits_axpy(ctx->kernels, f->residual, -f->disc[k].change, eits_atom(ctx, k), rank);
    }
}

eits_fit_kept eits_fit_keep(const eits_context *ctx, const eits_fit *f)
{
    eits_fit_kept kept = {.count = f->count, .left = eits_fit_left(ctx, f)};
    memcpy(kept.disc, f->disc, sizeof kept.disc);
    return kept;
}

void eits_fit_undo(eits_context *ctx, const eits_scratch *scratch, eits_fit *f,
                   const eits_fit_kept *kept)
{
    memcpy(f->disc, kept->disc, sizeof kept->disc);
    f->count = kept->count;
    eits_fit_restart(ctx, scratch, f);
}

/* Solve H s = g for the step, H symmetric: scaled to a unit diagonal, damped, Cholesky. A parameter
 * that nothing depends on, or that rounding makes dependent, does not move.
 *
 * Levenberg and Marquardt's damping on a unit diagonal, so that it acts alike on millimetres and
 * on relative change. A parameter with nothing to hold it, as the radius of a disc without
 * effect, gets no step instead of an infinite one. */
static void damped_step(const eits_real h[4][4], const eits_real g[4], eits_real step[4])
{
    eits_real scale[4], lower[EITS_LOWER_SIZE(4)];
    for (uint32_t i = 0; i < 4; ++i)
        scale[i] = h[i][i] > 0 ? 1 / eits_sqrt(h[i][i]) : 0;
    for (uint32_t i = 0; i < 4; ++i) {
        eits_real *row = eits_lower_row(lower, i);
        for (uint32_t j = 0; j <= i; ++j)
            row[j] = i == j ? 1 + EITS_DAMPING : h[i][j] * scale[i] * scale[j];
        const eits_real pivot = eits_cholesky_row(lower, i);
        row[i] = eits_sqrt(
            pivot > EITS_DAMPING * EITS_DAMPING_PIVOT ? pivot : EITS_DAMPING * EITS_DAMPING_PIVOT);
        step[i] = g[i] * scale[i];
    }
    eits_lower_solve(lower, 4, step);
    eits_lower_solve_transposed(lower, 4, step);
    for (uint32_t i = 0; i < 4; ++i)
        step[i] *= scale[i];
}

eits_real eits_expected_radius(const eits_options *o, const eits_disc *disc)
{
    if (!(o->touch_change_s_per_m > 0))
        return o->touch_seed_radius_mm;
    const eits_real area_ratio = disc->change * disc->polarity / o->touch_change_s_per_m;
    return eits_clamp(disc->radius_mm * eits_sqrt(area_ratio), o->touch_min_radius_mm,
                      o->touch_max_radius_mm);
}

/* |target - change atom|^2, target being what the other touches leave. */
static eits_real squared_residual(const eits_context *ctx, const eits_scratch *scratch,
                                  const eits_real *target, eits_real change, const eits_real *atom)
{
    const uint32_t rank = ctx->model->rank;
    eits_real *difference = scratch->row[1];
    for (uint32_t i = 0; i < rank; ++i)
        difference[i] = eits_fma(-change, atom[i], target[i]);
    return eits_dot(ctx->kernels, difference, difference, rank);
}

uint64_t eits_fit_limit(const eits_context *ctx, uint32_t per_fold)
{
    const uint32_t folds = ctx->model->n_folded;
    return (uint64_t)per_fold * (folds > EITS_LEAST_FOLDS ? folds : EITS_LEAST_FOLDS);
}

int eits_fit_may_go_on(const eits_context *ctx, eits_fit *f)
{
    f->cut |= f->macs >= eits_fit_limit(ctx, EITS_FIT_WORK);
    return !f->cut;
}

/* One damped Gauss-Newton step of one disc, others held; halved up to twice until the residual
 * falls. Returns how far it went, mm. f->residual is what all discs leave, before and
 * after. */
static eits_real move_disc(eits_context *ctx, const eits_scratch *scratch, eits_fit *f, uint32_t k)
{
    const uint32_t rank = ctx->model->rank;
    const eits_options *o = &ctx->options;
    eits_disc *disc = &f->disc[k];
    eits_real *atom = eits_atom(ctx, k), *trial_atom = scratch->row[2], *left = scratch->row[3],
              *target = f->residual;
    eits_axpy(ctx->kernels, target, disc->change, atom, rank);
    f->macs += eits_disc_shape(ctx, scratch, disc, NULL, &scratch->row[5], NULL);
    disc->change = eits_best_change(ctx, disc, atom, target);
    for (uint32_t i = 0; i < rank; ++i)
        left[i] = eits_fma(-disc->change, atom[i], target[i]);
    const eits_real energy = disc->change * disc->change * eits_dot(ctx->kernels, atom, atom, rank);
    /* Data tell area times change well and the radius badly. The change is known within limits, so
     * strength suggests a radius: a prior whose weight is the touch's energy, or the noise where
     * that is more. */
    const eits_real expected = eits_expected_radius(o, disc),
                    deviation = EITS_RADIUS_DEVIATION * expected;
    const eits_real by_energy = f->radius_weight * energy, by_noise = f->noise / (eits_real)rank;
    const eits_real weight = eits_larger(by_energy, by_noise) / (deviation * deviation);
    const eits_real *column[4] = {scratch->row[5], scratch->row[6], scratch->row[7], atom};
    eits_real h[4][4], g[4], step[4];
    for (int i = 0; i < 4; ++i) {
        /* the fourth parameter is the change, relatively */
        const eits_real by_change = disc->change * disc->change;
        for (int j = 0; j <= i; ++j)
            h[i][j] = h[j][i] = by_change * eits_dot(ctx->kernels, column[i], column[j], rank);
        g[i] = disc->change * eits_dot(ctx->kernels, column[i], left, rank);
    }
    h[2][2] += weight;
    g[2] = eits_fma(weight, expected - disc->radius_mm, g[2]);
    f->macs += 17u * rank;
    /* Gauss-Newton: H = J'J of x, y, radius and relative change, so that all four are of the same
     * size. */
    damped_step((const eits_real(*)[4])h, g, step);
    const eits_real reach = (eits_real)ctx->model->pixel_mm,
                    radius_reach = EITS_MAX_RADIUS_STEP_PIXELS * reach;
    const eits_real off = disc->radius_mm - expected;
    const eits_real cost = eits_dot(ctx->kernels, left, left, rank) + weight * off * off;
    /* The step is tried whole, then by halves: the model is linear only near by. What does not
     * lower the cost is not done at all, so that the fit never gets worse. */
    eits_real moved = 0, fraction = 1;
    for (int attempt = 0; attempt < EITS_STEP_TRIALS; ++attempt, fraction *= R(0.5)) {
        eits_disc trial = *disc;
        trial.x_mm += fraction * eits_clamp(step[0], -reach, reach);
        trial.y_mm += fraction * eits_clamp(step[1], -reach, reach);
        trial.radius_mm = eits_clamp(
            disc->radius_mm + fraction * eits_clamp(step[2], -radius_reach, radius_reach),
            o->touch_min_radius_mm, o->touch_max_radius_mm);
        if (!eits_disc_on_skin(ctx, &trial))
            continue;
        f->macs += eits_disc_atom(ctx, scratch, &trial, trial_atom, NULL) + 3u * rank;
        trial.change = eits_best_change(ctx, &trial, trial_atom, target);
        const eits_real trial_off = trial.radius_mm - expected;
        if (!(squared_residual(ctx, scratch, target, trial.change, trial_atom) +
                  weight * trial_off * trial_off <
              cost))
            continue;
        const eits_real dx = eits_fabs(trial.x_mm - disc->x_mm),
                        dy = eits_fabs(trial.y_mm - disc->y_mm);
        const eits_real dr = eits_fabs(trial.radius_mm - disc->radius_mm);
        moved = eits_larger(dr, eits_larger(dx, dy));
        *disc = trial;
        eits_copy(atom, trial_atom, rank);
        break;
    }
    eits_axpy(ctx->kernels, target, -disc->change, atom, rank);
    return moved;
}

/* One disc after the other rather than all at once: with touches further apart than their radii
 * they hardly depend on each other, and four unknowns need no matrix in memory. */
void eits_fit_move(eits_context *ctx, const eits_scratch *scratch, eits_fit *f, uint32_t first,
                   uint32_t last, uint32_t sweeps)
{
    for (uint32_t sweep = 0; sweep < sweeps; ++sweep) {
        eits_real farthest = 0;
        for (uint32_t k = first; k <= last; ++k) {
            if (!eits_fit_may_go_on(ctx, f))
                return;
            const eits_real moved = move_disc(ctx, scratch, f, k);
            farthest = eits_larger(moved, farthest);
        }
        /* Further moves would not be seen. */
        if (farthest < EITS_SETTLED_PIXELS * (eits_real)ctx->model->pixel_mm)
            break;
    }
}

void eits_fit_move_all(eits_context *ctx, const eits_scratch *scratch, eits_fit *f, uint32_t sweeps)
{
    if (f->count > 0)
        eits_fit_move(ctx, scratch, f, 0, f->count - 1u, sweeps);
}
