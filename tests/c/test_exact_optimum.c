/* The active set: its result is the optimum by a duality gap that is written apart from the core,
 * whatever the columns are like and wherever it starts. All solvers: the same bits in every layout.
 */
#include "steps.h"

enum { SIDE = 9, N = SIDE * SIDE, RANK = 12, MANY = 200000 };

static const small_spec RANDOM = {.rank = RANK, .side = SIDE};

static dense_bench b;

static eits_context *set_up(dense_bench *b, small_spec spec, int prepared)
{
    eits_context *ctx = dense_bench_open(b, spec, prepared);
    small_new_data(ctx, 61);
    return ctx;
}

/* lambda: a fraction of the greatest correlation. */
static eits_info solve(eits_context *ctx, eits_solver solver, uint32_t iterations, eits_sign sign,
                       double lambda, double gap)
{
    CHANGE_OPTIONS(ctx, o.solver = solver, o.iterations = iterations, o.sign = sign,
                   o.lambda_abs = 0, o.lambda_rel = (eits_real)lambda, o.lambda_noise_factor = 0,
                   o.gap_rel = (eits_real)gap);
    CHECK_OK(eits_solve(ctx, NULL));
    return *eits_get_info(ctx);
}

/* The gap at the result, in double. */
static void check_gap(const eits_context *ctx, double max_rel)
{
    const uint32_t n = ctx->model->n_pixels, rank = ctx->model->rank;
    double *x = dense_copy(eits_get_coefficients(ctx), n), *y = dense_copy(ctx->frame.y, rank);
    const double gap = dense_gap(&b.d, y, x, (double)ctx->info.lambda, eits_get_options(ctx)->sign),
                 scale = 0.5 * dense_dot(y, y, rank);
    CHECK_NEAR(gap, ctx->info.gap, 300 * EPS * scale);
    CHECK(gap <= max_rel * scale);
    for (uint32_t j = 0; j < n; ++j)
        CHECK(eits_get_options(ctx)->sign == EITS_SIGN_BOTH ||
              (eits_get_options(ctx)->sign == EITS_SIGN_INCREASE ? x[j] >= 0 : x[j] <= 0));
    free(x), free(y);
}

/* Each storage with each sign, each lambda with each sign; with panels and without. */
TEST(it_reaches_the_optimum)
{
    static const struct {
        const char *name;
        eits_storage storage;
        eits_sign sign;
        double lambda;
        int prepared;
    } rows[] = {
        {"f32, increase, many columns", EITS_STORAGE_F32, EITS_SIGN_INCREASE, 1e-3, 0},
        {"f32, decrease, some columns", EITS_STORAGE_F32, EITS_SIGN_DECREASE, 0.03, 1},
        {"f32, both, few columns", EITS_STORAGE_F32, EITS_SIGN_BOTH, 0.5, 0},
        {"f16, increase, some columns", EITS_STORAGE_F16, EITS_SIGN_INCREASE, 0.03, 1},
        {"f16, decrease, few columns", EITS_STORAGE_F16, EITS_SIGN_DECREASE, 0.5, 0},
        {"f16, both, one column", EITS_STORAGE_F16, EITS_SIGN_BOTH, 0.999, 1},
        {"i16, increase, few columns", EITS_STORAGE_I16, EITS_SIGN_INCREASE, 0.5, 0},
        {"i16, decrease, one column", EITS_STORAGE_I16, EITS_SIGN_DECREASE, 0.999, 1},
        {"i16, both, many columns", EITS_STORAGE_I16, EITS_SIGN_BOTH, 1e-3, 0},
        {"i8, increase, one column", EITS_STORAGE_I8, EITS_SIGN_INCREASE, 0.999, 1},
        {"i8, decrease, many columns", EITS_STORAGE_I8, EITS_SIGN_DECREASE, 1e-3, 0},
        {"i8, both, some columns", EITS_STORAGE_I8, EITS_SIGN_BOTH, 0.03, 1},
    };
    EACH_ROW(row, rows) {
        eits_context *ctx = set_up(
            &b, (small_spec){.rank = RANK, .side = SIDE, .storage = row->storage}, row->prepared);
        const eits_info info = solve(ctx, EITS_SOLVER_ACTIVE_SET, MANY, row->sign, row->lambda, 0);
        CHECK_EQUAL(info.stop, EITS_STOP_OPTIMUM);
        CHECK(info.nonzeros >= 1 && info.nonzeros <= RANK);
        check_gap(ctx, BOTH_WIDTHS(2e-6, 1e-14));
    }
}

