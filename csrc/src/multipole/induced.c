/* Compute the fields that shapes send to each other and, through the rim, to themselves.
 *
 * Each shape lies in a field a_n (multipole.h) and sends out sum_k B_k (z - c)^-k, where B_k is a
 * linear function of conj(a_n). About another shape's middle c_i this is again a Taylor series,
 *
 *     (t + s)^-k = sum_q t^(-k-q) binomial(-k, q) s^q,    t = c_i - c_j
 *
 * No current crosses the rim, so it mirrors each source: the image is conj(B_k) h(z)^k. The model
 * stores a and b of D = a - b z (docs/reference/eitm-format.md, "FLDS"), which make a circle of
 * radius R through which the rim passes near the source. With 1 / R = (1 - |b|^2) / (a - b c_j), 0
 * where the rim is straight, h = (conj(b) + (z - c_j) / R) / D. For a round skin the circle is the
 * rim, and h = z / (R D). In all cases h_q = b^(q-1) / D^(q+1) for q > 0. A shape also lies in the
 * field of its own image. The computation has rounds: in each, every shape responds to the field of
 * the round before.
 */
#include "base/vec.h"
#include "multipole/constants.h"
#include "multipole/form.h"

/* Compute B_1 ... B_sent of each electrode from the modes of the field in which the shape lies. */
static void send(const eits_form *f, const eits_real *mode, uint32_t sent, uint32_t electrodes,
                 eits_real *out)
{
    const size_t width = 2u * (size_t)electrodes;
    for (uint32_t o = 1; o <= sent; ++o) {
        eits_real *re = out + width * (o - 1u), *im = re + electrodes;
        eits_zero(re, width);
        eits_real power = 1;
        for (uint32_t q = o;; q -= 2u) {
            const eits_real *from = mode + width * (q - 1u);
            const eits_real whole = -(f->excess / 8) * (eits_real)q * f->gap[q - 1u] * power *
                                    eits_pole_halves[o] * eits_pole_binomial[o][(o - q) / 2u] /
                                    (eits_real)o;
            const eits_real c = whole * f->tc[q - 1u], s = -(whole * f->ts[q - 1u]);
            for (uint32_t e = 0; e < electrodes; ++e) {
                re[e] = eits_fma(c, from[e], re[e]);
                im[e] = eits_fma(s, from[electrodes + e], im[e]);
            }
            power *= f->f2;
            if (q < 3u || f->f2 == 0)
                break;
        }
        for (uint32_t e = 0; e < electrodes; ++e) { /* back from the ellipse's frame */
            const eits_complex b = eits_times((eits_complex){re[e], im[e]}, f->turn[o - 1u]);
            re[e] = b.re;
            im[e] = b.im;
        }
    }
}

/* The rim's mirror of a source in slot j, in pixels. */
typedef struct mirror {
    eits_complex a, b;
    eits_complex middle; /* h_0 D = offset + (z - middle) times per_radius */
    eits_complex offset, per_radius;
} mirror;

static mirror mirror_of(const eits_context *ctx, uint32_t j, const eits_shape *shape)
{
    const eits_model *model = ctx->model;
    const eits_real pixel = (eits_real)model->pixel_mm, *stored = ctx->multipole.mirror[j];
    const eits_pixel at = model->pixel[ctx->multipole.home_pixel[j]];
    const eits_complex home = {(eits_real)at.ix + R(0.5), (eits_real)at.iy + R(0.5)};
    /* the mirror was stored for the home pixel's middle */
    const eits_complex moved = {shape->x - (eits_real)at.ix - R(0.5),
                                shape->y - (eits_real)at.iy - R(0.5)};
    eits_complex whole = {stored[0] / pixel, stored[1] / pixel}; /* a in the model's coordinates */
    const eits_complex origin = {-((eits_real)model->origin_x_mm / pixel),
                                 -((eits_real)model->origin_y_mm / pixel)};
    mirror m = {.b = {stored[2], stored[3]}};
    const eits_complex c = {home.re - origin.re, home.im - origin.im}, bc = eits_times(m.b, c),
                       back = eits_times(eits_conjugate(m.b), whole);
    const eits_real away_re = back.re - c.re, away_im = back.im - c.im, depth = whole.re - bc.re;
    if (eits_fma(away_re, away_re, away_im * away_im) < EITS_POLE_CENTRED * EITS_POLE_CENTRED &&
        depth > EITS_POLE_DEPTH) { /* the circle's middle is the origin: a round skin */
        const eits_complex by = eits_times(eits_conjugate(moved), eits_inverse(whole));
        m.middle = origin;
        m.per_radius = eits_inverse(whole);
        m.b.re += by.re;
        m.b.im += by.im;
    } else {
        const eits_real square = eits_fma(m.b.re, m.b.re, m.b.im * m.b.im),
                        per_radius = depth > EITS_POLE_DEPTH ? (1 - square) / depth : 0;
        m.middle = home;
        m.offset = eits_conjugate(m.b);
        m.per_radius.re = per_radius;
        const eits_complex by =
            eits_times(eits_conjugate(moved), (eits_complex){m.offset.re - per_radius * c.re,
                                                             m.offset.im - per_radius * c.im});
        whole.re -= by.re;
        whole.im -= by.im;
        m.b.re = eits_fma(per_radius, moved.re, m.b.re);
        m.b.im = eits_fma(per_radius, -moved.im, m.b.im);
    }
    const eits_complex part = eits_times(m.b, origin); /* z = z_grid - origin */
    m.a = (eits_complex){whole.re + part.re, whole.im + part.im};
    return m;
}

