/* The matrix products: against naive sums within a bound, and to the bit between builds and
 * layouts. */
#include "steps.h"

#include "kernels/kernels.h"

#ifdef EITS_BUILD_AVX2
extern const eits_kernels eits_kernels_avx2;
#endif

/* Every build that this processor runs. */
static const eits_kernels *builds[2];
static int build_count = 0;

TEST(find_builds)
{
    const eits_kernels *best = eits_kernels_best();
    builds[build_count++] = &eits_kernels_portable;
    CHECK(strcmp(eits_kernels_portable.name, "portable") == 0);
#ifdef EITS_BUILD_AVX2
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
        __builtin_cpu_supports("f16c")) {
        builds[build_count++] = &eits_kernels_avx2;
        CHECK(best == &eits_kernels_avx2 && strcmp(best->name, "avx2") == 0);
        return;
    }
    printf("kernels: no AVX2 on this processor, the portable build alone is tested\n");
#endif
    CHECK(best == &eits_kernels_portable);
}

typedef struct sample {
    eits_matrix matrix;
    void *data;
    float *scale;
} sample;

static void *memory_of(size_t size)
{
    void *made = calloc(1, size + 1);
    if (made == NULL)
        abort();
    return made;
}

/* Random columns, a fifth of the numbers zero, padding zero; exactly as large as stated, so that
 * reads beyond are seen. */
static sample make_sample(eits_storage storage, uint32_t rows, uint32_t cols, uint64_t *state)
{
    static const size_t item[] = {4, 2, 2, 1};
    const uint32_t stride = (rows + 7u) & ~7u;
    sample s = {.data = malloc((size_t)stride * cols * item[storage])};
    const int integer = storage >= EITS_STORAGE_I16;
    if (s.data == NULL)
        abort();
    memset(s.data, 0, (size_t)stride * cols * item[storage]);
    for (uint32_t j = 0; j < cols; ++j) {
        for (uint32_t i = 0; i < rows; ++i) {
            const double value = small_random(state) < -0.6 ? 0 : small_random(state);
            const size_t at = (size_t)stride * j + i;
            switch (storage) {
            case EITS_STORAGE_F32:
                ((float *)s.data)[at] = (float)value;
                break;
            case EITS_STORAGE_F16:
                ((uint16_t *)s.data)[at] = (uint16_t)(0xBBFF & (int)(32768 + 32767 * value));
                break;
            case EITS_STORAGE_I16:
                ((int16_t *)s.data)[at] = (int16_t)(32767 * value);
                break;
            case EITS_STORAGE_I8:
                ((int8_t *)s.data)[at] = (int8_t)(127 * value);
                break;
            }
        }
    }
    if (integer) {
        s.scale = memory_of(cols * sizeof(float));
        for (uint32_t j = 0; j < cols; ++j)
            s.scale[j] =
                (float)((1.2 + small_random(state)) / (storage == EITS_STORAGE_I8 ? 127 : 32767));
    }
    s.matrix = (eits_matrix){s.data, s.scale, rows, cols, stride, storage};
    return s;
}

static void free_sample(sample *s)
{
    free(s->data);
    free(s->scale);
}

static eits_real *reals(size_t count)
{
    return memory_of(count * sizeof(eits_real));
}

static void fill(eits_real *out, size_t count, double zeros, uint64_t *state)
{
    for (size_t i = 0; i < count; ++i)
        out[i] = small_random(state) < 2 * zeros - 1 ? 0 : (eits_real)small_random(state);
}

static int same_bits(const eits_real *a, const eits_real *b, size_t count)
{
    return memcmp(a, b, count * sizeof *a) == 0;
}

/* S x for a list of columns: the exact sum in long double, and the documented chain of fused
 * multiply-adds. */
