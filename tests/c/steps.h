/* Headers and steps that most tests of the core share. */
#ifndef EITSKIN_TEST_STEPS_H
#define EITSKIN_TEST_STEPS_H

#include "check.h"
#include "dense.h"
#include "small_model.h"

#include "base/vec.h"
#include "eitskin/frame.h"
#include "eitskin/solve.h"
#include "eitskin/touch.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A reference of so many of these frames. */
#define LEARN(ctx, count, frames)                                             \
    do {                                                                      \
        CHECK_OK(eits_reference_begin(ctx, count));                           \
        for (uint32_t learned = 0; learned < (uint32_t)(count); ++learned)    \
            CHECK_OK(eits_reference_add(ctx, (frames)[learned], SMALL_ROWS)); \
        CHECK_OK(eits_reference_finish(ctx));                                 \
    } while (0)

/* Each solver, of SOLVERS: their numbers have a gap at 2, which is reserved. */
enum { SOLVERS = 3 };

static inline eits_solver each_solver(int k)
{
    static const eits_solver solvers[SOLVERS] = {EITS_SOLVER_FISTA, EITS_SOLVER_WORKING_SET,
                                                 EITS_SOLVER_ACTIVE_SET};
    return solvers[k];
}

/* The frame stage, whatever it leaves out and costs. */
#define STAGE(ctx, frame) \
    CHECK_OK(eits_frame_stage(ctx, frame, SMALL_ROWS, &(uint32_t){0}, &(uint64_t){0}))

static inline void mask_fold(eits_context *ctx, uint32_t k)
{
    const eits_fold fold = ctx->model->fold[k];
    CHECK_OK(eits_mask_row(ctx, fold.first, 1));
    if (fold.second != EITS_FOLD_NONE)
        CHECK_OK(eits_mask_row(ctx, fold.second, 1));
}

/* Both rows of fold k become no numbers. */
static inline void lose_fold(const eits_model *model, uint32_t k, eits_real *frame)
{
    const eits_fold fold = model->fold[k];
    frame[fold.first] = R(NAN);
    if (fold.second != EITS_FOLD_NONE)
        frame[fold.second] = R(NAN);
}

/* Each row of `from`, changed by up to the fraction `by` of itself. */
static inline void vary(eits_real *out, const eits_real *from, double by, uint64_t *state)
{
    for (int i = 0; i < SMALL_ROWS; ++i)
        out[i] = from[i] * (eits_real)(1 + by * small_random(state));
}

static inline uint32_t count_nonzeros(const eits_context *ctx)
{
    uint32_t count = 0;
    for (uint32_t j = 0; j < ctx->model->n_pixels; ++j)
        count += ctx->solver.x[j] != 0;
    return count;
}

/* Whether image and coefficients are wholly zero; wholly finite. */
static inline int is_cleared(const eits_context *ctx)
{
    int all = 1;
    for (uint32_t j = 0; j < ctx->model->n_pixels; ++j)
        all &= ctx->solver.image[j] == 0 && ctx->solver.x[j] == 0;
    return all;
}

static inline int is_finite(const eits_context *ctx)
{
    int all = 1;
    for (uint32_t j = 0; j < ctx->model->n_pixels; ++j)
        all &= eits_is_finite(ctx->solver.image[j]) && eits_is_finite(ctx->solver.x[j]);
    return all;
}

#endif
