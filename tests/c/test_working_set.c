/* FISTA on a working set: with a look at every column in each iteration the bits of FISTA; with
 * fewer, the same optimum for less work. */
#include "steps.h"

#include "solve/solve.h"
#include "solve/violations.h"

enum { SIDE = 9, N = SIDE * SIDE, RANK = 12 };

static const small_spec RANDOM = {.rank = RANK, .side = SIDE};

static dense_bench b;

static eits_context *set_up(dense_bench *b, small_spec spec, int prepared)
{
    eits_context *ctx = dense_bench_open(b, spec, prepared);
    small_new_data(ctx, 61);
    return ctx;
}

static eits_options with(const eits_context *ctx, eits_solver solver, uint32_t iterations,
                         eits_sign sign, double lambda)
{
    eits_options o = *eits_get_options(ctx);
    o.solver = solver;
    o.iterations = iterations;
    o.sign = sign;
    o.lambda_abs = (eits_real)lambda;
    return o;
}

static eits_info solve(eits_context *ctx, eits_options o)
{
    CHECK_OK(eits_set_options(ctx, &o));
    CHECK_OK(eits_solve(ctx, NULL));
    return *eits_get_info(ctx);
}

/* A gap is asked for that is never reached, so that each iteration looks at every column. */
static void look_always(eits_options *o)
{
    o->gap_every = 1;
    o->gap_rel = R(1e-30);
}

static void check_same(const eits_context *a, const eits_context *b)
{
    const eits_info *i = &a->info, *j = &b->info;
    CHECK(memcmp(eits_get_coefficients(a), eits_get_coefficients(b),
                 eits_get_model(a)->n_pixels * sizeof(eits_real)) == 0);
    CHECK(memcmp(eits_get_image(a), eits_get_image(b),
                 a->model->n_pixels * sizeof *eits_get_image(a)) == 0);
    CHECK_EQUAL(i->iterations, j->iterations);
    CHECK_EQUAL(i->stop, j->stop);
    CHECK_EQUAL(i->nonzeros, j->nonzeros);
    CHECK_EQUAL(i->step_halvings, j->step_halvings);
    CHECK(i->gap == j->gap && i->residual == j->residual && i->lambda == j->lambda);
}

/* Each storage with each sign, from a start at zero and warm, to other data; with panels and
 * without. */
TEST(looking_always_gives_the_bits_of_fista)
{
    static const struct {
        const char *name;
        eits_storage storage;
        eits_sign sign;
        int prepared;
        uint32_t iterations;
    } rows[] = {
        {"f32, increase, one iteration", EITS_STORAGE_F32, EITS_SIGN_INCREASE, 0, 1},
        {"f32, decrease, two", EITS_STORAGE_F32, EITS_SIGN_DECREASE, 1, 2},
        {"f32, both, sixty", EITS_STORAGE_F32, EITS_SIGN_BOTH, 0, 60},
        {"f32, both, sixty, panels", EITS_STORAGE_F32, EITS_SIGN_BOTH, 1, 60},
        {"f16, increase, two", EITS_STORAGE_F16, EITS_SIGN_INCREASE, 0, 2},
        {"f16, decrease, sixty", EITS_STORAGE_F16, EITS_SIGN_DECREASE, 1, 60},
        {"f16, both, eleven", EITS_STORAGE_F16, EITS_SIGN_BOTH, 0, 11},
        {"i16, increase, sixty", EITS_STORAGE_I16, EITS_SIGN_INCREASE, 1, 60},
        {"i16, decrease, eleven", EITS_STORAGE_I16, EITS_SIGN_DECREASE, 0, 11},
        {"i16, both, one", EITS_STORAGE_I16, EITS_SIGN_BOTH, 1, 1},
        {"i8, increase, eleven", EITS_STORAGE_I8, EITS_SIGN_INCREASE, 0, 11},
        {"i8, decrease, one", EITS_STORAGE_I8, EITS_SIGN_DECREASE, 1, 1},
        {"i8, both, two", EITS_STORAGE_I8, EITS_SIGN_BOTH, 0, 2},
    };
    static const eits_solver solvers[2] = {EITS_SOLVER_FISTA, EITS_SOLVER_WORKING_SET};
    EACH_ROW(row, rows) {
        dense_bench b[2] = {0};
        for (int k = 0; k < 2; ++k) {
            const small_spec spec = {.rank = RANK, .side = SIDE, .storage = row->storage};
            eits_context *ctx = set_up(&b[k], spec, row->prepared);
            eits_options o = with(ctx, solvers[k], row->iterations, row->sign, 0.05);
            look_always(&o);
            o.warm_start = 1;
            (void)solve(ctx, o);
            small_new_data(ctx, 62); /* and from there to other data */
            (void)solve(ctx, o);
        }
        CHECK(b[0].c.ctx->info.nonzeros > 0);
        check_same(b[0].c.ctx, b[1].c.ctx);
        dense_bench_close(&b[0]);
        dense_bench_close(&b[1]);
    }
}

