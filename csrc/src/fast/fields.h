/* The model's fields at a pixel (section FLDS). */
#ifndef EITSKIN_FAST_FIELDS_H
#define EITSKIN_FAST_FIELDS_H

#include "base/half.h"
#include "fast/fast.h"

/* E along x of each electrode's current, then along y. */
static inline const uint16_t *fast_column(const eits_fast *fast, uint32_t pixel)
{
    const eits_matrix *at = &fast->model->fields.at;
    return (const uint16_t *)at->data + (size_t)pixel * at->stride;
}

static inline eits_real fast_number(uint16_t half)
{
    return (eits_real)eits_half_to_float(half);
}

/* The same of electrodes e and e + 1; past an odd number of them stands another of the column's. */
static inline void fast_two(const uint16_t *column, uint32_t e, eits_real value[2])
{
    float both[2];
    eits_halves_to_floats(column + e, both);
    value[0] = (eits_real)both[0];
    value[1] = (eits_real)both[1];
}

#endif
