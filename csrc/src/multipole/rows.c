/* Compute what shapes answer on the folded rows.
 *
 * A row's answer is the drive's field with what is induced, times the measuring pair's without it.
 * By reciprocity the reverse is the same once the rounds have converged. */
#include "base/vec.h"
#include "multipole/constants.h"
#include "multipole/form.h"

static const eits_real PI = R(3.14159265358979323846);

/* One side of a row: by order, the difference of two electrodes' modes, real part and imaginary
 * part. The drive's lies in the whole field, times the order's weights, and is made once for all
 * rows of a drive; the measuring pair's lies in its own. */
typedef struct side {
    eits_real re[EITS_POLE_ORDERS], im[EITS_POLE_ORDERS];
} side;

/* What orders weigh in a row's voltage: c for products of real parts, s of imaginary ones. */
typedef struct order_weights {
    eits_real c[EITS_POLE_ORDERS], s[EITS_POLE_ORDERS];
} order_weights;

static order_weights weights_of(const eits_context *ctx, const eits_form *f)
{
    const eits_fields *at = &ctx->model->fields;
    const eits_real pixel = (eits_real)ctx->model->pixel_mm;
    const eits_real volts = (eits_real)at->volts * eits_pole_sheet(ctx->model) * pixel * pixel;
    order_weights w = {{0}, {0}};
    for (uint32_t n = 0; n < f->orders; ++n) {
        const eits_real whole = -(volts * f->excess * (eits_real)(n + 1u) * (PI / 4) * f->gap[n]);
        w.c[n] = whole * f->tc[n];
        w.s[n] = whole * f->ts[n];
    }
    return w;
}

static side difference(const eits_real *mode, uint32_t plus, uint32_t minus, uint32_t orders,
                       uint32_t electrodes)
{
    side out = {{0}, {0}};
    for (uint32_t n = 0; n < orders; ++n) {
        const eits_real *re = mode + 2u * (size_t)electrodes * n, *im = re + electrodes;
        out.re[n] = re[plus] - re[minus];
        out.im[n] = im[plus] - im[minus];
    }
    return out;
}

/* The drive's side, and its slopes by x and y: along y, a slope is i times that along x. */
typedef struct drive_side {
    side whole, by_x, by_y;
} drive_side;

static drive_side drive_of(const eits_real *whole, const eits_real *by, const order_weights *w,
                           const uint8_t *row, uint32_t orders, uint32_t electrodes)
{
    drive_side d = {.whole = difference(whole, row[0], row[1], orders, electrodes),
                    .by_x = difference(by, row[0], row[1], orders, electrodes)};
    for (uint32_t n = 0; n < orders; ++n) {
        d.by_y.re[n] = -(w->c[n] * d.by_x.im[n]);
        d.by_y.im[n] = w->s[n] * d.by_x.re[n];
        d.by_x.re[n] *= w->c[n];
        d.by_x.im[n] *= w->s[n];
        d.whole.re[n] *= w->c[n];
        d.whole.im[n] *= w->s[n];
    }
    return d;
}

/* The relative change of each order's weight with the amplitude. */
static order_weights per_amplitude(const eits_form *f, eits_real amplitude)
{
    const eits_real of_contrast = 4 / ((2 - amplitude) * (2 - amplitude)),
                    part = eits_fabs(f->excess) > R(1e-6) ? of_contrast / f->excess : 0;
    order_weights w = {{0}, {0}};
    for (uint32_t n = 0; n < f->orders; ++n) {
        /* of (k - 1) t with t = 2 / (u + k w) and u + w = 2, the logarithm's slope by k is
         * t / (k - 1) */
        w.c[n] = part * f->tc[n];
        w.s[n] = part * f->ts[n];
    }
    return w;
}

static const uint8_t *fold_row(const eits_context *ctx, uint32_t fold)
{
    return eits_row(ctx, ctx->model->fold[fold].first);
}

/* Whether a row's drive is another than that of the row before. */
static int new_drive(const uint8_t *row, const uint8_t *before)
{
    return before == NULL || row[0] != before[0] || row[1] != before[1];
}

/* The shape's answer on the folds. */
static void fill_values(const eits_context *ctx, const eits_shape *shape, const eits_poles *poles,
                        uint32_t first, uint32_t count, eits_real *out)
{
    const uint32_t electrodes = ctx->model->n_electrodes;
    const size_t width = 2u * (size_t)electrodes, slot = width * EITS_POLE_TERMS;
    eits_real *field = ctx->multipole.work, *own = field + 2u * slot, *whole = own + slot;
    const eits_form f = eits_form_of(shape, poles->orders);
    const order_weights w = weights_of(ctx, &f);
    eits_modes(&f, field, 0, electrodes, own);
    eits_modes(&f, field + slot, 0, electrodes, whole);
    const uint8_t *before = NULL;
    side drive = {{0}, {0}};
    for (uint32_t i = 0; i < count; ++i) {
        const uint8_t *row = fold_row(ctx, first + i);
        if (new_drive(row, before)) {
            drive = difference(whole, row[0], row[1], f.orders, electrodes);
            for (uint32_t n = 0; n < f.orders; ++n) {
                drive.re[n] *= w.c[n];
                drive.im[n] *= w.s[n];
            }
        }
        before = row;
        const uint32_t plus = row[2], minus = row[3];
        const eits_real *re = own, *im = own + electrodes;
        eits_real sum = 0;
        for (uint32_t n = 0; n < f.orders; ++n, re += width, im += width)
            sum = eits_fma(drive.re[n], re[plus] - re[minus],
                           eits_fma(drive.im[n], im[plus] - im[minus], sum));
        out[i] = sum;
    }
}

