/* More touches than can be told apart: reported, not guessed.
 *
 * Touches that overlap, or are many for so few electrodes, may be counted wrongly, and the fit
 * cannot know. A diagnostic says how likely that is instead of hiding it: a logistic model of
 * whether the count is right, from features that the fit has anyhow. In: the touches found,
 * info.unexplained, lambda_max and lambda_noise. Out: one bit; no touch is changed by it. Costs
 * nothing beside the fit. */
#include "diagnostics/diagnostics.h"

#include "base/vec.h"
#include "kernels/kernels.h"

/* A linear score of what the touch fit found, the logarithm of the odds that every touch is found
 * and nothing else: fitted on mixed tuning scenes of 1 to 12 touches at 40, 60 and 80 dB by eitskin
 * study multitouch, whose page has how well it is calibrated. */
static const eits_real OFFSET = R(-0.3583);
/* each, with so many electrodes */
static const eits_real TOUCHES = R(-0.2429), OF_ELECTRODES = R(16.0);
/* the least distance over the sum of the radii, at most this */
static const eits_real NEAREST = R(3.645), FAR = R(2.0);
/* the greatest radius over the seed's */
static const eits_real WIDEST = R(-4.607);
/* the root of the fraction of |y|^2 that is left */
static const eits_real LEFT = R(-3.659);
/* the weakest touch over noise, at most this */
static const eits_real WEAKEST = R(0.1329), STRONG = R(10.0);
/* it over what is left, at most this */
static const eits_real CLEAREST = R(0.7892), CLEAR = R(3.0);
/* below it the count is a guess */
static const eits_real MIN = R(1.078);
/* max(S'y) over that of noise: below it what is there may be noise, and no crowd */
static const eits_real FAINT = R(3.0);

static eits_real lesser(eits_real a, eits_real b)
{
    return a < b ? a : b;
}

static eits_real nearest(const eits_touch *touches, uint32_t count)
{
    eits_real min = FAR;
    for (uint32_t k = 0; k < count; ++k) {
        for (uint32_t l = 0; l < k; ++l) {
            const eits_real dx = touches[k].x_mm - touches[l].x_mm,
                            dy = touches[k].y_mm - touches[l].y_mm;
            min = lesser(min, eits_sqrt(eits_fma(dx, dx, dy * dy)) /
                                  (touches[k].radius_mm + touches[l].radius_mm));
        }
    }
    return min;
}

/* Of at least one touch.
 *
 * Features that say how hard the scene is, in the order of what they were worth: touches that
 * overlap, a wide one that may be two, what no touch explains, the weakest against noise and
 * against what is left, and their number. */
static eits_real score(const eits_context *ctx, const eits_touch *touches, uint32_t count)
{
    const eits_real noise = ctx->info.lambda_noise, left = ctx->info.unexplained;
    eits_real widest = 0, weakest = touches[0].confidence;
    for (uint32_t k = 0; k < count; ++k) {
        widest = touches[k].radius_mm > widest ? touches[k].radius_mm : widest;
        weakest = lesser(weakest, touches[k].confidence);
    }
    const eits_real above =
        noise > 0 ? lesser(STRONG, eits_sqrt(weakest) * ctx->info.lambda_max / noise) : STRONG;
    const eits_real clear = weakest < CLEAR * CLEAR * left ? eits_sqrt(weakest / left) : CLEAR;
    eits_real sum = eits_fma(TOUCHES * OF_ELECTRODES / (eits_real)ctx->model->n_electrodes,
                             (eits_real)count, OFFSET);
    sum = eits_fma(NEAREST, nearest(touches, count), sum);
    sum = eits_fma(WIDEST, widest / ctx->options.touch_seed_radius_mm, sum);
    sum = eits_fma(LEFT, eits_sqrt(left), sum);
    sum = eits_fma(WEAKEST, above, sum);
    return eits_fma(CLEAREST, clear, sum);
}

void eits_check_crowd(eits_context *ctx, const eits_touch *touches, uint32_t count)
{
    ctx->info.diagnostics &= ~(uint32_t)EITS_DIAGNOSTIC_CROWDED;
    if (count == 0 || !eits_wants(ctx, EITS_DIAGNOSTIC_CROWDED) ||
        ctx->info.lambda_max < FAINT * ctx->info.lambda_noise)
        return;
    if (count >= ctx->options.max_touches || score(ctx, touches, count) < MIN)
        ctx->info.diagnostics |= EITS_DIAGNOSTIC_CROWDED;
}