TEST(a_gap_that_is_asked_for)
{
    eits_context *ctx = set_up(&b, RANDOM, 1);
    const eits_info info = solve(ctx, EITS_SOLVER_ACTIVE_SET, MANY, EITS_SIGN_BOTH, 0.03, 1e-3);
    CHECK_EQUAL(info.stop, EITS_STOP_GAP);
    CHECK(info.gap_rel <= R(1e-3));
    check_gap(ctx, 1.001e-3);
}

/* lambda 0: without a sign rule the support fills the rank and the residual is zero. */
TEST(the_support_reaches_the_rank)
{
    for (int sign = 0; sign < 3; ++sign) {
        eits_context *ctx = set_up(&b, RANDOM, 1);
        const eits_info info = solve(ctx, EITS_SOLVER_ACTIVE_SET, 200, (eits_sign)sign, 0, 0);
        CHECK(info.stop != EITS_STOP_DIVERGED);
        CHECK(info.nonzeros <= RANK);
        if (sign == EITS_SIGN_BOTH)
            CHECK(info.residual <= R(BOTH_WIDTHS(1e-3, 1e-6)) * info.data_norm);
        CHECK(is_finite(ctx));
    }
}

/* Every third column the one before, every seventh zero; and columns that nearly depend on their
 * neighbours. */
TEST(columns_that_depend)
{
    static const struct {
        const char *name;
        double off; /* by which columns that depend differ */
        eits_sign sign;
        double lambda;
        int prepared;
    } rows[] = {
        {"equal, increase, many columns", 0, EITS_SIGN_INCREASE, 1e-4, 0},
        {"equal, decrease, some columns", 0, EITS_SIGN_DECREASE, 0.02, 1},
        {"equal, both, few columns", 0, EITS_SIGN_BOTH, 0.3, 0},
        {"equal, both, many columns", 0, EITS_SIGN_BOTH, 1e-4, 0},
        {"nearly equal, increase, some columns", 1e-4, EITS_SIGN_INCREASE, 0.02, 1},
        {"nearly equal, decrease, few columns", 1e-4, EITS_SIGN_DECREASE, 0.3, 0},
        {"nearly equal, both, some columns", 1e-4, EITS_SIGN_BOTH, 0.02, 1},
        {"nearly equal, both, many columns", 1e-4, EITS_SIGN_BOTH, 1e-4, 0},
    };
    EACH_ROW(row, rows) {
        small_model made =
            small_model_make((small_spec){.rank = RANK, .side = SIDE, .lipschitz_factor = 9});
        small_model_depend(&made, N, RANK, row->off);
        eits_context *ctx = dense_bench_take(&b, made, row->prepared);
        small_new_data(ctx, 61);
        const eits_info info = solve(ctx, EITS_SOLVER_ACTIVE_SET, 50000, row->sign, row->lambda, 0);
        CHECK(info.stop != EITS_STOP_DIVERGED && info.nonzeros >= 1);
        check_gap(ctx, BOTH_WIDTHS(1e-3, 1e-4));
    }
}

/* More directions than pixels, and one pixel. */
TEST(few_pixels)
{
    for (uint32_t side = 1; side <= 3; ++side) {
        eits_context *ctx = set_up(&b, (small_spec){.rank = RANK, .side = side}, 1);
        CHECK_EQUAL(solve(ctx, EITS_SOLVER_ACTIVE_SET, MANY, EITS_SIGN_BOTH, 0.02, 0).stop,
                    EITS_STOP_OPTIMUM);
        check_gap(ctx, BOTH_WIDTHS(1e-5, 1e-12));
    }
}

/* Solves on the context and leaves it with its coefficients, image and info. */
static eits_context *solved(dense_bench *on, eits_storage storage, eits_solver solver, int prepared,
                            int portable)
{
    const small_spec spec = {.rank = RANK, .side = SIDE, .storage = storage};
    eits_context *ctx = set_up(on, spec, prepared);
    CHECK_EQUAL(ctx->columns.panels != NULL, prepared);
    CHECK_OK(eits_use_portable_kernels(ctx, portable));
    (void)solve(ctx, solver, 60, EITS_SIGN_BOTH, 0.005, 0);
    CHECK(ctx->info.nonzeros > 0);
    return ctx;
}

