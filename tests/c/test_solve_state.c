/* Influences on a solve from outside the frame: detection threshold and lambda rule, warm start, a
 * wrong step, units. */
#include "steps.h"

enum { SIDE = 8, N = SIDE * SIDE, RANK = 16 };

static dense_bench b;

static eits_context *set_up(dense_bench *b, small_spec spec)
{
    return dense_bench_open(b, spec, 1);
}

static const small_spec RANDOM = {.rank = RANK, .side = SIDE};

/* y = S x for two patches of x, times `size`, plus noise; `shift` moves the patches. */
static void fill_y(dense_bench *b, double size, double noise, uint32_t shift)
{
    uint64_t state = 61;
    for (uint32_t i = 0; i < RANK; ++i) {
        double sum = noise * small_random(&state);
        for (uint32_t k = 0; k < 4; ++k) {
            const uint32_t j = (k < 2 ? 9 + k : 41 + 2 * k) + shift;
            sum += size * b->d.s[(size_t)j * RANK + i];
        }
        b->c.ctx->frame.y[i] = (eits_real)sum;
    }
}

static eits_info solve(eits_context *ctx)
{
    CHECK_OK(eits_solve(ctx, NULL));
    return *eits_get_info(ctx);
}

TEST(detection_threshold_and_lambda_rule)
{
    eits_context *ctx = set_up(&b, RANDOM);
    fill_y(&b, 1, 0, 0);
    CHANGE_OPTIONS(ctx, o.detection_factor = R(1.5), o.lambda_rel = R(0.1),
                   o.lambda_noise_factor = R(0.5));
    eits_info info = solve(ctx); /* the noise is not known: nothing is below a threshold */
    const double top = (double)info.lambda_max;
    CHECK(top > 0.1 && info.stop == EITS_STOP_ITERATIONS);
    CHECK_NEAR(info.lambda, 0.1 * top, 2 * EPS * top);
    ctx->reference.lambda_noise = (eits_real)(0.1 * top);
    info = solve(ctx); /* 0.05 of lambda_max by the noise, 0.1 by the fraction */
    CHECK_NEAR(info.lambda, 0.1 * top, 2 * EPS * top);
    CHECK_NEAR(info.lambda_noise, 0.1 * top, 2 * EPS * top);
    ctx->reference.lambda_noise = (eits_real)(0.5 * top);
    info = solve(ctx);
    CHECK_NEAR(info.lambda, 0.25 * top, 2 * EPS * top);
    /* lambda_abs overrides both */
    CHANGE_OPTIONS(ctx, o.lambda_abs = (eits_real)(0.6 * top));
    info = solve(ctx);
    CHECK_NEAR(info.lambda, 0.6 * top, 2 * EPS * top);
    CHECK_EQUAL(info.stop, EITS_STOP_ITERATIONS);
    /* just below the detection threshold, then just above */
    ctx->reference.lambda_noise = (eits_real)(top / 1.49);
    info = solve(ctx);
    CHECK(info.stop == EITS_STOP_BELOW_THRESHOLD && info.iterations == 0 && info.nonzeros == 0);
    CHECK(is_cleared(ctx));
    ctx->reference.lambda_noise = (eits_real)(top / 1.51);
    info = solve(ctx);
    CHECK(info.stop == EITS_STOP_ITERATIONS && info.nonzeros > 0);
    CHANGE_OPTIONS(ctx, o.detection_factor = 0);
    ctx->reference.lambda_noise = (eits_real)(100 * top);
    /* no threshold, and lambda_abs does not look at the noise */
    CHECK_EQUAL(solve(ctx).stop, EITS_STOP_ITERATIONS);
}

TEST(warm_start_saves_iterations)
{
    uint32_t needed[2];
    for (uint32_t warm = 0; warm < 2; ++warm) {
        eits_context *ctx = set_up(&b, RANDOM);
        CHANGE_OPTIONS(ctx, o.gap_rel = R(1e-4), o.gap_every = 1, o.iterations = 100000,
                       o.warm_start = warm);
        fill_y(&b, 1, 0, 0);
        (void)solve(ctx);
        fill_y(&b, 1.01, 1e-3, 0); /* nearly the same frame */
        const eits_info info = solve(ctx);
        CHECK_EQUAL(info.stop, EITS_STOP_GAP);
        CHECK(info.gap_rel <= R(1e-4));
        needed[warm] = info.iterations;
    }
    CHECK(needed[0] >= 10);
    CHECK(2 * needed[1] <= needed[0]);
}

