/* Compute the answers of shapes on the folded rows.
 *
 * A row's answer is the product of the drive's field with the induced field, and the measuring
 * pair's field without it. By reciprocity the reverse is the same once the rounds have converged.
 *
 * The answer is bilinear in the Taylor coefficients of both sides. For each drive, the factors of a
 * measuring pair's coefficients are computed once, for the answer and for its slopes. A row then
 * needs one sum of products for the answer and one for each slope. */
#include "base/vec.h"
#include "multipole/constants.h"
#include "multipole/form.h"

static const eits_real PI = R(3.14159265358979323846);

enum { ORDERS = EITS_POLE_ORDERS, OF_DISC = EITS_POLE_DISC_ORDERS, TERMS = EITS_POLE_TERMS };
enum { SLOPES_OF_DISC = 4, SLOPES = 6 };

/* The weights of the orders in a row's voltage: c for products of real parts, s for products of
 * imaginary parts. */
typedef struct order_weights {
    eits_real c[ORDERS], s[ORDERS];
} order_weights;

static order_weights weights_of(const eits_context *ctx, const eits_form *f)
{
    const eits_fields *at = &ctx->model->fields;
    const eits_real pixel = (eits_real)ctx->model->pixel_mm;
    const eits_real volts = (eits_real)at->volts * eits_pole_sheet(ctx->model) * pixel * pixel;
    order_weights w;
    for (uint32_t n = 0; n < f->orders; ++n) {
        const eits_real whole = -(volts * f->excess * (eits_real)(n + 1u) * (PI / 4) * f->gap[n]);
        w.c[n] = whole * f->tc[n];
        w.s[n] = whole * f->ts[n];
    }
    return w;
}

/* Return the weights times the relative change of each order's weight with the amplitude. */
static order_weights by_amplitude(const order_weights *w, const eits_form *f, eits_real amplitude)
{
    const eits_real of_contrast = 4 / ((2 - amplitude) * (2 - amplitude)),
                    part = eits_fabs(f->excess) > R(1e-6) ? of_contrast / f->excess : 0;
    order_weights by;
    for (uint32_t n = 0; n < f->orders; ++n) {
        /* of (k - 1) t with t = 2 / (u + k w) and u + w = 2, the logarithm's slope by k is
         * t / (k - 1) */
        by.c[n] = w->c[n] * part * f->tc[n];
        by.s[n] = w->s[n] * part * f->ts[n];
    }
    return by;
}

/* The shape with e1 (part 0) or e2 (part 1) a little larger. */
static eits_shape varied(const eits_shape *shape, int part)
{
    eits_shape out = *shape;
    if (part == 0)
        out.e1 += EITS_POLE_STEP;
    else
        out.e2 += EITS_POLE_STEP;
    return out;
}

/* A shape in the form that the rows need. In the functions below `more` is the shape with a
 * slightly larger e1 or e2. */
typedef struct answering {
    eits_form form;
    order_weights weight;
} answering;

static answering answering_of(const eits_context *ctx, const eits_shape *shape, uint32_t orders)
{
    answering a = {.form = eits_form_of(shape, orders)};
    a.weight = weights_of(ctx, &a.form);
    return a;
}

/* beta_n = sum over k of T_nk a_k, written out: a compiler does not unroll such loops. */
static inline void to_modes(const eits_form *f, const eits_complex *a, eits_complex *beta)
{
    const eits_complex(*t)[ORDERS] = f->to_mode;
    beta[0] =
        eits_plus_times(eits_plus_times(eits_times(t[0][0], a[0]), t[0][2], a[2]), t[0][4], a[4]);
    beta[1] = eits_plus_times(eits_times(t[1][1], a[1]), t[1][3], a[3]);
    beta[2] = eits_plus_times(eits_times(t[2][2], a[2]), t[2][4], a[4]);
    beta[3] = eits_times(t[3][3], a[3]);
    beta[4] = eits_times(t[4][4], a[4]);
}

/* c_k = sum over n of T_nk g_n with g = w_c Re beta - i w_s Im beta: then the real part of
 * sum c_k m_k is the answer to a measuring pair's m_k. */
