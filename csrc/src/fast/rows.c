/* What a touch does to one drive's rows, from the model's fields (section FLDS).
 *
 * A row's datum changes by -volts strength mean(E_drive . E_measure), the mean over a soft disc:
 * each pixel counts (1 - d^2 / rho^2)^2 at a distance d below rho, which has a derivative
 * everywhere and needs no root. One pass over some ten pixels gives E_drive . E for all electrodes;
 * a row is a difference of two. */
#include "fast/fields.h"

/* Pixels that are summed at a time. */
enum { NEAR = 16 };

/* A pixel near a touch: its column, the drive's field there, and its weight by way. */
typedef struct near_pixel {
    const uint16_t *x;
    eits_real along[2], weight[FAST_WAYS];
} near_pixel;

/* Sums over pixels, by way and electrode, and those that are still to be added. */
typedef struct sums {
    eits_real of[FAST_WAYS][EITS_MAX_ELECTRODES];
    eits_real weight[FAST_WAYS];
    near_pixel near[NEAR];
    uint32_t count;
} sums;

/* E_drive . E of each electrode's current at the pixels, times each way's weight, onto the sums.
 * Two electrodes at a time: their halves are one load, and their sums stay in registers. */
static void add_near(const eits_fast *fast, sums *s)
{
    const uint32_t electrodes = fast->model->n_electrodes;
    for (uint32_t e = 0; e < electrodes; e += 2) {
        eits_real a[FAST_WAYS], b[FAST_WAYS], x[2], y[2];
        for (uint32_t way = 0; way < FAST_WAYS; ++way) {
            a[way] = s->of[way][e];
            b[way] = s->of[way][e + 1];
        }
        for (const near_pixel *p = s->near; p < s->near + s->count; ++p) {
            fast_two(p->x, e, x);
            fast_two(p->x + electrodes, e, y);
            const eits_real first = p->along[0] * x[0] + p->along[1] * y[0];
            const eits_real second = p->along[0] * x[1] + p->along[1] * y[1];
            for (uint32_t way = 0; way < FAST_WAYS; ++way) {
                a[way] += p->weight[way] * first;
                b[way] += p->weight[way] * second;
            }
        }
        for (uint32_t way = 0; way < FAST_WAYS; ++way) {
            s->of[way][e] = a[way];
            s->of[way][e + 1] = b[way];
        }
    }
    s->count = 0;
}

static void add_pixel(const eits_fast *fast, const fast_drive *d, uint32_t pixel, eits_real left,
                      eits_real slope_x, eits_real slope_y, sums *s)
{
    const uint16_t *x = fast_column(fast, pixel), *y = x + fast->model->n_electrodes;
    if (s->count == NEAR)
        add_near(fast, s);
    near_pixel *p = &s->near[s->count++];
    p->x = x;
    p->along[0] = fast_number(x[d->plus]) - fast_number(x[d->minus]);
    p->along[1] = fast_number(y[d->plus]) - fast_number(y[d->minus]);
    p->weight[0] = left;
    p->weight[1] = slope_x;
    p->weight[2] = slope_y;
    for (uint32_t way = 0; way < FAST_WAYS; ++way)
        s->weight[way] += p->weight[way];
}

static void over_rows(const eits_fast *fast, const fast_drive *d, const eits_real *seen,
                      eits_real *out)
{
    const eits_real volts = -(eits_real)fast->model->fields.volts;
    for (uint32_t i = 0; i < d->count; ++i) {
        const uint8_t *row = eits_row(fast->ctx, fast->row[d->first + i]);
        out[i] = volts * (seen[row[2]] - seen[row[3]]);
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

/* Visit the pixels near a place; returns how many there are. `s` NULL: only to count the first. */
static uint32_t gather(const eits_fast *fast, const fast_drive *d, const eits_real *place, sums *s)
{
    const eits_model *m = fast->model;
    const eits_real pixel = (eits_real)m->pixel_mm, reach = eits_sqrt(fast->rho2) / pixel;
    const eits_real x = (place[0] - (eits_real)m->origin_x_mm) / pixel;
    const eits_real y = (place[1] - (eits_real)m->origin_y_mm) / pixel;
    uint32_t x0, x1, y0, y1, near = 0;
    if (!cell_range(x, reach, m->nx, &x0, &x1) || !cell_range(y, reach, m->ny, &y0, &y1))
        return 0;
    const eits_real scale = pixel * pixel / fast->rho2, slope = 4 * pixel / fast->rho2;
    for (uint32_t iy = y0; iy <= y1; ++iy) {
        for (uint32_t ix = x0; ix <= x1; ++ix) {
            const uint32_t j = fast->ctx->cell[(size_t)iy * m->nx + ix];
            const eits_real dx = (eits_real)ix + R(0.5) - x, dy = (eits_real)iy + R(0.5) - y;
            const eits_real left = 1 - scale * (dx * dx + dy * dy);
            if (j == EITS_NO_PIXEL || !(left > 0))
                continue;
            ++near;
            if (s == NULL)
                return near;
            add_pixel(fast, d, j, left * left, slope * left * dx, slope * left * dy, s);
        }
    }
    return near;
}

int eits_fast_answer(const eits_fast *fast, uint32_t drive, const eits_real *place, eits_real *out)
{
    const fast_drive *d = &fast->drive[drive];
    const uint32_t electrodes = fast->model->n_electrodes;
    sums s;
    s.count = 0;
    for (uint32_t way = 0; way < FAST_WAYS; ++way) {
        s.weight[way] = 0;
        eits_zero(s.of[way], (electrodes + 1) & ~1u);
        eits_zero(out + (size_t)way * fast->most_rows, fast->most_rows);
    }
    if (gather(fast, d, place, &s) == 0)
        return 0;
    add_near(fast, &s);
    const eits_real per = 1 / s.weight[0];
    for (uint32_t e = 0; e < electrodes; ++e) {
        const eits_real mean = s.of[0][e] * per;
        s.of[0][e] = mean;
        for (uint32_t way = 1; way < FAST_WAYS; ++way)
            s.of[way][e] = (s.of[way][e] - s.weight[way] * mean) * per;
    }
    for (uint32_t way = 0; way < FAST_WAYS; ++way)
        over_rows(fast, d, s.of[way], out + (size_t)way * fast->most_rows);
    return 1;
}

int eits_fast_on_skin(const eits_fast *fast, const eits_real *place)
{
    return gather(fast, NULL, place, NULL) > 0;
}
