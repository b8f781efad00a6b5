/* The answer of one drive's rows to a touch, from the model's fields (section FLDS).
 *
 * A row's datum changes by -volts strength mean(E_drive . E_measure), the mean over a soft disc:
 * each pixel counts (1 - d^2 / rho^2)^2 at a distance d below rho, which has a derivative
 * everywhere and needs no root. One pass over some ten pixels gives E_drive . E for all electrodes;
 * a row is a difference of two. The polynomials of csrc/src/multipole would give the same with its
 * radius, but cost some 4,000 multiply-accumulates for each new pixel, of which a search sees many
 * and a drive one: this sum costs 900. */
#include "fast/fields.h"

/* E_drive . E of two electrodes' currents at one pixel, times each way's weight, onto `sum`. */
static inline void add_pixel(const eits_real along[2], const eits_real *x, const eits_real *y,
                             const eits_real weight[FAST_WAYS], eits_real sum[2][FAST_WAYS])
{
    const eits_real first = eits_fma(along[0], x[0], along[1] * y[0]);
    const eits_real second = eits_fma(along[0], x[1], along[1] * y[1]);
    sum[0][0] = eits_fma(weight[0], first, sum[0][0]);
    sum[0][1] = eits_fma(weight[1], first, sum[0][1]);
    sum[0][2] = eits_fma(weight[2], first, sum[0][2]);
    sum[1][0] = eits_fma(weight[0], second, sum[1][0]);
    sum[1][1] = eits_fma(weight[1], second, sum[1][1]);
    sum[1][2] = eits_fma(weight[2], second, sum[1][2]);
}

/* The same of each electrode at all pixels: two electrodes at a time, and no loop over the ways, so
 * that their sums stay in registers. */
static void add_up(const eits_fast *fast, const fast_drive *d, const fast_disc *disc,
                   eits_real of[FAST_WAYS][EITS_MAX_ELECTRODES])
{
    const uint32_t electrodes = fast->model->n_electrodes;
    const eits_real *field[FAST_NEAR_MOST];
    eits_real along[FAST_NEAR_MOST][2];
    for (uint32_t n = 0; n < disc->count; ++n) {
        const eits_real *x = field[n] = fast_field(fast, disc->near[n].pixel);
        const eits_real *y = x + electrodes;
        along[n][0] = x[d->plus] - x[d->minus];
        along[n][1] = y[d->plus] - y[d->minus];
    }
    for (uint32_t e = 0; e < electrodes; e += 2) {
        eits_real sum[2][FAST_WAYS] = {{0, 0, 0}, {0, 0, 0}};
        for (uint32_t n = 0; n < disc->count; ++n) {
            const eits_real *x = field[n] + e;
            add_pixel(along[n], x, x + electrodes, disc->near[n].weight, sum);
        }
        for (uint32_t way = 0; way < FAST_WAYS; ++way) {
            of[way][e] = sum[0][way];
            of[way][e + 1] = sum[1][way];
        }
    }
}

/* Cells from first to last whose centres may lie within `reach` of `at`, all in pixels; compared
 * before they are converted, and none for what is no number. */
static int cell_range(eits_real at, eits_real reach, uint32_t count, uint32_t *first,
                      uint32_t *last)
{
    const eits_real low = at - reach, high = at + reach, top = (eits_real)count;
    if (!(high > 0 && low < top))
        return 0;
    *first = low > 0 ? (uint32_t)low : 0;
    *last = high < top ? (uint32_t)high : count - 1;
    return 1;
}