/* A step that is too long, by little or beyond all bounds: the same halvings, the same end. */
TEST(looking_always_recovers_like_fista)
{
    static const double factors[] = {1.0 / 3, 1.0 / 16, 1e-9};
    for (size_t f = 0; IN_TABLE(f, factors); ++f) {
        dense_bench b[2] = {0};
        for (int solver = 0; solver < 2; ++solver) {
            eits_context *ctx = set_up(
                &b[solver],
                (small_spec){.rank = RANK, .side = SIDE, .lipschitz_factor = factors[f]}, solver);
            eits_options o = with(ctx, (eits_solver)solver, 200, EITS_SIGN_BOTH, 0.05);
            look_always(&o);
            (void)solve(ctx, o);
        }
        CHECK(b[0].c.ctx->info.step_halvings > 0);
        check_same(b[0].c.ctx, b[1].c.ctx);
        dense_bench_close(&b[0]);
        dense_bench_close(&b[1]);
    }
}

/* Asked for a gap, or given time: the duality gap holds over all columns, also those that no
 * iteration touched. */
TEST(the_optimum_is_that_of_all_columns)
{
    static const struct {
        const char *name;
        eits_sign sign;
        int asked;      /* for a gap; else there is time for as small a one */
        uint32_t every; /* how often the gap is looked at, which is also when columns are added */
        int prepared;
    } rows[] = {
        {"increase, a gap, each iteration", EITS_SIGN_INCREASE, 1, 1, 1},
        {"increase, a gap, every 8th", EITS_SIGN_INCREASE, 1, 8, 0},
        {"increase, a gap, every 50th", EITS_SIGN_INCREASE, 1, 50, 0},
        {"decrease, a gap, every 15th", EITS_SIGN_DECREASE, 1, 15, 1},
        {"decrease, time, every 8th", EITS_SIGN_DECREASE, 0, 8, 0},
        {"both, a gap, every 22nd", EITS_SIGN_BOTH, 1, 22, 0},
        {"both, time, each iteration", EITS_SIGN_BOTH, 0, 1, 1},
        {"both, time, every 50th", EITS_SIGN_BOTH, 0, 50, 0},
    };
    EACH_ROW(row, rows) {
        eits_context *ctx = set_up(&b, RANDOM, row->prepared);
        eits_options o =
            with(ctx, EITS_SOLVER_WORKING_SET, row->asked ? 50000 : 20000, row->sign, 0.03);
        o.gap_every = row->every;
        o.gap_rel = row->asked ? R(BOTH_WIDTHS(1e-5, 1e-11)) : 0;
        const eits_info info = solve(ctx, o);
        CHECK_EQUAL(info.stop, row->asked ? EITS_STOP_GAP : EITS_STOP_ITERATIONS);
        double *x = dense_copy(eits_get_coefficients(ctx), N), *y = dense_copy(ctx->frame.y, RANK);
        const double gap = dense_gap(&b.d, y, x, (double)info.lambda, row->sign),
                     scale = 0.5 * dense_dot(y, y, RANK);
        CHECK_NEAR(gap, info.gap, 100 * EPS * scale);
        CHECK(gap <= BOTH_WIDTHS(1e-5, 1e-11) * scale * (1 + 1e-3) + 100 * EPS * scale);
        CHECK(info.nonzeros >= 3);
        free(x), free(y);
    }
}

