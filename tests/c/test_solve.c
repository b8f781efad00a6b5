/* The solver on given reduced data: against the closed form, a textbook FISTA, and the conditions
 * of an optimum. */
#include "steps.h"

enum { SIDE = 6, N = SIDE * SIDE, RANK = 12 };

static dense_bench b;
static double y[16];

/* A context of this model, with random y in [-1, 1). */
static eits_context *set_up(small_spec spec, int prepared)
{
    eits_context *ctx = dense_bench_open(&b, spec, prepared);
    small_new_data(ctx, 51);
    for (uint32_t i = 0; i < spec.rank; ++i)
        y[i] = (double)ctx->frame.y[i];
    return ctx;
}

static const small_spec RANDOM = {.rank = RANK, .side = SIDE};

/* Solve with these settings; other options at their defaults. */
static eits_info solve(eits_context *ctx, uint32_t iterations, eits_sign sign, double lambda)
{
    CHANGE_OPTIONS(ctx, o.iterations = iterations, o.sign = sign, o.lambda_abs = (eits_real)lambda);
    CHECK_OK(eits_solve(ctx, NULL));
    return *eits_get_info(ctx);
}

TEST(identity_gives_the_soft_threshold)
{
    const small_spec spec = {.rank = 16, .side = 4, .shape = SMALL_IDENTITY, .lipschitz_factor = 1};
    for (int sign = 0; sign < 3; ++sign) {
        for (uint32_t iterations = 1; iterations <= 41; iterations += 40) {
            eits_context *ctx = set_up(spec, 0);
            const eits_info info = solve(ctx, iterations, (eits_sign)sign, 0.25);
            uint32_t nonzeros = 0;
            double squares = 0;
            for (int j = 0; j < 16; ++j) {
                const double size = fabs(y[j]) - 0.25;
                const int allowed =
                    y[j] > 0 ? sign != EITS_SIGN_DECREASE : sign != EITS_SIGN_INCREASE;
                const double expected = size > 0 && allowed ? copysign(size, y[j]) : 0;
                /* one step is exact: 1/4 is a round number */
                CHECK_NEAR(eits_get_coefficients(ctx)[j], expected, iterations == 1 ? 0 : 2 * EPS);
                CHECK(eits_get_image(ctx)[j] == eits_get_coefficients(ctx)[j]);
                nonzeros += expected != 0;
                squares += pow(y[j] - expected, 2);
            }
            CHECK(nonzeros >= 4);
            CHECK_EQUAL(info.nonzeros, nonzeros);
            CHECK_NEAR(info.residual, sqrt(squares), 8 * EPS);
            CHECK_NEAR(info.data_norm, sqrt(dense_dot(y, y, 16)), 8 * EPS);
            CHECK_NEAR(info.gap, 0, 8 * EPS);
            CHECK_NEAR(info.lambda, 0.25, 0);
        }
    }
}

