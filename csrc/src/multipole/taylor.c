/* Represent the electrodes' fields about a place by analytic polynomials.
 *
 * Section FLDS stores E_x and E_y of each electrode's current on every pixel. In an even sheet F =
 * E_x - i E_y is analytic, so a polynomial in z of degree 5 fitted to the pixels within 2.6 of the
 * home pixel (21 inside the skin, fewer at its rim) gives the field between pixels and its
 * derivatives. Weights fall with the distance, 1 - (d / 2.6)^2. The least squares use polynomials
 * that are orthogonal on these pixels (modified Gram-Schmidt, twice for accuracy in float32): the
 * monomials' normal equations would lose half of the digits at the rim, where only half a circle of
 * pixels is left. */
#include "multipole/multipole.h"

#include "base/vec.h"
#include "kernels/column.h"
#include "multipole/complex.h"
#include "multipole/constants.h"

enum {
    DEGREE = EITS_POLE_TERMS - 1, /* of F; the potential has one more */
    AROUND = 2,                   /* pixels to either side */
    MAX_POINTS = (2 * AROUND + 1) * (2 * AROUND + 1)
};

/* sum conj(a_i) b_i */
static eits_complex inner(const eits_complex *a, const eits_complex *b, uint32_t count)
{
    eits_complex sum = {0, 0};
    for (uint32_t i = 0; i < count; ++i) {
        sum.re = eits_fma(a[i].re, b[i].re, eits_fma(a[i].im, b[i].im, sum.re));
        sum.im = eits_fma(a[i].re, b[i].im, eits_fma(-a[i].im, b[i].re, sum.im));
    }
    return sum;
}

/* b -= s a */
static void subtract(eits_complex *b, eits_complex s, const eits_complex *a, uint32_t count)
{
    for (uint32_t i = 0; i < count; ++i) {
        const eits_complex part = eits_times(s, a[i]);
        b[i].re -= part.re;
        b[i].im -= part.im;
    }
}

typedef struct points {
    uint32_t count;
    uint32_t pixel[MAX_POINTS];
    eits_real weight[MAX_POINTS];
    eits_complex z[MAX_POINTS]; /* from the home pixel's middle, over EITS_POLE_UNIT */
} points;

static uint32_t cell_at(eits_real at, uint32_t count)
{
    const eits_real last = (eits_real)(count - 1u);
    return at > 0 ? (at < last ? (uint32_t)at : count - 1u) : 0;
}

/* Return the kept pixel nearest to a place. If the place's own cell is off the skin, the pixels
 * around it are examined. */
static uint32_t home_pixel(const eits_context *ctx, const eits_shape *shape)
{
    const eits_model *model = ctx->model;
    const uint32_t cx = cell_at(shape->x, model->nx), cy = cell_at(shape->y, model->ny);
    uint32_t best = ctx->cell[(size_t)cy * model->nx + cx];
    if (best != EITS_NO_PIXEL)
        return best;
    eits_real nearest = 0;
    for (uint32_t reach = 1; best == EITS_NO_PIXEL && reach < model->nx + model->ny; ++reach) {
        for (uint32_t iy = cy > reach ? cy - reach : 0; iy <= cy + reach && iy < model->ny; ++iy) {
            for (uint32_t ix = cx > reach ? cx - reach : 0; ix <= cx + reach && ix < model->nx;
                 ++ix) {
                const uint32_t j = ctx->cell[(size_t)iy * model->nx + ix];
                const eits_real dx = (eits_real)ix + R(0.5) - shape->x,
                                dy = (eits_real)iy + R(0.5) - shape->y,
                                apart = eits_fma(dx, dx, dy * dy);
                if (j == EITS_NO_PIXEL || (best != EITS_NO_PIXEL && apart >= nearest))
                    continue;
                best = j;
                nearest = apart;
            }
        }
    }
    return best;
}

/* Return 1 if a place of the square around the home pixel is near enough; `z` gets its position,
 * and `share` its squared distance over that of EITS_POLE_REACH. */