/* With panels or without, by portable or by the fastest kernels. */
TEST(same_bits_in_every_layout)
{
    static const struct {
        const char *name;
        eits_storage storage;
        eits_solver solver;
    } rows[] = {
        {"FISTA, f32", EITS_STORAGE_F32, EITS_SOLVER_FISTA},
        {"FISTA, f16", EITS_STORAGE_F16, EITS_SOLVER_FISTA},
        {"FISTA, i16", EITS_STORAGE_I16, EITS_SOLVER_FISTA},
        {"FISTA, i8", EITS_STORAGE_I8, EITS_SOLVER_FISTA},
        {"working set, f32", EITS_STORAGE_F32, EITS_SOLVER_WORKING_SET},
        {"working set, f16", EITS_STORAGE_F16, EITS_SOLVER_WORKING_SET},
        {"working set, i16", EITS_STORAGE_I16, EITS_SOLVER_WORKING_SET},
        {"working set, i8", EITS_STORAGE_I8, EITS_SOLVER_WORKING_SET},
        {"active set, f32", EITS_STORAGE_F32, EITS_SOLVER_ACTIVE_SET},
        {"active set, f16", EITS_STORAGE_F16, EITS_SOLVER_ACTIVE_SET},
        {"active set, i16", EITS_STORAGE_I16, EITS_SOLVER_ACTIVE_SET},
        {"active set, i8", EITS_STORAGE_I8, EITS_SOLVER_ACTIVE_SET},
    };
    EACH_ROW(row, rows) {
        dense_bench first = {0};
        const eits_context *plain = solved(&first, row->storage, row->solver, 0, 0);
        static const struct {
            int prepared, portable;
        } layouts[] = {{1, 0}, {0, 1}, {1, 1}};
        for (size_t l = 0; IN_TABLE(l, layouts); ++l) {
            dense_bench other = {0};
            const eits_context *ctx =
                solved(&other, row->storage, row->solver, layouts[l].prepared, layouts[l].portable);
            CHECK(memcmp(ctx->solver.x, plain->solver.x, N * sizeof(eits_real)) == 0);
            CHECK(memcmp(ctx->solver.image, plain->solver.image, N * sizeof(eits_real)) == 0);
            CHECK(memcmp(&ctx->info, &plain->info, sizeof ctx->info) == 0);
            dense_bench_close(&other);
        }
        dense_bench_close(&first);
    }
}

/* From FISTA's many coefficients, from other data's, from the optimum, it comes to the same
 * optimum. */
TEST(warm_starts)
{
    for (int sign = 0; sign < 3; ++sign) {
        eits_context *ctx = set_up(&b, RANDOM, sign % 2);
        ctx->options.warm_start = 1;
        (void)solve(ctx, EITS_SOLVER_FISTA, 2, (eits_sign)sign, 0.001, 0);
        const uint32_t many = ctx->info.nonzeros;
        CHECK(many > RANK);
        CHECK_EQUAL(solve(ctx, EITS_SOLVER_ACTIVE_SET, MANY, (eits_sign)sign, 0.01, 0).stop,
                    EITS_STOP_OPTIMUM);
        check_gap(ctx, BOTH_WIDTHS(1e-4, 1e-10));
        small_new_data(ctx, 62);
        CHECK_EQUAL(solve(ctx, EITS_SOLVER_ACTIVE_SET, MANY, (eits_sign)sign, 0.01, 0).stop,
                    EITS_STOP_OPTIMUM);
        check_gap(ctx, BOTH_WIDTHS(1e-4, 1e-10));
        const eits_info again = solve(ctx, EITS_SOLVER_ACTIVE_SET, MANY, (eits_sign)sign, 0.01, 0);
        CHECK_EQUAL(again.stop, EITS_STOP_OPTIMUM);
        CHECK(again.iterations <= 3);
        check_gap(ctx, BOTH_WIDTHS(1e-4, 1e-10));
        for (uint32_t i = 0; i < RANK; ++i)
            ctx->frame.y[i] = -ctx->frame.y[i]; /* where zero is the better start */
        CHECK_EQUAL(solve(ctx, EITS_SOLVER_ACTIVE_SET, MANY, (eits_sign)sign, 0.01, 0).stop,
                    EITS_STOP_OPTIMUM);
        check_gap(ctx, BOTH_WIDTHS(1e-4, 1e-10));
    }
}