/* After lift-off, a frame of noise starts from the touch's coefficients; the result is that of a
 * cold start. */
TEST(no_ghost_after_lift_off)
{
    eits_context *ctx = set_up(&b, RANDOM);
    CHANGE_OPTIONS(ctx, o.warm_start = 1, o.iterations = 20);
    fill_y(&b, 1, 0, 0);
    double peak = 0;
    for (int k = 0; k < 5; ++k)
        (void)solve(ctx);
    for (int j = 0; j < N; ++j)
        peak = fmax(peak, (double)eits_get_coefficients(ctx)[j]);
    CHECK(peak > 0.1);
    fill_y(&b, 0, 1e-3, 0);
    (void)solve(ctx);
    double *after = dense_copy(eits_get_coefficients(ctx), N);
    eits_forget(ctx);
    (void)solve(ctx);
    /* zero is the better start: the very cold result */
    CHECK(dense_greatest_difference(after, eits_get_coefficients(ctx), N) == 0);
    for (int j = 0; j < N; ++j)
        CHECK(fabs(after[j]) < 0.1 * peak);
    free(after);
}

TEST(warm_start_is_forgotten)
{
    eits_context *ctx = set_up(&b, RANDOM);
    eits_real cold[N], warm[N], reference[SMALL_ROWS];
    CHANGE_OPTIONS(ctx, o.warm_start = 1, o.iterations = 6);
    fill_y(&b, 1, 0.01, 0);
    (void)solve(ctx);
    memcpy(cold, eits_get_coefficients(ctx), sizeof cold);
    (void)solve(ctx);
    memcpy(warm, eits_get_coefficients(ctx), sizeof warm);
    CHECK(memcmp(cold, warm, sizeof cold) != 0); /* it does start elsewhere */
    eits_forget(ctx);
    (void)solve(ctx);
    CHECK(memcmp(cold, eits_get_coefficients(ctx), sizeof cold) == 0);
    /* coefficients of the other sign are no start */
    CHANGE_OPTIONS(ctx, o.sign = EITS_SIGN_DECREASE);
    CHANGE_OPTIONS(ctx, o.sign = EITS_SIGN_INCREASE);
    (void)solve(ctx);
    CHECK(memcmp(cold, eits_get_coefficients(ctx), sizeof cold) == 0);
    small_reference(&b.c.model, 1, reference);
    /* nor are those against another reference */
    CHECK_OK(eits_reference_set(ctx, reference, SMALL_ROWS));
    (void)solve(ctx);
    CHECK(memcmp(cold, eits_get_coefficients(ctx), sizeof cold) == 0);
    CHANGE_OPTIONS(ctx, o.warm_start = 0);
    (void)solve(ctx);
    CHECK(memcmp(cold, eits_get_coefficients(ctx), sizeof cold) == 0);
    eits_forget(NULL);
}

/* A stated Lipschitz constant that is too small: the step is halved until the objective falls. */
TEST(step_too_large)
{
    static const double factors[] = {0.3, 0.125, 0.02};
    for (size_t f = 0; IN_TABLE(f, factors); ++f) {
        eits_context *ctx =
            set_up(&b, (small_spec){.rank = RANK, .side = SIDE, .lipschitz_factor = factors[f]});
        CHANGE_OPTIONS(ctx, o.iterations = 400);
        fill_y(&b, 1, 0.01, 0);
        const eits_info info = solve(ctx);
        CHECK_EQUAL(info.stop, EITS_STOP_ITERATIONS);
        CHECK(info.step_halvings >= 1 && info.step_halvings <= 8);
        CHECK(ldexp(factors[f], (int)info.step_halvings) > 0.4); /* enough of them */
        double *y = dense_copy(ctx->frame.y, RANK), *x = dense_copy(eits_get_coefficients(ctx), N),
               good[N] = {0};
        const double lambda = (double)info.lambda, at_zero = 0.5 * dense_dot(y, y, RANK);
        dense_fista(&b.d, y, lambda, (double)b.c.model.lipschitz / factors[f], 20000,
                    EITS_SIGN_INCREASE, good);
        const double best = dense_objective(&b.d, y, good, lambda),
                     own = dense_objective(&b.d, y, x, lambda);
        CHECK(own < 0.1 * at_zero && own - best < 0.02 * at_zero);
        CHECK_NEAR(info.gap, dense_gap(&b.d, y, x, lambda, EITS_SIGN_INCREASE), 1e-4 * at_zero);
        for (int again = 0; again < 12; ++again) { /* no count runs on from call to call */
            const eits_info next = solve(ctx);
            CHECK(next.step_halvings == info.step_halvings && next.stop == info.stop &&
                  next.macs == info.macs);
        }
        for (int power = -10; power <= 10; power += 20) { /* nor does the unit matter */
            for (int i = 0; i < RANK; ++i)
                ctx->frame.y[i] = (eits_real)ldexp(y[i], power);
            const eits_info scaled = solve(ctx);
            CHECK(scaled.step_halvings == info.step_halvings && scaled.macs == info.macs &&
                  scaled.gap_rel == info.gap_rel);
        }
        free(y);
        free(x);
    }
}

