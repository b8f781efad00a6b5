#include "solve/violations.h"

#include "base/vec.h"
#include "frame/whitening.h"
#include "kernels/kernels.h"

/* How far the correlations lie violation zero under the sign rule. */
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

/* One branch at the end: each of them would be guessed wrong. */
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

/* Put column j, if it is a peak, into the list of `count`, greatest first; returns how many there
 * are then. */
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

enum { BLOCK = 32 };

/* Pixel j's two coordinates as one number: a neighbour in the row differs by one's. */
static inline uint32_t place_of(const eits_pixel *pixel)
{
    uint32_t place;
    memcpy(&place, pixel, sizeof place);
    return place;
}

/* Of BLOCK columns from v and p on, which are violation `min` and no less than their neighbours
 * in the row; returns whether any is. The columns before and after are there too. Without a branch,
 * so that compilers make vectors of it. */
static uint32_t peaks_of_rows(const eits_real *v, const eits_pixel *p, eits_real min,
                              uint32_t flag[BLOCK])
{
    const eits_pixel one = {.ix = 1};
    const uint32_t next = place_of(&one);
    uint32_t any = 0;
    for (uint32_t l = 0; l < BLOCK; ++l)
        any |= v[l] > min;
    if (!any)
        return 0;
    any = 0;
    for (int l = 0; l < BLOCK; ++l) {
        const uint32_t before =
            (place_of(p + l) - place_of(p + l - 1) == next) & (v[l - 1] >= v[l]);
        const uint32_t after = (place_of(p + l + 1) - place_of(p + l) == next) & (v[l + 1] > v[l]);
        any |= flag[l] = (v[l] > min) & (before == 0) & (after == 0);
    }
    return any;
}

static uint32_t of_all(const eits_context *ctx, const eits_scratch *scratch, const eits_real *v,
                       eits_real min)
{
    const uint32_t n = ctx->model->n_pixels;
    uint32_t count = 0, flag[BLOCK];
    for (uint32_t first = 0; first < n; first += BLOCK) {
        const uint32_t end = first + BLOCK < n ? first + BLOCK : n;
        const int whole = first > 0 && first + BLOCK < n;
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
    /* Peaks only: neighbours of a column that is missing exceed lambda as well, and most of them no
     * longer do once it is in. */
    const eits_real *v = violation(ctx, scratch);
    if (near == NULL)
        return of_all(ctx, scratch, v, min);
    uint32_t above = 0, count = 0, *list = scratch->index;
    for (uint32_t k = 0; k < near->count; ++k) { /* no branch that would be guessed wrong */
        list[above] = near->column[k];
        above += v[near->column[k]] > min;
    }
    for (uint32_t k = 0; k < above; ++k) /* there are never more peaks than columns read */
        count = consider(ctx, scratch, v, list[k], count);
    return count;
}

eits_nearby eits_nearby_none(const eits_context *ctx)
{
    const eits_nearby near = {.column = (uint32_t *)(void *)ctx->solver.image,
                              .marked = (uint8_t *)(void *)ctx->solver.z};
    memset(near.marked, 0, ctx->model->n_pixels);
    return near;
}

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

/* A column is looked around once: the mark remembers, so that a set which grows by one costs
 * nine looks and not a walk over all. */
void eits_nearby_add(const eits_context *ctx, eits_nearby *near)
{
    for (uint32_t k = 0; k < ctx->solver.working_count; ++k) {
        if (near->marked[ctx->solver.working[k]] != AROUND)
            add_around(ctx, near, ctx->solver.working[k]);
    }
}

/* A few columns instead of all of them: the gap is not known from it, so the solve cannot end by
 * it. */
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