/* The optimum of the same data is the start: the active set has next to nothing to do. */
TEST(from_the_optimum)
{
    for (int sign = 0; sign < 3; ++sign) {
        eits_context *ctx = set_up(&b, RANDOM, sign % 2);
        ctx->options.warm_start = 1;
        const eits_info cold = solve(ctx, EITS_SOLVER_ACTIVE_SET, MANY, (eits_sign)sign, 0.01, 0);
        const eits_info warm = solve(ctx, EITS_SOLVER_ACTIVE_SET, MANY, (eits_sign)sign, 0.01, 0);
        CHECK(cold.iterations >= 1 && warm.iterations == 0 && warm.macs < cold.macs / 4);
        CHECK_EQUAL(warm.nonzeros, cold.nonzeros);
    }
}

static double objective(const eits_context *ctx)
{
    double *x = dense_copy(eits_get_coefficients(ctx), N), *y = dense_copy(ctx->frame.y, RANK);
    const double value = dense_objective(&b.d, y, x, (double)ctx->info.lambda);
    free(x), free(y);
    return value;
}

/* Each further round lowers the objective. */
TEST(it_never_rises)
{
    double before = INFINITY;
    for (uint32_t count = 1; count <= 25; ++count) {
        eits_context *ctx = set_up(&b, RANDOM, 0);
        const eits_info info =
            solve(ctx, EITS_SOLVER_ACTIVE_SET, count, EITS_SIGN_INCREASE, 0.003, 0);
        CHECK(info.iterations <= count);
        const double now = objective(ctx);
        CHECK(now <= before * (1 + 20 * EPS));
        before = now;
    }
}

/* One direction, several, all but one ignored. */
TEST(beside_a_basis)
{
    static const int lost[] = {0, 1, 4, RANK - 2};
    for (int k = 0; k < 4; ++k) {
        eits_context *ctx = set_up(&b, RANDOM, k % 2);
        eits_real reference[SMALL_ROWS], frame[SMALL_ROWS];
        uint64_t state = 63;
        small_reference(&b.c.model, 1, reference);
        vary(frame, reference, 0.3, &state);
        for (int i = 0; i < lost[k]; ++i)
            frame[b.c.model.fold[i].first] =
                frame[b.c.model.fold[i].second > SMALL_ROWS ? b.c.model.fold[i].first
                                                            : b.c.model.fold[i].second] = R(NAN);
        CHECK_OK(eits_reference_set(ctx, reference, SMALL_ROWS));
        CHANGE_OPTIONS(ctx, o.solver = EITS_SOLVER_ACTIVE_SET, o.iterations = MANY,
                       o.max_masked = SMALL_ROWS, o.sign = EITS_SIGN_BOTH, o.lambda_rel = R(0.01));
        CHECK_OK(eits_reconstruct(ctx, frame, SMALL_ROWS, NULL, NULL));
        CHECK_EQUAL(ctx->projection.count, lost[k] + 1);
        CHECK_EQUAL(ctx->info.stop, EITS_STOP_OPTIMUM);
        CHECK(ctx->info.nonzeros >= 1 && ctx->info.gap_rel <= R(BOTH_WIDTHS(1e-4, 1e-10)));
        CHECK(ctx->info.nonzeros <= (uint32_t)(RANK - 1 - lost[k]));
    }
}

TEST(numbers_that_cannot_be)
{
    static const double wild[] = {NAN, INFINITY, BOTH_WIDTHS(1e25, 1e200),
                                  BOTH_WIDTHS(1e-25, 1e-200), 0};
    for (size_t k = 0; IN_TABLE(k, wild); ++k) {
        for (int whole = 0; whole < 2; ++whole) {
            eits_context *ctx = set_up(&b, RANDOM, 0);
            for (uint32_t i = 0; i < (whole ? RANK : 1u); ++i)
                ctx->frame.y[i] = (eits_real)(wild[k] * (i % 2 ? 1 : 0.7));
            CHANGE_OPTIONS(ctx, o.solver = EITS_SOLVER_ACTIVE_SET);
            const eits_status status = eits_solve(ctx, NULL);
            CHECK(k > 1 || status == EITS_E_NOT_FINITE);
            for (int j = 0; j < N; ++j)
                CHECK(isfinite((double)eits_get_image(ctx)[j]) &&
                      isfinite((double)eits_get_coefficients(ctx)[j]) &&
                      (k > 1 || eits_get_image(ctx)[j] == 0));
            CHECK(isfinite((double)ctx->info.gap) && isfinite((double)ctx->info.gap_rel) &&
                  isfinite((double)ctx->info.residual));
        }
    }
}

RUN_TESTS("active set", dense_bench_close(&b))