/* a - b z vanishes at the image of the middle. The image lies as far behind the rim as the middle
 * lies before it.
 */
eits_real eits_pole_room(const eits_context *ctx, uint32_t k, const eits_shape *shape)
{
    const mirror m = mirror_of(ctx, k, shape);
    const eits_complex bz = eits_times(m.b, (eits_complex){shape->x, shape->y}),
                       d = {m.a.re - bz.re, m.a.im - bz.im};
    const eits_real square = eits_fma(m.b.re, m.b.re, m.b.im * m.b.im);
    return square > 0 ? eits_sqrt(eits_fma(d.re, d.re, d.im * d.im) / square) / 2 : R(INFINITY);
}

/* Compute h_0 ... h_terms about `at`. */
static void mirror_series(const mirror *m, eits_complex at, uint32_t terms, eits_complex *h)
{
    const eits_complex bz = eits_times(m->b, at),
                       d = eits_inverse((eits_complex){m->a.re - bz.re, m->a.im - bz.im});
    const eits_complex z = {at.re - m->middle.re, at.im - m->middle.im},
                       bent = eits_times(eits_times(z, d), m->per_radius),
                       flat = eits_times(m->offset, d);
    h[0] = (eits_complex){flat.re + bent.re, flat.im + bent.im};
    eits_complex next = eits_times(d, d);
    const eits_complex ratio = eits_times(m->b, d);
    for (uint32_t q = 1; q <= terms; ++q) {
        h[q] = next;
        next = eits_times(next, ratio);
    }
}

/* Compute the first terms of the product of two series, in a. */
static void multiply_series(eits_complex *a, const eits_complex *b, uint32_t terms)
{
    eits_complex out[EITS_POLE_TERMS + 1];
    for (uint32_t n = 0; n <= terms; ++n) {
        out[n] = (eits_complex){0, 0};
        for (uint32_t m = 0; m <= n; ++m) {
            const eits_complex part = eits_times(a[m], b[n - m]);
            out[n].re += part.re;
            out[n].im += part.im;
        }
    }
    for (uint32_t n = 0; n <= terms; ++n)
        a[n] = out[n];
}

/* Return 1 / (c_i - c_j). The multipole series does not hold for overlapping shapes: if they are
 * nearer than touching, they count as touching. */
static eits_complex nearness_of(const eits_shape *i, const eits_shape *j)
{
    const eits_complex apart = {i->x - j->x, i->y - j->y};
    const eits_real square = eits_fma(apart.re, apart.re, apart.im * apart.im),
                    touching = i->radius + j->radius, least = touching * touching;
    if (!(square < least))
        return eits_inverse(apart);
    if (!(square > R(1e-6) * least))
        return (eits_complex){0, 0};
    return eits_scaled(eits_sqrt(square / least), eits_inverse(apart));
}

