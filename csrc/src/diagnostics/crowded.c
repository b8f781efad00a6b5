/* Report frames with more touches than can be separated.
 *
 * Overlapping touches, or many touches with few electrodes, may be counted wrongly, and the fit
 * cannot notice it. A logistic model estimates how likely the count is right, from features that
 * the fit has computed anyway. In: the touches found, info.unexplained, lambda_max and
 * lambda_noise. Out: one bit; no touch is changed. The cost is negligible beside the fit. */
#include "diagnostics/diagnostics.h"

#include "base/vec.h"
#include "kernels/kernels.h"

/* The score is linear in features of the touch fit. It is the logarithm of the odds that all
 * touches and no others were found. `eitskin study multitouch` fitted it on mixed tuning scenes of
 * 1 to 12 touches at 40, 60 and 80 dB; its page shows the calibration. */
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

/* Return the score of at least one touch.
 *
 * The features measure how difficult the scene is. In the order of their benefit: touches that
 * overlap, a wide touch that may be two, the unexplained part of the data, the weakest touch
 * against noise and against the residual, and the number of touches. */
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