int eits_fast_window(const eits_fast *fast, const eits_real *place, eits_real rho2, fast_window *w)
{
    const eits_model *m = fast->model;
    const eits_real pixel = (eits_real)m->pixel_mm, reach = eits_sqrt(rho2) / pixel;
    w->x = (place[0] - (eits_real)m->origin_x_mm) / pixel;
    w->y = (place[1] - (eits_real)m->origin_y_mm) / pixel;
    w->scale = pixel * pixel / rho2;
    /* of a wide disc every second pixel along x and y is enough, or every third */
    w->every = 1 + (uint32_t)(2 * reach / (FAST_NEAR_SIDE - 1));
    return cell_range(w->x, reach, m->nx, &w->x0, &w->x1) &&
           cell_range(w->y, reach, m->ny, &w->y0, &w->y1);
}

int eits_fast_gather(const eits_fast *fast, const eits_real *place, eits_real rho2, fast_disc *disc)
{
    fast_window w;
    disc->count = 0;
    eits_zero(disc->sum, FAST_WAYS);
    if (!eits_fast_window(fast, place, rho2, &w))
        return 0;
    const eits_real slope = 4 * (eits_real)fast->model->pixel_mm / rho2;
    for (uint32_t iy = w.y0; iy <= w.y1; iy += w.every) {
        for (uint32_t ix = w.x0; ix <= w.x1; ix += w.every) {
            uint32_t pixel;
            eits_real dx, dy;
            const eits_real left = fast_weight(fast, &w, ix, iy, &pixel, &dx, &dy);
            if (!(left > 0) || disc->count == FAST_NEAR_MOST)
                continue;
            fast_near *near = &disc->near[disc->count++];
            near->pixel = (uint16_t)pixel;
            near->weight[0] = left * left;
            near->weight[1] = slope * left * dx;
            near->weight[2] = slope * left * dy;
            for (uint32_t way = 0; way < FAST_WAYS; ++way)
                disc->sum[way] += near->weight[way];
        }
    }
    return disc->count > 0;
}

void eits_fast_answer(const eits_fast *fast, uint32_t drive, const fast_disc *disc, eits_real *out)
{
    const fast_drive *d = &fast->drive[drive];
    const uint32_t rows = fast->most_rows;
    eits_real of[FAST_WAYS][EITS_MAX_ELECTRODES];
    add_up(fast, d, disc, of);
    const eits_real per = 1 / disc->sum[0];
    const eits_real volts = -(per * (eits_real)fast->model->fields.volts);
    const eits_real mean_x = disc->sum[1] * per, mean_y = disc->sum[2] * per;
    for (uint32_t i = 0; i < d->count; ++i) {
        const uint8_t *row = eits_row(fast->ctx, fast->row[d->first + i]);
        const uint32_t m = row[2], n = row[3];
        const eits_real value = of[0][m] - of[0][n];
        out[i] = volts * value;
        out[rows + i] = volts * (of[1][m] - of[1][n] - mean_x * value);
        out[2 * rows + i] = volts * (of[2][m] - of[2][n] - mean_y * value);
    }
    for (uint32_t i = d->count; i < rows; ++i)
        out[i] = out[rows + i] = out[2 * rows + i] = 0;
}

int eits_fast_on_skin(const eits_fast *fast, const eits_real *place, eits_real rho2)
{
    fast_window w;
    if (!eits_fast_window(fast, place, rho2, &w))
        return 0;
    for (uint32_t iy = w.y0; iy <= w.y1; iy += w.every) {
        for (uint32_t ix = w.x0; ix <= w.x1; ix += w.every) {
            uint32_t pixel;
            eits_real dx, dy;
            if (fast_weight(fast, &w, ix, iy, &pixel, &dx, &dy) > 0)
                return 1;
        }
    }
    return 0;
}

/* The interaction of two touches in the rows, to second order (csrc/src/touch/interaction.c has the
 * physics). Each is a dipole in the drive's field, with a mirror in the rim, and bends the field at
 * the other. Fields are means over the touches' soft discs. */

typedef struct complex_number {
    eits_real re, im;
} complex_number;

