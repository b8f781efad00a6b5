/* The model's fields at a pixel (section FLDS). */
#ifndef EITSKIN_FAST_FIELDS_H
#define EITSKIN_FAST_FIELDS_H

#include "base/half.h"
#include "fast/fast.h"

/* Return a pixel's column: E along x of each electrode's current, then along y. */
static inline const uint16_t *fast_column(const eits_fast *fast, uint32_t pixel)
{
    const eits_matrix *at = &fast->model->fields.at;
    return (const uint16_t *)at->data + (size_t)pixel * at->stride;
}

static inline eits_real fast_number(uint16_t half)
{
    return (eits_real)eits_half_to_float(half);
}

/* Convert the numbers of electrodes e and e + 1. After an odd number of electrodes, the second is
 * the column's next number, of another kind. */
static inline void fast_two(const uint16_t *column, uint32_t e, eits_real value[2])
{
    float both[2];
    eits_halves_to_floats(column + e, both);
    value[0] = (eits_real)both[0];
    value[1] = (eits_real)both[1];
}

/* Return a pixel's column as eits_real: the fields and the mirror's four numbers. It is converted
 * once and kept until another pixel needs its place. The pixels of one touch have different places.
 */
static inline const eits_real *fast_field(const eits_fast *fast, uint32_t pixel)
{
    const eits_pixel *at = &fast->model->pixel[pixel];
    const uint32_t ix = at->ix, iy = at->iy, side = FAST_CACHE_SIDE;
    const uint32_t slot = iy % side * side + ix % side;
    const uint32_t numbers = 2 * fast->model->n_electrodes + 4;
    eits_real *kept = fast->field + (size_t)slot * numbers;
    if (fast->kept[slot] != pixel + 1) {
        const uint16_t *column = fast_column(fast, pixel);
        for (uint32_t k = 0; k < numbers; k += 2)
            fast_two(column, k, kept + k);
        fast->kept[slot] = (uint16_t)(pixel + 1);
    }
    return kept;
}

/* The pixels whose centres may lie in a soft disc: every `every`-th of a range, in pixels from the
 * grid's corner. */
typedef struct fast_window {
    uint32_t x0, x1, y0, y1, every;
    eits_real x, y, scale;
} fast_window;

/* rows.c: compute the window. Returns 0 if no pixel of the grid is near. */
int eits_fast_window(const eits_fast *fast, const eits_real *place, eits_real rho2,
                     fast_window *window);

/* Return 1 - d^2 / rho^2 for a pixel at dx, dy pixels from the place; 0 if no pixel is kept there.
 */
static inline eits_real fast_weight(const eits_fast *fast, const fast_window *w, uint32_t ix,
                                    uint32_t iy, uint32_t *pixel, eits_real *dx, eits_real *dy)
{
    *pixel = fast->ctx->cell[(size_t)iy * fast->model->nx + ix];
    *dx = (eits_real)ix + R(0.5) - w->x;
    *dy = (eits_real)iy + R(0.5) - w->y;
    const eits_real left = 1 - w->scale * (*dx * *dx + *dy * *dy);
    return *pixel == EITS_NO_PIXEL || !(left > 0) ? 0 : left;
}

#endif
