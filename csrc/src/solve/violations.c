/* Find the violations of the KKT conditions: columns at zero that would lower the objective.
 *
 * With r the residual, the optimum of |y - F S x|^2 / 2 + lambda |x|_1 has s_j'r = lambda sign(x_j)
 * where x_j is not zero, and |s_j'r| <= lambda where it is (one-sided under a sign rule). The
 * active set solver asks after each round which columns break the second condition. It needs a few
 * good columns, not all. Neighbouring pixels have nearly parallel columns, so if one is missing,
 * its neighbours violate the condition, too, and most of them no longer do after it has been added.
 * Therefore only local maxima over the eight neighbours in the image are listed.
 *
 * In: solver.gradient = S'F'r, with the active columns' set to zero; the image's grid. Out: columns
 * in scratch->index, greatest violation first, ties by the lower number. That order is part of the
 * result's bits: columns join in it, and the limit of multiply-accumulates may cut it off.
 *
 * A look at every column costs n_pixels x rank multiply-accumulates and dominates a round. Between
 * two of them the solver looks at the active columns' neighbours alone (eits_nearby): touches are
 * connected, so most columns that join are neighbours of active ones. */
#include "solve/violations.h"

#include "base/vec.h"
#include "frame/whitening.h"
#include "kernels/kernels.h"
#include "solve/constants.h"

/* Return the correlations with a sign such that a greater number is a greater violation. If the
 * sign rule allows only increases, they have it already, and no copy is made. */
static const eits_real *violation(const eits_context *ctx, const eits_scratch *scratch)
{
    const eits_real *g = ctx->solver.gradient;
    const uint32_t n = ctx->model->n_pixels;
    eits_real *out = scratch->value;
    switch (ctx->options.sign) {
    case EITS_SIGN_INCREASE:
        return g;
    case EITS_SIGN_DECREASE:
        for (uint32_t j = 0; j < n; ++j)
            out[j] = -g[j];
        break;
    case EITS_SIGN_BOTH:
        for (uint32_t j = 0; j < n; ++j)
            out[j] = eits_fabs(g[j]);
        break;
    }
    return out;
}

/* The loop has no branch, because a processor would mispredict half of these comparisons. At the
 * image's edge, and if a neighbour is not a kept pixel, the pixel is compared with itself or with
 * another neighbour, which changes nothing. Among equal pixels the one with the lowest number is
 * the peak, so that a plateau has exactly one. */
int eits_is_peak(const eits_context *ctx, const eits_real *v, uint32_t j)
{
    const uint32_t nx = ctx->model->nx, ix = ctx->model->pixel[j].ix, iy = ctx->model->pixel[j].iy;
    const uint32_t left = ix - (ix > 0), right = ix + (ix + 1 < nx),
                   top = iy + (iy + 1u < ctx->model->ny);
    const uint16_t *row[3] = {ctx->cell + (size_t)(iy - (iy > 0)) * nx, ctx->cell + (size_t)iy * nx,
                              ctx->cell + (size_t)top * nx};
    const eits_real own = v[j];
    int beaten = 0;
    for (int y = 0; y < 3; ++y) {
        const uint32_t around[3] = {row[y][left], row[y][ix], row[y][right]};
        for (int x = 0; x < 3; ++x) {
            const uint32_t other = around[x] == EITS_NO_PIXEL ? j : around[x];
            beaten |= (v[other] > own) | ((v[other] == own) & (other < j));
        }
    }
    return !beaten;
}

/* If column j is a peak, insert it into the list of `count` columns, greatest first. Returns the
 * new length of the list. */
static uint32_t consider(const eits_context *ctx, const eits_scratch *scratch, const eits_real *v,
                         uint32_t j, uint32_t count)
{
    if (!eits_is_peak(ctx, v, j))
        return count;
    uint32_t at = count, *list = scratch->index;
    for (; at > 0 && v[list[at - 1]] < v[j]; --at)
        list[at] = list[at - 1];
    list[at] = j;
    return count + 1;
}

/* Return a pixel's two coordinates as one number. It differs by 1 between neighbours in a row. */
static inline uint32_t place_of(const eits_pixel *pixel)
{
    uint32_t place;
    memcpy(&place, pixel, sizeof place);
    return place;
}

/* Flag those of the EITS_SIEVE_BLOCK columns from v and p on that exceed `min` and are not less
 * than their neighbours in the row. Returns 1 if there is any. This is a cheap test before
 * eits_is_peak, which looks at all eight neighbours through the cell map. The columns before and
 * after the block must exist. The loop has no branch, so that compilers can vectorise it. */
