/* Part of kernels_avx2.c: products with each storage type, S x, S'v by chains and to floats. */

/* Four stored numbers as floats: every conversion is exact. */
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
    return _mm_cvtepi32_ps(_mm_cvtepi16_epi32(_mm_loadl_epi64((const __m128i *)(const void *)from)));
}

static inline __m128 four_i8(const int8_t *from)
{
    int32_t bytes;
    memcpy(&bytes, from, sizeof bytes);
    return _mm_cvtepi32_ps(_mm_cvtepi8_epi32(_mm_cvtsi32_si128(bytes)));
}

#ifdef EITS_DOUBLE

enum { FLOATS = 1 };
#define STORE_FLOATS _mm_storeu_ps
#define FLOATS_OF(TAG) four_##TAG
#define DEFINE_LANES(TAG, TYPE)                                                                                            \
    static inline vector lanes_##TAG(const TYPE *from)                                                                    \
    {                                                                                                                      \
        return _mm256_cvtps_pd(four_##TAG(from));                                                                          \
    }                                                                                                                      \
    /* row[i]: number i of four columns, a lane each */                                                                    \
    static inline void transpose_##TAG(const TYPE *const column[], size_t at, vector row[])                               \
    {                                                                                                                      \
        const vector c0 = lanes_##TAG(column[0] + at), c1 = lanes_##TAG(column[1] + at);                                   \
        const vector c2 = lanes_##TAG(column[2] + at), c3 = lanes_##TAG(column[3] + at);                                   \
        const vector a = _mm256_unpacklo_pd(c0, c1), b = _mm256_unpackhi_pd(c0, c1);                                       \
        const vector c = _mm256_unpacklo_pd(c2, c3), d = _mm256_unpackhi_pd(c2, c3);                                       \
        row[0] = _mm256_permute2f128_pd(a, c, 0x20), row[1] = _mm256_permute2f128_pd(b, d, 0x20);                          \
        row[2] = _mm256_permute2f128_pd(a, c, 0x31), row[3] = _mm256_permute2f128_pd(b, d, 0x31);                          \
    }

#else

enum { FLOATS = 2 };
#define STORE_FLOATS _mm256_storeu_ps
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
    return _mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(_mm_loadu_si128((const __m128i *)(const void *)from)));
}

static inline __m256 lanes_i8(const int8_t *from)
{
    return _mm256_cvtepi32_ps(_mm256_cvtepi8_epi32(_mm_loadl_epi64((const __m128i *)(const void *)from)));
}

