/* The answer of the skin to a disc, and the part of the grid that a disc covers.
 *
 * The image is a sum of pixels, but a finger is neither square nor on the grid. A disc of uniform
 * change covers pixels wholly, partly or not; its answer is the sum of S's columns by these covers,
 * so a touch can lie between pixels and its place can be found to a fraction of one. The cover of a
 * pixel is clamp(1/2 + (radius - distance) / pixel, 0, 1), exact for a straight edge parallel to
 * the pixel's side and continuous in place and radius. The fit needs that continuity: with covers
 * of 0 and 1 the residual would be a staircase, and its derivative would be zero or infinite.
 *
 *     atom  = Q F S (c / w),      w the column weights, c the covers: the answer to 1 S/m
 *     slope = Q F S (dc / w),     dc / dx = ramp (x_pixel - x) / distance / pixel, and so on
 *
 * Costs: an atom takes rank multiply-accumulates a covered pixel and Q F on the sum, each of its
 * three slopes the same of the pixels under the rim; the walk over cells is small beside it. Discs
 * of a fit move by parts of a pixel, so the columns come from the cache where it has room. */
#include "touch/disc.h"

#include "base/vec.h"
#include "context/column_cache.h"
#include "frame/whitening.h"
#include "kernels/column.h"
#include "kernels/kernels.h"
#include "touch/constants.h"

/* The kept pixels that the disc covers, in list_index, how much of each, and the cover's derivative
 * by distance, times pixel_mm. */
typedef struct covered {
    uint32_t count;
    uint32_t *index;
    eits_matrix matrix; /* whose columns `index` lists: S, or the cached columns */
    eits_real *cover;
    eits_real *ramp;                /* minus the derivative */
    eits_real *toward_x, *toward_y; /* unit vector from centre to pixel; later the derivatives */
} covered;

/* Cells from first to last, clipped to 0 .. count - 1, whose centres may lie within `reach` of
 * `at`; all in pixels.
 *
 * Up to one cell further than needed on either side, as rounding of a bound must not lose a
 * cell: a cell without cover costs one distance. Beyond the grid the range is empty. Compared
 * before it is converted, since a real out of range of an integer is undefined in C. */
static void cell_range(eits_real at, eits_real reach, uint32_t count, uint32_t *first,
                       uint32_t *last)
{
    const eits_real low = at - reach - R(0.5), high = at + reach - R(0.5),
                    top = (eits_real)(count - 1);
    *first = low > 0 ? (low < top ? (uint32_t)low : count) : 0;
    *last = high < 0 ? 0 : (high < top ? (uint32_t)high + 1 : count - 1);
}

static eits_real column_factor(const eits_model *model, uint32_t j)
{
    return eits_column_scale(&model->sensitivity, j) / (eits_real)model->column_weight[j];
}

/* eits_disc_area walks likewise. One walk for both costs a board a fifteenth of the touch fit's
 * instructions: what the loops know of each other no longer stays in registers. */
static covered cover(eits_context *ctx, const eits_scratch *scratch, const eits_disc *disc)
{
    const eits_model *model = ctx->model;
    const eits_real pixel = (eits_real)model->pixel_mm;
    const eits_real x = (disc->x_mm - (eits_real)model->origin_x_mm) / pixel;
    const eits_real y = (disc->y_mm - (eits_real)model->origin_y_mm) / pixel;
    const eits_real radius = disc->radius_mm / pixel, reach = radius + R(0.5),
                    beyond = reach * reach * R(1.0001);
    covered c = {0,
                 scratch->index,
                 model->sensitivity,
                 scratch->value,
                 scratch->pixel[0],
                 scratch->pixel[1],
                 scratch->pixel[2]};
    uint32_t x0, x1, y0, y1;
    cell_range(x, reach, model->nx, &x0, &x1);
    cell_range(y, reach, model->ny, &y0, &y1);
    for (uint32_t iy = y0; iy <= y1 && iy < model->ny; ++iy) {
        for (uint32_t ix = x0; ix <= x1 && ix < model->nx; ++ix) {
            const eits_real dx = (eits_real)ix + R(0.5) - x, dy = (eits_real)iy + R(0.5) - y,
                            square = eits_fma(dx, dx, dy * dy);
            /* the corners of the square of cells: half of them, without a root */
            if (square > beyond)
                continue;
            const uint32_t j = ctx->cell[(size_t)iy * model->nx + ix];
            if (j == EITS_NO_PIXEL || model->column_weight[j] == 0.0f)
                continue;
            const eits_real distance = eits_sqrt(square);
            const eits_real fraction = R(0.5) + (radius - distance);
            if (!(fraction > 0))
                continue;
            /* At the very centre no direction is the way to it; the slope there is zero by
             * symmetry. */
            const eits_real from = distance > EITS_NO_DIRECTION ? 1 / distance : 0;
            c.index[c.count] = j;
            c.cover[c.count] = fraction < 1 ? fraction : 1;
            c.ramp[c.count] = fraction < 1 ? 1 : 0;
            c.toward_x[c.count] = dx * from;
            c.toward_y[c.count] = dy * from;
            ++c.count;
        }
    }
    return c;
}

