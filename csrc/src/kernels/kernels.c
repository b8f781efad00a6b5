/* This file has the functions that all builds of the kernels share: they choose a build, list
 * non-zeros, read columns and make panels.
 *
 * The builds differ in speed, not in bits (kernels.h has the order of every sum). So the processor
 * decides which one runs, and no option is needed. The choice is made when a context is set up, not
 * in each product. */
#include "kernels/kernels.h"

#include "base/half.h"
#include "base/vec.h"

#ifdef EITS_BUILD_AVX2
extern const eits_kernels eits_kernels_avx2;
/* clang's __builtin_cpu_supports does not know "f16c", at least up to version 14; each processor
 * with AVX2 has it. */
#ifdef __clang__
#define SUPPORTS_F16C 1
#else
#define SUPPORTS_F16C __builtin_cpu_supports("f16c")
#endif
#endif
#ifdef EITS_BUILD_M7
extern const eits_kernels eits_kernels_m7;
#endif

const eits_kernels *eits_kernels_best(void)
{
#ifdef EITS_BUILD_AVX2
    __builtin_cpu_init(); /* not every compiler's library does so by itself */
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && SUPPORTS_F16C)
        return &eits_kernels_avx2;
#endif
#ifdef EITS_BUILD_M7
    return &eits_kernels_m7;
#else
    return &eits_kernels_portable;
#endif
}

/* Read a single number; the kernels' own loops read whole columns of a storage type. The switch has
 * no default case, so that the compiler reports a storage type that is missing. */
static eits_real read_entry(const eits_matrix *matrix, size_t at)
{
    switch (matrix->storage) {
    case EITS_STORAGE_F32:
        return (eits_real)((const float *)matrix->data)[at];
    case EITS_STORAGE_F16:
        return (eits_real)eits_half_to_float(((const uint16_t *)matrix->data)[at]);
    case EITS_STORAGE_I16:
        return (eits_real)((const int16_t *)matrix->data)[at];
    case EITS_STORAGE_I8:
        break;
    }
    return (eits_real)((const int8_t *)matrix->data)[at];
}

void eits_read_column(const eits_matrix *matrix, uint32_t column, eits_real *out)
{
    for (uint32_t i = 0; i < matrix->rows; ++i)
        out[i] = read_entry(matrix, (size_t)matrix->stride * column + i);
}

void eits_scale_listed(const eits_matrix *matrix, const uint32_t *index, uint32_t count,
                       eits_real *values)
{
    if (matrix->scale == NULL)
        return;
    for (uint32_t k = 0; k < count; ++k)
        values[k] *= (eits_real)matrix->scale[index[k]];
}

/* Non-zeros are listed first, so that the product has no test in its loop. Scales are multiplied
 * into these few values rather than into every stored number. */
uint32_t eits_list_nonzeros(const eits_kernels *kernels, const eits_matrix *matrix,
                            const eits_real *x, uint32_t *index, eits_real *value)
{
    const uint32_t count = kernels->nonzeros(x, matrix->cols, index, value);
    eits_scale_listed(matrix, index, count, value);
    return count;
}

/* A panel holds a few columns row by row: S'v then reads memory in order, and each vector
 * register holds one row of many columns, so that no sum goes across a register. */
void eits_make_panels(const eits_matrix *matrix, eits_real *panels)
{
    /* Lanes beyond the last column are zeros: they take part in every sum and change none. */
    for (uint32_t j = 0; j < EITS_PANEL_COLUMNS(matrix->cols); ++j) {
        eits_real *lane =
            panels + (size_t)(j / EITS_PANEL) * EITS_PANEL * matrix->rows + j % EITS_PANEL;
        for (uint32_t i = 0; i < matrix->rows; ++i)
            lane[(size_t)i * EITS_PANEL] =
                j < matrix->cols ? read_entry(matrix, (size_t)matrix->stride * j + i) : 0;
    }
}
