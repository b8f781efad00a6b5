/* For each cell, how much of the waiting drives' data a touch there would explain. A search begins
 * with this map.
 *
 * A cell's answer is g = D f, f_e = E_drive . E_e of each electrode, and D the rows' differences.
 * So g'S^-1 e = f . (D'S^-1 e), in which the bracket is the drive's: a cell costs one pass over the
 * electrodes. g'S^-1 g is made with the diagonal of S's factor alone: it is exact where no touch is
 * known, and what known touches may do beside it only tells where to begin. */
#include "fast/fields.h"

/* One drive against all cells. */
typedef struct sight {
    uint8_t plus, minus;
    uint32_t rows;
    eits_real toward[EITS_MAX_ELECTRODES]; /* D'S^-1 of what is unexplained */
    eits_real shared[EITS_MAX_ELECTRODES]; /* what a cell has in common with the known touch */
    eits_real energy;                      /* of that touch; 0: none is known */
    eits_real weight[EITS_FAST_MAX_ROWS];  /* of a row's square */
    const uint8_t *measured[EITS_FAST_MAX_ROWS];
    eits_real f[EITS_MAX_ELECTRODES];           /* of the cell at hand */
    const eits_real *of[EITS_FAST_MAX_ROWS][2]; /* a row's two of them */
} sight;

/* D'u of the drive's rows, by electrode. */
static void over_electrodes(const eits_fast *fast, const sight *s, const eits_real *u,
                            eits_real *out)
{
    const eits_real volts = -(eits_real)fast->model->fields.volts;
    eits_zero(out, (fast->model->n_electrodes + 1) & ~1u);
    for (uint32_t i = 0; i < s->rows; ++i) {
        out[s->measured[i][0]] += volts * u[i];
        out[s->measured[i][1]] -= volts * u[i];
    }
}

/* u <- L'^-1 u, L a triangle. */
static void whiten_back(eits_real *factor, eits_real *u, uint32_t rows)
{
    for (uint32_t i = rows; i-- > 0;) {
        const eits_real *line = fast_line(factor, i);
        u[i] /= line[i];
        fast_axpy(u, -u[i], line, i);
    }
}

/* Prepare what all cells share. `beside` is a touch's whitened answer, or NULL. */
static void look_at(eits_fast *fast, const fast_held *held, const eits_real *beside, sight *s)
{
    const fast_drive *d = &fast->drive[held->drive];
    const eits_real volts = (eits_real)fast->model->fields.volts;
    eits_real *left = fast->spare, *own = fast->search.rest;
    s->plus = d->plus;
    s->minus = d->minus;
    s->rows = d->count;
    s->energy = 0;
    eits_copy(left, held->white, s->rows);
    for (uint32_t i = 0; i < s->rows; ++i) {
        const int used = held->used >> i & 1u;
        const eits_real per = used ? 1 / fast_line(held->factor, i)[i] : 0;
        s->weight[i] = fast_square(volts * per);
        s->measured[i] = eits_row(fast->ctx, fast->row[d->first + i]) + 2;
        s->of[i][0] = s->f + s->measured[i][0];
        s->of[i][1] = s->f + s->measured[i][1];
    }
    s->energy = beside == NULL ? 0 : fast_dot(beside, beside, s->rows);
    if (s->energy > 0) {
        fast_axpy(left, -(fast_dot(beside, left, s->rows) / s->energy), beside, s->rows);
        eits_copy(own, beside, s->rows);
        whiten_back(held->factor, own, s->rows);
        over_electrodes(fast, s, own, s->shared);
    }
    whiten_back(held->factor, left, s->rows);
    over_electrodes(fast, s, left, s->toward);
}

static eits_real explained(const eits_fast *fast, sight *s, uint32_t pixel)
{
    const uint32_t electrodes = fast->model->n_electrodes;
    const uint16_t *x = fast_column(fast, pixel), *y = x + electrodes;
    const eits_real along_x = fast_number(x[s->plus]) - fast_number(x[s->minus]);
    const eits_real along_y = fast_number(y[s->plus]) - fast_number(y[s->minus]);
    eits_real *f = s->f, own = 0, along = 0, of_x[2], of_y[2];
    for (uint32_t e = 0; e < electrodes; e += 2) {
        fast_two(x, e, of_x);
        fast_two(y, e, of_y);
        f[e] = eits_fma(along_x, of_x[0], along_y * of_y[0]);
        f[e + 1] = eits_fma(along_x, of_x[1], along_y * of_y[1]);
        along = eits_fma(f[e], s->toward[e], along);
        along = eits_fma(f[e + 1], s->toward[e + 1], along);
    }
    if (!(along > 0))
        return 0;
    for (uint32_t i = 0; i < s->rows; ++i)
        own = eits_fma(s->weight[i], fast_square(*s->of[i][0] - *s->of[i][1]), own);
    if (s->energy > 0)
        own -= fast_square(fast_dot(f, s->shared, electrodes)) / s->energy;
    return own > 0 ? along * along / own : 0;
}

void eits_fast_map(eits_fast *fast, const fast_held *held, const eits_real *beside,
                   eits_real *score)
{
    sight s;
    look_at(fast, held, beside, &s);
    /* where the work is limited, one half of the cells by one drive, the other by the next */
    const uint32_t step = 2;
    for (uint32_t n = held->drive % step; n < fast->cells; n += step)
        score[n] += explained(fast, &s, fast->cell[n]);
}

/* The pixel's centre, mm. */
static void centre(const eits_fast *fast, uint32_t pixel, eits_real *place)
{
    const eits_model *m = fast->model;
    const eits_real side = (eits_real)m->pixel_mm;
    place[0] = (eits_real)m->origin_x_mm + ((eits_real)m->pixel[pixel].ix + R(0.5)) * side;
    place[1] = (eits_real)m->origin_y_mm + ((eits_real)m->pixel[pixel].iy + R(0.5)) * side;
}

int eits_fast_peak(const eits_fast *fast, const eits_real *score, const eits_real (*places)[2],
                   uint32_t count, eits_real *place)
{
    /* One pass without sorting: a map has hundreds of cells and at most two peaks are wanted. */
    eits_real greatest = 0;
    for (uint32_t n = 0; n < fast->cells; ++n) {
        eits_real here[2];
        if (!(score[n] > greatest))
            continue;
        centre(fast, fast->cell[n], here);
        int free = 1;
        for (uint32_t k = 0; k < count; ++k)
            free &= fast_apart(here, places[k]);
        if (free) {
            greatest = score[n];
            eits_copy(place, here, 2);
        }
    }
    return greatest > 0;
}