/* Answer and slopes by place, log radius and amplitude of a disc or, but for the radius, of an
 * ellipse. Slopes by place come from the Taylor series of the same fields, one term on: the drive's
 * slope times the measuring pair's modes and the reverse. Order n goes with r^(2n) for a disc. */
static void fill_slopes(const eits_context *ctx, const eits_shape *shape, const eits_poles *poles,
                        uint32_t first, uint32_t count, const eits_pole_out *out)
{
    const uint32_t electrodes = ctx->model->n_electrodes;
    const size_t width = 2u * (size_t)electrodes, slot = width * EITS_POLE_TERMS;
    eits_real *field = ctx->multipole.work, *own = field + 2u * slot, *whole = own + slot,
              *own_by = whole + slot, *whole_by = own_by + slot;
    const eits_form f = eits_form_of(shape, poles->orders);
    const order_weights w = weights_of(ctx, &f), per = per_amplitude(&f, shape->amplitude);
    eits_modes(&f, field, 0, electrodes, own);
    eits_modes(&f, field + slot, 0, electrodes, whole);
    eits_modes(&f, field, 1, electrodes, own_by);
    eits_modes(&f, field + slot, 1, electrodes, whole_by);
    const uint8_t *before = NULL;
    drive_side d = {.whole = {{0}, {0}}};
    for (uint32_t i = 0; i < count; ++i) {
        const uint8_t *row = fold_row(ctx, first + i);
        if (new_drive(row, before))
            d = drive_of(whole, whole_by, &w, row, f.orders, electrodes);
        before = row;
        const uint32_t plus = row[2], minus = row[3];
        const eits_real *re = own, *by = own_by;
        eits_real value = 0, x = 0, y = 0, radius = 0, amplitude = 0, twice = 2;
        for (uint32_t n = 0; n < f.orders; ++n, re += width, by += width, twice += 2) {
            const eits_real *im = re + electrodes, *by_im = by + electrodes;
            const eits_real mr = re[plus] - re[minus], mi = im[plus] - im[minus],
                            br = by[plus] - by[minus], bi = by_im[plus] - by_im[minus],
                            dr = d.whole.re[n], di = d.whole.im[n], real = dr * mr,
                            imaginary = di * mi, part = real + imaginary;
            value += part;
            radius = eits_fma(twice, part, radius);
            amplitude = eits_fma(per.c[n], real, eits_fma(per.s[n], imaginary, amplitude));
            x = eits_fma(dr, br, eits_fma(di, bi, x));
            x = eits_fma(d.by_x.re[n], mr, eits_fma(d.by_x.im[n], mi, x));
            y = eits_fma(di, br, eits_fma(-dr, bi, y));
            y = eits_fma(d.by_y.re[n], mr, eits_fma(d.by_y.im[n], mi, y));
        }
        out->value[i] = value;
        out->slope[0][i] = x;
        out->slope[1][i] = y;
        out->slope[2][i] = radius;
        out->slope[3][i] = amplitude;
    }
}

/* The shape with parameter p (2: log radius ... 5: e2) a little larger. */
static eits_shape varied(const eits_shape *shape, uint32_t p, eits_real step)
{
    eits_shape out = *shape;
    switch (p) {
    case 2:
        out.radius *= 1 + step;
        break;
    case 3:
        out.amplitude += step;
        break;
    case 4:
        out.e1 += step;
        break;
    default:
        out.e2 += step;
        break;
    }
    return out;
}

uint64_t eits_pole_rows(eits_context *ctx, uint32_t k, const eits_shape *shape,
                        const eits_poles *poles, uint32_t first, uint32_t count,
                        const eits_pole_out *out)
{
    const uint32_t electrodes = ctx->model->n_electrodes;
    const size_t slot = 2u * (size_t)electrodes * EITS_POLE_TERMS;
    eits_real *own = ctx->multipole.work, *whole = own + slot;
    const eits_real *induced = ctx->multipole.induced + slot * k;
    const uint64_t field = 84u * electrodes, mode = 4u * poles->orders * electrodes,
                   row = (uint64_t)count * poles->orders;
    eits_pole_field(ctx, k, shape, own);
    for (size_t e = 0; e < slot; ++e)
        whole[e] = own[e] + induced[e];
    if (out->slope[0] == NULL) {
        fill_values(ctx, shape, poles, first, count, out->value);
        return field + mode + 2u * row;
    }
    fill_slopes(ctx, shape, poles, first, count, out);
    if (out->slope[4] == NULL)
        return field + 2u * mode + 14u * row;
    for (uint32_t p = 2; p < 6u; ++p) {
        if (p == 3u)
            continue;
        const eits_shape more = varied(shape, p, EITS_POLE_STEP);
        eits_real *slope = out->slope[p];
        fill_values(ctx, &more, poles, first, count, slope);
        for (uint32_t i = 0; i < count; ++i)
            slope[i] = (slope[i] - out->value[i]) / EITS_POLE_STEP;
    }
    return field + 5u * mode + 20u * row;
}