static inline void answer_of(const eits_form *f, const order_weights *w, const eits_complex *beta,
                             eits_complex *c)
{
    const eits_complex(*t)[ORDERS] = f->to_mode;
    eits_complex g[ORDERS];
    for (uint32_t n = 0; n < ORDERS; ++n)
        g[n] = (eits_complex){w->c[n] * beta[n].re, -(w->s[n] * beta[n].im)};
    c[0] = eits_times(t[0][0], g[0]);
    c[1] = eits_times(t[1][1], g[1]);
    c[2] = eits_plus_times(eits_times(t[2][2], g[2]), t[0][2], g[0]);
    c[3] = eits_plus_times(eits_times(t[3][3], g[3]), t[1][3], g[1]);
    c[4] =
        eits_plus_times(eits_plus_times(eits_times(t[4][4], g[4]), t[0][4], g[0]), t[2][4], g[2]);
}

/* The factors by which a drive multiplies a measuring pair's numbers (real part and imaginary part
 * of each term): for the answer, then for the slopes in the order of eits_pole_out. */
typedef struct drive {
    eits_real by[1 + SLOPES][2 * TERMS];
} drive;

static inline void put(eits_real *by, const eits_complex *c, uint32_t terms)
{
    for (uint32_t k = 0; k < terms; ++k) {
        by[2u * k] = c[k].re;
        by[2u * k + 1u] = -c[k].im;
    }
}

/* Compute the difference of two electrodes' coefficients, including the induced field. */
static void whole_field(const eits_real *own, const eits_real *induced, uint32_t electrodes,
                        const uint8_t *row, eits_complex *a)
{
    const uint32_t plus = row[0], minus = row[1];
    for (uint32_t k = 0; k < TERMS; ++k) {
        const eits_real *re = own + 2u * (size_t)electrodes * k, *im = re + electrodes,
                        *more = induced + 2u * (size_t)electrodes * k, *more_im = more + electrodes;
        a[k].re = (re[plus] + more[plus]) - (re[minus] + more[minus]);
        a[k].im = (im[plus] + more_im[plus]) - (im[minus] + more_im[minus]);
    }
}

/* Put the slopes by place, from the answers c and x to the fields a_k and (k + 1) a_k+1: a shift of
 * the middle by dx changes a_k by (k + 1) a_k+1 dx on both sides, and one by dy by i times that. */
static inline void put_moves(drive *d, uint32_t orders, const eits_complex *c, eits_complex *x,
                             eits_complex *y)
{
    x[orders] = y[orders] = (eits_complex){0, 0};
    for (uint32_t k = 1; k <= orders; ++k) {
        const eits_complex more = eits_scaled((eits_real)(k + 1u), c[k - 1u]);
        x[k].re += more.re;
        x[k].im += more.im;
        y[k].re -= more.im;
        y[k].im += more.re;
    }
    put(d->by[1], x, orders + 1u);
    put(d->by[2], y, orders + 1u);
}

/* A disc's orders do not couple, and its amplitude scales all of them alike. */
static void disc_drive(const answering *s, eits_real by_amplitude_share, int slopes,
                       const eits_complex *a, drive *d)
{
    eits_complex c[OF_DISC], x[OF_DISC + 1], y[OF_DISC + 1], other[OF_DISC];
    for (uint32_t k = 0; k < OF_DISC; ++k) {
        const eits_real w = s->weight.c[k] * (s->form.to_mode[k][k].re * s->form.to_mode[k][k].re);
        c[k] = (eits_complex){w * a[k].re, -(w * a[k].im)};
        x[k] = (eits_complex){(eits_real)(k + 2u) * w * a[k + 1u].re,
                              -((eits_real)(k + 2u) * w * a[k + 1u].im)};
        y[k] = (eits_complex){x[k].im, -x[k].re}; /* of i times that field */
    }
    put(d->by[0], c, OF_DISC);
    if (!slopes)
        return;
    put_moves(d, OF_DISC, c, x, y);
    for (uint32_t k = 0; k < OF_DISC; ++k)
        other[k] = eits_scaled((eits_real)(2u * (k + 1u)), c[k]);
    put(d->by[3], other, OF_DISC);
    for (uint32_t k = 0; k < OF_DISC; ++k)
        other[k] = eits_scaled(by_amplitude_share, c[k]);
    put(d->by[4], other, OF_DISC);
}

/* Compute the factors of an ellipse for the answer and the slopes by place, log radius and
 * amplitude. A larger radius scales a_k r^k.
 */