/* Covers become what columns of S are multiplied by: over the column weight, times the column
 * scale.
 *
 * S is of coefficients, which are changes over the column weight; and stored columns are without
 * their scale. Cached columns spare a board the unpacking: the same discs move by parts of a
 * pixel, over and over the same columns. */
static void weigh(eits_context *ctx, covered *c)
{
    const eits_real pixel = (eits_real)ctx->model->pixel_mm;
    for (uint32_t k = 0; k < c->count; ++k) {
        const eits_real factor = column_factor(ctx->model, c->index[k]);
        c->cover[k] *= factor;
        c->ramp[k] *= factor / pixel;
    }
    if (eits_cache_columns(&ctx->columns, ctx->kernels, c->index, c->count)) {
        eits_cache_slots(&ctx->columns, c->index, c->count, c->index);
        c->matrix = eits_cached_columns(&ctx->columns);
    }
}

static uint64_t respond(eits_context *ctx, const covered *c, const eits_real *value, eits_real *out)
{
    ctx->kernels->mul(&c->matrix, c->index, value, c->count, out);
    return (uint64_t)c->count * ctx->model->rank + eits_forward(ctx, out);
}

/* Keep only the pixels under the rim, whose cover changes. */
static void keep_rim(covered *c)
{
    uint32_t kept = 0;
    for (uint32_t k = 0; k < c->count; ++k) {
        c->index[kept] = c->index[k];
        c->ramp[kept] = c->ramp[k];
        c->toward_x[kept] = c->toward_x[k];
        c->toward_y[kept] = c->toward_y[k];
        kept += c->ramp[k] != 0;
    }
    c->count = kept;
}

/* The cover changes where the rim of the disc lies within a pixel: there its derivative by the
 * distance of the centre is -1 a pixel, and by the radius 1; elsewhere 0. So the slopes need no
 * second look at the cells, and fewer columns. */
uint64_t eits_disc_shape(eits_context *ctx, const eits_scratch *scratch, const eits_disc *disc,
                         eits_real *atom, eits_real *const *slope, eits_real *const *edge)
{
    covered c = cover(ctx, scratch, disc);
    weigh(ctx, &c);
    uint64_t macs = atom != NULL ? respond(ctx, &c, c.cover, atom) : 0;
    if (slope == NULL && edge == NULL)
        return macs;
    keep_rim(&c);
    for (uint32_t part = 0; edge != NULL && part < 2; ++part) {
        for (uint32_t k = 0; k < c.count; ++k) {
            const eits_real x = c.toward_x[k], y = c.toward_y[k];
            c.cover[k] = c.ramp[k] * (part == 0 ? eits_fma(x, x, -(y * y)) : 2 * x * y);
        }
        macs += respond(ctx, &c, c.cover, edge[part]);
    }
    if (slope == NULL)
        return macs;
    for (uint32_t k = 0; k < c.count; ++k) {
        c.toward_x[k] *= c.ramp[k];
        c.toward_y[k] *= c.ramp[k];
    }
    macs += respond(ctx, &c, c.toward_x, slope[0]);
    macs += respond(ctx, &c, c.toward_y, slope[1]);
    macs += respond(ctx, &c, c.ramp, slope[2]);
    return macs;
}

uint64_t eits_disc_ellipse(eits_context *ctx, const eits_scratch *scratch, const eits_disc *disc,
                           const eits_real edge_mm[2], eits_real *atom)
{
    covered c = cover(ctx, scratch, disc);
    weigh(ctx, &c);
    for (uint32_t k = 0; k < c.count; ++k) {
        const eits_real x = c.toward_x[k], y = c.toward_y[k],
                        out = eits_fma(edge_mm[0], eits_fma(x, x, -(y * y)),
                                       edge_mm[1] * (2 * x * y));
        c.cover[k] = eits_fma(c.ramp[k], out, c.cover[k]);
    }
    return respond(ctx, &c, c.cover, atom);
}

