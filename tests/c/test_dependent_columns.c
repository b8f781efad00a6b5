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
    static const struct {
        const char *name;
        double off; /* by which columns that depend differ */
        eits_sign sign;
        double lambda;
        uint32_t warm;
    } rows[] = {
        {"equal, increase, cold", 0, EITS_SIGN_INCREASE, 0.1, 0},
        {"equal, both, warm", 0, EITS_SIGN_BOTH, 0.001, 1},
        {"off by rounding, increase, warm", 1e-7, EITS_SIGN_INCREASE, 0.001, 1},
        {"off by rounding, both, cold", 1e-7, EITS_SIGN_BOTH, 0.1, 0},
        {"nearly equal, increase, cold", 1e-4, EITS_SIGN_INCREASE, 0.001, 0},
        {"nearly equal, both, warm", 1e-4, EITS_SIGN_BOTH, 0.1, 1},
        {"alike, increase, warm", 3e-3, EITS_SIGN_INCREASE, 0.1, 1},
        {"alike, both, cold", 3e-3, EITS_SIGN_BOTH, 0.001, 0},
    };
    EACH_ROW(row, rows) {
        eits_context *ctx = set_up(&b, row->off);
        eits_options o = *eits_get_options(ctx);
        o.sign = row->sign;
        o.lambda_rel = (eits_real)row->lambda;
        o.iterations = 30;
        for (uint32_t limit = 40; limit < 12000; limit += 1 + limit / 60) {
            small_new_data(ctx, 81);
            eits_forget(ctx);
            o.mac_limit = 0;
            o.solver = EITS_SOLVER_FISTA;
            o.warm_start = row->warm;
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

/* A start with large coefficients that cancel, on columns that are nearly equal. Without the
 * dependent ones it is far worse than zero. */
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

/* Without a penalty the first round already fails on these data: FISTA would go on, but no
 * iteration is left. */
TEST(a_round_that_fails_at_the_last_iteration)
{
    eits_context *ctx = set_up(&b, 3e-3);
    CHANGE_OPTIONS(ctx, o.solver = EITS_SOLVER_ACTIVE_SET, o.sign = EITS_SIGN_BOTH,
                   o.lambda_rel = o.lambda_noise_factor = 0, o.iterations = 1);
    small_new_data(ctx, 83);
    ctx->frame.y[1] += R(0.4);
    double *y = dense_copy(ctx->frame.y, RANK);
    CHECK_OK(eits_solve(ctx, NULL));
    CHECK_EQUAL(ctx->info.stop, EITS_STOP_ITERATIONS);
    CHECK_EQUAL(ctx->info.iterations, 1);
    check_result(&b, 0.5 * dense_dot(y, y, RANK));
    free(y);
}

/* The optimum to rounding, in few rounds. */
TEST(the_active_set_ends_soon)
{
    enum { RANK_HERE = 12, ROUNDS = 25 };
    static const struct {
        const char *name;
        eits_storage storage;
        eits_sign sign;
        double lambda;
    } rows[] = {
        {"f32, increase, many columns", EITS_STORAGE_F32, EITS_SIGN_INCREASE, 0.003},
        {"f32, decrease, some columns", EITS_STORAGE_F32, EITS_SIGN_DECREASE, 0.03},
        {"f32, both, few columns", EITS_STORAGE_F32, EITS_SIGN_BOTH, 0.3},
        {"f16, increase, some columns", EITS_STORAGE_F16, EITS_SIGN_INCREASE, 0.03},
        {"f16, decrease, few columns", EITS_STORAGE_F16, EITS_SIGN_DECREASE, 0.3},
        {"f16, both, many columns", EITS_STORAGE_F16, EITS_SIGN_BOTH, 0.003},
        {"i16, increase, few columns", EITS_STORAGE_I16, EITS_SIGN_INCREASE, 0.3},
        {"i16, decrease, many columns", EITS_STORAGE_I16, EITS_SIGN_DECREASE, 0.003},
        {"i16, both, some columns", EITS_STORAGE_I16, EITS_SIGN_BOTH, 0.03},
        {"i8, increase, many columns", EITS_STORAGE_I8, EITS_SIGN_INCREASE, 0.003},
        {"i8, decrease, some columns", EITS_STORAGE_I8, EITS_SIGN_DECREASE, 0.03},
        {"i8, both, few columns", EITS_STORAGE_I8, EITS_SIGN_BOTH, 0.3},
    };
    uint64_t seed = 85;
    EACH_ROW(row, rows) {
        const small_spec spec = {.rank = RANK_HERE, .side = 9, .storage = row->storage};
        eits_context *ctx = dense_bench_open(&b, spec, (int)(seed % 2));
        small_new_data(ctx, seed++);
        CHANGE_OPTIONS(ctx, o.solver = EITS_SOLVER_ACTIVE_SET, o.sign = row->sign,
                       o.iterations = ROUNDS, o.lambda_rel = (eits_real)row->lambda);
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
