/* Many frames in one call: each as if it were alone, refused ones among them. */
#include "steps.h"

#include "eitskin/batch.h"

enum { SIDE = 8, N = SIDE * SIDE, FRAMES = 5, SHORT = 1, REFUSED = 3 };

typedef struct bench {
    dense_bench on;
    eits_real frames[FRAMES][SMALL_ROWS];
} bench;

static bench b;

/* Frames of noise on the reference; one has nothing but NaN. */
static eits_context *set_up(bench *b)
{
    const small_spec spec = {.rank = 12, .side = SIDE, .shape = SMALL_WAVES};
    eits_context *ctx = dense_bench_open(&b->on, spec, 0);
    uint64_t state = 12;
    eits_real reference[SMALL_ROWS];
    small_reference(ctx->model, 1, reference);
    CHECK_OK(eits_reference_set(ctx, reference, SMALL_ROWS));
    for (int k = 0; k < FRAMES; ++k) {
        for (int i = 0; i < SMALL_ROWS; ++i)
            b->frames[k][i] =
                k == REFUSED ? R(NAN) : reference[i] * (eits_real)(1 + 0.1 * small_random(&state));
    }
    return ctx;
}

TEST(each_as_if_alone)
{
    bench b = {0}, alone = {0};
    eits_context *ctx = set_up(&b), *other = set_up(&alone);
    static eits_real images[FRAMES][N], coefficients[FRAMES][N], image[N];
    eits_touch touches[FRAMES][EITS_MAX_TOUCHES], found[EITS_MAX_TOUCHES];
    eits_result results[FRAMES];
    uint32_t touches_seen = 0;
    CHECK_OK(eits_reconstruct_batch(ctx, b.frames[0], SMALL_ROWS, FRAMES, images[0],
                                    coefficients[0], touches[0], results));
    for (int k = 0; k < FRAMES; ++k) {
        eits_forget(other);
        const eits_status status =
            eits_reconstruct(other, alone.frames[k], SMALL_ROWS, image, NULL);
        CHECK_EQUAL(results[k].status, status);
        CHECK_EQUAL(status, k == REFUSED ? EITS_E_FRAME_ROWS : EITS_OK);
        uint32_t count = 0;
        if (status == EITS_OK)
            CHECK_OK(eits_find_touches(other, found, EITS_MAX_TOUCHES, &count));
        CHECK_EQUAL(results[k].count, count);
        for (uint32_t t = 0; t < count; ++t)
            CHECK(small_same_touch(&touches[k][t], &found[t]));
        CHECK(memcmp(images[k], image, sizeof image) == 0);
        CHECK(memcmp(coefficients[k], eits_get_coefficients(other), sizeof image) == 0);
        CHECK(memcmp(&results[k].info, eits_get_info(other), sizeof(eits_info)) == 0);
        touches_seen += count;
    }
    CHECK(touches_seen >= FRAMES - 1);
    for (int j = 0; j < N; ++j)
        CHECK(images[REFUSED][j] == 0 && coefficients[REFUSED][j] == 0);
    dense_bench_close(&b.on);
    dense_bench_close(&alone.on);
}

/* Outputs that are not asked for are not computed. Frames of another length are rejected, each with
 * its own status. */
TEST(without_outputs)
{
    eits_context *ctx = set_up(&b);
    eits_result results[FRAMES];
    CHECK_OK(
        eits_reconstruct_batch(ctx, b.frames[0], SMALL_ROWS, SHORT, NULL, NULL, NULL, results));
    CHECK(results[0].status == EITS_OK && results[0].count == 0 &&
          results[0].info.touch_macs == 0 && results[0].info.macs > 0);
    CHECK_OK(
        eits_reconstruct_batch(ctx, b.frames[0], SMALL_ROWS - 1, SHORT, NULL, NULL, NULL, results));
    CHECK_EQUAL(results[0].status, EITS_E_FRAME_LENGTH);
    CHECK_OK(eits_reconstruct_batch(ctx, b.frames[0], SMALL_ROWS, 0, NULL, NULL, NULL, results));
    CHECK_REFUSED(
        eits_reconstruct_batch(NULL, b.frames[0], SMALL_ROWS, 1, NULL, NULL, NULL, results));
    CHECK_REFUSED(eits_reconstruct_batch(ctx, NULL, SMALL_ROWS, 1, NULL, NULL, NULL, results));
    CHECK_REFUSED(eits_reconstruct_batch(ctx, b.frames[0], SMALL_ROWS, 1, NULL, NULL, NULL, NULL));
}

RUN_TESTS("batch", dense_bench_close(&b.on))
