/* The limit of multiply-accumulates: whatever it is, it holds, and the image is finite and no worse
 * than zero. */
#include "steps.h"

enum { SIDE = 7, N = SIDE * SIDE, RANK = 12 };

static dense_bench b;

static eits_context *set_up(dense_bench *b)
{
    return dense_bench_open(b, (small_spec){.rank = RANK, .side = SIDE}, 0);
}

typedef struct setting {
    const char *name;
    eits_solver solver;
    eits_sign sign;
    int warm;
    double gap_rel;
} setting;

static eits_info solve(eits_context *ctx, setting w, uint32_t limit)
{
    eits_options o = *eits_get_options(ctx);
    o.solver = w.solver;
    o.sign = w.sign;
    o.iterations = 40;
    o.gap_every = 5;
    o.gap_rel = (eits_real)w.gap_rel;
    o.lambda_rel = R(0.01);
    o.warm_start = (uint32_t)w.warm;
    o.mac_limit = 0;
    eits_forget(ctx);
    if (w.warm) {
        CHECK_OK(eits_set_options(ctx, &o));
        small_new_data(ctx, 71);
        CHECK_OK(eits_solve(ctx, NULL));
    }
    small_new_data(ctx, 72);
    for (uint32_t i = 0; w.warm && i < RANK; ++i) { /* near what the start is for */
        eits_real kept = ctx->frame.y[i];
        uint64_t state = 71;
        for (uint32_t k = 0; k <= i; ++k)
            kept = (eits_real)small_random(&state);
        ctx->frame.y[i] = kept + R(0.2) * ctx->frame.y[i];
    }
    o.mac_limit = limit;
    CHECK_OK(eits_set_options(ctx, &o));
    CHECK_OK(eits_solve(ctx, NULL));
    return *eits_get_info(ctx);
}

static void check_result(const dense_bench *b, const eits_info *info)
{
    const eits_context *ctx = b->c.ctx;
    double *x = dense_copy(eits_get_coefficients(ctx), N), *y = dense_copy(ctx->frame.y, RANK);
    CHECK(is_finite(ctx));
    CHECK_EQUAL(count_nonzeros(ctx), info->nonzeros);
    if (info->lambda > 0) {
        const double scale = 0.5 * dense_dot(y, y, RANK);
        CHECK_NEAR(dense_gap(&b->d, y, x, (double)info->lambda, eits_get_options(ctx)->sign),
                   info->gap, 300 * EPS * scale);
        CHECK(dense_objective(&b->d, y, x, (double)info->lambda) <= scale * (1 + 1e-3));
    }
    free(x), free(y);
}

/* At each limit up to twice what the solver spends when it is free. */
static void check_limits(const setting *w)
{
    eits_context *ctx = set_up(&b);
    const eits_info free_run = solve(ctx, *w, 0);
    CHECK(free_run.stop != EITS_STOP_MACS);
    uint64_t spent = 0;
    for (uint32_t limit = 1; limit <= 2 * free_run.macs + 1; limit += 1 + limit / 97) {
        const eits_info info = solve(ctx, *w, limit);
        CHECK(info.macs <= limit);
        CHECK(info.stop == EITS_STOP_MACS || info.stop == free_run.stop ||
              info.stop == EITS_STOP_OPTIMUM);
        CHECK(info.stop != EITS_STOP_MACS || limit < 2 * free_run.macs);
        if (limit < N * RANK)
            CHECK(info.macs == 0 && info.stop == EITS_STOP_MACS && info.nonzeros == 0);
        spent = info.macs > spent ? info.macs : spent;
        check_result(&b, &info);
    }
    CHECK(spent == free_run.macs || w->warm);
    const eits_info enough = solve(ctx, *w, (uint32_t)(2 * free_run.macs));
    CHECK(enough.macs == free_run.macs && enough.gap == free_run.gap &&
          enough.stop == free_run.stop);
}

