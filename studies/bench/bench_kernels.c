/* Times each kernel beside this machine's peaks, in turns: bench_kernels RANK COLUMNS ROUNDS.
 * Prints a line a case: name, storage, multiply-accumulates and bytes of a call, bytes of its
 * working memory, least number of dependent FMAs, and the nanoseconds of a call in each round.
 * Peaks are cases too: "read" (bytes), "fma" (multiply-accumulates) and "chain" (dependent FMAs).
 * One thread, whose own time is taken; data stay where a call leaves them, so caches are as warm as
 * they get. */
#include "kernels/kernels.h"

#include <immintrin.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { MAX_CASES = 64, MAX_ROUNDS = 200, FEW_COLUMNS = 48 };

#ifdef EITS_DOUBLE
enum { LANES = 4 };
typedef __m256d vector;
#define FMA  _mm256_fmadd_pd
#define SET1 _mm256_set1_pd
#else
enum { LANES = 8 };
typedef __m256 vector;
#define FMA  _mm256_fmadd_ps
#define SET1 _mm256_set1_ps
#endif

typedef struct work {
    const eits_kernels *kernels;
    eits_matrix matrix[4];
    eits_real *panels, *v, *x, *y, *z, *out;
    uint32_t *index, *few;
    float *unpacked;
    uint8_t *memory;
    size_t bytes; /* of a read */
    eits_storage storage;
    uint32_t columns;
    uint64_t sink;
} work;

typedef struct bench_case {
    const char *name, *storage;
    double macs, bytes, footprint, chain;
    void (*call)(work *);
    eits_storage which;
    uint32_t columns;
    size_t read_bytes;
    double ns[MAX_ROUNDS];
} bench_case;

static bench_case cases[MAX_CASES];
static int case_count;

static double now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

static void *made(size_t bytes)
{
    void *memory = aligned_alloc(4096, (bytes + 4095) / 4096 * 4096);
    if (memory == NULL)
        exit(1);
    memset(memory, 0, (bytes + 4095) / 4096 * 4096);
    return memory;
}

static void call_read(work *w)
{
    __m256i sum[8];
    for (int k = 0; k < 8; ++k)
        sum[k] = _mm256_setzero_si256();
    const uint8_t *at = w->memory, *end = at + w->bytes / 256 * 256;
    for (; at < end; at += 256) {
        for (int k = 0; k < 8; ++k)
            sum[k] = _mm256_xor_si256(
                sum[k], _mm256_load_si256((const __m256i *)(const void *)(at + 32 * k)));
    }
    for (int k = 1; k < 8; ++k)
        sum[0] = _mm256_xor_si256(sum[0], sum[k]);
    w->sink += (uint64_t)_mm256_extract_epi64(sum[0], 0);
}

enum { FMA_TURNS = 1000, FMA_CHAINS = 10 };

#define STEP(S)       \
    S = FMA(S, a, b); \
    __asm__ volatile("" : "+x"(S)); /* the turns are not to be folded */

static void call_fma(work *w)
{
    const vector a = SET1((eits_real)0.5), b = SET1(w->v[0]);
    vector s0 = b, s1 = b, s2 = b, s3 = b, s4 = b, s5 = b, s6 = b, s7 = b, s8 = b, s9 = b;
    for (int turn = 0; turn < FMA_TURNS; ++turn) {
        STEP(s0) STEP(s1) STEP(s2) STEP(s3) STEP(s4) STEP(s5) STEP(s6) STEP(s7) STEP(s8) STEP(s9)
    }
    eits_real out[LANES];
    s0 = FMA(FMA(s1, s2, s3), FMA(s4, s5, s6), FMA(s7, s8, FMA(s9, a, s0)));
    memcpy(out, &s0, sizeof out);
    w->sink += out[0] > 1;
}

static void call_chain(work *w)
{
    vector sum = SET1(1);
    const vector a = SET1((eits_real)0.5), b = SET1(w->v[0]);
    for (int turn = 0; turn < FMA_TURNS; ++turn) {
        STEP(sum)
    }
    eits_real out[LANES];
    memcpy(out, &sum, sizeof out);
    w->sink += out[0] > 1;
}

static void call_mul(work *w)
{
    w->kernels->mul(&w->matrix[w->storage], w->columns == FEW_COLUMNS ? w->few : w->index, w->x,
                    w->columns, w->out);
}

