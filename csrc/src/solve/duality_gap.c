/* The duality gap, the gradient that it needs, and the limit of multiply-accumulates.
 *
 * The gap is an upper bound of the distance of the objective from its optimum. It holds for any x,
 * so a caller can rely on it without trusting the solver. It needs the gradient of every column,
 * n_pixels x rank multiply-accumulates, which is more than half of an iteration on a working set;
 * the solvers therefore compute it rarely. All solvers share this file, so that gap, objective and
 * limit mean the same for each.
 *
 * All numbers are relative to |y|^2 / 2, the objective at x = 0: with gap_rel = 0.01 the objective
 * is within a hundredth of that value of its optimum. */
#include "solve/constants.h"
#include "solve/solve.h"

#include "base/vec.h"
#include "context/products.h"
#include "context/projection.h"
#include "frame/whitening.h"
#include "kernels/kernels.h"

uint64_t eits_take_residual(eits_context *ctx, const eits_real *sx)
{
    return eits_residual(ctx, sx, ctx->solver.residual);
}

/* The cost is also counted in advance, so that no step begins after which the limit would not allow
 * the gap. */
uint64_t eits_gradient_macs(const eits_context *ctx)
{
    return (uint64_t)ctx->model->n_pixels * ctx->model->rank + eits_forward_macs(ctx) +
           eits_adjoint_macs(ctx);
}

void eits_take_gradient(eits_context *ctx, const eits_real *sx)
{
    (void)eits_take_residual(ctx, sx);
    eits_apply_t(ctx, eits_adjoint(ctx, ctx->solver.residual, ctx->solver.adjoint),
                 ctx->solver.gradient);
    ctx->info.macs += eits_gradient_macs(ctx);
}

int eits_affords(const eits_context *ctx, uint64_t macs)
{
    return ctx->options.mac_limit == 0 || ctx->info.macs + macs <= ctx->options.mac_limit;
}

static eits_real half_square_of_data(const eits_context *ctx)
{
    return R(0.5) * ctx->info.data_norm * ctx->info.data_norm;
}

/* Rounding may raise the objective slightly. A thousandth of its value at zero is far above
 * rounding, and far below the rise by a step that is too long. */
eits_real eits_ceiling(const eits_context *ctx)
{
    return half_square_of_data(ctx) * (1 + EITS_MAX_RISE);
}

/* With r = y - S x, c = S' r and s = min(1, lambda / max c), the dual point s r gives
 *     gap = (1 - s)^2 |r|^2 / 2 + sum_j (lambda |x_j| - s x_j c_j),
 * a sum of terms that are not negative, so that nothing cancels (from Kim et al., IEEE J. Sel. Top.
 * Signal Process. 1 (2007) 606, doi 10.1109/JSTSP.2007.910971, with |y|^2 / 2 - |y - s r|^2 / 2
 * written out). */
eits_duality_gap eits_duality_gap_of(const eits_context *ctx, eits_real lambda, eits_layout layout)
{
    const eits_real largest =
        eits_greatest(ctx->kernels, ctx->solver.gradient, ctx->model->n_pixels, ctx->options.sign);
    const eits_real s = largest > lambda ? lambda / largest : 1;
    const uint32_t count =
        layout == EITS_LAYOUT_WORKING ? ctx->solver.working_count : ctx->model->n_pixels;
    eits_real lane[8] = {0}, lane_l1[8] = {0};
    for (uint32_t k = 0; k < count; ++k) { /* columns that are not listed add zero to their lanes */
        const uint32_t j = layout == EITS_LAYOUT_WORKING ? ctx->solver.working[k] : k;
        const eits_real weight = lambda * eits_fabs(ctx->solver.x[k]);
        const eits_real slack = eits_fma(-s * ctx->solver.x[k], ctx->solver.gradient[j], weight);
        /* The lane follows from the column's number, not from its place in the list, so that the
         * sum has the same bits in both layouts. */
        lane[j % 8] += slack > 0 ? slack : 0; /* below zero by rounding only */
        lane_l1[j % 8] += weight;
    }
    eits_duality_gap c;
    c.residual_squared =
        eits_dot(ctx->kernels, ctx->solver.residual, ctx->solver.residual, ctx->model->rank);
    c.gap = eits_fma(R(0.5) * (1 - s) * (1 - s), c.residual_squared, eits_tree8(lane));
    c.objective = eits_fma(R(0.5), c.residual_squared, eits_tree8(lane_l1));
    return c;
}

eits_duality_gap eits_find_duality_gap(eits_context *ctx, eits_real lambda, eits_layout layout)
{
    eits_take_gradient(ctx, ctx->solver.sx);
    return eits_duality_gap_of(ctx, lambda, layout);
}

/* At x = 0, r = y, and the sum over coefficients is empty. */
eits_duality_gap eits_duality_gap_at_zero(const eits_context *ctx, eits_real lambda)
{
    const eits_real half = half_square_of_data(ctx),
                    s = ctx->info.lambda_max > lambda ? lambda / ctx->info.lambda_max : 1;
    return (eits_duality_gap){(1 - s) * (1 - s) * half, half,
                              ctx->info.data_norm * ctx->info.data_norm};
}

void eits_report_duality_gap(eits_context *ctx, eits_duality_gap c)
{
    ctx->info.gap = c.gap;
    const eits_real half = half_square_of_data(ctx);
    ctx->info.gap_rel = half > 0 ? c.gap / half : 0;
    ctx->info.residual = eits_sqrt(c.residual_squared);
}