TEST(every_limit_holds)
{
    static const setting settings[] = {
        {"FISTA, cold", EITS_SOLVER_FISTA, EITS_SIGN_BOTH, 0, 0},
        {"FISTA, warm, to a gap", EITS_SOLVER_FISTA, EITS_SIGN_INCREASE, 1, 1e-6},
        {"working set, cold", EITS_SOLVER_WORKING_SET, EITS_SIGN_BOTH, 0, 0},
        {"working set, cold, to a gap", EITS_SOLVER_WORKING_SET, EITS_SIGN_BOTH, 0, 1e-6},
        {"working set, warm", EITS_SOLVER_WORKING_SET, EITS_SIGN_INCREASE, 1, 0},
        {"working set, warm, to a gap", EITS_SOLVER_WORKING_SET, EITS_SIGN_INCREASE, 1, 1e-6},
        {"active set, cold", EITS_SOLVER_ACTIVE_SET, EITS_SIGN_BOTH, 0, 0},
        {"active set, cold, to a gap", EITS_SOLVER_ACTIVE_SET, EITS_SIGN_BOTH, 0, 1e-6},
        {"active set, warm", EITS_SOLVER_ACTIVE_SET, EITS_SIGN_INCREASE, 1, 0},
    };
    EACH_ROW(row, settings)
        check_limits(row);
}

/* Cold FISTA needs just what it spends; and more MACs give no worse an image, so far as FISTA goes
 * down at all. */
TEST(to_the_last_mac)
{
    for (int solver = 0; solver < 2; ++solver) {
        eits_context *ctx = set_up(&b);
        const setting w = {"", (eits_solver)solver, EITS_SIGN_INCREASE, 0, 0};
        const eits_info free_run = solve(ctx, w, 0);
        CHECK_EQUAL(solve(ctx, w, (uint32_t)free_run.macs).stop, EITS_STOP_ITERATIONS);
        const eits_info less = solve(ctx, w, (uint32_t)free_run.macs - 1);
        CHECK_EQUAL(less.stop, EITS_STOP_MACS);
        CHECK_EQUAL(less.iterations, free_run.iterations - 1);
    }
}

/* A step that is too long starts over from zero: the limit holds there too. */
TEST(beside_step_halvings)
{
    (void)dense_bench_open(
        &b, (small_spec){.rank = RANK, .side = SIDE, .lipschitz_factor = 1.0 / 16}, 0);
    for (int solver = 0; solver < 2; ++solver) {
        const setting w = {"", (eits_solver)solver, EITS_SIGN_BOTH, 0, 0};
        for (uint32_t limit = 1; limit < 60000; limit += 1 + limit / 53) {
            const eits_info info = solve(b.c.ctx, w, limit);
            CHECK(info.macs <= limit);
            CHECK(is_finite(b.c.ctx));
            CHECK(info.stop == EITS_STOP_DIVERGED || info.stop == EITS_STOP_MACS ||
                  info.stop == EITS_STOP_ITERATIONS);
        }
    }
}

/* The multiply-accumulates of the frame stage are always spent, and the solver gets the rest of
 * the limit. This also holds if rows are left out, and each column must be whitened. */
static void of_a_whole_frame(int masked)
{
    for (int solver = 0; solver < SOLVERS; ++solver) {
        const small_spec spec = {
            .rank = RANK, .side = SIDE, .shape = masked ? SMALL_WHITENED : SMALL_RANDOM};
        eits_context *ctx = dense_bench_open(&b, spec, 0);
        eits_real reference[SMALL_ROWS], frame[SMALL_ROWS];
        uint64_t state = 63;
        small_reference(&b.c.model, 1, reference);
        vary(frame, reference, 0.3, &state);
        CHECK_OK(eits_reference_set(ctx, reference, SMALL_ROWS));
        for (int k = 0; k < 2 * masked; ++k) {
            mask_fold(ctx, 2 + 4 * (uint32_t)k);
        }
        uint64_t min = 0;
        for (uint32_t limit = 1; limit < 20000; limit += 1 + limit / 50) {
            CHANGE_OPTIONS(ctx, o.solver = each_solver(solver), o.mac_limit = limit);
            eits_info info;
            CHECK_OK(eits_reconstruct(ctx, frame, SMALL_ROWS, NULL, &info));
            min = limit == 2 ? info.macs : min; /* the first frame also builds the basis */
            CHECK(limit <= 2 || info.macs <= (limit > min ? limit : min));
        }
        CHECK_EQUAL(ctx->whitening.form != EITS_WHITENING_STORED, masked);
    }
}

int main(void)
{
    run_tests();
    of_a_whole_frame(0);
    of_a_whole_frame(1);
    dense_bench_close(&b);
    return checks_report("mac limit");
}
