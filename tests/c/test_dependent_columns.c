/* The active set if columns depend on each other and the multiply-accumulates run out, wherever
 * that is: the image is finite, and never worse than zero. */
#include "steps.h"

static dense_bench b;

enum { SIDE = 7, N = SIDE * SIDE, RANK = 6 };

static eits_context *set_up(dense_bench *b, double off)
{
    small_model made =
        small_model_make((small_spec){.rank = RANK, .side = SIDE, .lipschitz_factor = 9});
    small_model_depend(&made, N, RANK, off);
    return dense_bench_take(b, made, 0);
}

static void check_result(const dense_bench *b, double max)
{
    const eits_context *ctx = b->c.ctx;
    double *x = dense_copy(eits_get_coefficients(ctx), N), *y = dense_copy(ctx->frame.y, RANK);
    CHECK(is_finite(ctx));
    CHECK_EQUAL(ctx->info.nonzeros, count_nonzeros(ctx));
    CHECK(dense_objective(&b->d, y, x, (double)ctx->info.lambda) <= max);
    free(x), free(y);
}

/* Another solver's coefficients to start from, and less and less to spend. */
TEST(every_limit_beside_columns_that_depend)
{
    static const double offs[] = {0, 1e-7, 1e-4, 3e-3};
    for (int way = 0; way < 16; ++way) {
        eits_context *ctx = set_up(&b, offs[way % 4]);
        eits_options o = *eits_get_options(ctx);
        o.sign = way / 4 % 2 ? EITS_SIGN_BOTH : EITS_SIGN_INCREASE;
        o.lambda_rel = R(way % 2 ? 0.001 : 0.1);
        o.iterations = 30;
        for (uint32_t limit = 40; limit < 12000; limit += 1 + limit / 60) {
            small_new_data(ctx, 81);
            eits_forget(ctx);
            o.mac_limit = 0;
            o.solver = EITS_SOLVER_FISTA;
            o.warm_start = way >= 8;
            CHECK_OK(eits_set_options(ctx, &o));
            CHECK_OK(eits_solve(ctx, NULL));
            ctx->frame.y[limit % RANK] += R(0.4);
            double *y = dense_copy(ctx->frame.y, RANK);
            const double at_zero = 0.5 * dense_dot(y, y, RANK);
            free(y);
            o.mac_limit = limit;
            o.solver = EITS_SOLVER_ACTIVE_SET;
            CHECK_OK(eits_set_options(ctx, &o));
            CHECK_OK(eits_solve(ctx, NULL));
            CHECK(ctx->info.macs <= limit);
            CHECK(ctx->info.stop == EITS_STOP_MACS || ctx->info.stop == EITS_STOP_OPTIMUM ||
                  ctx->info.stop == EITS_STOP_ITERATIONS);
            check_result(&b, at_zero * (1 + 1e-3));
        }
    }
}

/* A start whose great coefficients cancel, on columns that are alike: without those that depend it
 * is far worse than zero. */
TEST(starts_that_cancel)
{
    eits_context *ctx = set_up(&b, 0);
    const uint32_t one = 9 + 1, other = 9 + 2; /* of a group of three */
    CHANGE_OPTIONS(ctx, o.sign = EITS_SIGN_BOTH, o.solver = EITS_SOLVER_ACTIVE_SET,
                   o.warm_start = 1, o.lambda_abs = R(1e-5), o.iterations = 30);
    small_new_data(ctx, 83);
    ctx->solver.x[one] = R(300.5);
    ctx->solver.x[other] = R(-300);
    double column[RANK], along = 0;
    for (int i = 0; i < RANK; ++i) {
        column[i] = b.d.s[one * RANK + (uint32_t)i];
        along += column[i] * (double)ctx->frame.y[i];
    }
    if (along < 0) { /* so that the start is better than zero */
        ctx->solver.x[one] = R(-300.5);
        ctx->solver.x[other] = R(300);
    }
    ctx->solver.warm = 1;
    double *y = dense_copy(ctx->frame.y, RANK);
    CHECK_OK(eits_solve(ctx, NULL));
    CHECK_EQUAL(ctx->info.stop, EITS_STOP_OPTIMUM);
    check_result(&b, 0.5 * dense_dot(y, y, RANK));
    CHECK(ctx->info.gap_rel < R(1e-3));
    free(y);
}

/* The optimum to rounding, in few rounds. */
TEST(the_active_set_ends_soon)
{
    enum { RANK_HERE = 12, ROUNDS = 25 };
    static const double lambdas[] = {0.003, 0.03, 0.3};
    for (int way = 0; way < 36; ++way) {
        eits_context *ctx = dense_bench_open(
            &b, (small_spec){.rank = RANK_HERE, .side = 9, .storage = (eits_storage)(way / 9)},
            way % 2);
        small_new_data(ctx, 85 + (uint64_t)way);
        CHANGE_OPTIONS(ctx, o.solver = EITS_SOLVER_ACTIVE_SET, o.sign = (eits_sign)(way / 3 % 3),
                       o.iterations = ROUNDS, o.lambda_rel = (eits_real)lambdas[way % 3]);
        CHECK_OK(eits_solve(ctx, NULL));
        CHECK_EQUAL(ctx->info.stop, EITS_STOP_OPTIMUM);
        CHECK(ctx->info.iterations < ROUNDS && ctx->info.nonzeros <= RANK_HERE);
        double *x = dense_copy(eits_get_coefficients(ctx), 81),
               *y = dense_copy(ctx->frame.y, RANK_HERE);
        const double gap = dense_gap(&b.d, y, x, (double)ctx->info.lambda, ctx->options.sign);
        CHECK(gap <= BOTH_WIDTHS(3e-6, 1e-14) * 0.5 * dense_dot(y, y, RANK_HERE));
        free(x), free(y);
    }
}

/* Columns of which a row left out hides all but rounding are not taken in, and no reason to go on
 * for ever. */
TEST(hidden_columns)
{
    small_model made = small_model_make((small_spec){.rank = RANK, .side = SIDE});
    uint32_t size, k = 3;
    uint8_t *sens = small_model_section(&made, "SENS", &size);
    uint64_t state = 3;
    for (size_t j = 0; j < N; ++j) {
        const float *hidden =
            (const float *)(const void *)small_model_section(&made, "REDU", NULL) +
            EITS_STRIDE(RANK) * k;
        for (size_t i = 0; i < RANK; ++i)
            small_put_f32(sens + size / N * j + 4 * i,
                          hidden[i] * (float)(1 + BOTH_WIDTHS(1e-3, 2e-6) * small_random(&state)));
    }
    eits_context *ctx = dense_bench_take(&b, made, 0);
    CHANGE_OPTIONS(ctx, o.solver = EITS_SOLVER_ACTIVE_SET, o.diagnostics = o.project_reference = 0,
                   o.max_masked = SMALL_ROWS, o.detection_factor = o.gap_rel = 0);
    eits_real frame[SMALL_ROWS];
    small_reference(ctx->model, 1, frame);
    CHECK_OK(eits_reference_set(ctx, frame, SMALL_ROWS));
    vary(frame, frame, 0.2, &state);
    mask_fold(ctx, k);
    CHECK_OK(eits_reconstruct(ctx, frame, SMALL_ROWS, NULL, NULL));
    CHECK(ctx->projection.count == 1 && ctx->info.lambda > 0);
    CHECK_EQUAL(ctx->info.nonzeros, 0);
    CHECK_EQUAL(ctx->info.stop, EITS_STOP_OPTIMUM);
}

RUN_TESTS("active set at its edges", dense_bench_close(&b))