/* Each storage with each sign; with panels and without. */
TEST(same_as_the_textbook)
{
    static const struct {
        const char *name;
        eits_storage storage;
        eits_sign sign;
        uint32_t iterations;
        int prepared;
    } rows[] = {
        {"f32, increase, one iteration", EITS_STORAGE_F32, EITS_SIGN_INCREASE, 1, 0},
        {"f32, decrease, two", EITS_STORAGE_F32, EITS_SIGN_DECREASE, 2, 1},
        {"f32, both, sixty", EITS_STORAGE_F32, EITS_SIGN_BOTH, 60, 0},
        {"f16, increase, two", EITS_STORAGE_F16, EITS_SIGN_INCREASE, 2, 1},
        {"f16, decrease, sixty", EITS_STORAGE_F16, EITS_SIGN_DECREASE, 60, 0},
        {"f16, both, eleven", EITS_STORAGE_F16, EITS_SIGN_BOTH, 11, 1},
        {"i16, increase, sixty", EITS_STORAGE_I16, EITS_SIGN_INCREASE, 60, 0},
        {"i16, decrease, eleven", EITS_STORAGE_I16, EITS_SIGN_DECREASE, 11, 1},
        {"i16, both, one", EITS_STORAGE_I16, EITS_SIGN_BOTH, 1, 0},
        {"i8, increase, eleven", EITS_STORAGE_I8, EITS_SIGN_INCREASE, 11, 1},
        {"i8, decrease, one", EITS_STORAGE_I8, EITS_SIGN_DECREASE, 1, 0},
        {"i8, both, two", EITS_STORAGE_I8, EITS_SIGN_BOTH, 2, 1},
    };
    EACH_ROW(row, rows) {
        const small_spec spec = {.rank = RANK, .side = SIDE, .storage = row->storage};
        eits_context *ctx = set_up(spec, row->prepared);
        double x[N] = {0}, largest = 0;
        const eits_info info = solve(ctx, row->iterations, row->sign, 0.05);
        dense_fista(&b.d, y, (double)ctx->info.lambda, (double)b.c.model.lipschitz, row->iterations,
                    row->sign, x);
        for (int j = 0; j < N; ++j)
            largest = fmax(largest, fabs(x[j]));
        CHECK(largest > 0.1);
        CHECK_NEAR(dense_greatest_difference(x, eits_get_coefficients(ctx), N), 0,
                   400 * EPS * largest);
        for (int j = 0; j < N; ++j)
            CHECK(eits_get_image(ctx)[j] ==
                  eits_get_coefficients(ctx)[j] * (eits_real)b.c.model.column_weight[j]);
        CHECK_EQUAL(info.iterations, row->iterations); /* exactly so many */
        CHECK_EQUAL(info.stop, EITS_STOP_ITERATIONS);
    }
}

TEST(optimum_has_its_marks)
{
    for (int sign = 0; sign < 3; ++sign) {
        eits_context *ctx = set_up(RANDOM, 1);
        CHANGE_OPTIONS(ctx, o.gap_rel = R(BOTH_WIDTHS(1e-6, 1e-12)));
        const eits_info info = solve(ctx, 50000, (eits_sign)sign, 0.05);
        CHECK_EQUAL(info.stop, EITS_STOP_GAP);
        CHECK(info.gap_rel <= ctx->options.gap_rel && info.gap >= 0);
        double *x = dense_copy(eits_get_coefficients(ctx), N), r[RANK], c[N], largest = 0;
        dense_residual(&b.d, y, x, r);
        dense_correlate(&b.d, r, c);
        const double lambda = (double)info.lambda;
        /* |S (x - optimum)| sqrt L */
        const double slack = sqrt(2 * (double)b.c.model.lipschitz * (double)info.gap) + 20 * EPS;
        for (int j = 0; j < N; ++j)
            largest = fmax(largest, fabs(x[j]));
        uint32_t on = 0, off = 0;
        for (int j = 0; j < N; ++j) {
            if (sign != EITS_SIGN_DECREASE)
                CHECK(c[j] <= lambda + slack);
            if (sign != EITS_SIGN_INCREASE)
                CHECK(c[j] >= -lambda - slack);
            CHECK(sign != EITS_SIGN_INCREASE || x[j] >= 0);
            CHECK(sign != EITS_SIGN_DECREASE || x[j] <= 0);
            if (fabs(x[j]) > 0.05 * largest) {
                CHECK_NEAR(c[j], copysign(lambda, x[j]), slack);
                ++on;
            }
            off += x[j] == 0;
        }
        CHECK(slack < 0.1 * lambda && on >= 3 && off >= 10);
        free(x);
    }
}