/* Rows left out and the drift of the gain: the same projections as FISTA's. */
TEST(beside_a_basis)
{
    dense_bench b[2] = {0};
    for (int solver = 0; solver < 2; ++solver) {
        eits_context *ctx = set_up(&b[solver], RANDOM, 0);
        eits_real reference[SMALL_ROWS], frame[SMALL_ROWS];
        uint64_t state = 63;
        small_reference(&b[solver].c.model, 1, reference);
        vary(frame, reference, 0.3, &state);
        frame[b[solver].c.model.fold[4].first] = frame[b[solver].c.model.fold[4].second] = R(NAN);
        CHECK_OK(eits_reference_set(ctx, reference, SMALL_ROWS));
        eits_options o = with(ctx, (eits_solver)solver, 40, EITS_SIGN_INCREASE, 0.01);
        look_always(&o);
        CHECK_OK(eits_set_options(ctx, &o));
        CHECK_OK(eits_reconstruct(ctx, frame, SMALL_ROWS, NULL, NULL));
        CHECK_EQUAL(ctx->projection.count, 2);
    }
    CHECK(b[0].c.ctx->info.nonzeros >= 3);
    check_same(b[0].c.ctx, b[1].c.ctx);
    dense_bench_close(&b[0]);
    dense_bench_close(&b[1]);
}

/* From the optimum a warm start stays there; what it starts from is all of the last frame's
 * coefficients. */
TEST(warm_starts)
{
    eits_context *ctx = set_up(&b, RANDOM, 1);
    eits_options o = with(ctx, EITS_SOLVER_WORKING_SET, 20000, EITS_SIGN_BOTH, 0.03);
    const eits_info cold = solve(ctx, o);
    o.warm_start = 1;
    o.iterations = 1;
    const eits_info warm = solve(ctx, o);
    CHECK_EQUAL(warm.iterations, 1);
    CHECK(warm.gap_rel <= cold.gap_rel + R(200 * EPS));
    CHECK_EQUAL(warm.nonzeros, cold.nonzeros);
}

/* On the identity with one positive datum the working set is that one column. */
TEST(work_is_counted)
{
    eits_context *ctx = set_up(&b, (small_spec){.rank = 16, .side = 4, .shape = SMALL_IDENTITY}, 0);
    const uint64_t whole = 16 * 16, column = 16;
    eits_zero(ctx->frame.y, 16);
    ctx->frame.y[3] = 1;
    eits_options o = with(ctx, EITS_SOLVER_WORKING_SET, 1, EITS_SIGN_INCREASE, 0.25);
    o.gap_every = 5;
    CHECK_EQUAL(solve(ctx, o).macs, whole + column + whole);
    /* S'y serves the first iteration; then a column each for S'r and S x; S'r for the gap */
    o.iterations = 5;
    CHECK_EQUAL(solve(ctx, o).macs, whole + 4 * column + 5 * column + whole);
    o.iterations = 35; /* a look at 6 */
    CHECK_EQUAL(solve(ctx, o).macs, whole + whole + 33 * column + 35 * column + whole);
    o.iterations = 36; /* and, after six times as many, at 36 */
    CHECK_EQUAL(solve(ctx, o).macs, whole + 2 * whole + 33 * column + 36 * column + whole);
    o.gap_rel = R(1e-30); /* a look at 6 likewise, and a gap at 5 and at the end */
    o.iterations = 9;
    CHECK_EQUAL(solve(ctx, o).macs, whole + whole + 7 * column + 9 * column + 2 * whole);
}

TEST(refused_options)
{
    eits_context *ctx = set_up(&b, RANDOM, 0);
    CHECK_EQUAL(eits_get_options(ctx)->solver,
                EITS_SOLVER_FISTA); /* what a file of format 1.0 has */
    eits_options o = *eits_get_options(ctx);
    o.solver = (eits_solver)(EITS_SOLVER_ACTIVE_SET + 1);
    CHECK_REFUSED(eits_set_options(ctx, &o));
    o.solver = (eits_solver)2; /* reserved */
    CHECK_REFUSED(eits_set_options(ctx, &o));
}

