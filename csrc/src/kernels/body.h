/* The matrix products. Each processor's build includes this file once (portable.c, avx2.c, m7.c).
 * NAME(x) gives that build's names. Before it includes this file, the build defines
 *
 *     NAME(sum_panel): sum_l = sum over i = 0, 1, ... of panel[i * EITS_PANEL + l] * v_i, for the
 *     EITS_PANEL lanes l
 *
 * and, for what it brings itself: KERNELS_OWN_PRODUCTS (mul, mul_t, dots, unpack),
 * KERNELS_OWN_PANELS (sum_two_panels beside the above), KERNELS_OWN_VECTORS (dot, axpy),
 * KERNELS_OWN_ROWS (rows_dot, rows_sum), KERNELS_OWN_NONZEROS, KERNELS_OWN_GREATEST,
 * KERNELS_OWN_PROX.
 *
 * The loops are unrolled or split into lanes as far as a compiler needs to find vectors, and no
 * further. The order of a sum is part of the result (kernels.h): after a change of a loop here,
 * every build and the golden frames must still agree to the bit. */
#include "base/half.h"
#include "base/vec.h"
#include "kernels/kernels.h"

#ifndef KERNELS_OWN_PRODUCTS
/* One function for each storage type, from one text. */
#define DEFINE_PRODUCTS(TAG, TYPE, READ)                                                           \
    static void NAME(mul_##TAG)(const eits_matrix *matrix, const uint32_t *index,                  \
                                const eits_real *value, uint32_t count, eits_real *out)            \
    {                                                                                              \
        const TYPE *data = matrix->data;                                                           \
        const size_t stride = matrix->stride;                                                      \
        for (size_t row = 0; row < stride; row += 8) {                                             \
            eits_real a0 = 0, a1 = 0, a2 = 0, a3 = 0, a4 = 0, a5 = 0, a6 = 0, a7 = 0;              \
            for (uint32_t k = 0; k < count; ++k) {                                                 \
                const TYPE *c = data + stride * index[k] + row;                                    \
                const eits_real v = value[k];                                                      \
                a0 = eits_fma(READ(c[0]), v, a0);                                                  \
                a1 = eits_fma(READ(c[1]), v, a1);                                                  \
                a2 = eits_fma(READ(c[2]), v, a2);                                                  \
                a3 = eits_fma(READ(c[3]), v, a3);                                                  \
                a4 = eits_fma(READ(c[4]), v, a4);                                                  \
                a5 = eits_fma(READ(c[5]), v, a5);                                                  \
                a6 = eits_fma(READ(c[6]), v, a6);                                                  \
                a7 = eits_fma(READ(c[7]), v, a7);                                                  \
            }                                                                                      \
            eits_real *o = out + row;                                                              \
            o[0] = a0, o[1] = a1, o[2] = a2, o[3] = a3, o[4] = a4, o[5] = a5, o[6] = a6,           \
            o[7] = a7;                                                                             \
        }                                                                                          \
    }                                                                                              \
    static void NAME(mul_t_##TAG)(const eits_matrix *matrix, const uint32_t *index,                \
                                  uint32_t count, const eits_real *v, eits_real *out)              \
    {                                                                                              \
        const TYPE *data = matrix->data;                                                           \
        const size_t stride = matrix->stride;                                                      \
        uint32_t k = 0;                                                                            \
        for (; k + 4 <= count; k += 4) { /* four chains at a time hide the latency of one */       \
            const TYPE *c0 = data + stride * (index ? index[k] : k),                               \
                       *c1 = data + stride * (index ? index[k + 1] : k + 1);                       \
            const TYPE *c2 = data + stride * (index ? index[k + 2] : k + 2),                       \
                       *c3 = data + stride * (index ? index[k + 3] : k + 3);                       \
            eits_real a0 = 0, a1 = 0, a2 = 0, a3 = 0;                                              \
            for (uint32_t i = 0; i < matrix->rows; ++i) {                                          \
                const eits_real w = v[i];                                                          \
                a0 = eits_fma(READ(c0[i]), w, a0);                                                 \
                a1 = eits_fma(READ(c1[i]), w, a1);                                                 \
                a2 = eits_fma(READ(c2[i]), w, a2);                                                 \
                a3 = eits_fma(READ(c3[i]), w, a3);                                                 \
            }                                                                                      \
            out[k] = a0, out[k + 1] = a1, out[k + 2] = a2, out[k + 3] = a3;                        \
        }                                                                                          \
        for (; k < count; ++k) {                                                                   \
            const TYPE *c = data + stride * (index ? index[k] : k);                                \
            eits_real a = 0;                                                                       \
            for (uint32_t i = 0; i < matrix->rows; ++i)                                            \
                a = eits_fma(READ(c[i]), v[i], a);                                                 \
            out[k] = a;                                                                            \
        }                                                                                          \
    }                                                                                              \
    static void NAME(dots_##TAG)(const eits_matrix *matrix, const uint32_t *index, uint32_t count, \
                                 const eits_real *v, eits_real *out)                               \
    {                                                                                              \
        const uint32_t rows = matrix->rows;                                                        \
        for (uint32_t k = 0; k < count; ++k) {                                                     \
            const TYPE *c = (const TYPE *)matrix->data + (size_t)matrix->stride * index[k];        \
            eits_real lane[8] = {0};                                                               \
            uint32_t i = 0;                                                                        \
            for (; i + 8 <= rows; i += 8) {                                                        \
                for (uint32_t l = 0; l < 8; ++l)                                                   \
                    lane[l] = eits_fma(READ(c[i + l]), v[i + l], lane[l]);                         \
            }                                                                                      \
            for (uint32_t l = 0; i + l < rows; ++l)                                                \
                lane[l] = eits_fma(READ(c[i + l]), v[i + l], lane[l]);                             \
            out[k] = eits_tree8(lane);                                                             \
        }                                                                                          \
    }