TEST(gap_bounds_the_suboptimality)
{
    static const uint32_t counts[] = {1, 2, 4, 8, 16, 32, 64, 128};
    for (int sign = 0; sign < 3; ++sign) {
        double before = 1e9, best_x[N] = {0};
        for (size_t k = 0; IN_TABLE(k, counts); ++k) {
            eits_context *ctx = set_up(RANDOM, 0);
            const eits_info info = solve(ctx, counts[k], (eits_sign)sign, 0.05);
            double *x = dense_copy(eits_get_coefficients(ctx), N), r[RANK];
            const double lambda = (double)info.lambda, gap = (double)info.gap;
            if (k == 0) /* the optimum, of the same data for each count */
                dense_fista(&b.d, y, lambda, (double)b.c.model.lipschitz, 30000, (eits_sign)sign,
                            best_x);
            const double best = dense_objective(&b.d, y, best_x, lambda),
                         own = dense_objective(&b.d, y, x, lambda);
            const double rounding = 40 * EPS * dense_dot(y, y, RANK);
            CHECK(own - best >= -1e-12);
            CHECK(own - best <= gap + rounding);
            CHECK_NEAR(gap, dense_gap(&b.d, y, x, lambda, (eits_sign)sign), rounding);
            CHECK_NEAR(info.gap_rel, gap / (0.5 * dense_dot(y, y, RANK)), 10 * EPS);
            dense_residual(&b.d, y, x, r);
            CHECK_NEAR(info.residual, sqrt(dense_dot(r, r, RANK)), 20 * EPS);
            CHECK(counts[k] < 4 || gap < before);
            before = gap;
            free(x);
        }
    }
}

TEST(stopping_by_the_gap)
{
    eits_context *ctx = set_up(RANDOM, 0);
    CHANGE_OPTIONS(ctx, o.gap_rel = R(1e-3), o.gap_every = 7);
    eits_info info = solve(ctx, 100000, EITS_SIGN_INCREASE, 0.05);
    CHECK_EQUAL(info.stop, EITS_STOP_GAP);
    CHECK(info.gap_rel <= R(1e-3) && info.gap_rel > 0);
    CHECK(info.iterations % 7 == 0 && info.iterations < 2000);
    const uint32_t needed = info.iterations;
    /* one check earlier it was not small enough */
    info = solve(ctx, needed - 7, EITS_SIGN_INCREASE, 0.05);
    CHECK(info.stop == EITS_STOP_ITERATIONS && info.iterations == needed - 7 &&
          info.gap_rel > R(1e-3));
    info = solve(ctx, 5, EITS_SIGN_INCREASE, 0.05);
    CHECK(info.stop == EITS_STOP_ITERATIONS && info.iterations == 5 && info.gap_rel > 0);
    CHANGE_OPTIONS(ctx, o.gap_rel = R(0.9), o.gap_every = 1000);
    info = solve(ctx, 3, EITS_SIGN_INCREASE, 0.05); /* the last iteration is always checked */
    CHECK(info.stop == EITS_STOP_GAP && info.iterations == 3);
}