static void check_mul(const sample *s, uint64_t *state)
{
    const eits_matrix *m = &s->matrix;
    eits_real *x = reals(m->cols), *value = reals(m->cols),
              *out[2] = {reals(m->stride), reals(m->stride)};
    uint32_t *index = memory_of(m->cols * sizeof *index);
    for (int fraction = 0; fraction <= 4;
         ++fraction) { /* of zeros: all, three quarters, ... none */
        fill(x, m->cols, 1 - 0.25 * fraction, state);
        const uint32_t count =
            eits_list_nonzeros(builds[fraction % build_count], m, x, index, value);
        uint32_t seen = 0;
        for (uint32_t j = 0; j < m->cols; ++j) {
            if (x[j] == 0)
                continue;
            CHECK(seen < count && index[seen] == j);
            const eits_real scaled = m->scale != NULL ? x[j] * (eits_real)m->scale[j] : x[j];
            CHECK(seen < count && value[seen] == scaled);
            ++seen;
        }
        CHECK_EQUAL(count, seen);
        for (int b = 0; b < build_count; ++b) {
            memset(out[b], 0xFF, m->stride * sizeof(eits_real));
            builds[b]->mul(m, index, value, count, out[b]);
        }
        CHECK(build_count < 2 || same_bits(out[0], out[1], m->stride));
        for (uint32_t i = 0; i < m->stride; ++i) {
            long double exact = 0, sizes = 0;
            eits_real chain = 0;
            for (uint32_t k = 0; k < count; ++k) {
                const double entry = i < m->rows ? dense_entry(m, index[k], i) : 0;
                exact += (long double)entry * (long double)value[k];
                sizes += fabsl((long double)entry * (long double)value[k]);
                chain = eits_fma((eits_real)entry, value[k], chain);
            }
            CHECK_NEAR(out[0][i], exact, (count + 2.0) * EPS / 2 * (double)sizes);
            CHECK(out[0][i] == chain);
        }
    }
    free(x), free(value), free(out[0]), free(out[1]), free(index);
}

/* S' v from columns and from panels, in each build: one result, to the bit. */
static void check_mul_t(const sample *s, uint64_t *state)
{
    const eits_matrix *m = &s->matrix;
    eits_real *v = reals(m->rows), *expected = reals(m->cols), *out = reals(m->cols);
    eits_real *panels = reals(EITS_PANEL_COLUMNS(m->cols) * m->rows), *column = reals(m->rows);
    eits_make_panels(m, panels);
    fill(v, m->rows, 0.1, state);
    for (uint32_t j = 0; j < m->cols; ++j) {
        long double exact = 0, sizes = 0;
        eits_real chain = 0;
        const eits_real scale = m->scale != NULL ? (eits_real)m->scale[j] : 1;
        eits_read_column(m, j, column);
        for (uint32_t i = 0; i < m->rows; ++i) {
            const double entry = dense_entry(m, j, i);
            CHECK((double)column[i] == entry);
            exact += (long double)entry * (long double)v[i];
            sizes += fabsl((long double)entry * (long double)v[i]);
            chain = eits_fma((eits_real)entry, v[i], chain);
        }
        expected[j] = m->scale != NULL ? chain * scale : chain;
        CHECK_NEAR(expected[j], exact * (long double)scale,
                   (m->rows + 3.0) * EPS / 2 * (double)(sizes * (long double)scale));
    }
    for (int b = 0; b < build_count; ++b) {
        memset(out, 0xFF, m->cols * sizeof *out);
        builds[b]->mul_t(m, NULL, m->cols, v, out);
        CHECK(same_bits(out, expected, m->cols));
        memset(out, 0xFF, m->cols * sizeof *out);
        builds[b]->mul_t_panels(m, panels, NULL, m->cols, v, out);
        CHECK(same_bits(out, expected, m->cols));
        /* every column but each third, then none */
        uint32_t *index = memory_of(m->cols * sizeof *index), count = 0;
        for (uint32_t j = 0; j < m->cols; ++j) {
            index[count] = j;
            count += j % 3 != 2;
        }
        memset(out, 0xFF, m->cols * sizeof *out);
        builds[b]->mul_t(m, index, count, v, out);
        for (uint32_t k = 0; k < count; ++k)
            CHECK(same_bits(out + k, expected + index[k], 1));
        builds[b]->mul_t(m, index, 0, v, out);
        CHECK(same_bits(out, expected, 1));
        free(index);
    }
    free(v), free(expected), free(out), free(panels), free(column);
}

/* S' v by eight lanes and a tree, in each build: one result, to the bit; numbers beside a column do
 * not count. */