/* Add to the field about shape i the field that shape j sends there, directly and by its image. */
static uint64_t receive(const eits_context *ctx, const eits_shape *shape, uint32_t i, uint32_t j,
                        const mirror *m, const eits_poles *poles)
{
    const uint32_t electrodes = ctx->model->n_electrodes;
    const size_t width = 2u * (size_t)electrodes;
    eits_real *to = ctx->multipole.induced + width * EITS_POLE_TERMS * i;
    const eits_real *from = ctx->multipole.sent + width * EITS_POLE_SENT * j;
    const eits_complex at = {shape[i].x, shape[i].y};
    const eits_complex nearness = nearness_of(&shape[i], &shape[j]);
    eits_complex h[EITS_POLE_TERMS + 1], image[EITS_POLE_TERMS + 1], direct = {1, 0};
    const eits_real reach = EITS_POLE_FAR * (shape[i].radius + shape[j].radius);
    const int far =
        i != j && eits_fma(nearness.re, nearness.re, nearness.im * nearness.im) * reach * reach < 1;
    const uint32_t sent_orders = far ? 1u : poles->sent, terms = far ? 3u : poles->orders + 1u;
    mirror_series(m, at, terms, h);
    for (uint32_t q = 0; q <= terms; ++q)
        image[q] = h[q];
    for (uint32_t k = 1; k <= sent_orders; ++k) {
        const eits_real *sent = from + width * (k - 1u);
        if (k > 1u)
            multiply_series(image, h, terms);
        direct = eits_times(direct, nearness);
        eits_complex term = direct;
        for (uint32_t q = 1; q <= terms; ++q) {
            eits_real *re = to + width * (q - 1u), *im = re + electrodes;
            term =
                eits_scaled(-((eits_real)(k + q - 1u) / (eits_real)q), eits_times(term, nearness));
            /* term B + image conj(B); a shape sends no direct term to itself */
            const eits_complex own = i == j ? (eits_complex){0, 0} : term;
            const eits_real by_re = own.re + image[q].re, by_im = image[q].im - own.im,
                            im_by_re = own.im + image[q].im, im_by_im = own.re - image[q].re;
            for (uint32_t e = 0; e < electrodes; ++e) {
                const eits_real b = sent[e], b_im = sent[electrodes + e];
                re[e] = eits_fma(by_re, b, eits_fma(by_im, b_im, re[e]));
                im[e] = eits_fma(im_by_re, b, eits_fma(im_by_im, b_im, im[e]));
            }
        }
    }
    return (uint64_t)sent_orders * terms * electrodes * 4u;
}

void eits_pole_lift(eits_context *ctx, uint32_t k)
{
    const size_t slot = EITS_POLE_FIELD(ctx->model->n_electrodes);
    eits_zero(ctx->multipole.induced + slot * k, slot);
}

void eits_pole_clear(eits_context *ctx, uint32_t count)
{
    eits_zero(ctx->multipole.induced,
              2u * (size_t)ctx->model->n_electrodes * EITS_POLE_TERMS * count);
}

uint64_t eits_pole_induced_in(eits_context *ctx, const eits_shape *shape, uint32_t count,
                              const uint32_t *into, uint32_t into_count, const eits_poles *poles,
                              uint32_t rounds)
{
    const uint32_t electrodes = ctx->model->n_electrodes;
    const size_t width = 2u * (size_t)electrodes, slot = width * EITS_POLE_TERMS;
    eits_real *field = ctx->multipole.work, *mode = field + slot;
    mirror rim[EITS_MAX_TOUCHES];
    uint64_t macs = 0;
    for (uint32_t j = 0; j < count; ++j)
        rim[j] = mirror_of(ctx, j, &shape[j]);
    for (uint32_t round = 0; round < rounds; ++round) {
        for (uint32_t k = 0; k < into_count; ++k) {
            const uint32_t i = into[k];
            const eits_form f = eits_form_of(&shape[i], poles->orders);
            eits_real *induced = ctx->multipole.induced + slot * i;
            const eits_real *own = ctx->multipole.own + slot * i;
            for (size_t e = 0; e < width * poles->orders; ++e)
                field[e] = own[e] + induced[e];
            eits_modes(&f, field, electrodes, mode);
            send(&f, mode, poles->sent, electrodes,
                 ctx->multipole.sent + width * EITS_POLE_SENT * i);
            eits_zero(induced, slot);
        }
        for (uint32_t k = 0; k < into_count; ++k) {
            for (uint32_t j = 0; j < count; ++j) {
                if (j != into[k] || !poles->of_others)
                    macs += receive(ctx, shape, into[k], j, &rim[j], poles);
            }
        }
    }
    return macs + (uint64_t)rounds * electrodes * into_count * 12u * poles->orders;
}

uint64_t eits_pole_induced(eits_context *ctx, const eits_shape *shape, uint32_t count,
                           const eits_poles *poles, uint32_t rounds)
{
    uint32_t all[EITS_MAX_TOUCHES];
    for (uint32_t k = 0; k < count; ++k)
        all[k] = k;
    return eits_pole_induced_in(ctx, shape, count, all, count, poles, rounds);
}
