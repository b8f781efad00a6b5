/* This part of avx2.c has the products by eight lanes and a tree, the greatest of many numbers and
 * the list of the non-zero ones. Eight lanes are one float register or two double ones: a column is
 * read in order without a transpose, and the trees of four columns are added together. */

/* out = the trees of four columns' eight lanes each, in the order of eits_tree8. */
static inline void four_trees(vector lanes[4][8 / LANES], eits_real *out)
{
#ifdef EITS_DOUBLE
    for (int k = 0; k < 4; ++k) {
        const __m256d four = _mm256_add_pd(lanes[k][0], lanes[k][1]);
        const __m128d two =
            _mm_add_pd(_mm256_castpd256_pd128(four), _mm256_extractf128_pd(four, 1));
        out[k] = _mm_cvtsd_f64(_mm_add_sd(two, _mm_unpackhi_pd(two, two)));
    }
#else
    __m128 four[4];
    for (int k = 0; k < 4; ++k)
        four[k] =
            _mm_add_ps(_mm256_castps256_ps128(lanes[k][0]), _mm256_extractf128_ps(lanes[k][0], 1));
    const __m128 a =
        _mm_add_ps(_mm_unpacklo_ps(four[0], four[1]), _mm_unpackhi_ps(four[0], four[1]));
    const __m128 b =
        _mm_add_ps(_mm_unpacklo_ps(four[2], four[3]), _mm_unpackhi_ps(four[2], four[3]));
    _mm_storeu_ps(out, _mm_add_ps(_mm_movelh_ps(a, b), _mm_movehl_ps(b, a)));
#endif
}

/* Four columns are read at a time. If fewer are left, the last one is read again in the spare
 * lanes. `rest` marks the lanes of the numbers beyond the last multiple of eight. */
