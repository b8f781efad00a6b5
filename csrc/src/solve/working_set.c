/* FISTA's working set. An iteration moves few coefficients: those that are not zero in x or in the
 * extrapolated point z, and those whose correlation with the residual exceeds lambda. All others
 * stay zero. Between two looks at every column the products therefore run over these columns only,
 * and over fewer of them as more come to rest at zero. A column that would have moved in the
 * meantime moves after the next look. With a look in every iteration the bits are those of FISTA on
 * every column.
 *
 * The benefit: a product over all columns costs n_pixels x rank multiply-accumulates, but one or
 * two touches move only some per cent of the columns. The risk: a column joins up to one interval
 * between looks too late. No column is lost for good, because a look is exact.
 *
 * Invariants while a set is in force: working[] ascends, so that lists and sums have the order of
 * the full problem; x[k], z[k] and gradient[k] belong to column working[k]; every column outside is
 * zero in x and in z. eits_working_set_begin and _end convert from and to the layout by pixel. */
#include "solve/solve.h"

#include "base/vec.h"
#include "kernels/kernels.h"

/* A column at rest moves if its gradient is outside these limits.
 *
 * The rule for joining is the proximal step itself: a column at x = z = 0 stays zero exactly if its
 * gradient is within lambda on each side that the sign rule allows. A side that is not allowed has
 * an infinite limit, so one pair of comparisons serves all three rules. */
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

/* A warm start begins with the columns that are not zero; others join at the first look. */
void eits_working_set_begin(eits_context *ctx)
{
    uint32_t count = 0;
    for (uint32_t j = 0; j < ctx->model->n_pixels; ++j) {
        const eits_real value = ctx->solver.x[j];
        if (value == 0)
            continue;
        ctx->solver.working[count] = j;
        ctx->solver.x[count++] = value;
    }
    ctx->solver.working_count = count;
}

/* Two ascending lists are merged, the old set and the columns that would move: the cost is linear
 * in n_pixels, without a search. A column of the old set stays as long as x or z is not zero,
 * because momentum may still carry it, whatever its gradient is. The gradient is compacted in
 * place: count <= j, so no number is overwritten before it is read. x and z are copied through
 * x_next and the image, which are free between iterations. */
void eits_working_set_choose(eits_context *ctx, const eits_scratch *scratch, eits_real lambda)
{
    const uint32_t n = ctx->model->n_pixels, before = ctx->solver.working_count;
    const limits rest = limits_for(lambda, ctx->options.sign);
    /* the image is computed after the last iteration */
    eits_real *x = ctx->solver.x_next, *z = ctx->solver.image, *gradient = ctx->solver.gradient;
    uint32_t *chosen = scratch->index;
    uint32_t count = 0, j = 0;
    for (uint32_t old = 0; old <= before; ++old) {
        const uint32_t next = old < before ? ctx->solver.working[old] : n;
        for (; j < next; ++j) {
            if (!moves(gradient[j], rest))
                continue;
            chosen[count] = j;
            x[count] = z[count] = 0;
            gradient[count++] = gradient[j];
        }
        if (next == n ||
            (ctx->solver.x[old] == 0 && ctx->solver.z[old] == 0 && !moves(gradient[next], rest))) {
            ++j;
            continue;
        }
        chosen[count] = j;
        x[count] = ctx->solver.x[old];
        z[count] = ctx->solver.z[old];
        gradient[count++] = gradient[j++];
    }
    ctx->solver.working_count = count;
    memcpy(ctx->solver.working, chosen, count * sizeof *chosen);
    eits_copy(ctx->solver.x, x, count);
    eits_copy(ctx->solver.z, z, count);
    eits_pack_panels(ctx);
}

/* Between looks the gradient of the set is known, so leaving columns out costs nothing. */
void eits_working_set_prune(eits_context *ctx, eits_real lambda)
{
    const uint32_t before = ctx->solver.working_count;
    const limits rest = limits_for(lambda, ctx->options.sign);
    uint32_t count = 0;
    for (uint32_t k = 0; k < before; ++k) {
        const eits_real x = ctx->solver.x[k], z = ctx->solver.z[k],
                        gradient = ctx->solver.gradient[k];
        if (x == 0 && z == 0 && !moves(gradient, rest))
            continue;
        ctx->solver.working[count] = ctx->solver.working[k];
        ctx->solver.x[count] = x;
        ctx->solver.z[count] = z;
        ctx->solver.gradient[count++] = gradient;
    }
    ctx->solver.working_count = count;
    /* Packing costs about as much as an iteration, so it is only done if the set has changed. */
    if (count < before)
        eits_pack_panels(ctx);
}