static int is_near(uint32_t place, eits_complex *z, eits_real *share)
{
    const uint32_t side = 2u * AROUND + 1u;
    *z = (eits_complex){(eits_real)(place % side) - AROUND, (eits_real)(place / side) - AROUND};
    *share = eits_fma(z->re, z->re, z->im * z->im) / (EITS_POLE_REACH * EITS_POLE_REACH);
    return *share < 1;
}

static void add_point(points *p, uint32_t pixel, eits_complex z, eits_real share)
{
    p->pixel[p->count] = pixel;
    p->weight[p->count] = 1 - share;
    p->z[p->count] = (eits_complex){z.re / EITS_POLE_UNIT, z.im / EITS_POLE_UNIT};
    ++p->count;
}

static points points_around(const eits_context *ctx, uint32_t home)
{
    const eits_model *model = ctx->model;
    const eits_pixel at = model->pixel[home];
    points p;
    p.count = 0;
    for (uint32_t place = 0; place < MAX_POINTS; ++place) {
        const uint32_t side = 2u * AROUND + 1u, ix = at.ix + place % side - AROUND,
                       iy = at.iy + place / side - AROUND; /* 0 - 1: none */
        eits_complex z;
        eits_real share;
        if (!is_near(place, &z, &share) || ix >= model->nx || iy >= model->ny)
            continue;
        const uint32_t j = ctx->cell[(size_t)iy * model->nx + ix];
        if (j != EITS_NO_PIXEL)
            add_point(&p, j, z, share);
    }
    return p;
}

/* Return the points of a home pixel with all of its neighbours; they are the same for each such
 * pixel. */
static points all_points(void)
{
    points p;
    p.count = 0;
    for (uint32_t place = 0; place < MAX_POINTS; ++place) {
        eits_complex z;
        eits_real share;
        if (is_near(place, &z, &share))
            add_point(&p, 0, z, share);
    }
    return p;
}

/* W V = Q T, Q's columns orthonormal; then the coefficients of F are T^-1 Q* W F. */
typedef struct basis {
    uint32_t terms;
    eits_complex q[EITS_POLE_TERMS][MAX_POINTS];
    eits_complex t[EITS_POLE_TERMS][EITS_POLE_TERMS];
} basis;

static void make_basis(const points *p, basis *b)
{
    eits_complex power[MAX_POINTS];
    for (uint32_t i = 0; i < p->count; ++i)
        power[i] = (eits_complex){p->weight[i], 0};
    b->terms = 0;
    for (uint32_t n = 0; n <= DEGREE && n < p->count; ++n) {
        eits_complex *q = b->q[n];
        for (uint32_t i = 0; i < p->count; ++i)
            q[i] = power[i];
        const eits_real whole = inner(q, q, p->count).re;
        for (uint32_t m = 0; m <= DEGREE; ++m)
            b->t[m][n] = (eits_complex){0, 0};
        for (int pass = 0; pass < 2; ++pass) {
            for (uint32_t m = 0; m < n; ++m) {
                const eits_complex s = inner(b->q[m], q, p->count);
                subtract(q, s, b->q[m], p->count);
                b->t[m][n].re += s.re;
                b->t[m][n].im += s.im;
            }
        }
        const eits_real left = inner(q, q, p->count).re;
        if (!(left > EITS_POLE_DEPENDENT * whole))
            break;
        const eits_real norm = eits_sqrt(left);
        for (uint32_t i = 0; i < p->count; ++i)
            q[i] = (eits_complex){q[i].re / norm, q[i].im / norm};
        b->t[n][n] = (eits_complex){norm, 0};
        b->terms = n + 1;
        for (uint32_t i = 0; i < p->count; ++i)
            power[i] = eits_times(power[i], p->z[i]);
    }
}

/* Compute the weight of each point's F in each coefficient: T^-1 Q* W, in powers of z instead of z
 * / EITS_POLE_UNIT. Coefficients that the points do not determine are 0. */
