/* The matrix products for x86-64 with AVX2 and FMA; this file alone is compiled with -mavx2 -mfma
 * -mf16c, and runs only where the processor has them (eits_kernels_best).
 *
 * The results have the same bits as the portable build's. That decides the design: a chain of the
 * specification is one lane of a register, so vectors run across columns (S'v) or across rows (S
 * x), never along a sum. Columns that are stored one after the other are transposed in registers
 * for that, eight at a time (avx2_stored.h); panels hold them transposed already.
 *
 * An FMA takes four to five cycles and two can start in each, so eight to ten independent sums are
 * needed to keep both units busy. Two panels are therefore read at a time.
 *
 * The same source serves float and double: `vector`, LANES and the macros below stand for either
 * width. */
#define NAME(x) avx2_##x

#include "base/vec.h"
#include "kernels/kernels.h"

#include <immintrin.h>

/* Unaligned loads are used since a caller's frame may lie at any address; they cost nothing extra
 * when the address happens to be aligned. */
#ifdef EITS_DOUBLE
enum { LANES = 4 };
typedef __m256d vector;
#define LOAD                   _mm256_loadu_pd
#define STORE                  _mm256_storeu_pd
#define SET1                   _mm256_set1_pd
#define FMA                    _mm256_fmadd_pd
#define ZERO                   _mm256_setzero_pd
#define LOAD_WHERE(FROM, MASK) _mm256_maskload_pd(FROM, _mm256_castpd_si256(MASK))
#define CHOOSE                 _mm256_blendv_pd
typedef int64_t whole_number; /* has the width of eits_real */
#else
enum { LANES = 8 };
typedef __m256 vector;
#define LOAD                   _mm256_loadu_ps
#define STORE                  _mm256_storeu_ps
#define SET1                   _mm256_set1_ps
#define FMA                    _mm256_fmadd_ps
#define ZERO                   _mm256_setzero_ps
#define LOAD_WHERE(FROM, MASK) _mm256_maskload_ps(FROM, _mm256_castps_si256(MASK))
#define CHOOSE                 _mm256_blendv_ps
typedef int32_t whole_number; /* has the width of eits_real */
#endif

enum { VECTORS = (int)EITS_PANEL / LANES };

static void avx2_sum_panel(const eits_real *panel, const eits_real *v, uint32_t rows,
                           eits_real *sum)
{
    vector lane[VECTORS];
    for (int k = 0; k < VECTORS; ++k)
        lane[k] = ZERO();
    for (uint32_t i = 0; i < rows; ++i) {
        const vector w = SET1(v[i]);
        for (int k = 0; k < VECTORS; ++k)
            lane[k] = FMA(LOAD(panel + (size_t)i * EITS_PANEL + (size_t)(k * LANES)), w, lane[k]);
    }
    for (int k = 0; k < VECTORS; ++k)
        STORE(sum + k * LANES, lane[k]);
}

/* Two float panels give eight chains, which hide the latency that the four chains of one panel do
 * not. One double panel has eight already, and they fill the registers. */
#ifndef EITS_DOUBLE
static void avx2_sum_two_panels(const eits_real *panel, const eits_real *other, const eits_real *v,
                                uint32_t rows, eits_real *sum)
{
    vector lane[2 * VECTORS];
    for (int k = 0; k < 2 * VECTORS; ++k)
        lane[k] = ZERO();
    for (uint32_t i = 0; i < rows; ++i) {
        const vector w = SET1(v[i]);
        for (int k = 0; k < VECTORS; ++k)
            lane[k] = FMA(LOAD(panel + (size_t)i * EITS_PANEL + (size_t)(k * LANES)), w, lane[k]);
        for (int k = 0; k < VECTORS; ++k)
            lane[VECTORS + k] = FMA(LOAD(other + (size_t)i * EITS_PANEL + (size_t)(k * LANES)), w,
                                    lane[VECTORS + k]);
    }
    for (int k = 0; k < 2 * VECTORS; ++k)
        STORE(sum + k * LANES, lane[k]);
}

#define KERNELS_OWN_PANELS
#endif

#define KERNELS_OWN_PRODUCTS
#define KERNELS_OWN_ROWS
#define KERNELS_OWN_GREATEST
#ifndef EITS_DOUBLE
#define KERNELS_OWN_NONZEROS
#endif
#define KERNELS_OWN_PROX
#include "kernels/body.h"

#ifdef EITS_DOUBLE
#define ADD              _mm256_add_pd
#define SUB              _mm256_sub_pd
#define AND              _mm256_and_pd
#define ANDNOT           _mm256_andnot_pd
#define XOR              _mm256_xor_pd
#define MAX              _mm256_max_pd
#define WHERE(A, HOW, B) _mm256_cmp_pd(A, B, HOW)
#define EVERYWHERE       _mm256_castsi256_pd(_mm256_set1_epi32(-1))
#else
#define ADD              _mm256_add_ps
#define SUB              _mm256_sub_ps
#define AND              _mm256_and_ps
#define ANDNOT           _mm256_andnot_ps
#define XOR              _mm256_xor_ps
#define MAX              _mm256_max_ps
#define WHERE(A, HOW, B) _mm256_cmp_ps(A, B, HOW)
#define EVERYWHERE       _mm256_castsi256_ps(_mm256_set1_epi32(-1))
#endif