static complex_number product(complex_number a, complex_number b)
{
    return (complex_number){a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
}

/* 1 / a^2; 0 where a is all but zero. */
static complex_number inverse_square(complex_number a)
{
    const eits_real square = a.re * a.re + a.im * a.im;
    if (!(square > EITS_FAST_NO_DIPOLE_MM2))
        return (complex_number){0, 0};
    const complex_number inverse = {a.re / square, -(a.im / square)};
    return product(inverse, inverse);
}

void eits_fast_look(const eits_fast *fast, const eits_real *place, eits_real rho2,
                    const fast_disc *disc, fast_sight *sight)
{
    const uint32_t numbers = 2 * fast->model->n_electrodes;
    const eits_real per = 1 / disc->sum[0];
    const eits_real *field[FAST_NEAR_MOST];
    eits_real weight[FAST_NEAR_MOST];
    for (uint32_t n = 0; n < disc->count; ++n) {
        field[n] = fast_field(fast, disc->near[n].pixel);
        weight[n] = per * disc->near[n].weight[0];
    }
    for (uint32_t e = 0; e < numbers + 4; e += 2) {
        eits_real first = 0, second = 0;
        for (uint32_t n = 0; n < disc->count; ++n) {
            first = eits_fma(weight[n], field[n][e], first);
            second = eits_fma(weight[n], field[n][e + 1], second);
        }
        sight->field[e] = first;
        sight->field[e + 1] = second;
    }
    eits_copy(sight->z, place, 2);
    sight->radius = eits_sqrt(rho2 / 2);
}

/* conj of what `source` adds to the drive's field at `at`. */
static complex_number bent(const eits_fast *fast, const fast_drive *d, const fast_sight *at,
                           const fast_sight *source)
{
    const eits_real *x = source->field, *y = x + fast->model->n_electrodes;
    const eits_real *mirror = y + fast->model->n_electrodes;
    const eits_real s = (eits_real)fast->model->fields.per_sheet;
    const complex_number z = {at->z[0], at->z[1]};
    const complex_number apart = {at->z[0] - source->z[0], at->z[1] - source->z[1]};
    const complex_number b_z = product((complex_number){mirror[2], mirror[3]}, z);
    const complex_number mirrored =
        inverse_square((complex_number){mirror[0] - b_z.re, mirror[1] - b_z.im});
    /* discs that overlap are no dipoles: the field where they touch, taken in */
    const eits_real distance = eits_sqrt(apart.re * apart.re + apart.im * apart.im);
    const eits_real touching = at->radius + source->radius;
    const eits_real share = distance < touching ? distance / touching : 1;
    complex_number direct = inverse_square(apart);
    direct.re *= share * share;
    direct.im *= share * share;
    const complex_number e = {x[d->plus] - x[d->minus], y[d->plus] - y[d->minus]};
    const complex_number from = product(direct, e);
    const complex_number back = product(mirrored, (complex_number){e.re, -e.im});
    return (complex_number){s * (from.re - back.re), -(s * (from.im - back.im))};
}

void eits_fast_add_interplay(const eits_fast *fast, uint32_t drive, const fast_sight *a,
                             const fast_sight *b, eits_real factor, eits_real *out)
{
    const fast_drive *d = &fast->drive[drive];
    const uint32_t electrodes = fast->model->n_electrodes;
    const eits_real volts = -(fast->sign * factor * (eits_real)fast->model->fields.volts);
    const complex_number at_a = bent(fast, d, a, b), at_b = bent(fast, d, b, a);
    for (uint32_t i = 0; i < d->count; ++i) {
        const uint8_t *row = eits_row(fast->ctx, fast->row[d->first + i]);
        const uint32_t m = row[2], n = row[3];
        const eits_real of_a = at_a.re * (a->field[m] - a->field[n]) +
                               at_a.im * (a->field[electrodes + m] - a->field[electrodes + n]);
        const eits_real of_b = at_b.re * (b->field[m] - b->field[n]) +
                               at_b.im * (b->field[electrodes + m] - b->field[electrodes + n]);
        out[i] += volts * (of_a + of_b);
    }
}