/* The same peaks in the same order, of the columns around the active ones alone. */
TEST(violations_nearby)
{
    static const uint32_t active[] = {0, 30, 31, N - 1};
    for (uint32_t count = 0; count <= 4; ++count) {
        eits_context *ctx = set_up(&b, RANDOM, 0);
        eits_nearby near = eits_nearby_none(ctx);
        uint32_t expected[N], wanted = 0, most = 0;
        uint64_t state = 5;
        for (uint32_t k = 0; k < count; ++k)
            ctx->solver.working[k] = active[k];
        ctx->solver.working_count = count;
        eits_nearby_add(ctx, &near);
        eits_nearby_add(ctx, &near); /* what is listed is not listed again */
        eits_zero(ctx->solver.gradient, N);
        for (uint32_t j = 0; j < N; ++j) {
            int beside = 0;
            for (uint32_t k = 0; k < count; ++k)
                beside |= abs((int)(j % SIDE) - (int)(active[k] % SIDE)) <= 1 &&
                          abs((int)(j / SIDE) - (int)(active[k] / SIDE)) <= 1;
            most += (uint32_t)beside;
            ctx->solver.gradient[j] = beside ? (eits_real)(0.6 + 0.5 * small_random(&state)) : 0;
        }
        CHECK_EQUAL(near.count, most);
        wanted = eits_list_violations(ctx, &ctx->scratch, R(0.2), NULL);
        memcpy(expected, ctx->scratch.index, wanted * sizeof *expected);
        memset(ctx->scratch.index, 0xFF, N * sizeof *ctx->scratch.index);
        CHECK_EQUAL(eits_list_violations(ctx, &ctx->scratch, R(0.2), &near), wanted);
        CHECK(memcmp(expected, ctx->scratch.index, wanted * sizeof *expected) == 0);
        CHECK(wanted >= (count < 3 ? count : count - 1)); /* each has a peak, two share theirs */
    }
}

/* Zeros that stay zero leave the set; what is not zero, is on the way, or would move stays, in its
 * order. */
TEST(zeros_at_rest_are_pruned)
{
    static const struct {
        double x, z, gradient;
        int stays[3]; /* of both signs; x >= 0; x <= 0 */
    } CASES[] = {{0, 0, 0.9, {0, 0, 0}},  {0, 0, 1, {0, 0, 0}},    {0, 0, 1.1, {1, 1, 0}},
                 {0, 0, -1.1, {1, 0, 1}}, {0, 0, -1, {0, 0, 0}},   {2, 0, 0.5, {1, 1, 1}},
                 {0, 3, 0.5, {1, 1, 1}},  {-2, 1, 0.5, {1, 1, 1}}, {0, 0, 0, {0, 0, 0}}};
    enum { COUNT = COUNT_OF(CASES) };
    static const eits_sign signs[3] = {EITS_SIGN_BOTH, EITS_SIGN_INCREASE, EITS_SIGN_DECREASE};
    for (int s = 0; s < 3; ++s) {
        for (int prepared = 0; prepared < 2; ++prepared) {
            eits_context *ctx = set_up(&b, RANDOM, prepared);
            ctx->options.sign = signs[s];
            ctx->solver.working_count = COUNT;
            for (uint32_t k = 0; k < COUNT; ++k) {
                ctx->solver.working[k] = 3 * k;
                ctx->solver.x[k] = (eits_real)CASES[k].x;
                ctx->solver.z[k] = (eits_real)CASES[k].z;
                ctx->solver.gradient[k] = (eits_real)CASES[k].gradient;
            }
            eits_working_set_prune(ctx, 1);
            uint32_t left = 0;
            for (uint32_t k = 0; k < COUNT; ++k) {
                if (!CASES[k].stays[s])
                    continue;
                CHECK_EQUAL(ctx->solver.working[left], 3 * k);
                CHECK(ctx->solver.x[left] == (eits_real)CASES[k].x &&
                      ctx->solver.z[left] == (eits_real)CASES[k].z &&
                      ctx->solver.gradient[left] == (eits_real)CASES[k].gradient);
                ++left;
            }
            CHECK_EQUAL(ctx->solver.working_count, left);
        }
    }
}

RUN_TESTS("working set", dense_bench_close(&b))
