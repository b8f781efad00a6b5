/* A small model with model errors, and frames with the data of discs: for tests of the touch test.
 * */
#ifndef EITSKIN_TEST_EVIDENCE_BENCH_H
#define EITSKIN_TEST_EVIDENCE_BENCH_H

#include "check.h"
#include "dense.h"
#include "small_model.h"

#include "base/vec.h"
#include "diagnostics/diagnostics.h"
#include "eitskin/frame.h"
#include "evidence/constants.h"
#include "evidence/evidence.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { RANK = 20, SIDE = 12, STRIDE = 24, PACKED = RANK * (RANK + 1) / 2 };

static const double BOARD = 0.5; /* what the board's volts are of the model's */
static const small_spec SPEC = {.rank = RANK, .side = SIDE, .shape = SMALL_WHITENED, .fields = 1};
static const eits_disc ONE = {-13, 4, 12, R(0.02), 1}, OTHER = {15, -8, 13, R(0.015), 1};

typedef struct bench {
    dense_bench b;
    float errors[PACKED], drift[PACKED];
    double d[SMALL_FOLDED]; /* the frame's folded data */
    eits_real frame[SMALL_ROWS];
} bench;

static bench b;

/* Errors like those of a real skin: some of any direction, none alike. */
static inline void fill_errors(float *packed, double size)
{
    uint64_t state = 17;
    double half[RANK][RANK];
    for (int i = 0; i < RANK * RANK; ++i)
        half[i / RANK][i % RANK] = small_random(&state);
    for (int i = 0, at = 0; i < RANK; ++i) {
        for (int j = 0; j <= i; ++j)
            packed[at++] = (float)(size * dense_dot(half[i], half[j], RANK));
    }
}

static inline eits_context *set_up(bench *b, int project)
{
    dense_bench_close(&b->b);
    memset(b, 0, sizeof *b);
    eits_context *ctx = dense_bench_open(&b->b, SPEC, 0);
    CHANGE_OPTIONS(ctx, o.diagnostics = 0, o.project_reference = (uint32_t)project,
                   o.max_masked = SMALL_ROWS);
    fill_errors(b->errors, 1e-4);
    fill_errors(b->drift, 1e-5);
    b->b.c.model.uncertainty = (eits_uncertainty){.errors = b->errors, .drift = b->drift};
    small_reference(ctx->model, BOARD, b->frame);
    CHECK_EQUAL(eits_reference_set(ctx, b->frame, SMALL_ROWS), EITS_OK);
    return ctx;
}

static inline double energy(const bench *b, int i)
{
    double sum = 0;
    for (int k = 0; k < SMALL_FOLDED; ++k)
        sum += pow(b->b.d.p[k * RANK + i], 2);
    return sum;
}

/* A frame whose reduced data are y: P's rows are orthogonal. */
static inline void stage(bench *b, const double *y)
{
    uint32_t masked;
    uint64_t macs;
    eits_context *ctx = b->b.c.ctx;
    small_reference(ctx->model, BOARD, b->frame);
    for (int k = 0; k < SMALL_FOLDED; ++k) {
        const eits_fold fold = ctx->model->fold[k];
        b->d[k] = 0;
        for (int i = 0; i < RANK; ++i)
            b->d[k] += b->b.d.p[k * RANK + i] * y[i] / energy(b, i);
        b->frame[fold.first] += (eits_real)(BOARD * b->d[k]);
        if (fold.second != EITS_FOLD_NONE)
            b->frame[fold.second] += (eits_real)(BOARD * fold.sign * b->d[k]);
    }
    CHECK_EQUAL(eits_frame_stage(ctx, b->frame, SMALL_ROWS, &masked, &macs), EITS_OK);
}

/* y += part of what the disc answers, as if nothing were projected or whitened again. */
static inline void add_disc(bench *b, const eits_disc *disc, double part, double *y)
{
    eits_real atom[STRIDE];
    eits_context *ctx = b->b.c.ctx;
    const uint32_t count = ctx->projection.count;
    ctx->projection.count = 0;
    (void)eits_disc_atom(ctx, &ctx->scratch, disc, atom, NULL);
    ctx->projection.count = count;
    for (int i = 0; i < RANK; ++i)
        y[i] += part * (double)disc->change * (double)atom[i];
}

static inline void stage_discs(bench *b, const eits_disc *disc, int count)
{
    double y[RANK] = {0};
    for (int k = 0; k < count; ++k)
        add_disc(b, disc + k, 1, y);
    stage(b, y);
}

static inline eits_fit fit_of(eits_context *ctx, const eits_disc *disc, uint32_t count)
{
    eits_fit f = eits_fit_none(ctx, &ctx->scratch);
    f.count = count;
    memcpy(f.disc, disc, count * sizeof *disc);
    eits_fit_restart(ctx, &ctx->scratch, &f);
    eits_fit_explain(ctx, &f);
    return f;
}

static inline eits_answer answer_of(const eits_disc *disc, uint32_t count, uint32_t parameters)
{
    eits_answer a = {.count = count, .parameters = parameters};
    for (uint32_t k = 0; k < count; ++k) {
        a.disc[k] = disc[k];
        a.radius_mm[k] = R(0.9) * disc[k].radius_mm;
        for (uint32_t p = 0; p + EITS_PLACE_PARAMETERS < parameters; ++p)
            a.shape[k][p] = R(0.1) * (eits_real)(p + 1) - R(0.2) * (eits_real)k;
    }
    return a;
}

#endif
