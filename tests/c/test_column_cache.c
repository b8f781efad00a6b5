/* Columns held in the workspace: the right numbers wherever they stand, each unpacked once while it
 * is cached, products with the same bits as from S itself. */
#include "steps.h"

#include "context/column_cache.h"
#include "context/products.h"
#include "kernels/kernels.h"
#include "solve/solve.h"

enum { SIDE = 20, N = SIDE * SIDE, RANK = 13, ROOM = 256 };

static unsigned unpacked;
static const eits_kernels *real_kernels;

static void count_and_unpack(const eits_matrix *matrix, size_t first, size_t count, float *out)
{
    ++unpacked;
    real_kernels->unpack(matrix, first, count, out);
}

typedef struct bench {
    dense_bench on;
    eits_kernels kernels;
} bench;

static bench b;

static eits_context *set_up(bench *b, eits_storage storage, int prepared)
{
    const small_spec spec = {.rank = RANK, .side = SIDE, .storage = storage};
    eits_context *ctx = dense_bench_open(&b->on, spec, prepared);
    real_kernels = ctx->kernels;
    b->kernels = *real_kernels;
    b->kernels.unpack = count_and_unpack;
    ctx->kernels = &b->kernels;
    unpacked = 0;
    return ctx;
}

/* `count` columns from `first`, every `step`-th. */
static void list(uint32_t first, uint32_t step, uint32_t count, uint32_t *index)
{
    for (uint32_t k = 0; k < count; ++k)
        index[k] = first + step * k;
}

static void check_cached(const eits_context *ctx, const uint32_t *index, uint32_t count)
{
    uint32_t slot[ROOM];
    const eits_matrix cached = eits_cached_columns(&ctx->columns), *s = &ctx->model->sensitivity;
    CHECK(cached.scale == NULL && cached.storage == EITS_STORAGE_F32 && cached.rows == RANK &&
          cached.cols == ROOM);
    eits_cache_slots(&ctx->columns, index, count, slot);
    for (uint32_t k = 0; k < count; ++k) {
        CHECK(slot[k] < ROOM);
        for (uint32_t i = 0; i < cached.stride; ++i) {
            const float expected = i < RANK ? (float)dense_entry(s, index[k], i) : 0.0f;
            CHECK(((const float *)cached.data)[(size_t)cached.stride * slot[k] + i] == expected);
        }
    }
}

static void unpacked_once_and_replaced(eits_storage storage)
{
    eits_context *ctx = set_up(&b, storage, 0);
    uint32_t index[N];
    list(3, 1, 100, index);
    CHECK_EQUAL(eits_cache_columns(&ctx->columns, ctx->kernels, index, 100), 1);
    CHECK_EQUAL(unpacked, 100);
    CHECK_EQUAL(eits_cache_columns(&ctx->columns, ctx->kernels, index + 20, 60), 1); /* all there */
    CHECK_EQUAL(unpacked, 100);
    list(53, 1, 200, index); /* 50 there, 150 new: 250 in all */
    CHECK_EQUAL(eits_cache_columns(&ctx->columns, ctx->kernels, index, 200), 1);
    CHECK_EQUAL(unpacked, 250);
    check_cached(ctx, index, 200);
    list(3, 1, 50, index); /* the first ones still are */
    CHECK_EQUAL(eits_cache_columns(&ctx->columns, ctx->kernels, index, 50), 1);
    CHECK_EQUAL(unpacked, 250);
    list(0, 1, ROOM, index); /* 253 of 256 are there; those that are wanted do not give way */
    CHECK_EQUAL(eits_cache_columns(&ctx->columns, ctx->kernels, index, ROOM), 1);
    CHECK_EQUAL(unpacked, 256);
    check_cached(ctx, index, ROOM);
    list(N - 10, 1, 10, index);
    CHECK_EQUAL(eits_cache_columns(&ctx->columns, ctx->kernels, index, 10), 1);
    CHECK_EQUAL(unpacked, 266);
    check_cached(ctx, index, 10);
    list(0, 1, ROOM + 1, index);
    CHECK_EQUAL(eits_cache_columns(&ctx->columns, ctx->kernels, index, ROOM + 1), 0); /* too many */
    CHECK_EQUAL(unpacked, 266);
    CHECK_EQUAL(eits_cache_columns(&ctx->columns, ctx->kernels, index, 0), 1);
    eits_clear_column_cache(&ctx->columns);
    list(0, 2, 5, index);
    CHECK_EQUAL(eits_cache_columns(&ctx->columns, ctx->kernels, index, 5), 1);
    CHECK_EQUAL(unpacked, 271);
    check_cached(ctx, index, 5);
}

/* The working set's products from cached columns and from S. */
static void same_products(eits_storage storage, int prepared)
{
    eits_context *ctx = set_up(&b, storage, prepared);
    uint64_t state = 5;
    for (uint32_t count = 0; count <= 300; count += 30) {
        list(1, 1, count, ctx->solver.working);
        ctx->solver.working_count = count;
        eits_pack_panels(ctx);
        CHECK_EQUAL(ctx->solver.working_cached, count <= ROOM);
        eits_real v[EITS_STRIDE(RANK)] = {0}, x[N], by_cached[N], by_s[N],
                  sum_cached[EITS_STRIDE(RANK)], sum_s[EITS_STRIDE(RANK)];
        for (uint32_t i = 0; i < RANK; ++i)
            v[i] = (eits_real)small_random(&state);
        for (uint32_t k = 0; k < count; ++k)
            x[k] = small_random(&state) < 0 ? 0 : (eits_real)small_random(&state);
        eits_real *const panels = ctx->solver.working_panels;
        eits_apply_t_working(ctx, v, by_s);
        ctx->solver.working_panels = NULL;
        eits_apply_t_working(ctx, v, by_cached);
        CHECK(memcmp(by_s, by_cached, count * sizeof *by_s) == 0);
        CHECK(eits_apply_working(ctx, &ctx->scratch, x, sum_cached) <= count);
        ctx->solver.working_cached = 0;
        eits_apply_t_working(ctx, v, by_s);
        CHECK(memcmp(by_s, by_cached, count * sizeof *by_s) == 0);
        (void)eits_apply_working(ctx, &ctx->scratch, x, sum_s);
        CHECK(memcmp(sum_s, sum_cached, sizeof sum_s) == 0);
        ctx->solver.working_panels = panels;
    }
}

int main(void)
{
    for (int storage = 0; storage < 4; ++storage) {
        unpacked_once_and_replaced((eits_storage)storage);
        same_products((eits_storage)storage, 0);
        same_products((eits_storage)storage, 1);
    }
    dense_bench_close(&b.on);
    return checks_report("columns");
}