#define DEFINE_UNPACK(TAG, TYPE, READ)                                                    \
    static void NAME(unpack_##TAG)(const eits_matrix *matrix, size_t first, size_t count, \
                                   float *restrict out)                                   \
    {                                                                                     \
        const TYPE *restrict data = (const TYPE *)matrix->data + first;                   \
        for (size_t i = 0; i < count; ++i)                                                \
            out[i] = READ(data[i]);                                                       \
    }

#define READ_PLAIN(x) ((eits_real)(x))
#define READ_HALF(x)  ((eits_real)eits_half_to_float(x))
DEFINE_PRODUCTS(f32, float, READ_PLAIN)
DEFINE_PRODUCTS(f16, uint16_t, READ_HALF)
DEFINE_PRODUCTS(i16, int16_t, READ_PLAIN)
DEFINE_PRODUCTS(i8, int8_t, READ_PLAIN)
DEFINE_UNPACK(f32, float, )
DEFINE_UNPACK(f16, uint16_t, eits_half_to_float)
DEFINE_UNPACK(i16, int16_t, (float))
DEFINE_UNPACK(i8, int8_t, (float))
#undef READ_PLAIN
#undef READ_HALF
#undef DEFINE_PRODUCTS
#undef DEFINE_UNPACK
#endif

static void NAME(scale)(const eits_matrix *matrix, const uint32_t *index, uint32_t count,
                        eits_real *out)
{
    if (matrix->scale == NULL)
        return;
    for (uint32_t k = 0; k < count; ++k)
        out[k] *= (eits_real)matrix->scale[index == NULL ? k : index[k]];
}

#ifndef KERNELS_OWN_PRODUCTS
static void NAME(unpack)(const eits_matrix *matrix, size_t first, size_t count, float *out)
{
    switch (matrix->storage) {
    case EITS_STORAGE_F32:
        NAME(unpack_f32)(matrix, first, count, out);
        break;
    case EITS_STORAGE_F16:
        NAME(unpack_f16)(matrix, first, count, out);
        break;
    case EITS_STORAGE_I16:
        NAME(unpack_i16)(matrix, first, count, out);
        break;
    case EITS_STORAGE_I8:
        NAME(unpack_i8)(matrix, first, count, out);
        break;
    }
}

