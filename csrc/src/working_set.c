/* FISTA's working set. An iteration moves few coefficients: those that are not zero, in x or in the extrapolated point z, and
 * those whose correlation with the residual exceeds lambda. All others stay zero, so between two looks at every column the
 * products run over these alone, and over fewer and fewer of them as they come to rest at zero. A column that would have moved
 * meanwhile does so after the next look; with a look in every iteration the bits are those of FISTA on every column. */
#include "fista.h"

#include "kernels.h"
#include "vec.h"

static int would_move(eits_real gradient, eits_real lambda, eits_sign sign)
{
    return (sign != EITS_SIGN_DECREASE && gradient > lambda) || (sign != EITS_SIGN_INCREASE && gradient < -lambda);
}

void eits_working_set_begin(eits_context *ctx)
{
    uint32_t count = 0;
    for (uint32_t j = 0; j < ctx->model->n_pixels; ++j) {
        const eits_real value = ctx->x[j];
        if (value == 0)
            continue;
        ctx->working[count] = j;
        ctx->x[count++] = value;
    }
    ctx->working_count = count;
}

void eits_working_set_choose(eits_context *ctx, eits_real lambda)
{
    const uint32_t n = ctx->model->n_pixels, before = ctx->working_count;
    const eits_sign sign = ctx->options.sign;
    eits_real *x = ctx->x_next, *z = ctx->image; /* the image is made after the last iteration */
    uint32_t *chosen = ctx->list_index;
    uint32_t count = 0, old = 0, next = before > 0 ? ctx->working[0] : n;
    for (uint32_t j = 0; j < n; ++j) {
        const eits_real gradient = ctx->gradient[j];
        const int moves = would_move(gradient, lambda, sign);
        if (j != next && !moves)
            continue;
        x[count] = z[count] = 0;
        if (j == next) {
            x[count] = ctx->x[old];
            z[count] = ctx->z[old++];
            next = old < before ? ctx->working[old] : n;
            if (!moves && x[count] == 0 && z[count] == 0)
                continue;
        }
        chosen[count] = j;
        ctx->gradient[count++] = gradient;
    }
    ctx->working_count = count;
    memcpy(ctx->working, chosen, count * sizeof *chosen);
    eits_copy(ctx->x, x, count);
    eits_copy(ctx->z, z, count);
    eits_pack_panels(ctx);
}

void eits_working_set_prune(eits_context *ctx, eits_real lambda)
{
    const uint32_t before = ctx->working_count;
    uint32_t count = 0;
    for (uint32_t k = 0; k < before; ++k) {
        const eits_real x = ctx->x[k], z = ctx->z[k], gradient = ctx->gradient[k];
        if (x == 0 && z == 0 && !would_move(gradient, lambda, ctx->options.sign))
            continue;
        ctx->working[count] = ctx->working[k];
        ctx->x[count] = x;
        ctx->z[count] = z;
        ctx->gradient[count++] = gradient;
    }
    ctx->working_count = count;
    if (count < before)
        eits_pack_panels(ctx);
}

void eits_working_set_end(eits_context *ctx)
{
    eits_zero(ctx->x_next, ctx->model->n_pixels);
    for (uint32_t k = 0; k < ctx->working_count; ++k)
        ctx->x_next[ctx->working[k]] = ctx->x[k];
    eits_copy(ctx->x, ctx->x_next, ctx->model->n_pixels);
}