static uint32_t peaks_of_rows(const eits_real *v, const eits_pixel *p, eits_real min,
                              uint32_t flag[EITS_SIEVE_BLOCK])
{
    const eits_pixel one = {.ix = 1};
    const uint32_t next = place_of(&one);
    uint32_t any = 0;
    for (uint32_t l = 0; l < EITS_SIEVE_BLOCK; ++l)
        any |= v[l] > min;
    if (!any)
        return 0;
    any = 0;
    for (int l = 0; l < EITS_SIEVE_BLOCK; ++l) {
        const uint32_t before =
            (place_of(p + l) - place_of(p + l - 1) == next) & (v[l - 1] >= v[l]);
        const uint32_t after = (place_of(p + l + 1) - place_of(p + l) == next) & (v[l + 1] > v[l]);
        any |= flag[l] = (v[l] > min) & (before == 0) & (after == 0);
    }
    return any;
}

/* The first and the last columns have no column before or after them, so they are tested one by
 * one. */
static uint32_t of_all(const eits_context *ctx, const eits_scratch *scratch, const eits_real *v,
                       eits_real min)
{
    const uint32_t n = ctx->model->n_pixels;
    uint32_t count = 0, flag[EITS_SIEVE_BLOCK];
    for (uint32_t first = 0; first < n; first += EITS_SIEVE_BLOCK) {
        const uint32_t end = first + EITS_SIEVE_BLOCK < n ? first + EITS_SIEVE_BLOCK : n;
        const int whole = first > 0 && first + EITS_SIEVE_BLOCK < n;
        if (whole && !peaks_of_rows(v + first, ctx->model->pixel + first, min, flag))
            continue;
        for (uint32_t j = first; j < end; ++j) {
            if (whole ? flag[j - first] : v[j] > min)
                count = consider(ctx, scratch, v, j, count);
        }
    }
    return count;
}

uint32_t eits_list_violations(const eits_context *ctx, const eits_scratch *scratch, eits_real min,
                              const eits_nearby *near)
{
    /* Only peaks are listed: the neighbours of a missing column exceed lambda as well, and most of
     * them no longer do after it has been added. */
    const eits_real *v = violation(ctx, scratch);
    if (near == NULL)
        return of_all(ctx, scratch, v, min);
    uint32_t above = 0, count = 0, *list = scratch->index;
    for (uint32_t k = 0; k < near->count; ++k) { /* no branch, which would often be mispredicted */
        list[above] = near->column[k];
        above += v[near->column[k]] > min;
    }
    for (uint32_t k = 0; k < above; ++k) /* there are never more peaks than columns read */
        count = consider(ctx, scratch, v, list[k], count);
    return count;
}

/* The image is computed after the solve, and the active set method does not use z, so their memory
 * is free. */
eits_nearby eits_nearby_none(const eits_context *ctx)
{
    const eits_nearby near = {.column = (uint32_t *)(void *)ctx->solver.image,
                              .marked = (uint8_t *)(void *)ctx->solver.z};
    memset(near.marked, 0, ctx->model->n_pixels);
    return near;
}

/* A mark in near.marked: all neighbours of this column are listed. */
enum { AROUND = 2 };

static void add_around(const eits_context *ctx, eits_nearby *near, uint32_t j)
{
    const eits_model *m = ctx->model;
    const uint32_t ix = m->pixel[j].ix, iy = m->pixel[j].iy;
    const uint32_t right = ix + 1 < m->nx ? ix + 1 : ix, top = iy + 1 < m->ny ? iy + 1 : iy;
    for (uint32_t y = iy > 0 ? iy - 1 : 0; y <= top; ++y) {
        for (uint32_t x = ix > 0 ? ix - 1 : 0; x <= right; ++x) {
            const uint32_t other = ctx->cell[(size_t)y * m->nx + x];
            if (other == EITS_NO_PIXEL || near->marked[other] != 0)
                continue;
            near->marked[other] = 1;
            near->column[near->count++] = other;
        }
    }
    near->marked[j] = AROUND;
}

/* The mark makes sure that the neighbours of a column are listed only once: if the set grows by one
 * column, nine pixels are examined and not all. */
void eits_nearby_add(const eits_context *ctx, eits_nearby *near)
{
    for (uint32_t k = 0; k < ctx->solver.working_count; ++k) {
        if (near->marked[ctx->solver.working[k]] != AROUND)
            add_around(ctx, near, ctx->solver.working[k]);
    }
}

/* The gradient of a few columns does not give the gap, so the solve cannot end by it. */
void eits_take_gradient_nearby(eits_context *ctx, const eits_scratch *scratch,
                               const eits_nearby *near)
{
    const eits_matrix *s = &ctx->model->sensitivity;
    ctx->kernels->dots(s, near->column, near->count,
                       eits_adjoint(ctx, ctx->solver.residual, ctx->solver.adjoint),
                       scratch->value);
    eits_zero(ctx->solver.gradient, s->cols);
    for (uint32_t k = 0; k < near->count; ++k)
        ctx->solver.gradient[near->column[k]] = scratch->value[k];
    ctx->info.macs += (uint64_t)near->count * s->rows + eits_adjoint_macs(ctx);
}