static void NAME(mul)(const eits_matrix *matrix, const uint32_t *index, const eits_real *value,
                      uint32_t count, eits_real *out)
{
    switch (matrix->storage) {
    case EITS_STORAGE_F32:
        NAME(mul_f32)(matrix, index, value, count, out);
        break;
    case EITS_STORAGE_F16:
        NAME(mul_f16)(matrix, index, value, count, out);
        break;
    case EITS_STORAGE_I16:
        NAME(mul_i16)(matrix, index, value, count, out);
        break;
    case EITS_STORAGE_I8:
        NAME(mul_i8)(matrix, index, value, count, out);
        break;
    }
}

static void NAME(mul_t)(const eits_matrix *matrix, const uint32_t *index, uint32_t count,
                        const eits_real *v, eits_real *out)
{
    switch (matrix->storage) {
    case EITS_STORAGE_F32:
        NAME(mul_t_f32)(matrix, index, count, v, out);
        break;
    case EITS_STORAGE_F16:
        NAME(mul_t_f16)(matrix, index, count, v, out);
        break;
    case EITS_STORAGE_I16:
        NAME(mul_t_i16)(matrix, index, count, v, out);
        break;
    case EITS_STORAGE_I8:
        NAME(mul_t_i8)(matrix, index, count, v, out);
        break;
    }
    NAME(scale)(matrix, index, count, out);
}

static void NAME(dots)(const eits_matrix *matrix, const uint32_t *index, uint32_t count,
                       const eits_real *v, eits_real *out)
{
    switch (matrix->storage) {
    case EITS_STORAGE_F32:
        NAME(dots_f32)(matrix, index, count, v, out);
        break;
    case EITS_STORAGE_F16:
        NAME(dots_f16)(matrix, index, count, v, out);
        break;
    case EITS_STORAGE_I16:
        NAME(dots_i16)(matrix, index, count, v, out);
        break;
    case EITS_STORAGE_I8:
        NAME(dots_i8)(matrix, index, count, v, out);
        break;
    }
    NAME(scale)(matrix, index, count, out);
}
#endif

static void NAME(mul_t_panels)(const eits_matrix *matrix, const eits_real *panels,
                               const uint32_t *index, uint32_t count, const eits_real *v,
                               eits_real *out)
{
    uint32_t j = 0;
#ifdef KERNELS_OWN_PANELS
    const size_t whole = (size_t)EITS_PANEL * matrix->rows;
    for (; j + 2 * EITS_PANEL <= count; j += 2 * EITS_PANEL)
        NAME(sum_two_panels)(panels + (size_t)j * matrix->rows,
                             panels + (size_t)j * matrix->rows + whole, v, matrix->rows, out + j);
#endif
    for (; j < count; j += EITS_PANEL) {
        const uint32_t lanes = count - j < EITS_PANEL ? count - j : EITS_PANEL;
        eits_real sum[EITS_PANEL];
        NAME(sum_panel)(panels + (size_t)j * matrix->rows, v, matrix->rows, sum);
        for (uint32_t l = 0; l < lanes; ++l)
            out[j + l] = sum[l];
    }
    NAME(scale)(matrix, index, count, out);
}

#ifndef KERNELS_OWN_VECTORS
static eits_real NAME(dot)(const eits_real *a, const eits_real *b, size_t count)
{
    eits_real lane[8] = {0};
    size_t i = 0;
    for (; i + 8 <= count; i += 8) {
        for (size_t l = 0; l < 8; ++l)
            lane[l] = eits_fma(a[i + l], b[i + l], lane[l]);
    }
    for (size_t l = 0; i + l < count; ++l)
        lane[l] = eits_fma(a[i + l], b[i + l], lane[l]);
    return eits_tree8(lane);
}

static void NAME(axpy)(eits_real *out, eits_real factor, const eits_real *a, size_t count)
{
    for (size_t i = 0; i < count; ++i)
        out[i] = eits_fma(factor, a[i], out[i]);
}

#endif

#ifndef KERNELS_OWN_NONZEROS
static uint32_t NAME(nonzeros)(const eits_real *a, uint32_t count, uint32_t *place,
                               eits_real *value)
{
    uint32_t found = 0;
    for (uint32_t j = 0; j < count; ++j) {
        place[found] = j;
        value[found] = a[j];
        found += a[j] != 0; /* no branch: it would often be mispredicted */
    }
    return found;
}
#endif

