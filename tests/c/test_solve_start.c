/* The start of a solve. It must not use a start that is worse than zero, nor what is left of a
 * halved step, of another stage's scratch, or of a frame that was rejected or empty. */
#include "steps.h"

static dense_bench b;

enum { SIDE = 8, N = SIDE * SIDE, RANK = 16 };

static const small_spec RANDOM = {.rank = RANK, .side = SIDE};
static const small_spec WAVES = {.rank = RANK, .side = SIDE, .shape = SMALL_WAVES};

static void set_options(eits_context *ctx, eits_options o)
{
    CHECK_OK(eits_set_options(ctx, &o));
}

static eits_info solve(eits_context *ctx)
{
    CHECK_OK(eits_solve(ctx, NULL));
    return *eits_get_info(ctx);
}

/* After a halved step the iterations that are left are those from zero, with fresh momentum. */
TEST(a_halved_step_starts_afresh)
{
    small_spec spec = RANDOM;
    spec.lipschitz_factor = 1.02 / 6;
    eits_context *ctx = dense_bench_open(&b, spec, 0);
    small_new_data(ctx, 91);
    /* so that each check is made */
    CHANGE_OPTIONS(ctx, o.solver = EITS_SOLVER_FISTA, o.lambda_rel = R(0.1), o.gap_rel = R(1e-30),
                   o.iterations = 60, o.gap_every = 10);
    const eits_info info = solve(ctx);
    CHECK(info.step_halvings >= 1 && info.step_halvings <= 3);
    const double lipschitz = (double)b.c.model.lipschitz * pow(2, info.step_halvings);
    double *y = dense_copy(ctx->frame.y, RANK), *x = dense_numbers(N);
    dense_fista(&b.d, y, (double)info.lambda, lipschitz, 60 - 10 * info.step_halvings,
                EITS_SIGN_INCREASE, x);
    CHECK(dense_greatest_difference(x, eits_get_coefficients(ctx), N) < 2000 * EPS);
    free(y), free(x);
}

/* The residual is small at the start, but the penalty is not: zero is the better start, to the bit.
 */
TEST(a_start_worse_than_zero)
{
    for (int solver = 0; solver < SOLVERS; ++solver) {
        dense_bench warm = {0}, cold = {0};
        eits_context *ctx = dense_bench_open(&warm, RANDOM, 0),
                     *other = dense_bench_open(&cold, RANDOM, 0);
        small_new_data(ctx, 92);
        small_new_data(other, 92);
        eits_options o = *eits_get_options(ctx);
        o.solver = each_solver(solver);
        o.warm_start = 1;
        o.lambda_rel = R(1e-4);
        o.iterations = 3000;
        set_options(ctx, o);
        CHECK(solve(ctx).residual < R(0.5) * ctx->info.data_norm);
        o.lambda_rel = R(0.8);
        o.iterations = 3;
        set_options(ctx, o);
        set_options(other, o);
        const eits_info info = solve(ctx);
        CHECK_EQUAL(info.nonzeros, solve(other).nonzeros);
        CHECK(memcmp(eits_get_coefficients(ctx), eits_get_coefficients(other),
                     N * sizeof(eits_real)) == 0);
        dense_bench_close(&warm);
        dense_bench_close(&cold);
    }
}

/* Frame k of a touch that wanders. */
static void wandering_frame(const dense_bench *b, uint32_t k, eits_real *frame)
{
    uint64_t state = 93 + k / 2;
    small_reference(&b->c.model, 1, frame);
    vary(frame, frame, 0.05, &state);
}

static eits_context *open_warm(dense_bench *b, int solver)
{
    eits_context *ctx = dense_bench_open(b, WAVES, 0);
    eits_real frame[SMALL_ROWS];
    small_reference(&b->c.model, 1, frame);
    CHECK_OK(eits_reference_set(ctx, frame, SMALL_ROWS));
    CHANGE_OPTIONS(ctx, o.solver = each_solver(solver), o.warm_start = 1, o.iterations = 4,
                   o.sign = EITS_SIGN_BOTH);
    return ctx;
}

/* Whether touches are looked for between warm frames makes no difference to the images. */
TEST(touches_leave_no_trace)
{
    for (int solver = 0; solver < SOLVERS; ++solver) {
        dense_bench seen = {0}, unseen = {0};
        eits_context *ctx = open_warm(&seen, solver), *other = open_warm(&unseen, solver);
        for (uint32_t k = 0; k < 12; ++k) {
            eits_real frame[SMALL_ROWS];
            uint32_t count;
            wandering_frame(&seen, k, frame);
            CHECK_OK(eits_reconstruct(ctx, frame, SMALL_ROWS, NULL, NULL));
            CHECK_OK(eits_reconstruct(other, frame, SMALL_ROWS, NULL, NULL));
            CHECK(memcmp(eits_get_image(ctx), eits_get_image(other), N * sizeof(eits_real)) == 0);
            CHECK(memcmp(eits_get_info(ctx), eits_get_info(other), sizeof *eits_get_info(ctx)) ==
                  0);
            CHECK_OK(eits_find_touches(ctx, NULL, 0, &count));
            CHECK(count > 0);
        }
        dense_bench_close(&seen);
        dense_bench_close(&unseen);
    }
}