static void ellipse_drive(const answering *s, const order_weights *by_q, int slopes,
                          const eits_complex *a, eits_complex *c, drive *d)
{
    eits_complex field[ORDERS], beta[ORDERS], mode[ORDERS], x[TERMS], y[TERMS];
    to_modes(&s->form, a, beta);
    answer_of(&s->form, &s->weight, beta, c);
    put(d->by[0], c, ORDERS);
    if (!slopes)
        return;
    for (uint32_t k = 0; k < ORDERS; ++k)
        field[k] = eits_scaled((eits_real)(k + 2u), a[k + 1u]);
    to_modes(&s->form, field, mode);
    answer_of(&s->form, &s->weight, mode, x);
    for (uint32_t k = 0; k < ORDERS; ++k)
        mode[k] = (eits_complex){-mode[k].im, mode[k].re};
    answer_of(&s->form, &s->weight, mode, y);
    put_moves(d, ORDERS, c, x, y);
    for (uint32_t k = 0; k < ORDERS; ++k)
        field[k] = eits_scaled((eits_real)(k + 1u), a[k]);
    to_modes(&s->form, field, mode);
    answer_of(&s->form, &s->weight, mode, x);
    for (uint32_t k = 0; k < ORDERS; ++k) {
        x[k].re = eits_fma((eits_real)(k + 1u), c[k].re, x[k].re);
        x[k].im = eits_fma((eits_real)(k + 1u), c[k].im, x[k].im);
    }
    put(d->by[3], x, ORDERS);
    answer_of(&s->form, by_q, beta, x);
    put(d->by[4], x, ORDERS);
}

/* Compute the slope by e1 or e2, as a finite difference. */
static inline void slope_by_shape(const answering *more, const eits_complex *a,
                                  const eits_complex *c, eits_real *by)
{
    const eits_real per = 1 / EITS_POLE_STEP;
    eits_complex beta[ORDERS], varied_c[ORDERS];
    to_modes(&more->form, a, beta);
    answer_of(&more->form, &more->weight, beta, varied_c);
    for (uint32_t k = 0; k < ORDERS; ++k) {
        by[2u * k] = (varied_c[k].re - c[k].re) * per;
        by[2u * k + 1u] = (c[k].im - varied_c[k].im) * per;
    }
}

static const uint8_t *fold_row(const eits_context *ctx, uint32_t fold)
{
    return eits_row(ctx, ctx->model->fold[fold].first);
}

/* Return 1 if a row's drive is not that of the row before. */
static int new_drive(const uint8_t *row, const uint8_t *before)
{
    return before == NULL || row[0] != before[0] || row[1] != before[1];
}

/* Add the next number of a measuring pair to the answer and the slopes. */
#define NEXT_NUMBER(J)                                        \
    do {                                                      \
        const eits_real number = *plus - *minus;              \
        plus += electrodes;                                   \
        minus += electrodes;                                  \
        value = eits_fma(d->by[0][J], number, value);         \
        x = eits_fma(d->by[1][J], number, x);                 \
        y = eits_fma(d->by[2][J], number, y);                 \
        radius = eits_fma(d->by[3][J], number, radius);       \
        amplitude = eits_fma(d->by[4][J], number, amplitude); \
        if (shaped) {                                         \
            e1 = eits_fma(d->by[5][J], number, e1);           \
            e2 = eits_fma(d->by[6][J], number, e2);           \
        }                                                     \
    } while (0)

/* Add the last order, which only the slopes by place have. */
#define LAST_NUMBER(J)                           \
    do {                                         \
        const eits_real number = *plus - *minus; \
        plus += electrodes;                      \
        minus += electrodes;                     \
        x = eits_fma(d->by[1][J], number, x);    \
        y = eits_fma(d->by[2][J], number, y);    \
    } while (0)

/* Compute the answer to a measuring pair and its slopes, for discs (three orders) or ellipses
 * (five). The code is written out, so that the sums stay in registers. */
