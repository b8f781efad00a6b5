/* A small skin with reference frames, and the rows of its electrodes: for tests of diagnostics. */
#ifndef EITSKIN_TEST_SPOILED_FRAME_H
#define EITSKIN_TEST_SPOILED_FRAME_H
#include "steps.h"

#include "diagnostics/diagnostics.h"

enum { UNTOUCHED = 16 };

typedef struct bench {
    dense_bench on;
    eits_real untouched[UNTOUCHED][SMALL_ROWS], frame[SMALL_ROWS];
    uint64_t state;
} bench;

static bench b;

static inline void add_noise(bench *b, eits_real *frame)
{
    for (uint32_t i = 0; i < SMALL_ROWS; ++i)
        frame[i] += (eits_real)(1e-3 * small_random(&b->state));
}

/* 8 electrodes: with 40 rows each electrode has 20 of them, each pair 5 or 6 that drive or measure
 * across it. */
static inline eits_context *set_up(bench *b, int noise_known)
{
    eits_context *ctx = dense_bench_open(&b->on, (small_spec){.rank = 12, .side = 4}, 0);
    b->state = 7;
    small_reference(ctx->model, 1, b->frame);
    /* all rows of a like size, so that all are significant */
    for (uint32_t i = 0; i < SMALL_ROWS; ++i)
        b->frame[i] = b->frame[i] < 0 ? R(-1) : R(1);
    for (int k = 0; k < UNTOUCHED; ++k) {
        memcpy(b->untouched[k], b->frame, sizeof b->frame);
        add_noise(b, b->untouched[k]);
    }
    if (noise_known)
        LEARN(ctx, UNTOUCHED, b->untouched);
    else
        CHECK_OK(eits_reference_set(ctx, b->frame, SMALL_ROWS));
    add_noise(b, b->frame);
    return ctx;
}

static inline int row_uses(const eits_context *ctx, uint32_t i, uint32_t e)
{
    const uint8_t *row = eits_row(ctx, i);
    return row[0] == e || row[1] == e || row[2] == e || row[3] == e;
}

static inline int row_drives(const eits_context *ctx, uint32_t i, uint32_t e)
{
    const uint8_t *row = eits_row(ctx, i);
    return row[0] == e || row[1] == e;
}

static inline int row_crosses(const eits_context *ctx, uint32_t i, uint32_t e, uint32_t f)
{
    const uint8_t *row = eits_row(ctx, i);
    return (row[0] == e && row[1] == f) || (row[0] == f && row[1] == e) ||
           (row[2] == e && row[3] == f) || (row[2] == f && row[3] == e);
}

static inline void look_for(eits_context *ctx, uint32_t diagnostics)
{
    CHANGE_OPTIONS(ctx, o.diagnostics = diagnostics, o.max_masked = SMALL_ROWS);
}

static inline void reconstruct(bench *b)
{
    CHECK_OK(eits_reconstruct(b->on.c.ctx, b->frame, SMALL_ROWS, NULL, NULL));
}

#endif