static void weigh_points(const points *p, const basis *b, eits_complex *weight)
{
    for (uint32_t i = 0; i < p->count; ++i) {
        eits_complex *w = weight + (size_t)EITS_POLE_TERMS * i;
        for (uint32_t n = b->terms; n < EITS_POLE_TERMS; ++n)
            w[n] = (eits_complex){0, 0};
        for (uint32_t n = b->terms; n-- > 0;) {
            eits_complex sum = eits_scaled(p->weight[i], eits_conjugate(b->q[n][i]));
            for (uint32_t m = n + 1; m < b->terms; ++m)
                sum = eits_plus_times(sum, eits_scaled(-1, b->t[n][m]), w[m]);
            w[n] = (eits_complex){sum.re / b->t[n][n].re, sum.im / b->t[n][n].re};
        }
        eits_real unit = 1;
        for (uint32_t n = 0; n < b->terms; ++n) {
            w[n] = eits_scaled(unit, w[n]);
            unit /= EITS_POLE_UNIT;
        }
    }
}

/* Read a stored column: E_x, E_y, then the mirror. */
static void read_fields(const eits_context *ctx, uint32_t pixel, eits_real *at)
{
#ifndef EITS_DOUBLE
    const eits_matrix *fields = &ctx->model->fields.at;
    ctx->kernels->unpack(fields, (size_t)fields->stride * pixel, fields->stride, at);
#else
    eits_read_column(&ctx->model->fields.at, pixel, at);
#endif
}

/* Compute the coefficients of F = E_x - i E_y of all electrodes, and the mirror at the home pixel.
 */
static void fit_fields(eits_context *ctx, const points *p, const eits_complex *weight,
                       uint32_t home, eits_real *terms, eits_real *mirror)
{
    const uint32_t electrodes = ctx->model->n_electrodes;
    const size_t width = 2u * (size_t)electrodes;
    eits_real *at = ctx->multipole.work;
    eits_zero(terms, EITS_POLE_FIELD(electrodes));
    for (uint32_t i = 0; i < p->count; ++i) {
        const eits_complex *w = weight + (size_t)EITS_POLE_TERMS * i;
        read_fields(ctx, p->pixel[i], at);
        if (p->pixel[i] == home)
            eits_copy(mirror, at + width, 4);
        for (uint32_t e = 0; e < electrodes; ++e) {
            const eits_real x = at[e], y = at[electrodes + e];
            eits_real *re = terms + e, *im = re + electrodes;
            for (uint32_t n = 0; n < EITS_POLE_TERMS; ++n) {
                re[width * n] = eits_fma(w[n].re, x, eits_fma(w[n].im, y, re[width * n]));
                im[width * n] = eits_fma(w[n].im, x, eits_fma(-w[n].re, y, im[width * n]));
            }
        }
    }
}

void eits_pole_init(eits_context *ctx)
{
    const points all = all_points();
    basis b;
    make_basis(&all, &b);
    weigh_points(&all, &b, (eits_complex *)ctx->multipole.inside);
    eits_pole_forget(ctx);
}

/* Return 1 if the polynomial in slot k can still be used for a middle that has left its home pixel,
 * but is not far from it. */
static int may_stay(const eits_context *ctx, uint32_t k, const eits_shape *shape)
{
    if (ctx->multipole.home_pixel[k] == EITS_NO_HOME)
        return 0;
    const eits_pixel at = ctx->model->pixel[ctx->multipole.home_pixel[k]];
    return eits_fabs(shape->x - (eits_real)at.ix - R(0.5)) < EITS_POLE_STAYS &&
           eits_fabs(shape->y - (eits_real)at.iy - R(0.5)) < EITS_POLE_STAYS;
}