/* The coefficients are copied through x_next: in place, some would be overwritten before they are
 * read. */
void eits_working_set_end(eits_context *ctx)
{
    eits_zero(ctx->solver.x_next, ctx->model->n_pixels);
    for (uint32_t k = 0; k < ctx->solver.working_count; ++k)
        ctx->solver.x_next[ctx->solver.working[k]] = ctx->solver.x[k];
    eits_copy(ctx->solver.x, ctx->solver.x_next, ctx->model->n_pixels);
}

/* ---- products over it ---- */

/* S'v over the set is computed from the fastest available copy of its columns: panels (on hosts
 * with enough memory), the column cache (on boards: unpacked once, in fast memory), or S as it is
 * stored. All three have the same order of sums, so the bits are the same. */
void eits_apply_t_working(const eits_context *ctx, const eits_real *v, eits_real *out)
{
    const eits_matrix *s = &ctx->model->sensitivity;
    if (ctx->solver.working_panels != NULL) {
        ctx->kernels->mul_t_panels(s, ctx->solver.working_panels, ctx->solver.working,
                                   ctx->solver.working_count, v, out);
    } else if (ctx->solver.working_cached) {
        const eits_matrix cached = eits_cached_columns(&ctx->columns);
        ctx->kernels->mul_t(&cached, ctx->solver.working_slot, ctx->solver.working_count, v, out);
        eits_scale_listed(s, ctx->solver.working, ctx->solver.working_count, out);
    } else {
        ctx->kernels->mul_t(s, ctx->solver.working, ctx->solver.working_count, v, out);
    }
}

/* Zeros are left out first: the product costs rank multiply-accumulates per column, the test one
 * comparison. The list is in ascending order as in eits_apply, so both give the same bits. */
uint32_t eits_apply_working(const eits_context *ctx, const eits_scratch *scratch,
                            const eits_real *x, eits_real *out)
{
    const eits_matrix *s = &ctx->model->sensitivity;
    uint32_t count = 0;
    for (uint32_t k = 0; k < ctx->solver.working_count; ++k) {
        scratch->index[count] = ctx->solver.working[k];
        scratch->value[count] = x[k];
        count += x[k] != 0;
    }
    eits_scale_listed(s, scratch->index, count, scratch->value);
    if (ctx->solver.working_cached) {
        const eits_matrix cached = eits_cached_columns(&ctx->columns);
        eits_cache_slots(&ctx->columns, scratch->index, count, scratch->index);
        ctx->kernels->mul(&cached, scratch->index, scratch->value, count, out);
    } else {
        ctx->kernels->mul(s, scratch->index, scratch->value, count, out);
    }
    return count;
}

/* The columns of a working set are scattered over S. Side by side in panels they are read in order,
 * many times. */
void eits_pack_panels(eits_context *ctx)
{
    const uint32_t rows = ctx->model->rank;
    ctx->solver.working_cached = eits_cache_columns(&ctx->columns, ctx->kernels,
                                                    ctx->solver.working, ctx->solver.working_count);
    if (ctx->solver.working_cached)
        eits_cache_slots(&ctx->columns, ctx->solver.working, ctx->solver.working_count,
                         ctx->solver.working_slot);
    if (ctx->solver.working_panels == NULL)
        return;
    for (uint32_t k = 0; k < EITS_PANEL_COLUMNS(ctx->solver.working_count); ++k) {
        eits_real *to = ctx->solver.working_panels + (size_t)(k / EITS_PANEL) * EITS_PANEL * rows +
                        k % EITS_PANEL;
        /* unused lanes hold any column */
        const uint32_t j = ctx->solver.working[k < ctx->solver.working_count ? k : 0];
        const eits_real *from =
            ctx->columns.panels + (size_t)(j / EITS_PANEL) * EITS_PANEL * rows + j % EITS_PANEL;
        for (uint32_t i = 0; i < rows; ++i)
            to[(size_t)i * EITS_PANEL] = from[(size_t)i * EITS_PANEL];
    }
}