TEST(zero_is_the_optimum)
{
    for (int sign = 0; sign < 3; ++sign) {
        eits_context *ctx = set_up(RANDOM, 0);
        double c[N], greatest = 0;
        dense_correlate(&b.d, y, c);
        for (int j = 0; j < N; ++j)
            greatest = fmax(greatest, sign == EITS_SIGN_INCREASE
                                          ? c[j]
                                          : (sign == EITS_SIGN_DECREASE ? -c[j] : fabs(c[j])));
        eits_info info = solve(ctx, 20, (eits_sign)sign, greatest * (1 + 1e-5));
        CHECK_NEAR(info.lambda_max, greatest, 10 * EPS);
        CHECK_EQUAL(info.stop, EITS_STOP_ZERO);
        CHECK(info.iterations == 0 && info.nonzeros == 0 && info.gap == 0 &&
              info.residual == info.data_norm);
        CHECK(is_cleared(ctx));
        info = solve(ctx, 20, (eits_sign)sign, greatest * (1 - 1e-3));
        CHECK(info.stop == EITS_STOP_ITERATIONS && info.nonzeros == 1);
        /* lambda just at lambda_max */
        info = solve(ctx, 20, (eits_sign)sign, (double)info.lambda_max);
        CHECK_EQUAL(info.stop, EITS_STOP_ZERO);
    }
    eits_context *ctx = set_up(RANDOM, 0);
    memset(ctx->frame.y, 0, RANK * sizeof *ctx->frame.y);
    eits_info info = solve(ctx, 20, EITS_SIGN_BOTH, 0);
    CHECK(info.stop == EITS_STOP_ZERO && info.lambda_max == 0 && info.data_norm == 0);
    const small_spec identity = {.rank = 16, .side = 4, .shape = SMALL_IDENTITY};
    ctx = set_up(identity, 0);
    for (int i = 0; i < 16; ++i)
        ctx->frame.y[i] = R(-1); /* nothing to be found above zero */
    info = solve(ctx, 20, EITS_SIGN_INCREASE, 0);
    CHECK(info.stop == EITS_STOP_ZERO && info.lambda_max == 0);
}

/* Rows that are left out: the same as the dense problem with their directions taken out of S and y.
 */
TEST(solving_beside_a_basis)
{
    eits_context *ctx = set_up(RANDOM, 1);
    eits_real reference[SMALL_ROWS], frame[SMALL_ROWS];
    uint64_t state = 52;
    small_reference(&b.c.model, 1, reference);
    vary(frame, reference, 0.3, &state);
    frame[b.c.model.fold[4].first] = frame[b.c.model.fold[4].second] =
        frame[b.c.model.fold[20].first] = R(NAN);
    CHECK_OK(eits_reference_set(ctx, reference, SMALL_ROWS));
    STAGE(ctx, frame);
    CHECK_EQUAL(ctx->projection.count, 3);
    const eits_info info = solve(ctx, 40, EITS_SIGN_INCREASE, 0.01);
    double *basis = dense_numbers(3 * RANK), *seen = dense_copy(ctx->frame.y, RANK), x[N] = {0},
           r[RANK];
    for (uint32_t k = 0; k < 3; ++k) {
        for (uint32_t i = 0; i < RANK; ++i)
            basis[k * RANK + i] = (double)ctx->projection.basis[k * EITS_STRIDE(RANK) + i];
    }
    for (int j = 0; j < N; ++j)
        dense_project_out(b.d.s + j * RANK, basis, 3, RANK);
    dense_fista(&b.d, seen, (double)info.lambda, (double)b.c.model.lipschitz, 40,
                EITS_SIGN_INCREASE, x);
    CHECK(info.nonzeros >= 3);
    CHECK_NEAR(dense_greatest_difference(x, eits_get_coefficients(ctx), N), 0, 400 * EPS);
    CHECK_NEAR(info.gap, dense_gap(&b.d, seen, x, (double)info.lambda, EITS_SIGN_INCREASE),
               400 * EPS);
    dense_residual(&b.d, seen, x, r);
    CHECK_NEAR(info.residual, sqrt(dense_dot(r, r, RANK)), 100 * EPS);
    free(basis);
    free(seen);
}

/* On the identity with one positive datum each iterate has one non-zero, so that each product can
 * be counted by hand. */