static inline void fill_row(const drive *d, const eits_real *own, uint32_t electrodes,
                            const uint8_t *row, int shaped, uint32_t i, const eits_pole_out *out)
{
    const eits_real *plus = own + row[2], *minus = own + row[3];
    eits_real value = 0, x = 0, y = 0, radius = 0, amplitude = 0, e1 = 0, e2 = 0;
    NEXT_NUMBER(0);
    NEXT_NUMBER(1);
    NEXT_NUMBER(2);
    NEXT_NUMBER(3);
    NEXT_NUMBER(4);
    NEXT_NUMBER(5);
    if (shaped) {
        NEXT_NUMBER(6);
        NEXT_NUMBER(7);
        NEXT_NUMBER(8);
        NEXT_NUMBER(9);
        LAST_NUMBER(10);
        LAST_NUMBER(11);
        out->slope[4][i] = e1;
        out->slope[5][i] = e2;
    } else {
        LAST_NUMBER(6);
        LAST_NUMBER(7);
    }
    out->value[i] = value;
    out->slope[0][i] = x;
    out->slope[1][i] = y;
    out->slope[2][i] = radius;
    out->slope[3][i] = amplitude;
}

/* Return the answer alone. `numbers` is a constant in each call. */
static inline eits_real value_of(const eits_real *by, const eits_real *own, uint32_t electrodes,
                                 const uint8_t *row, uint32_t numbers)
{
    const eits_real *plus = own + row[2], *minus = own + row[3];
    eits_real value = 0;
    for (uint32_t j = 0; j < numbers; ++j, plus += electrodes, minus += electrodes)
        value = eits_fma(by[j], *plus - *minus, value);
    return value;
}

/* Compute the numbers of a drive that its rows share. */
static void make_drive(const answering s[3], const order_weights *by_q, uint32_t slopes,
                       const eits_complex *a, drive *d)
{
    eits_complex c[ORDERS];
    if (s[0].form.orders == OF_DISC) {
        disc_drive(&s[0], s[0].weight.c[0] != 0 ? by_q->c[0] / s[0].weight.c[0] : 0, slopes > 0, a,
                   d);
        return;
    }
    ellipse_drive(&s[0], by_q, slopes > 0, a, c, d);
    for (uint32_t part = 0; part < 2u && slopes > 0; ++part)
        slope_by_shape(&s[1u + part], a, c, d->by[5u + part]);
}

uint64_t eits_pole_rows(eits_context *ctx, uint32_t k, const eits_shape *shape,
                        const eits_poles *poles, uint32_t first, uint32_t count,
                        const eits_pole_out *out)
{
    const uint32_t electrodes = ctx->model->n_electrodes, orders = poles->orders,
                   all = orders == OF_DISC ? SLOPES_OF_DISC : SLOPES,
                   slopes = out->slope[0] == NULL ? 0u : all;
    const eits_real *own = ctx->multipole.own + EITS_POLE_FIELD(electrodes) * k,
                    *induced = ctx->multipole.induced + EITS_POLE_FIELD(electrodes) * k;
    answering s[3]; /* the shape, and those with a larger e1 and e2 */
    s[0] = answering_of(ctx, shape, orders);
    const order_weights by_q = by_amplitude(&s[0].weight, &s[0].form, shape->amplitude);
    for (int part = 0; part < 2 && slopes == SLOPES; ++part) {
        const eits_shape larger = varied(shape, part);
        s[1 + part] = answering_of(ctx, &larger, orders);
    }
    const uint8_t *before = NULL;
    uint32_t drives = 0;
    drive d;
    for (uint32_t i = 0; i < count; ++i) {
        const uint8_t *row = fold_row(ctx, first + i);
        if (new_drive(row, before)) {
            eits_complex a[TERMS];
            whole_field(own, induced, electrodes, row, a);
            make_drive(s, &by_q, slopes, a, &d);
            ++drives;
        }
        before = row;
        if (slopes == SLOPES)
            fill_row(&d, own, electrodes, row, 1, i, out);
        else if (slopes == SLOPES_OF_DISC)
            fill_row(&d, own, electrodes, row, 0, i, out);
        else if (orders == ORDERS)
            out->value[i] = value_of(d.by[0], own, electrodes, row, 2 * ORDERS);
        else
            out->value[i] = value_of(d.by[0], own, electrodes, row, 2 * OF_DISC);
    }
    const uint32_t products = shape->e1 == 0 && shape->e2 == 0 ? 4u * orders : 8u * orders;
    return (uint64_t)count * (1u + slopes) * 2u * orders +
           (uint64_t)drives * (slopes + 1u) * products;
}