static void call_mul_t(work *w)
{
    w->kernels->mul_t(&w->matrix[w->storage], w->columns == FEW_COLUMNS ? w->few : NULL, w->columns,
                      w->v, w->out);
}

static void call_dots(work *w)
{
    w->kernels->dots(&w->matrix[w->storage], w->few, w->columns, w->v, w->out);
}

static void call_panels(work *w)
{
    w->kernels->mul_t_panels(&w->matrix[0], w->panels, NULL, w->columns, w->v, w->out);
}

static void call_unpack(work *w)
{
    const eits_matrix *m = &w->matrix[w->storage];
    w->kernels->unpack(m, 0, (size_t)m->stride * m->cols, w->unpacked);
}

static void call_dot(work *w)
{
    w->sink += w->kernels->dot(w->v, w->y, w->matrix[0].rows) > 0;
}

static void call_axpy(work *w)
{
    w->kernels->axpy(w->y, (eits_real)1e-6, w->v, w->matrix[0].rows);
}

static void call_prox(work *w)
{
    const eits_prox how = {(eits_real)0.5, (eits_real)0.1, (eits_real)0.3, EITS_SIGN_INCREASE};
    w->kernels->prox(&how, w->columns, w->x, w->y, w->out, w->z);
}

static bench_case *add(const char *name, const char *storage, void (*call)(work *), double macs,
                       double bytes)
{
    if (case_count == MAX_CASES)
        exit(1);
    cases[case_count] = (bench_case){.name = name,
                                     .storage = storage,
                                     .call = call,
                                     .macs = macs,
                                     .bytes = bytes,
                                     .footprint = bytes};
    return &cases[case_count++];
}

/* A read of as many bytes as a kernel works on, so that both find them in the same cache. */
static void add_read(double bytes)
{
    const size_t whole = ((size_t)bytes + 255) / 256 * 256;
    for (int k = 0; k < case_count; ++k) {
        if (cases[k].call == call_read && cases[k].read_bytes == whole)
            return;
    }
    add("read", "-", call_read, 0, (double)whole)->read_bytes = whole;
}

static void run_round(work *w, int round)
{
    for (int k = 0; k < case_count; ++k) {
        bench_case *c = &cases[k];
        w->storage = c->which;
        w->columns = c->columns;
        w->bytes = c->read_bytes;
        double spent = 0, calls = 1;
        c->call(w);
        for (;;) { /* as many calls as take 0.3 ms */
            const double start = now_ns();
            for (double call = 0; call < calls; ++call)
                c->call(w);
            spent = now_ns() - start;
            if (spent > 3e5)
                break;
            calls *= spent > 3e4 ? 1 + 4e5 / spent : 8;
        }
        c->ns[round] = spent / calls;
    }
}