TEST(work_is_counted)
{
    const small_spec spec = {.rank = 16, .side = 4, .shape = SMALL_IDENTITY};
    eits_context *ctx = set_up(spec, 0);
    const uint64_t whole = 16 * 16, column = 16;
    memset(ctx->frame.y, 0, 16 * sizeof *ctx->frame.y);
    ctx->frame.y[3] = 1;
    for (uint32_t iterations = 1; iterations <= 25; iterations += 8) {
        const eits_info info = solve(ctx, iterations, EITS_SIGN_INCREASE, 0.25);
        /* S'y once, which the first iteration uses again; S'r in each later one and for the last
         * gap; S x in each */
        CHECK_EQUAL(info.macs, whole + (iterations - 1) * whole + whole + iterations * column);
    }
    /* the gap is asked for every 5 iterations: another S'r each */
    CHANGE_OPTIONS(ctx, o.gap_rel = R(1e-12), o.gap_every = 5);
    eits_info info = solve(ctx, 4, EITS_SIGN_INCREASE, 0.25);
    CHECK_EQUAL(info.macs, whole + 3 * whole + whole + 4 * column);
    /* from the last coefficients: S x once more, and the first iteration's S'r */
    CHANGE_OPTIONS(ctx, o.gap_rel = 0, o.warm_start = 1);
    info = solve(ctx, 3, EITS_SIGN_INCREASE, 0.25);
    CHECK_EQUAL(info.macs, whole + column + 3 * (whole + column) + whole);
    ctx->frame.y[3] = 0;
    info = solve(ctx, 20, EITS_SIGN_INCREASE, 0.25); /* only S'y if there is no signal */
    CHECK_EQUAL(info.macs, whole);
    /* with the frame stage: P d over all folded rows, of differences and of logarithms, and two
     * projections' passes for the drift direction at first */
    eits_real frame[SMALL_ROWS];
    small_reference(&b.c.model, 1, frame);
    CHECK_OK(eits_reference_set(ctx, frame, SMALL_ROWS));
    CHECK_OK(eits_reconstruct(ctx, frame, SMALL_ROWS, NULL, NULL));
    const uint64_t reduce = SMALL_FOLDED * 16, project = 2 * 16;
    CHECK_EQUAL(ctx->info.macs,
                reduce + 2 * 16 /* direction, normalised */ + 2 * (reduce + project) + whole);
    CHECK_OK(eits_reconstruct(ctx, frame, SMALL_ROWS, NULL, NULL));
    CHECK_EQUAL(ctx->info.macs, 2 * (reduce + project) + whole); /* the basis is kept */
    /* one column of P less, and its rows whitened again: the rows left out once into the products,
     * three factors, eight probes of the noise; the data and the drift's direction by three
     * triangles; F' y */
    const uint64_t triangle = 16 * 17 / 2, cubic = 15 * 16 * 17 / 6;
    frame[b.c.model.fold[4].first] = frame[b.c.model.fold[4].second] = R(NAN);
    CHECK_OK(eits_reconstruct(ctx, frame, SMALL_ROWS, NULL, NULL));
    const uint64_t built =
        triangle + cubic + (2 * cubic + 2 * triangle - triangle) + cubic + 8 * 2 * triangle;
    CHECK(ctx->whitening.form);
    CHECK_EQUAL(ctx->projection.count, 1);
    CHECK_EQUAL(ctx->info.macs, built + (reduce + 3 * triangle + 2 * 16) +
                                    2 * (reduce - 16 + 3 * triangle + project) + triangle + whole);
    CHECK_OK(eits_reconstruct(ctx, frame, SMALL_ROWS, NULL, NULL));
    /* the whitening is kept */
    CHECK_EQUAL(ctx->info.macs, 2 * (reduce - 16 + 3 * triangle + project) + triangle + whole);
    /* each residual is mapped, there and back */
    CHANGE_OPTIONS(ctx, o.project_reference = 0, o.warm_start = 0);
    CHECK_OK(eits_reconstruct(ctx, frame, SMALL_ROWS, NULL, NULL));
    CHECK_EQUAL(ctx->projection.count, 0);
    ctx->frame.y[7] = 1;
    info = solve(ctx, 3, EITS_SIGN_INCREASE, 0.25);
    CHECK_EQUAL(info.nonzeros, 1);
    CHECK_EQUAL(info.macs, whole + triangle + 2 * (whole + 2 * triangle) + 3 * column +
                               (whole + 2 * triangle));
}

RUN_TESTS("solve", dense_bench_close(&b))