#ifndef KERNELS_OWN_GREATEST
/* Eight lanes are compared at a time: the greatest does not depend on the order. */
static eits_real NAME(maximum)(const eits_real *a, size_t count)
{
    eits_real lane[8] = {0};
    size_t i = 0;
    for (; i + 8 <= count; i += 8) {
        for (size_t l = 0; l < 8; ++l)
            lane[l] = a[i + l] > lane[l] ? a[i + l] : lane[l];
    }
    for (; i < count; ++i)
        lane[0] = a[i] > lane[0] ? a[i] : lane[0];
    for (size_t l = 1; l < 8; ++l)
        lane[0] = lane[l] > lane[0] ? lane[l] : lane[0];
    return lane[0];
}

static eits_real NAME(minimum)(const eits_real *a, size_t count)
{
    eits_real lane[8] = {0};
    size_t i = 0;
    for (; i + 8 <= count; i += 8) {
        for (size_t l = 0; l < 8; ++l)
            lane[l] = a[i + l] < lane[l] ? a[i + l] : lane[l];
    }
    for (; i < count; ++i)
        lane[0] = a[i] < lane[0] ? a[i] : lane[0];
    for (size_t l = 1; l < 8; ++l)
        lane[0] = lane[l] < lane[0] ? lane[l] : lane[0];
    return lane[0];
}

static eits_real NAME(greatest)(const eits_real *a, size_t count, eits_sign sign)
{
    const eits_real high = sign != EITS_SIGN_DECREASE ? NAME(maximum)(a, count) : 0;
    const eits_real low = sign != EITS_SIGN_INCREASE ? -NAME(minimum)(a, count) : 0;
    return low > high ? low : high;
}
#endif

static void NAME(extrapolate)(eits_real *restrict out, eits_real factor,
                              const eits_real *restrict a, const eits_real *restrict b,
                              size_t count)
{
    for (size_t i = 0; i < count; ++i)
        out[i] = eits_fma(factor, a[i] - b[i], a[i]);
}

#ifndef KERNELS_OWN_ROWS
static void NAME(rows_dot)(const eits_real *rows, size_t stride, uint32_t count, size_t length,
                           const eits_real *v, eits_real *out)
{
    for (uint32_t k = 0; k < count; ++k)
        out[k] = NAME(dot)(rows + stride * k, v, length);
}

static void NAME(rows_add)(const eits_real *rows, size_t stride, uint32_t count, size_t length,
                           const eits_real *value, eits_real *out)
{
    for (uint32_t k = 0; k < count; ++k)
        NAME(axpy)(out, value[k], rows + stride * k, length);
}
#endif

#ifndef KERNELS_OWN_PROX
/* The proximal step of threshold |x|_1: at least one of `up` and `down` is zero. v - v is zero, or
 * NaN if v is not finite: a run that overflows must not end as a zero. */
static void NAME(prox)(const eits_prox *how, uint32_t n, const eits_real *restrict gradient,
                       const eits_real *restrict x, eits_real *restrict next, eits_real *restrict z)
{
    const eits_real step = how->step, t = how->threshold, beta = how->beta;
    const int allow_up = how->sign != EITS_SIGN_DECREASE,
              allow_down = how->sign != EITS_SIGN_INCREASE;
    for (uint32_t j = 0; j < n; ++j) {
        const eits_real v = eits_fma(step, gradient[j], z[j]);
        const eits_real up = allow_up && v > t ? v - t : 0, down = allow_down && v < -t ? v + t : 0;
        const eits_real moved = up + down + (v - v);
        next[j] = moved;
        z[j] = eits_fma(beta, moved - x[j], moved);
    }
}
#endif

#define KERNELS_TABLE(TEXT)              \
    {.name = TEXT,                       \
     .mul = NAME(mul),                   \
     .mul_t = NAME(mul_t),               \
     .mul_t_panels = NAME(mul_t_panels), \
     .dots = NAME(dots),                 \
     .rows_dot = NAME(rows_dot),         \
     .rows_add = NAME(rows_add),         \
     .unpack = NAME(unpack),             \
     .dot = NAME(dot),                   \
     .axpy = NAME(axpy),                 \
     .extrapolate = NAME(extrapolate),   \
     .nonzeros = NAME(nonzeros),         \
     .greatest = NAME(greatest),         \
     .prox = NAME(prox)}