#include "kernels/avx2_stored.h"

#include "kernels/avx2_dots.h" /* uses the lanes of avx2_stored.h */

/* These switches have no default, so that the compiler reports a storage type that is missing. */
static void avx2_mul(const eits_matrix *matrix, const uint32_t *index, const eits_real *value,
                     uint32_t count, eits_real *out)
{
    switch (matrix->storage) {
    case EITS_STORAGE_F32:
        mul_f32(matrix, index, value, count, out);
        break;
    case EITS_STORAGE_F16:
        mul_f16(matrix, index, value, count, out);
        break;
    case EITS_STORAGE_I16:
        mul_i16(matrix, index, value, count, out);
        break;
    case EITS_STORAGE_I8:
        mul_i8(matrix, index, value, count, out);
        break;
    }
}

static void avx2_mul_t(const eits_matrix *matrix, const uint32_t *index, uint32_t count,
                       const eits_real *v, eits_real *out)
{
    switch (matrix->storage) {
    case EITS_STORAGE_F32:
        mul_t_f32(matrix, index, count, v, out);
        break;
    case EITS_STORAGE_F16:
        mul_t_f16(matrix, index, count, v, out);
        break;
    case EITS_STORAGE_I16:
        mul_t_i16(matrix, index, count, v, out);
        break;
    case EITS_STORAGE_I8:
        mul_t_i8(matrix, index, count, v, out);
        break;
    }
    avx2_scale(matrix, index, count, out);
}

static void avx2_dots(const eits_matrix *matrix, const uint32_t *index, uint32_t count,
                      const eits_real *v, eits_real *out)
{
    switch (matrix->storage) {
    case EITS_STORAGE_F32:
        dots_f32(matrix, index, count, v, out);
        break;
    case EITS_STORAGE_F16:
        dots_f16(matrix, index, count, v, out);
        break;
    case EITS_STORAGE_I16:
        dots_i16(matrix, index, count, v, out);
        break;
    case EITS_STORAGE_I8:
        dots_i8(matrix, index, count, v, out);
        break;
    }
    avx2_scale(matrix, index, count, out);
}

static void avx2_unpack(const eits_matrix *matrix, size_t first, size_t count, float *out)
{
    switch (matrix->storage) {
    case EITS_STORAGE_F32:
        unpack_f32(matrix, first, count, out);
        break;
    case EITS_STORAGE_F16:
        unpack_f16(matrix, first, count, out);
        break;
    case EITS_STORAGE_I16:
        unpack_i16(matrix, first, count, out);
        break;
    case EITS_STORAGE_I8:
        unpack_i8(matrix, first, count, out);
        break;
    }
}

/* Each lane does the same operations in the same order as kernels/body.h. Masks replace the
 * branches: a lane that is not above its threshold gets zero by AND. SUB(v, v) is zero, or NaN if v
 * is not finite. */
static void avx2_prox(const eits_prox *how, uint32_t n, const eits_real *restrict gradient,
                      const eits_real *restrict x, eits_real *restrict next, eits_real *restrict z)
{
    const eits_real step = how->step, t = how->threshold, beta = how->beta;
    const int allow_up = how->sign != EITS_SIGN_DECREASE,
              allow_down = how->sign != EITS_SIGN_INCREASE;
    const vector steps = SET1(step), high = SET1(t), low = SET1(-t), betas = SET1(beta);
    const vector up_mask = allow_up ? EVERYWHERE : ZERO(),
                 down_mask = allow_down ? EVERYWHERE : ZERO();
    uint32_t j = 0;
    for (; j + LANES <= n; j += LANES) {
        const vector v = FMA(steps, LOAD(gradient + j), LOAD(z + j));
        const vector up = AND(AND(WHERE(v, _CMP_GT_OQ, high), up_mask), SUB(v, high));
        const vector down = AND(AND(WHERE(v, _CMP_LT_OQ, low), down_mask), ADD(v, high));
        const vector moved = ADD(ADD(up, down), SUB(v, v));
        STORE(next + j, moved);
        STORE(z + j, FMA(betas, SUB(moved, LOAD(x + j)), moved));
    }
    /* Fewer numbers than a vector are left. They are computed one by one, by the same operations
     * and so with the same bits. */
    for (; j < n; ++j) {
        const eits_real v = eits_fma(step, gradient[j], z[j]);
        const eits_real up = allow_up && v > t ? v - t : 0, down = allow_down && v < -t ? v + t : 0;
        const eits_real moved = up + down + (v - v);
        next[j] = moved;
        z[j] = eits_fma(beta, moved - x[j], moved);
    }
}

extern const eits_kernels eits_kernels_avx2;
const eits_kernels eits_kernels_avx2 = KERNELS_TABLE("avx2");