static void check_dots(const sample *s, uint64_t *state)
{
    const eits_matrix *m = &s->matrix;
    eits_real *v = reals(m->rows), *expected = reals(m->cols), *out = reals(m->cols + 1),
              *column = reals(m->rows);
    uint32_t *index = memory_of(m->cols * sizeof *index);
    fill(v, m->rows, 0.1, state);
    for (uint32_t j = 0; j < m->cols; ++j) {
        index[j] = m->cols - 1 - j;
        eits_read_column(m, index[j], column);
        eits_real lane[8] = {0};
        for (uint32_t i = 0; i < m->rows; ++i)
            lane[i % 8] = eits_fma(column[i], v[i], lane[i % 8]);
        expected[j] = eits_tree8(lane);
        if (m->scale != NULL)
            expected[j] *= (eits_real)m->scale[index[j]];
    }
    for (int b = 0; b < build_count; ++b) {
        for (uint32_t count = 0; count <= m->cols; count += count < 9 ? 1 : 23) {
            memset(out, 0xFF, (m->cols + 1) * sizeof *out);
            builds[b]->dots(m, index, count, v, out);
            CHECK(same_bits(out, expected, count));
            CHECK(isnan((double)out[count]));
        }
    }
    free(v), free(expected), free(out), free(column), free(index);
}

/* Stored numbers as floats, from any block of eight on: the numbers themselves, padding included,
 * and nothing beside them. */
static void check_unpack(const sample *s)
{
    const eits_matrix *m = &s->matrix;
    const size_t whole = (size_t)m->stride * m->cols;
    float *out = memory_of((whole + 1) * sizeof *out);
    for (int b = 0; b < build_count; ++b) {
        for (size_t first = 0; first < whole; first += 8 * (1 + whole / 64)) {
            memset(out, 0xFF, (whole + 1) * sizeof *out);
            builds[b]->unpack(m, first, whole - first, out);
            for (size_t i = 0; i < whole - first; ++i) {
                const size_t row = (first + i) % m->stride, column = (first + i) / m->stride;
                CHECK(out[i] ==
                      (float)(row < m->rows ? dense_entry(m, (uint32_t)column, (uint32_t)row) : 0));
            }
            CHECK(isnan(out[whole - first]));
        }
    }
    free(out);
}

TEST(products_of_all_storages_and_sizes)
{
    static const uint32_t rows[] = {1, 3, 7, 8, 9, 13, 24, 33},
                          cols[] = {1, 2, 3, 4, 5, 7, 31, 32, 33, 64, 99};
    uint64_t state = 11;
    for (int storage = 0; storage < 4; ++storage) {
        for (size_t r = 0; IN_TABLE(r, rows); ++r) {
            for (size_t c = 0; IN_TABLE(c, cols); ++c) {
                sample s = make_sample((eits_storage)storage, rows[r], cols[c], &state);
                check_mul(&s, &state);
                check_mul_t(&s, &state);
                check_dots(&s, &state);
                check_unpack(&s);
                free_sample(&s);
            }
        }
    }
}

TEST(dots_and_axpys)
{
    uint64_t state = 12;
    for (size_t count = 0; count <= 70; ++count) {
        eits_real *a = reals(count), *b = reals(count), *out[2] = {reals(count), reals(count)};
        fill(a, count, 0.1, &state);
        fill(b, count, 0.1, &state);
        long double exact = 0, sizes = 0;
        eits_real lane[8] = {0};
        for (size_t i = 0; i < count; ++i) {
            exact += (long double)a[i] * (long double)b[i];
            sizes += fabsl((long double)a[i] * (long double)b[i]);
            lane[i % 8] = eits_fma(a[i], b[i], lane[i % 8]);
        }
        const eits_real tree = ((lane[0] + lane[4]) + (lane[2] + lane[6])) +
                               ((lane[1] + lane[5]) + (lane[3] + lane[7]));
        for (int k = 0; k < build_count; ++k) {
            const eits_real got = builds[k]->dot(a, b, count);
            CHECK_NEAR(got, exact, ((double)count / 8 + 5) * EPS / 2 * (double)sizes);
            CHECK(got == tree);
            memcpy(out[k], b, count * sizeof *b);
            builds[k]->axpy(out[k], R(-0.37), a, count);
            for (size_t i = 0; i < count; ++i)
                CHECK(out[k][i] == eits_fma(R(-0.37), a[i], b[i]));
            builds[k]->extrapolate(out[k], R(0.8), a, b, count);
            for (size_t i = 0; i < count; ++i)
                CHECK(out[k][i] == eits_fma(R(0.8), a[i] - b[i], a[i]));
        }
        free(a), free(b), free(out[0]), free(out[1]);
    }
}