/* On the identity one step of s takes the objective, for any lambda, to its start's value just
 * where s = 2: a run that ends above it has won nothing. */
TEST(ending_above_the_start)
{
    for (int k = 0; k < 4; ++k) {
        const int above = k % 2;
        const double step = above ? 2.02 : 1.98, lambda = k < 2 ? 1e-4 : 0.5;
        eits_context *ctx = set_up(&b, (small_spec){.rank = RANK,
                                                    .side = 4,
                                                    .shape = SMALL_IDENTITY,
                                                    .lipschitz_factor = 1 / step});
        CHANGE_OPTIONS(ctx, o.iterations = 1, o.lambda_abs = (eits_real)lambda);
        for (int i = 0; i < RANK; ++i)
            ctx->frame.y[i] = 1;
        const eits_info info = solve(ctx);
        CHECK_EQUAL(info.stop, above ? EITS_STOP_DIVERGED : EITS_STOP_ITERATIONS);
        CHECK_EQUAL(info.nonzeros, above ? 0 : RANK);
        CHECK_NEAR(eits_get_coefficients(ctx)[0], above ? 0 : 1.98 * (1 - lambda), 1e-5);
    }
}

/* The step of FISTA, and of FISTA on a working set, is absurdly large. */
TEST(step_absurdly_large)
{
    static const struct {
        const char *name;
        eits_solver solver;
        eits_sign sign;
        double factor;
    } rows[] = {
        {"FISTA, increase, 1e4 too long", EITS_SOLVER_FISTA, EITS_SIGN_INCREASE, 1e-4},
        {"FISTA, decrease, 1e12 too long", EITS_SOLVER_FISTA, EITS_SIGN_DECREASE, 1e-12},
        {"FISTA, both, 1e36 too long", EITS_SOLVER_FISTA, EITS_SIGN_BOTH, 1e-36},
        {"working set, increase, 1e12 too long", EITS_SOLVER_WORKING_SET, EITS_SIGN_INCREASE,
         1e-12},
        {"working set, decrease, 1e36 too long", EITS_SOLVER_WORKING_SET, EITS_SIGN_DECREASE,
         1e-36},
        {"working set, both, 1e4 too long", EITS_SOLVER_WORKING_SET, EITS_SIGN_BOTH, 1e-4},
    };
    EACH_ROW(row, rows) {
        eits_context *ctx =
            set_up(&b, (small_spec){.rank = RANK, .side = SIDE, .lipschitz_factor = row->factor});
        CHANGE_OPTIONS(ctx, o.iterations = 1000, o.sign = row->sign, o.warm_start = 1,
                       o.solver = row->solver);
        fill_y(&b, 1, 0.01, 0);
        for (int again = 0; again < 2; ++again) {
            const eits_info info = solve(ctx);
            CHECK_EQUAL(info.stop, EITS_STOP_DIVERGED);
            CHECK(info.nonzeros == 0 && info.step_halvings == 8 && info.iterations < 1000);
            /* no number of the wild run stays */
            CHECK(info.residual == info.data_norm && info.gap == 0 && info.gap_rel == 0);
            CHECK(is_cleared(ctx));
            uint32_t count = 9;
            CHECK_OK(eits_find_touches(ctx, NULL, 0, &count));
            CHECK_EQUAL(count, 0);
        }
    }
}

