/* More touches than can be separated: reported, not guessed.
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
static eits_real lesser(eits_real a, eits_real b)
{
    return a < b ? a : b;
}

static eits_real nearest(const eits_touch *touches, uint32_t count)
{
    eits_real min = EITS_CROWD_FAR;
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
    eits_real widest = 0, weakest = touches[0].explained;
    for (uint32_t k = 0; k < count; ++k) {
        widest = touches[k].radius_mm > widest ? touches[k].radius_mm : widest;
        weakest = lesser(weakest, touches[k].explained);
    }
    const eits_real above =
        noise > 0 ? lesser(EITS_CROWD_STRONG, eits_sqrt(weakest) * ctx->info.lambda_max / noise)
                  : EITS_CROWD_STRONG;
    const eits_real clear = weakest < EITS_CROWD_CLEAR * EITS_CROWD_CLEAR * left
                                ? eits_sqrt(weakest / left)
                                : EITS_CROWD_CLEAR;
    eits_real sum = eits_fma(EITS_CROWD_TOUCHES / (eits_real)ctx->model->n_electrodes,
                             (eits_real)count, EITS_CROWD_OFFSET);
    sum = eits_fma(EITS_CROWD_NEAREST, nearest(touches, count), sum);
    sum = eits_fma(EITS_CROWD_WIDEST, widest / ctx->options.touch_seed_radius_mm, sum);
    sum = eits_fma(EITS_CROWD_LEFT, eits_sqrt(left), sum);
    sum = eits_fma(EITS_CROWD_WEAKEST, above, sum);
    return eits_fma(EITS_CROWD_CLEAREST, clear, sum);
}

int eits_is_faint(const eits_context *ctx)
{
    return ctx->info.lambda_max < EITS_CROWD_FAINT * ctx->info.lambda_noise;
}

void eits_check_crowd(eits_context *ctx, const eits_touch *touches, uint32_t count)
{
    ctx->info.diagnostics &= ~(uint32_t)EITS_DIAGNOSTIC_CROWDED;
    if (count == 0 || !eits_wants(ctx, EITS_DIAGNOSTIC_CROWDED) || eits_is_faint(ctx))
        return;
    if (count >= ctx->options.max_touches || EITS_CROWD_NUMBERS * count > ctx->model->rank ||
        score(ctx, touches, count) < EITS_CROWD_MIN)
        ctx->info.diagnostics |= EITS_DIAGNOSTIC_CROWDED;
}
