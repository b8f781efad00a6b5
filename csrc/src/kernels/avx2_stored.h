/* This part of avx2.c has the products with each storage type: S x, S'v by chains, and the
 * conversion to floats. S'v reads LANES columns and transposes LANES x LANES numbers in registers,
 * so that each lane is the chain of one column. */

/* These functions read four stored numbers as floats. Every conversion is exact. */
static inline __m128 four_f32(const float *from)
{
    return _mm_loadu_ps(from);
}

static inline __m128 four_f16(const uint16_t *from)
{
    return _mm_cvtph_ps(_mm_loadl_epi64((const __m128i *)(const void *)from));
}

static inline __m128 four_i16(const int16_t *from)
{
    return _mm_cvtepi32_ps(
        _mm_cvtepi16_epi32(_mm_loadl_epi64((const __m128i *)(const void *)from)));
}

static inline __m128 four_i8(const int8_t *from)
{
    int32_t bytes;
    memcpy(&bytes, from, sizeof bytes);
    return _mm_cvtepi32_ps(_mm_cvtepi8_epi32(_mm_cvtsi32_si128(bytes)));
}

#ifdef EITS_DOUBLE

enum { FLOATS = 1 };
#define STORE_FLOATS   _mm_storeu_ps
#define FLOATS_OF(TAG) four_##TAG
#define DEFINE_LANES(TAG, TYPE)                                                                   \
    static inline vector lanes_##TAG(const TYPE *from)                                            \
    {                                                                                             \
        return _mm256_cvtps_pd(four_##TAG(from));                                                 \
    }                                                                                             \
    /* row[i]: number i of four columns, a lane each */                                           \
    static inline void transpose_##TAG(const TYPE *const column[], size_t at, vector row[])       \
    {                                                                                             \
        const vector c0 = lanes_##TAG(column[0] + at), c1 = lanes_##TAG(column[1] + at);          \
        const vector c2 = lanes_##TAG(column[2] + at), c3 = lanes_##TAG(column[3] + at);          \
        const vector a = _mm256_unpacklo_pd(c0, c1), b = _mm256_unpackhi_pd(c0, c1);              \
        const vector c = _mm256_unpacklo_pd(c2, c3), d = _mm256_unpackhi_pd(c2, c3);              \
        row[0] = _mm256_permute2f128_pd(a, c, 0x20), row[1] = _mm256_permute2f128_pd(b, d, 0x20); \
        row[2] = _mm256_permute2f128_pd(a, c, 0x31), row[3] = _mm256_permute2f128_pd(b, d, 0x31); \
    }

#else

enum { FLOATS = 2 };
#define STORE_FLOATS   _mm256_storeu_ps
#define FLOATS_OF(TAG) lanes_##TAG

static inline __m256 lanes_f32(const float *from)
{
    return _mm256_loadu_ps(from);
}

static inline __m256 lanes_f16(const uint16_t *from)
{
    return _mm256_cvtph_ps(_mm_loadu_si128((const __m128i *)(const void *)from));
}

static inline __m256 lanes_i16(const int16_t *from)
{
    return _mm256_cvtepi32_ps(
        _mm256_cvtepi16_epi32(_mm_loadu_si128((const __m128i *)(const void *)from)));
}

static inline __m256 lanes_i8(const int8_t *from)
{
    return _mm256_cvtepi32_ps(
        _mm256_cvtepi8_epi32(_mm_loadl_epi64((const __m128i *)(const void *)from)));
}

/* Make four rows from four registers, each of which has four numbers of a column in either half.
 * Blends are cheaper than shuffles. */
static inline void four_rows(const vector c[4], vector row[4])
{
    const vector a = _mm256_unpacklo_ps(c[0], c[1]), b = _mm256_unpackhi_ps(c[0], c[1]);
    const vector d = _mm256_unpacklo_ps(c[2], c[3]), e = _mm256_unpackhi_ps(c[2], c[3]);
    const vector ad = _mm256_shuffle_ps(a, d, 0x4E), be = _mm256_shuffle_ps(b, e, 0x4E);
    row[0] = _mm256_blend_ps(a, ad, 0xCC), row[1] = _mm256_blend_ps(ad, d, 0xCC);
    row[2] = _mm256_blend_ps(b, be, 0xCC), row[3] = _mm256_blend_ps(be, e, 0xCC);
}

#define DEFINE_LANES(TAG, TYPE)                                                                \
    /* row[i]: number i of eight columns, a lane each; whole columns of eight are converted at \
     * once */                                                                                 \
    static inline void transpose_##TAG(const TYPE *const column[], size_t at, vector row[])    \
    {                                                                                          \
        vector low[4], high[4];                                                                \
        for (int l = 0; l < 4; ++l) {                                                          \
            const vector c = lanes_##TAG(column[l] + at), d = lanes_##TAG(column[l + 4] + at); \
            low[l] = _mm256_permute2f128_ps(c, d, 0x20),                                       \
            high[l] = _mm256_permute2f128_ps(c, d, 0x31);                                      \
        }                                                                                      \
        four_rows(low, row);                                                                   \
        four_rows(high, row + 4);                                                              \
    }

#endif

/* mul_t reads this many groups of LANES columns at a time: so many chains hide the latency of one
 */
enum { GROUPS = 3 };

#define DEFINE_PRODUCTS(TAG, TYPE)                                                                 \
    DEFINE_LANES(TAG, TYPE)                                                                        \
    static void unpack_##TAG(const eits_matrix *matrix, size_t first, size_t count, float *out)    \
    {                                                                                              \
        const TYPE *data = (const TYPE *)matrix->data + first;                                     \
        for (size_t i = 0; i < count; i += 4 * FLOATS)                                             \
            STORE_FLOATS(out + i, FLOATS_OF(TAG)(data + i));                                       \
    }                                                                                              \
    /* `width` vectors of the sum stay in registers while the columns pass */                      \
    __attribute__((always_inline)) static inline void rows_##TAG(                                  \
        const TYPE *data, size_t stride, const uint32_t *index, const eits_real *value,            \
        uint32_t count, eits_real *out, const int width)                                           \
    {                                                                                              \
        vector sum[8];                                                                             \
        for (int w = 0; w < width; ++w)                                                            \
            sum[w] = ZERO();                                                                       \
        for (uint32_t k = 0; k < count; ++k) {                                                     \
            const TYPE *c = data + stride * index[k];                                              \
            const vector v = SET1(value[k]);                                                       \
            for (int w = 0; w < width; ++w)                                                        \
                sum[w] = FMA(lanes_##TAG(c + w * LANES), v, sum[w]);                               \
        }                                                                                          \
        for (int w = 0; w < width; ++w)                                                            \
            STORE(out + w * LANES, sum[w]);                                                        \
    }                                                                                              \
    static void mul_##TAG(const eits_matrix *matrix, const uint32_t *index,                        \
                          const eits_real *value, uint32_t count, eits_real *out)                  \
    {                                                                                              \
        const TYPE *data = matrix->data;                                                           \
        const size_t stride = matrix->stride;                                                      \
        size_t row = 0;                                                                            \
        for (; row + 8 * LANES <= stride; row += 8 * LANES)                                        \
            rows_##TAG(data + row, stride, index, value, count, out + row, 8);                     \
        for (; row + 4 * LANES <= stride; row += 4 * LANES)                                        \
            rows_##TAG(data + row, stride, index, value, count, out + row, 4);                     \
        for (; row < stride; row += 8)                                                             \
            rows_##TAG(data + row, stride, index, value, count, out + row, 8 / LANES);             \
    }                                                                                              \
    /* sum_l = the chain over the first `whole` rows of column l, of `groups` times LANES columns  \
     */                                                                                            \
    static inline void chains_##TAG(const TYPE *const column[], uint32_t whole,                    \
                                    const eits_real *v, eits_real *sum, const int groups)          \
    {                                                                                              \
        vector lane[GROUPS];                                                                       \
        for (int g = 0; g < groups; ++g)                                                           \
            lane[g] = ZERO();                                                                      \
        for (uint32_t i = 0; i < whole; i += LANES) {                                              \
            for (int g = 0; g < groups; ++g) {                                                     \
                vector row[LANES];                                                                 \
                transpose_##TAG(column + g * LANES, i, row);                                       \
                for (uint32_t r = 0; r < LANES; ++r)                                               \
                    lane[g] = FMA(row[r], SET1(v[i + r]), lane[g]);                                \
            }                                                                                      \
        }                                                                                          \
        for (int g = 0; g < groups; ++g)                                                           \
            STORE(sum + g * LANES, lane[g]);                                                       \
    }                                                                                              \
    static void mul_t_##TAG(const eits_matrix *matrix, const uint32_t *index, uint32_t count,      \
                            const eits_real *v, eits_real *out)                                    \
    {                                                                                              \
        const TYPE *data = matrix->data;                                                           \
        const uint32_t rows = matrix->rows, whole = rows / 8 * 8;                                  \
        for (uint32_t k = 0; k < count;) {                                                         \
            const TYPE *column[GROUPS * LANES];                                                    \
            eits_real sum[GROUPS * LANES];                                                         \
            const uint32_t width = count - k >= GROUPS * LANES ? GROUPS * LANES : LANES;           \
            const uint32_t taken = count - k < width ? count - k : width;                          \
            for (uint32_t l = 0; l < width; ++l) { /* lanes to spare take the last column again */ \
                const uint32_t at = l < taken ? k + l : count - 1;                                 \
                column[l] = data + (size_t)matrix->stride * (index != NULL ? index[at] : at);      \
            }                                                                                      \
            if (width > LANES)                                                                     \
                chains_##TAG(column, whole, v, sum, GROUPS);                                       \
            else                                                                                   \
                chains_##TAG(column, whole, v, sum, 1);                                            \
            for (uint32_t i = whole; i < rows; ++i) {                                              \
                for (uint32_t l = 0; l < taken; ++l) {                                             \
                    float number[8]; /* a column is padded to a multiple of eight */               \
                    _mm_storeu_ps(number, four_##TAG(column[l] + whole));                          \
                    _mm_storeu_ps(number + 4, four_##TAG(column[l] + whole + 4));                  \
                    sum[l] = eits_fma((eits_real)number[i - whole], v[i], sum[l]);                 \
                }                                                                                  \
            }                                                                                      \
            memcpy(out + k, sum, taken * sizeof *sum);                                             \
            k += taken;                                                                            \
        }                                                                                          \
    }

DEFINE_PRODUCTS(f32, float)
DEFINE_PRODUCTS(f16, uint16_t)
DEFINE_PRODUCTS(i16, int16_t)
DEFINE_PRODUCTS(i8, int8_t)