TEST(data_that_are_not_finite)
{
    eits_context *ctx = set_up(&b, RANDOM);
    static const double wrong[] = {NAN, INFINITY, -INFINITY, BOTH_WIDTHS(1e30, 1e200)};
    CHECK_REFUSED(eits_solve(NULL, NULL));
    for (int k = 0; k < 4; ++k) {
        fill_y(&b, 1, 0.01, 0);
        (void)solve(ctx);
        CHECK(ctx->info.nonzeros > 0);
        ctx->frame.y[5] = (eits_real)wrong[k];
        CHECK_EQUAL(eits_solve(ctx, NULL), EITS_E_NOT_FINITE);
        CHECK(ctx->info.nonzeros == 0 && ctx->info.data_norm == 0 && ctx->info.residual == 0 &&
              ctx->info.lambda == 0);
        CHECK(is_cleared(ctx));
    }
    /* coefficients that are finite, an image that is not */
    dense_bench w = {0};
    small_model made = small_model_make(RANDOM);
    for (uint32_t j = 0; j < N; ++j)
        small_put_f32(small_model_section(&made, "COLW", NULL) + 4 * j, 3e38f);
    (void)dense_bench_take(&w, made, 1);
    fill_y(&w, 1000, 0, 0);
    CHECK_EQUAL(eits_solve(w.c.ctx, NULL), BOTH_WIDTHS(EITS_E_NOT_FINITE, EITS_OK));
    for (int j = 0; j < N; ++j)
        CHECK(isfinite((double)eits_get_image(w.c.ctx)[j]) &&
              (sizeof(eits_real) == 8 || eits_get_image(w.c.ctx)[j] == 0));
    dense_bench_close(&w);
}

/* Frames in other units: the gain takes them up. By powers of two to the bit, by others within
 * rounding. */
TEST(units_do_not_matter)
{
    static const double units[] = {1, 0x1p-20, 0x1p20, 0x1p-60, 1e-6, 1e-3, 3.7, 1e6, -1, -1e-6};
    eits_real first[N], frame[SMALL_ROWS], reference[SMALL_ROWS];
    eits_info first_info = {0};
    double peak = 0;
    for (size_t u = 0; IN_TABLE(u, units); ++u) {
        eits_context *ctx = set_up(&b, RANDOM);
        uint64_t state = 71;
        small_reference(&b.c.model, 1, reference);
        for (int i = 0; i < SMALL_ROWS; ++i) {
            reference[i] *= (eits_real)(1 + 0.01 * small_random(&state));
            frame[i] = reference[i] * (eits_real)(1 + 0.2 * small_random(&state));
            reference[i] *= (eits_real)units[u];
            frame[i] *= (eits_real)units[u];
        }
        CHECK_OK(eits_reference_set(ctx, reference, SMALL_ROWS));
        CHECK_OK(eits_reconstruct(ctx, frame, SMALL_ROWS, NULL, NULL));
        if (u == 0) {
            memcpy(first, eits_get_image(ctx), sizeof first);
            first_info = *eits_get_info(ctx);
            for (int j = 0; j < N; ++j)
                peak = fmax(peak, (double)first[j]);
            CHECK(ctx->info.nonzeros >= 3);
        }
        double *as_doubles = dense_copy(first, N);
        CHECK_NEAR(dense_greatest_difference(as_doubles, eits_get_image(ctx), N), 0,
                   u < 4 ? 0 : 200 * EPS * peak);
        CHECK_NEAR(ctx->info.lambda, first_info.lambda, 100 * EPS * (double)first_info.lambda);
        free(as_doubles);
    }
    /* and reduced data in other units give coefficients in them */
    eits_context *ctx = set_up(&b, RANDOM);
    fill_y(&b, 1, 0.01, 0);
    (void)solve(ctx);
    memcpy(first, eits_get_coefficients(ctx), sizeof first);
    for (int power = -40; power <= 40; power += 20) {
        fill_y(&b, 1, 0.01, 0);
        for (int i = 0; i < RANK; ++i)
            ctx->frame.y[i] *= (eits_real)ldexp(1, power);
        const eits_info info = solve(ctx);
        for (int j = 0; j < N; ++j)
            CHECK(eits_get_coefficients(ctx)[j] == first[j] * (eits_real)ldexp(1, power));
        CHECK(info.gap_rel > 0);
    }
}

RUN_TESTS("solve_state", dense_bench_close(&b))