TEST(products_with_few_rows)
{
    enum { STRIDE = 40 };
    uint64_t state = 15;
    for (uint32_t count = 0; count <= 18; ++count) {
        for (size_t length = 0; length <= STRIDE; length += 8) {
            eits_real *rows = reals((size_t)STRIDE * count), *v = reals(STRIDE + 18), dots[20],
                      sums[STRIDE + 1];
            fill(rows, (size_t)STRIDE * count, 0.2, &state);
            fill(v, STRIDE + 18, 0.2, &state);
            for (int b = 0; b < build_count; ++b) {
                memset(dots, 0xFF, sizeof dots), memset(sums, 0xFF, sizeof sums);
                memcpy(sums, v + 9, length * sizeof *sums); /* what is added to */
                builds[b]->rows_dot(rows, STRIDE, count, length, v, dots);
                builds[b]->rows_add(rows, STRIDE, count, length, v, sums);
                for (uint32_t k = 0; k < count; ++k)
                    CHECK(dots[k] == builds[b]->dot(rows + STRIDE * k, v, length));
                for (size_t i = 0; i < length; ++i) {
                    eits_real chain = v[9 + i];
                    for (uint32_t k = 0; k < count; ++k)
                        chain = eits_fma(v[k], rows[STRIDE * k + i], chain);
                    CHECK(sums[i] == chain);
                }
                CHECK(isnan((double)dots[count]) && isnan((double)sums[length]));
            }
            free(rows), free(v);
        }
    }
}

TEST(the_greatest)
{
    uint64_t state = 16;
    for (size_t count = 0; count <= 70; ++count) {
        for (int kind = 0; kind < 3; ++kind) { /* of both signs, none above zero, none below */
            eits_real *a = reals(count), max[3] = {0};
            fill(a, count, 0.1, &state);
            for (size_t i = 0; i < count; ++i) {
                a[i] = kind == 0 ? a[i] : kind == 1 ? -eits_fabs(a[i]) : eits_fabs(a[i]);
                const eits_real as[3] = {a[i], -a[i], eits_fabs(a[i])};
                for (int sign = 0; sign < 3; ++sign)
                    max[sign] = as[sign] > max[sign] ? as[sign] : max[sign];
            }
            for (int b = 0; b < build_count; ++b) {
                for (int sign = 0; sign < 3; ++sign)
                    CHECK(builds[b]->greatest(a, count, (eits_sign)sign) == max[sign]);
            }
            if (count > 0)
                a[count / 2] = R(NAN); /* is never the greatest */
            for (int b = 0; b < build_count; ++b)
                CHECK(builds[b]->greatest(a, count, EITS_SIGN_BOTH) <= max[2]);
            free(a);
        }
    }
}

/* Every pattern of eight, and a few more behind; nothing is written behind the last place. */
TEST(places_of_nonzeros)
{
    for (uint32_t pattern = 0; pattern < 256; ++pattern) {
        for (uint32_t count = 8; count < 12; ++count) {
            eits_real a[12] = {0}, value[13];
            uint32_t place[13], found = 0;
            for (uint32_t j = 0; j < count; ++j)
                a[j] = pattern >> j % 8 & 1 ? (eits_real)j + 1 : 0;
            for (int b = 0; b < build_count; ++b) {
                place[count] = 77, value[count] = 77, found = 0;
                const uint32_t listed = builds[b]->nonzeros(a, count, place, value);
                for (uint32_t j = 0; j < count; ++j) {
                    if (a[j] == 0)
                        continue;
                    CHECK(found < listed && place[found] == j && value[found] == a[j]);
                    ++found;
                }
                CHECK_EQUAL(listed, found);
                CHECK(place[count] == 77 && value[count] == 77);
            }
        }
    }
}

