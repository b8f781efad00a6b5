/* FISTA's working set. An iteration moves few coefficients: those that are not zero, in x or in the
 * extrapolated point z, and those whose correlation with the residual exceeds lambda. All others
 * stay zero, so between two looks at every column the products run over these alone, and over fewer
 * and fewer of them as they come to rest at zero. A column that would have moved meanwhile does so
 * after the next look; with a look in every iteration the bits are those of FISTA on every column.
 */
#include "solve/working_set.h"

#include "base/vec.h"
#include "kernels/kernels.h"

/* A column at rest moves where its gradient lies outside these. */
typedef struct limits {
    eits_real low, high;
} limits;

static limits limits_for(eits_real lambda, eits_sign sign)
{
    const eits_real none = R(INFINITY);
    return (limits){sign == EITS_SIGN_INCREASE ? -none : -lambda,
                    sign == EITS_SIGN_DECREASE ? none : lambda};
}

static int moves(eits_real gradient, limits rest)
{
    return gradient > rest.high || gradient < rest.low;
}

int eits_moves(eits_real gradient, eits_real lambda, eits_sign sign)
{
    return moves(gradient, limits_for(lambda, sign));
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
    const limits rest = limits_for(lambda, ctx->options.sign);
    /* the image is made after the last iteration */
    eits_real *x = ctx->x_next, *z = ctx->image, *gradient = ctx->gradient;
    uint32_t *chosen = ctx->list_index;
    uint32_t count = 0, j = 0;
    for (uint32_t old = 0; old <= before; ++old) {
        const uint32_t next = old < before ? ctx->working[old] : n;
        for (; j < next; ++j) {
            if (!moves(gradient[j], rest))
                continue;
            chosen[count] = j;
            x[count] = z[count] = 0;
            gradient[count++] = gradient[j];
        }
        if (next == n || (ctx->x[old] == 0 && ctx->z[old] == 0 && !moves(gradient[next], rest))) {
            ++j;
            continue;
        }
        chosen[count] = j;
        x[count] = ctx->x[old];
        z[count] = ctx->z[old];
        gradient[count++] = gradient[j++];
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
    const limits rest = limits_for(lambda, ctx->options.sign);
    uint32_t count = 0;
    for (uint32_t k = 0; k < before; ++k) {
        const eits_real x = ctx->x[k], z = ctx->z[k], gradient = ctx->gradient[k];
        if (x == 0 && z == 0 && !moves(gradient, rest))
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