uint64_t eits_pole_home(eits_context *ctx, uint32_t k, const eits_shape *shape)
{
    const uint32_t electrodes = ctx->model->n_electrodes, home = home_pixel(ctx, shape);
    eits_real *terms = ctx->multipole.home + EITS_POLE_FIELD(electrodes) * k,
              *own = ctx->multipole.own + EITS_POLE_FIELD(electrodes) * k;
    uint64_t macs = 0;
    if (ctx->multipole.home_pixel[k] != home && !may_stay(ctx, k, shape)) {
        const points p = points_around(ctx, home);
        macs = (uint64_t)electrodes * 4u * EITS_POLE_TERMS * p.count;
        if (p.count == EITS_POLE_POINTS) {
            fit_fields(ctx, &p, (const eits_complex *)ctx->multipole.inside, home, terms,
                       ctx->multipole.mirror[k]);
        } else {
            basis b;
            eits_complex weight[MAX_POINTS * EITS_POLE_TERMS];
            make_basis(&p, &b);
            weigh_points(&p, &b, weight);
            fit_fields(ctx, &p, weight, home, terms, ctx->multipole.mirror[k]);
            macs += (uint64_t)10u * p.count * b.terms * b.terms;
        }
        ctx->multipole.home_pixel[k] = home;
    }
    eits_pole_field(ctx, k, shape, own);
    return macs;
}

void eits_pole_forget(eits_context *ctx)
{
    for (uint32_t k = 0; k < EITS_MAX_TOUCHES; ++k)
        ctx->multipole.home_pixel[k] = EITS_NO_HOME;
}

int eits_pole_on_skin(const eits_context *ctx, eits_real x, eits_real y)
{
    const eits_model *model = ctx->model;
    if (!(x >= 0 && y >= 0 && x < (eits_real)model->nx && y < (eits_real)model->ny))
        return 0;
    return ctx->cell[(size_t)(uint32_t)y * model->nx + (uint32_t)x] != EITS_NO_PIXEL;
}

/* Compute a_n+1 of all electrodes from the terms n, n + 1, ... of F. n is a constant in each call,
 * so that the factors stay in registers. */
static inline void shift_term(const eits_real *terms, const eits_complex *power, uint32_t n,
                              uint32_t electrodes, eits_real *out)
{
    static const eits_real binomial[EITS_POLE_TERMS][EITS_POLE_TERMS] = {
        {1}, {1, 1}, {1, 2, 1}, {1, 3, 3, 1}, {1, 4, 6, 4, 1}, {1, 5, 10, 10, 5, 1}};
    const size_t width = 2u * (size_t)electrodes;
    const eits_real share = 1 / (eits_real)(n + 1u); /* u is F's integral */
    eits_complex s[EITS_POLE_TERMS];
    for (uint32_t m = n; m < EITS_POLE_TERMS; ++m)
        s[m] = eits_scaled(share * binomial[m][n], power[m - n]);
    for (uint32_t e = 0; e < electrodes; ++e) {
        const eits_real *re = terms + e, *im = re + electrodes;
        eits_complex sum = {0, 0};
        for (uint32_t m = EITS_POLE_TERMS; m-- > n;) /* the small ones first */
            sum = eits_plus_times(sum, s[m], (eits_complex){re[width * m], im[width * m]});
        out[width * n + e] = sum.re;
        out[width * n + electrodes + e] = sum.im;
    }
}

void eits_pole_field(const eits_context *ctx, uint32_t k, const eits_shape *shape, eits_real *out)
{
    const eits_pixel at = ctx->model->pixel[ctx->multipole.home_pixel[k]];
    const eits_complex d = {shape->x - (eits_real)at.ix - R(0.5),
                            shape->y - (eits_real)at.iy - R(0.5)};
    const uint32_t electrodes = ctx->model->n_electrodes;
    const eits_real *terms = ctx->multipole.home + EITS_POLE_FIELD(electrodes) * k;
    eits_complex power[EITS_POLE_TERMS] = {{1, 0}};
    for (uint32_t n = 1; n < EITS_POLE_TERMS; ++n)
        power[n] = eits_times(power[n - 1u], d);
    shift_term(terms, power, 0, electrodes, out);
    shift_term(terms, power, 1, electrodes, out);
    shift_term(terms, power, 2, electrodes, out);
    shift_term(terms, power, 3, electrodes, out);
    shift_term(terms, power, 4, electrodes, out);
    shift_term(terms, power, 5, electrodes, out);
}
