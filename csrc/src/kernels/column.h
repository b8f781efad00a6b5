/* Read single columns of S as numbers, without their scale: in place if they are stored in the
 * width of eits_real, else as a copy. */
#ifndef EITSKIN_COLUMN_H
#define EITSKIN_COLUMN_H

#include "kernels/kernels.h"

/* Returns column j, with at least `rank` numbers. It may write to `copy` (stride numbers). */
static inline const eits_real *eits_column(const eits_matrix *matrix, uint32_t j, eits_real *copy)
{
#ifndef EITS_DOUBLE
    if (matrix->storage == EITS_STORAGE_F32)
        return (const float *)matrix->data + (size_t)matrix->stride * j;
#endif
    eits_read_column(matrix, j, copy);
    return copy;
}

static inline eits_real eits_column_scale(const eits_matrix *matrix, uint32_t j)
{
    return matrix->scale == NULL ? 1 : (eits_real)matrix->scale[j];
}

#endif