#define DEFINE_LANES(TAG, TYPE)                                                                                            \
    /* row[i]: number i of eight columns, a lane each; column l and l + 4 share a register, so that lanes need not cross */ \
    static inline void transpose_##TAG(const TYPE *const column[], size_t at, vector row[])                               \
    {                                                                                                                      \
        vector c[4];                                                                                                       \
        for (int l = 0; l < 4; ++l)                                                                                        \
            c[l] = _mm256_insertf128_ps(_mm256_castps128_ps256(four_##TAG(column[l] + at)), four_##TAG(column[l + 4] + at), 1); \
        const vector a = _mm256_unpacklo_ps(c[0], c[1]), b = _mm256_unpackhi_ps(c[0], c[1]);                               \
        const vector d = _mm256_unpacklo_ps(c[2], c[3]), e = _mm256_unpackhi_ps(c[2], c[3]);                               \
        const vector ad = _mm256_shuffle_ps(a, d, 0x4E), be = _mm256_shuffle_ps(b, e, 0x4E); /* blends are cheaper */      \
        row[0] = _mm256_blend_ps(a, ad, 0xCC), row[1] = _mm256_blend_ps(ad, d, 0xCC);                                      \
        row[2] = _mm256_blend_ps(b, be, 0xCC), row[3] = _mm256_blend_ps(be, e, 0xCC);                                      \
    }

#endif

enum { GROUPS = 4 }; /* of LANES columns at a time in mul_t: so many chains hide the latency of one */

#define DEFINE_PRODUCTS(TAG, TYPE)                                                                                         \
    DEFINE_LANES(TAG, TYPE)                                                                                                \
    static void unpack_##TAG(const eits_matrix *matrix, size_t first, size_t count, float *out)                           \
    {                                                                                                                      \
        const TYPE *data = (const TYPE *)matrix->data + first;                                                             \
        for (size_t i = 0; i < count; i += 4 * FLOATS)                                                                     \
            STORE_FLOATS(out + i, FLOATS_OF(TAG)(data + i));                                                               \
    }                                                                                                                      \
    /* `width` vectors of the sum stay in registers while the columns pass */                                             \
    __attribute__((always_inline)) static inline void rows_##TAG(const TYPE *data, size_t stride, const uint32_t *index,  \
                                                                 const eits_real *value, uint32_t count, eits_real *out,  \
                                                                 const int width)                                          \
    {                                                                                                                      \
        vector sum[8];                                                                                                     \
        for (int w = 0; w < width; ++w)                                                                                    \
            sum[w] = ZERO();                                                                                               \
        for (uint32_t k = 0; k < count; ++k) {                                                                             \
            const TYPE *c = data + stride * index[k];                                                                      \
            const vector v = SET1(value[k]);                                                                               \
            for (int w = 0; w < width; ++w)                                                                                \
                sum[w] = FMA(lanes_##TAG(c + w * LANES), v, sum[w]);                                                       \
        }                                                                                                                  \
        for (int w = 0; w < width; ++w)                                                                                    \
            STORE(out + w * LANES, sum[w]);                                                                                \
    }                                                                                                                      \
    static void mul_##TAG(const eits_matrix *matrix, const uint32_t *index, const eits_real *value, uint32_t count,       \
                          eits_real *out)                                                                                  \
    {                                                                                                                      \
        const TYPE *data = matrix->data;                                                                                   \
        const size_t stride = matrix->stride;                                                                              \
        size_t row = 0;                                                                                                    \
        for (; row + 8 * LANES <= stride; row += 8 * LANES)                                                                \
            rows_##TAG(data + row, stride, index, value, count, out + row, 8);                                             \
        for (; row + 4 * LANES <= stride; row += 4 * LANES)                                                                \
            rows_##TAG(data + row, stride, index, value, count, out + row, 4);                                             \
        for (; row < stride; row += 8)                                                                                     \
            rows_##TAG(data + row, stride, index, value, count, out + row, 8 / LANES);                                     \
    }                                                                                                                      \
    static void mul_t_##TAG(const eits_matrix *matrix, const uint32_t *index, uint32_t count, const eits_real *v,         \
                            eits_real *out)                                                                                \
    {                                                                                                                      \
        const TYPE *data = matrix->data;                                                                                   \
        const uint32_t rows = matrix->rows, whole = rows / 8 * 8;                                                          \
        for (uint32_t k = 0; k < count; k += GROUPS * LANES) {                                                             \
            const TYPE *column[GROUPS * LANES];                                                                            \
            eits_real sum[GROUPS * LANES];                                                                                 \
            vector lane[GROUPS];                                                                                           \
            const uint32_t taken = count - k < GROUPS * LANES ? count - k : GROUPS * LANES;                                \
            const int groups = (int)((taken + LANES - 1) / LANES);                                                         \
            for (uint32_t l = 0; l < GROUPS * LANES; ++l) { /* lanes to spare take the last column again */                \
                const uint32_t at = l < taken ? k + l : count - 1;                                                         \
                column[l] = data + (size_t)matrix->stride * (index != NULL ? index[at] : at);                              \
            }                                                                                                              \
            for (int g = 0; g < GROUPS; ++g)                                                                               \
                lane[g] = ZERO();                                                                                          \
            for (uint32_t i = 0; i < whole; i += 8) {                                                                      \
                for (int g = 0; g < groups; ++g) {                                                                         \
                    const TYPE *from[LANES];                                                                               \
                    vector row[4];                                                                                         \
                    for (int l = 0; l < LANES; ++l)                                                                        \
                        from[l] = column[g * LANES + l];                                                                   \
                    transpose_##TAG(from, i, row);                                                                         \
                    for (uint32_t r = 0; r < 4; ++r)                                                                       \
                        lane[g] = FMA(row[r], SET1(v[i + r]), lane[g]);                                                    \
                    transpose_##TAG(from, i + 4, row);                                                                     \
                    for (uint32_t r = 0; r < 4; ++r)                                                                       \
                        lane[g] = FMA(row[r], SET1(v[i + 4 + r]), lane[g]);                                                \
                }                                                                                                          \
            }                                                                                                              \
            for (int g = 0; g < GROUPS; ++g)                                                                               \
                STORE(sum + g * LANES, lane[g]);                                                                           \
            for (uint32_t i = whole; i < rows; ++i) {                                                                      \
                for (uint32_t l = 0; l < taken; ++l) {                                                                     \
                    float number[8]; /* a column is padded to a multiple of eight */                                       \
                    _mm_storeu_ps(number, four_##TAG(column[l] + whole));                                                  \
                    _mm_storeu_ps(number + 4, four_##TAG(column[l] + whole + 4));                                          \
                    sum[l] = eits_fma((eits_real)number[i - whole], v[i], sum[l]);                                         \
                }                                                                                                          \
            }                                                                                                              \
            memcpy(out + k, sum, taken * sizeof *sum);                                                                     \
        }                                                                                                                  \
    }

DEFINE_PRODUCTS(f32, float)
DEFINE_PRODUCTS(f16, uint16_t)
DEFINE_PRODUCTS(i16, int16_t)
DEFINE_PRODUCTS(i8, int8_t)
