/* More touches than can be told apart: said, not guessed. */
#include "examine.h"

#include "kernels.h"
#include "vec.h"

/* Chosen on training scenes of 1 to 12 touches; docs/findings.md has the rates. */
static const eits_real UNEXPLAINED = R(0.12); /* of |y|^2 beyond noise; model and tank may differ by less */
static const eits_real NOISE = R(1.5);         /* times the energy that is expected of it */
static const eits_real NEIGHBOURS = R(1.5);    /* two touches nearer than so many times the sum of their radii */
static const eits_real WEAKEST = R(0.01);      /* the weakest of several touches explains less than this of |y|^2 */
static const eits_real CLEAR = R(3.0);         /* max(S'y) over that of noise: below it what the touches leave is noise */
enum { ELECTRODES_A_TOUCH = 2 }; /* with fewer electrodes for each touch the count is often wrong */

static int too_near(const eits_touch *a, const eits_touch *b)
{
    const eits_real dx = a->x_mm - b->x_mm, dy = a->y_mm - b->y_mm, reach = NEIGHBOURS * (a->radius_mm + b->radius_mm);
    return eits_fma(dx, dx, dy * dy) < reach * reach;
}

eits_real eits_expected_noise(const eits_context *ctx)
{
    return eits_noise_energy(ctx) / (eits_real)ctx->model->n_folded * ctx->sheet_energy;
}

static eits_real noise_share(const eits_context *ctx)
{
    const eits_real energy = ctx->info.data_norm * ctx->info.data_norm;
    return energy > 0 ? eits_expected_noise(ctx) / energy : 0;
}

/* |residual|^2 / |y|^2. */
static eits_real unexplained(const eits_context *ctx)
{
    const uint32_t rank = ctx->model->rank;
    const eits_real whole = eits_dot(ctx, ctx->y, ctx->y, rank);
    return whole > 0 ? eits_dot(ctx, ctx->residual, ctx->residual, rank) / whole : 0;
}

void eits_judge_crowd(eits_context *ctx, int looked, const eits_touch *touches, uint32_t count)
{
    ctx->info.unexplained = looked ? unexplained(ctx) : 0;
    ctx->info.findings &= ~(uint32_t)EITS_FINDING_CROWDED;
    if (count == 0 || !eits_wants(ctx, EITS_FINDING_CROWDED) || ctx->info.lambda_max < CLEAR * ctx->info.lambda_noise)
        return;
    int crowded = count >= ctx->options.max_touches || ELECTRODES_A_TOUCH * count >= ctx->model->n_electrodes;
    crowded |= eits_fma(-NOISE, noise_share(ctx), ctx->info.unexplained) > UNEXPLAINED;
    for (uint32_t k = 0; k < count && count > 1; ++k) {
        crowded |= touches[k].confidence < WEAKEST;
        for (uint32_t l = 0; l < k; ++l)
            crowded |= too_near(touches + k, touches + l);
    }
    if (crowded)
        ctx->info.findings |= EITS_FINDING_CROWDED;
}