int main(int count, char **argument)
{
    static const char *const names[4] = {"f32", "f16", "i16", "i8"};
    static const uint32_t item[4] = {4, 2, 2, 1};
    const uint32_t rows = count == 4 ? (uint32_t)atoi(argument[1]) : 0,
                   cols = count == 4 ? (uint32_t)atoi(argument[2]) : 0;
    const int rounds = count == 4 ? atoi(argument[3]) : 0;
    if (rows < 8 || rows > 1024 || cols < FEW_COLUMNS || cols > 20000 || rounds < 1 ||
        rounds > MAX_ROUNDS) {
        fprintf(stderr, "usage: bench_kernels RANK COLUMNS ROUNDS\n");
        return 2;
    }
    const uint32_t stride = (rows + 7u) & ~7u;
    work w = {.kernels = eits_kernels_best()};
    float *scale = made(cols * sizeof *scale);
    w.panels = made(EITS_PANEL_COLUMNS(cols) * rows * sizeof(eits_real));
    w.v = made(stride * sizeof(eits_real));
    const size_t longest = cols > stride ? cols : stride;
    w.x = made(longest * sizeof(eits_real));
    w.y = made(longest * sizeof(eits_real));
    w.z = made(longest * sizeof(eits_real));
    w.out = made(longest * sizeof(eits_real));
    w.index = made(cols * sizeof *w.index);
    w.few = made(cols * sizeof *w.few);
    w.unpacked = made((size_t)stride * cols * sizeof(float));
    w.memory = made((size_t)64 << 20);
    memset(w.memory, 1, (size_t)64 << 20);
    for (uint32_t j = 0; j < cols; ++j) {
        scale[j] = 1;
        w.x[j] = (eits_real)(1 + j % 7) / 8;
        w.index[j] = j;
        w.few[j] = (uint32_t)((uint64_t)j * cols / FEW_COLUMNS % cols);
    }
    for (uint32_t i = 0; i < rows; ++i)
        w.v[i] = (eits_real)(1 + i % 5) / 4;
    for (int s = 0; s < 4; ++s) {
        uint8_t *data = made((size_t)stride * cols * item[s]);
        for (size_t k = 0; k < (size_t)stride * cols; ++k) {
            if (s == EITS_STORAGE_F32)
                ((float *)(void *)data)[k] = (float)(k % 11) / 16;
            else if (s == EITS_STORAGE_F16)
                ((uint16_t *)(void *)data)[k] = (uint16_t)(0x3800 + k % 512);
            else if (s == EITS_STORAGE_I16)
                ((int16_t *)(void *)data)[k] = (int16_t)(k % 1001);
            else
                ((int8_t *)data)[k] = (int8_t)(k % 101);
        }
        w.matrix[s] = (eits_matrix){
            data, s >= EITS_STORAGE_I16 ? scale : NULL, rows, cols, stride, (eits_storage)s};
    }
    eits_make_panels(&w.matrix[0], w.panels);

    const double all = (double)rows * cols, some = (double)rows * FEW_COLUMNS,
                 real = sizeof(eits_real);
    add("fma", "-", call_fma, (double)FMA_TURNS * FMA_CHAINS * LANES, 0);
    add("chain", "-", call_chain, 0, 0)->chain = FMA_TURNS;
    add("read", "-", call_read, 0, 64 << 20)->read_bytes = (size_t)64 << 20;
    bench_case *c = add("panels, all columns", "f32", call_panels, all, all * real);
    c->columns = cols;
    c = add("panels, working set", "f32", call_panels, some, some * real);
    c->columns = FEW_COLUMNS;
    c->macs = c->bytes / real;
    for (int s = 0; s < 4; ++s) {
        c = add("mul_t, all columns", names[s], call_mul_t, all, all * item[s]);
        c->which = (eits_storage)s, c->columns = cols;
        c = add("mul_t, 48 columns", names[s], call_mul_t, some, some * item[s]);
        c->which = (eits_storage)s, c->columns = FEW_COLUMNS;
        c = add("dots, 48 columns", names[s], call_dots, some, some * item[s]);
        c->which = (eits_storage)s, c->columns = FEW_COLUMNS;
        c = add("mul, all columns", names[s], call_mul, all, all * item[s]);
        c->which = (eits_storage)s, c->columns = cols, c->chain = cols;
        c = add("mul, 48 columns", names[s], call_mul, some, some * item[s]);
        c->which = (eits_storage)s, c->columns = FEW_COLUMNS, c->chain = FEW_COLUMNS;
        c = add("unpack", names[s], call_unpack, 0, all * (item[s] + 4));
        c->which = (eits_storage)s;
    }
    c = add("dot", "-", call_dot, rows, 2 * rows * real);
    c->chain = (rows + 7) / 8;
    add("axpy", "-", call_axpy, rows, 3 * rows * real);
    c = add("prox", "-", call_prox, 2.0 * cols, 5 * cols * real);
    c->columns = cols;
    for (int k = 0, made_so_far = case_count; k < made_so_far; ++k) {
        if (cases[k].bytes > 0)
            add_read(cases[k].footprint);
    }
    for (int round = 0; round < rounds; ++round)
        run_round(&w, round);
    printf("kernels %s\n", w.kernels->name);
    for (int k = 0; k < case_count; ++k) {
        printf("case %s;%s;%.0f;%.0f;%.0f;%.0f;", cases[k].name, cases[k].storage, cases[k].macs,
               cases[k].bytes, cases[k].footprint, cases[k].chain);
        for (int round = 0; round < rounds; ++round)
            printf("%s%.3f", round > 0 ? "," : "", cases[k].ns[round]);
        printf("\n");
    }
    return w.sink == 12345 ? 3 : 0;
}