#define DEFINE_DOTS(TAG, TYPE)                                                                  \
    static void dots_##TAG(const eits_matrix *matrix, const uint32_t *index, uint32_t count,    \
                           const eits_real *v, eits_real *out)                                  \
    {                                                                                           \
        const TYPE *data = matrix->data;                                                        \
        const size_t stride = matrix->stride, whole = matrix->rows / 8 * 8;                     \
        whole_number mask[8] = {0};                                                             \
        vector rest[8 / LANES];                                                                 \
        for (uint32_t l = 0; l < matrix->rows % 8; ++l)                                         \
            mask[l] = -1;                                                                       \
        for (int w = 0; w < 8 / LANES; ++w)                                                     \
            rest[w] = LOAD((const eits_real *)(const void *)(mask + w * LANES));                \
        for (uint32_t k = 0; k < count; k += 4) {                                               \
            const uint32_t last = count - k - 1 < 3 ? count - k - 1 : 3;                        \
            const TYPE *c0 = data + stride * index[k],                                          \
                       *c1 = data + stride * index[k + (last < 1 ? last : 1)];                  \
            const TYPE *c2 = data + stride * index[k + (last < 2 ? last : 2)],                  \
                       *c3 = data + stride * index[k + last];                                   \
            vector lanes[4][8 / LANES];                                                         \
            for (int w = 0; w < 8 / LANES; ++w)                                                 \
                lanes[0][w] = lanes[1][w] = lanes[2][w] = lanes[3][w] = ZERO();                 \
            for (size_t i = 0; i < whole; i += 8) {                                             \
                for (int w = 0; w < 8 / LANES; ++w) {                                           \
                    const size_t at = i + (size_t)(w * LANES);                                  \
                    const vector some = LOAD(v + at);                                           \
                    lanes[0][w] = FMA(lanes_##TAG(c0 + at), some, lanes[0][w]);                 \
                    lanes[1][w] = FMA(lanes_##TAG(c1 + at), some, lanes[1][w]);                 \
                    lanes[2][w] = FMA(lanes_##TAG(c2 + at), some, lanes[2][w]);                 \
                    lanes[3][w] = FMA(lanes_##TAG(c3 + at), some, lanes[3][w]);                 \
                }                                                                               \
            }                                                                                   \
            for (int w = 0; whole < matrix->rows && w < 8 / LANES;                              \
                 ++w) { /* a column is padded to a multiple of eight */                         \
                const size_t at = whole + (size_t)(w * LANES);                                  \
                const vector some = LOAD_WHERE(v + at, rest[w]);                                \
                lanes[0][w] =                                                                   \
                    CHOOSE(lanes[0][w], FMA(lanes_##TAG(c0 + at), some, lanes[0][w]), rest[w]); \
                lanes[1][w] =                                                                   \
                    CHOOSE(lanes[1][w], FMA(lanes_##TAG(c1 + at), some, lanes[1][w]), rest[w]); \
                lanes[2][w] =                                                                   \
                    CHOOSE(lanes[2][w], FMA(lanes_##TAG(c2 + at), some, lanes[2][w]), rest[w]); \
                lanes[3][w] =                                                                   \
                    CHOOSE(lanes[3][w], FMA(lanes_##TAG(c3 + at), some, lanes[3][w]), rest[w]); \
            }                                                                                   \
            eits_real sum[4];                                                                   \
            four_trees(lanes, sum);                                                             \
            if (last == 3) {                                                                    \
                memcpy(out + k, sum, sizeof sum);                                               \
                continue;                                                                       \
            }                                                                                   \
            for (uint32_t c = 0; c <= last; ++c)                                                \
                out[k + c] = sum[c];                                                            \
        }                                                                                       \
    }

DEFINE_DOTS(f32, float)
DEFINE_DOTS(f16, uint16_t)
DEFINE_DOTS(i16, int16_t)
DEFINE_DOTS(i8, int8_t)

static void avx2_rows_dot(const eits_real *rows, size_t stride, uint32_t count, size_t length,
                          const eits_real *v, eits_real *out)
{
    for (uint32_t k = 0; k < count; k += 4) {
        const uint32_t last = count - k - 1 < 3 ? count - k - 1 : 3;
        const eits_real *r0 = rows + stride * k, *r1 = r0 + stride * (last < 1 ? last : 1);
        const eits_real *r2 = r0 + stride * (last < 2 ? last : 2), *r3 = r0 + stride * last;
        vector lanes[4][8 / LANES];
        eits_real sum[4];
        for (int w = 0; w < 8 / LANES; ++w)
            lanes[0][w] = lanes[1][w] = lanes[2][w] = lanes[3][w] = ZERO();
        for (size_t i = 0; i < length; i += 8) {
            for (int w = 0; w < 8 / LANES; ++w) {
                const size_t at = i + (size_t)(w * LANES);
                const vector some = LOAD(v + at);
                lanes[0][w] = FMA(LOAD(r0 + at), some, lanes[0][w]);
                lanes[1][w] = FMA(LOAD(r1 + at), some, lanes[1][w]);
                lanes[2][w] = FMA(LOAD(r2 + at), some, lanes[2][w]);
                lanes[3][w] = FMA(LOAD(r3 + at), some, lanes[3][w]);
            }
        }
        four_trees(lanes, sum);
        for (uint32_t r = 0; r <= last; ++r)
            out[k + r] = sum[r];
    }
}

static void avx2_rows_add(const eits_real *rows, size_t stride, uint32_t count, size_t length,
                          const eits_real *value, eits_real *out)
{
    for (size_t i = 0; i < length; i += 8) {
        vector sum[8 / LANES];
        for (int w = 0; w < 8 / LANES; ++w)
            sum[w] = LOAD(out + i + w * LANES);
        for (uint32_t k = 0; k < count; ++k) {
            for (int w = 0; w < 8 / LANES; ++w)
                sum[w] = FMA(SET1(value[k]), LOAD(rows + stride * k + i + w * LANES), sum[w]);
        }
        for (int w = 0; w < 8 / LANES; ++w)
            STORE(out + i + w * LANES, sum[w]);
    }
}

/* The order does not change the result, since equal numbers are interchangeable. If the first
 * operand of MAX is NaN, it returns the second. */
static eits_real avx2_greatest(const eits_real *a, size_t count, eits_sign sign)
{
    const vector minus = SET1(-R(0.0)), flip = sign == EITS_SIGN_DECREASE ? minus : ZERO();
    const vector clear = sign == EITS_SIGN_BOTH ? minus : ZERO();
    vector max[4] = {ZERO(), ZERO(), ZERO(), ZERO()};
    size_t i = 0;
    for (; i + 4 * LANES <= count; i += 4 * LANES) {
        for (int k = 0; k < 4; ++k)
            max[k] = MAX(ANDNOT(clear, XOR(LOAD(a + i + (size_t)(k * LANES)), flip)), max[k]);
    }
    eits_real lane[LANES], greatest = 0;
    STORE(lane, MAX(MAX(max[0], max[1]), MAX(max[2], max[3])));
    for (int l = 0; l < LANES; ++l)
        greatest = lane[l] > greatest ? lane[l] : greatest;
    for (; i < count; ++i) {
        const eits_real value = sign == EITS_SIGN_BOTH       ? eits_fabs(a[i])
                                : sign == EITS_SIGN_DECREASE ? -a[i]
                                                             : a[i];
        greatest = value > greatest ? value : greatest;
    }
    return greatest;
}

#ifndef EITS_DOUBLE
/* Four numbers are handled at a time: a table says for each pattern of non-zeros how to move them
 * together. Numbers written beyond the non-zeros are overwritten by later ones or lie beyond the
 * returned count; none is written beyond the first `count` places. */
static uint32_t avx2_nonzeros(const eits_real *a, uint32_t count, uint32_t *place, eits_real *value)
{
#define L(k) 4 * k, 4 * k + 1, 4 * k + 2, 4 * k + 3
#define NO   0, 0, 0, 0
    static const uint8_t from[16][16] = {
        {NO, NO, NO, NO},         {L(0), NO, NO, NO},     {L(1), NO, NO, NO},
        {L(0), L(1), NO, NO},     {L(2), NO, NO, NO},     {L(0), L(2), NO, NO},
        {L(1), L(2), NO, NO},     {L(0), L(1), L(2), NO}, {L(3), NO, NO, NO},
        {L(0), L(3), NO, NO},     {L(1), L(3), NO, NO},   {L(0), L(1), L(3), NO},
        {L(2), L(3), NO, NO},     {L(0), L(2), L(3), NO}, {L(1), L(2), L(3), NO},
        {L(0), L(1), L(2), L(3)},
    };
#undef L
#undef NO
    static const uint8_t how_many[16] = {0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4};
    uint32_t found = 0, j = 0;
    __m128i places = _mm_setr_epi32(0, 1, 2, 3);
    for (; j + 4 <= count; j += 4) {
        const __m128 four = _mm_loadu_ps(a + j);
        const int pattern = _mm_movemask_ps(_mm_cmpneq_ps(four, _mm_setzero_ps()));
        const __m128i order = _mm_loadu_si128((const __m128i *)(const void *)from[pattern]);
        _mm_storeu_si128((__m128i *)(void *)(place + found), _mm_shuffle_epi8(places, order));
        _mm_storeu_si128((__m128i *)(void *)(value + found),
                         _mm_shuffle_epi8(_mm_castps_si128(four), order));
        found += how_many[pattern];
        places = _mm_add_epi32(places, _mm_set1_epi32(4));
    }
    for (; j < count; ++j) {
        place[found] = j;
        value[found] = a[j];
        found += a[j] != 0;
    }
    return found;
}
#endif