uint64_t eits_disc_atom(eits_context *ctx, const eits_scratch *scratch, const eits_disc *disc,
                        eits_real *atom, eits_real *const *slope)
{
    return eits_disc_shape(ctx, scratch, disc, atom, slope, NULL);
}

eits_real eits_disc_area(const eits_context *ctx, const eits_disc *disc)
{
    const eits_model *model = ctx->model;
    const eits_real pixel = (eits_real)model->pixel_mm, radius = disc->radius_mm / pixel,
                    reach = radius + R(0.5);
    const eits_real x = (disc->x_mm - (eits_real)model->origin_x_mm) / pixel;
    const eits_real y = (disc->y_mm - (eits_real)model->origin_y_mm) / pixel;
    eits_real pixels = 0;
    uint32_t x0, x1, y0, y1;
    cell_range(x, reach, model->nx, &x0, &x1);
    cell_range(y, reach, model->ny, &y0, &y1);
    for (uint32_t iy = y0; iy <= y1 && iy < model->ny; ++iy) {
        for (uint32_t ix = x0; ix <= x1 && ix < model->nx; ++ix) {
            const uint32_t j = ctx->cell[(size_t)iy * model->nx + ix];
            if (j == EITS_NO_PIXEL || model->column_weight[j] == 0.0f)
                continue;
            const eits_real dx = (eits_real)ix + R(0.5) - x, dy = (eits_real)iy + R(0.5) - y;
            const eits_real fraction = reach - eits_sqrt(eits_fma(dx, dx, dy * dy));
            pixels += fraction > 0 ? (fraction < 1 ? fraction : 1) : 0;
        }
    }
    return pixels * pixel * pixel;
}

/* Nine cells around the centre suffice: a disc whose centre is further from the skin than that is
 * not a touch, however large it is. */
int eits_disc_on_skin(const eits_context *ctx, const eits_disc *disc)
{
    const eits_model *model = ctx->model;
    const eits_real x = (disc->x_mm - (eits_real)model->origin_x_mm) / (eits_real)model->pixel_mm;
    const eits_real y = (disc->y_mm - (eits_real)model->origin_y_mm) / (eits_real)model->pixel_mm;
    if (!(x >= -1 && y >= -1 && x < (eits_real)model->nx + 1 && y < (eits_real)model->ny + 1))
        return 0;
    const uint32_t x1 = (uint32_t)(x + 1), y1 = (uint32_t)(y + 1); /* its cell, counted from 1 */
    for (uint32_t iy = y1 > 2 ? y1 - 2 : 0; iy <= y1 && iy < model->ny; ++iy) {
        for (uint32_t ix = x1 > 2 ? x1 - 2 : 0; ix <= x1 && ix < model->nx; ++ix) {
            if (ctx->cell[(size_t)iy * model->nx + ix] != EITS_NO_PIXEL)
                return 1;
        }
    }
    return 0;
}

/* The range of one cell along an axis, and where in it `at` is nearest; all in pixels. */
static eits_real nearest(eits_real at, uint32_t cell)
{
    const eits_real low = (eits_real)cell;
    return at < low ? low : (at > low + 1 ? low + 1 : at);
}

void eits_bring_onto_skin(const eits_context *ctx, eits_real *x_mm, eits_real *y_mm)
{
    const eits_model *model = ctx->model;
    const eits_real pixel = (eits_real)model->pixel_mm;
    const eits_real x = (*x_mm - (eits_real)model->origin_x_mm) / pixel,
                    y = (*y_mm - (eits_real)model->origin_y_mm) / pixel;
    eits_real best = -1, best_x = x, best_y = y;
    uint32_t x0, x1, y0, y1;
    cell_range(x, R(1.5), model->nx, &x0, &x1);
    cell_range(y, R(1.5), model->ny, &y0, &y1);
    for (uint32_t iy = y0; iy <= y1 && iy < model->ny; ++iy) {
        for (uint32_t ix = x0; ix <= x1 && ix < model->nx; ++ix) {
            if (ctx->cell[(size_t)iy * model->nx + ix] == EITS_NO_PIXEL)
                continue;
            const eits_real there_x = nearest(x, ix), there_y = nearest(y, iy), dx = there_x - x,
                            dy = there_y - y, apart = eits_fma(dx, dx, dy * dy);
            if (best >= 0 && apart >= best)
                continue;
            best = apart;
            best_x = there_x;
            best_y = there_y;
        }
    }
    if (best > 0) { /* a place on the skin keeps its bits */
        *x_mm = eits_fma(best_x, pixel, (eits_real)model->origin_x_mm);
        *y_mm = eits_fma(best_y, pixel, (eits_real)model->origin_y_mm);
    }
}