/* A frame after one that was refused, or showed nothing, starts cold: the same bits for the same
 * MACs as in a fresh context. */
TEST(cold_after_nothing)
{
    for (int why = 0; why < 3; ++why) {
        dense_bench b = {0}, fresh = {0};
        eits_context *ctx = open_warm(&b, EITS_SOLVER_WORKING_SET),
                     *other = open_warm(&fresh, EITS_SOLVER_WORKING_SET);
        eits_real frame[SMALL_ROWS], nothing[SMALL_ROWS];
        small_reference(&b.c.model, 1, nothing); /* the reference itself: zero is the answer */
        for (int i = 0; why == 1 && i < SMALL_ROWS; ++i)
            nothing[i] = R(NAN);
        for (int i = 0; why == 2 && i < SMALL_ROWS; ++i)
            nothing[i] = 0;
        wandering_frame(&b, 0, frame);
        CHECK_OK(eits_reconstruct(ctx, frame, SMALL_ROWS, NULL, NULL));
        CHECK_EQUAL(eits_reconstruct(ctx, nothing, SMALL_ROWS, NULL, NULL),
                    why == 0   ? EITS_OK
                    : why == 1 ? EITS_E_FRAME_ROWS
                               : EITS_E_FRAME_ZERO);
        /* makes the basis */
        CHECK_EQUAL(eits_reconstruct(other, nothing, SMALL_ROWS, NULL, NULL) == EITS_OK, why == 0);
        wandering_frame(&b, 4, frame);
        CHECK_OK(eits_reconstruct(other, frame, SMALL_ROWS, NULL, NULL));
        CHECK_OK(eits_reconstruct(ctx, frame, SMALL_ROWS, NULL, NULL));
        CHECK(memcmp(eits_get_image(ctx), eits_get_image(other), N * sizeof(eits_real)) == 0);
        CHECK(ctx->info.iterations == other->info.iterations && ctx->info.gap == other->info.gap);
        if (why == 0)
            CHECK_EQUAL(ctx->info.macs, other->info.macs);
        dense_bench_close(&b);
        dense_bench_close(&fresh);
    }
}

/* No interval is so long that it comes round to a short one. */
TEST(the_longest_intervals)
{
    static const uint32_t intervals[] = {1000, UINT32_MAX - 1, UINT32_MAX};
    uint64_t macs[3];
    for (int k = 0; k < 3; ++k) {
        eits_context *ctx = dense_bench_open(&b, RANDOM, 0);
        small_new_data(ctx, 95);
        CHANGE_OPTIONS(ctx, o.solver = EITS_SOLVER_WORKING_SET, o.iterations = 100,
                       o.gap_every = intervals[k]);
        macs[k] = solve(ctx).macs;
    }
    CHECK_EQUAL(macs[1], macs[0]);
    CHECK_EQUAL(macs[2], macs[0]);
}

/* A hundred thousand iterations end where the gap cannot fall any further, and nothing grows on the
 * way. */
TEST(iterations_without_number)
{
    for (int solver = 0; solver < SOLVERS; ++solver) {
        eits_context *ctx = dense_bench_open(&b, RANDOM, 1);
        small_new_data(ctx, 96);
        CHANGE_OPTIONS(ctx, o.solver = each_solver(solver), o.iterations = 100000,
                       o.lambda_rel = R(0.05));
        const eits_info info = solve(ctx);
        CHECK(solver < 2 ? info.stop == EITS_STOP_ITERATIONS && info.iterations == 100000
                         : info.stop == EITS_STOP_OPTIMUM);
        CHECK(info.gap_rel >= 0 && info.gap_rel < R(BOTH_WIDTHS(1e-5, 1e-12)) &&
              info.step_halvings == 0);
        for (int j = 0; j < N; ++j)
            CHECK(isfinite((double)eits_get_coefficients(ctx)[j]) &&
                  eits_get_coefficients(ctx)[j] >= 0);
    }
}

/* Steps more than twice too long that throw every coefficient beyond its sign, to zero, whenever
 * one looks. */
TEST(steps_that_end_at_zero)
{
    for (int factor = 40; factor < 50; factor += 3) {
        for (uint32_t every = 1; every < 6; ++every) {
            eits_context *ctx = dense_bench_open(&b,
                                                 (small_spec){.rank = 6,
                                                              .side = 4,
                                                              .shape = SMALL_IDENTITY,
                                                              .lipschitz_factor = 0.01 * factor},
                                                 0);
            for (uint32_t i = 0; i < 6; ++i)
                ctx->frame.y[i] = (eits_real)(1 + 0.1 * i);
            CHANGE_OPTIONS(ctx, o.solver = EITS_SOLVER_FISTA, o.lambda_rel = R(0.1),
                           o.detection_factor = 0, o.gap_every = every, o.iterations = 60);
            CHECK_OK(eits_solve(ctx, NULL));
            CHECK_EQUAL(ctx->info.stop, EITS_STOP_ITERATIONS);
            CHECK_EQUAL(ctx->info.nonzeros, 6);
            CHECK(ctx->info.step_halvings > 0 && ctx->info.gap_rel < R(1e-3));
        }
    }
}

RUN_TESTS("starts", dense_bench_close(&b))