TEST(proximal_steps)
{
    uint64_t state = 13;
    const double step = 0.7, threshold = 0.3, beta = 0.4;
    for (int sign = 0; sign < 3; ++sign) {
        for (uint32_t n = 0; n <= 40; ++n) {
            eits_real *g = reals(n), *x = reals(n), *start = reals(n), *z[2] = {reals(n), reals(n)},
                      *next[2] = {reals(n), reals(n)};
            const eits_prox how = {(eits_real)step, (eits_real)threshold, (eits_real)beta,
                                   (eits_sign)sign};
            fill(g, n, 0.1, &state);
            fill(x, n, 0.3, &state);
            fill(start, n, 0.2, &state);
            for (int b = 0; b < build_count; ++b) {
                memcpy(z[b], start, n * sizeof *start);
                builds[b]->prox(&how, n, g, x, next[b], z[b]);
            }
            for (uint32_t j = 0; j < n; ++j) {
                const double v = (double)start[j] + step * (double)g[j];
                double moved = 0;
                if (v > threshold && sign != EITS_SIGN_DECREASE)
                    moved = v - threshold;
                if (v < -threshold && sign != EITS_SIGN_INCREASE)
                    moved = v + threshold;
                CHECK_NEAR(next[0][j], moved, 3 * EPS);
                CHECK_NEAR(z[0][j], moved + beta * (moved - (double)x[j]), 6 * EPS);
                CHECK(next[0][j] != 0 || fabs(v) <= threshold + EPS || moved == 0);
            }
            CHECK(build_count < 2 || (same_bits(next[0], next[1], n) && same_bits(z[0], z[1], n)));
            free(g), free(x), free(start), free(z[0]), free(z[1]), free(next[0]), free(next[1]);
        }
    }
}

/* If a gradient is not finite, its coefficient is not finite either, at every place; it does not
 * become zero. */
TEST(steps_that_are_not_finite)
{
    enum { COUNT = 19 };
    const double wild[] = {NAN, INFINITY, -INFINITY};
    for (int sign = 0; sign < 3; ++sign) {
        for (int k = 0; k < 3; ++k) {
            for (int b = 0; b < build_count; ++b) {
                eits_real g[COUNT] = {0}, x[COUNT] = {0}, next[COUNT], z[COUNT] = {0};
                const eits_prox how = {1, R(0.5), R(0.5), (eits_sign)sign};
                for (int j = 0; j < COUNT; j += 3)
                    g[j] = (eits_real)wild[k];
                builds[b]->prox(&how, COUNT, g, x, next, z);
                for (int j = 0; j < COUNT; ++j)
                    CHECK(isfinite((double)next[j]) == (j % 3 != 0));
            }
        }
    }
}

TEST(zeros_are_skipped)
{
    uint64_t state = 14;
    sample s = make_sample(EITS_STORAGE_F32, 5, 9, &state);
    eits_real x[9] = {0, R(-0.0), 2, 0, 0, R(-1e-30), 0, 0, 3}, value[9], out[8];
    uint32_t index[9];
    for (int b = 0; b < build_count; ++b) {
        /* minus zero is zero, however small is not */
        CHECK_EQUAL(eits_list_nonzeros(builds[b], &s.matrix, x, index, value), 3);
        CHECK(index[0] == 2 && index[1] == 5 && index[2] == 8);
    }
    for (uint32_t i = 0; i < 5; ++i)
        ((float *)s.data)[8 * 3 + i] = NAN; /* a column that is not listed is not read */
    builds[0]->mul(&s.matrix, index, value, 3, out);
    for (uint32_t i = 0; i < 8; ++i)
        CHECK(isfinite((double)out[i]));
    builds[0]->mul(&s.matrix, index, value, 0, out);
    for (uint32_t i = 0; i < 8; ++i)
        CHECK(out[i] == 0);
    free_sample(&s);
}

TEST(choice_of_kernels)
{
    dense_bench b = {0};
    eits_context *ctx = dense_bench_open(&b, (small_spec){.rank = 3, .side = 3}, 0);
    CHECK(strcmp(eits_kernels_name(ctx), eits_kernels_best()->name) == 0);
    CHECK_OK(eits_use_portable_kernels(ctx, 1));
    CHECK(strcmp(eits_kernels_name(ctx), "portable") == 0);
    CHECK_OK(eits_use_portable_kernels(ctx, 0));
    CHECK(strcmp(eits_kernels_name(ctx), eits_kernels_best()->name) == 0);
    CHECK_REFUSED(eits_use_portable_kernels(NULL, 0));
    CHECK(strcmp(eits_kernels_name(NULL), "") == 0);
    dense_bench_close(&b);
}

RUN_TESTS("kernels")
