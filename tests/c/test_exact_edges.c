/* The exact solvers where columns depend on each other and MACs run out, at whatever place: the image is finite, and never worse
 * than zero. */
#include "check.h"
#include "dense.h"
#include "small_model.h"

#include "eitskin/solve.h"
#include "vec.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SIDE = 7, N = SIDE * SIDE, RANK = 6 };

/* Columns in groups of three that are alike but for `off` of one number each, every seventh zero. */
static eits_context *set_up(dense_bench *b, double off)
{
    memset(b, 0, sizeof *b);
    b->made = small_model_make((small_spec){.rank = RANK, .side = SIDE, .lipschitz_factor = 9});
    uint32_t size;
    uint8_t *sens = small_model_section(&b->made, "SENS", &size);
    const size_t column = size / N;
    for (size_t j = 0; j < N; ++j) {
        float *values = (float *)(void *)(sens + column * j);
        if (j % 7 == 0)
            memset(values, 0, column);
        else if (j % 3 != 0)
            memcpy(values, values - column / sizeof *values, column);
        values[j % RANK] *= (float)(1 + off);
    }
    small_model_seal(&b->made);
    small_context_open(&b->c, &b->made, 0);
    b->d = dense_of(&b->c.model);
    return &b->c.ctx;
}

static void check_result(const dense_bench *b, double most)
{
    const eits_context *ctx = &b->c.ctx;
    double *x = dense_copy(ctx->x, N), *y = dense_copy(ctx->y, RANK);
    uint32_t nonzeros = 0;
    for (int j = 0; j < N; ++j) {
        CHECK(isfinite((double)ctx->image[j]) && isfinite(x[j]));
        nonzeros += x[j] != 0;
    }
    CHECK_EQUAL(ctx->info.nonzeros, nonzeros);
    CHECK(dense_objective(&b->d, y, x, (double)ctx->info.lambda) <= most);
    free(x), free(y);
}

/* Another solver's coefficients to start from, and less and less to spend. */
static void every_limit_beside_columns_that_depend(void)
{
    static const double offs[] = {0, 1e-7, 1e-4, 3e-3};
    for (int way = 0; way < 16; ++way) {
        dense_bench b;
        eits_context *ctx = set_up(&b, offs[way % 4]);
        eits_options o = ctx->options;
        o.sign = way / 4 % 2 ? EITS_SIGN_BOTH : EITS_SIGN_INCREASE;
        o.lambda_rel = R(way % 2 ? 0.001 : 0.1);
        o.iterations = 30;
        for (uint32_t limit = 40; limit < 12000; limit += 1 + limit / 60) {
            small_new_data(ctx, 81);
            eits_forget(ctx);
            o.mac_limit = 0;
            o.solver = EITS_SOLVER_FISTA;
            o.warm_start = way >= 8;
            CHECK_EQUAL(eits_set_options(ctx, &o), EITS_OK);
            CHECK_EQUAL(eits_solve(ctx), EITS_OK);
            ctx->y[limit % RANK] += R(0.4);
            double *y = dense_copy(ctx->y, RANK);
            const double at_zero = 0.5 * dense_dot(y, y, RANK);
            free(y);
            o.mac_limit = limit;
            o.solver = EITS_SOLVER_ACTIVE_SET;
            CHECK_EQUAL(eits_set_options(ctx, &o), EITS_OK);
            CHECK_EQUAL(eits_solve(ctx), EITS_OK);
            CHECK(ctx->info.macs <= limit);
            CHECK(ctx->info.stop == EITS_STOP_MACS || ctx->info.stop == EITS_STOP_OPTIMUM || ctx->info.stop == EITS_STOP_ITERATIONS);
            check_result(&b, at_zero * (1 + 1e-3));
        }
        dense_bench_close(&b);
    }
}

/* A start whose great coefficients cancel, on columns that are alike: without those that depend it is far worse than zero. */
static void starts_that_cancel(void)
{
    dense_bench b;
    eits_context *ctx = set_up(&b, 0);
    const uint32_t one = 9 + 1, other = 9 + 2; /* of a group of three */
    eits_options o = ctx->options;
    o.sign = EITS_SIGN_BOTH;
    o.solver = EITS_SOLVER_ACTIVE_SET;
    o.warm_start = 1;
    o.lambda_abs = R(1e-5);
    o.iterations = 30;
    CHECK_EQUAL(eits_set_options(ctx, &o), EITS_OK);
    small_new_data(ctx, 83);
    ctx->x[one] = R(300.5);
    ctx->x[other] = R(-300);
    double column[RANK], along = 0;
    for (int i = 0; i < RANK; ++i) {
        column[i] = b.d.s[one * RANK + (uint32_t)i];
        along += column[i] * (double)ctx->y[i];
    }
    if (along < 0) { /* so that the start is better than zero */
        ctx->x[one] = R(-300.5);
        ctx->x[other] = R(300);
    }
    ctx->warm = 1;
    double *y = dense_copy(ctx->y, RANK);
    CHECK_EQUAL(eits_solve(ctx), EITS_OK);
    CHECK_EQUAL(ctx->info.stop, EITS_STOP_OPTIMUM);
    check_result(&b, 0.5 * dense_dot(y, y, RANK));
    CHECK(ctx->info.gap_rel < R(1e-3));
    free(y);
    dense_bench_close(&b);
}

int main(void)
{
    starts_that_cancel();
    every_limit_beside_columns_that_depend();
    return checks_report("exact solvers at their edges");
}
