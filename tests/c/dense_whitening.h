/* A small whitened model, a frame, and what the core's map makes of S: for tests of rows left out
 * and of the regularisation. */
#ifndef EITSKIN_TEST_DENSE_WHITENING_H
#define EITSKIN_TEST_DENSE_WHITENING_H
#include "steps.h"

#include "frame/whitening.h"
#include "kernels/kernels.h"

enum { RANK = 13, STRIDE = 16, SIDE = 6, N = SIDE * SIDE };

static const small_spec WHITENED = {.rank = RANK, .side = SIDE, .shape = SMALL_WHITENED};

typedef struct bench {
    dense_bench b;
    eits_real reference[SMALL_ROWS], frame[SMALL_ROWS];
    int out[SMALL_FOLDED];
} bench;

static bench b;

static inline eits_context *set_up(bench *b, small_spec spec, int project)
{
    uint64_t state = 91;
    dense_bench_close(&b->b);
    memset(b, 0, sizeof *b);
    eits_context *ctx = dense_bench_open(&b->b, spec, 0);
    small_reference(ctx->model, 1, b->reference);
    vary(b->frame, b->reference, 0.2, &state);
    /* arbitrary frames: what is found wrong with them is for test_outliers.c */
    CHANGE_OPTIONS(ctx, o.diagnostics = 0, o.project_reference = (uint32_t)project,
                   o.max_masked = SMALL_ROWS, o.iterations = 40);
    CHECK_OK(eits_reference_set(ctx, b->reference, SMALL_ROWS));
    return ctx;
}

/* Leave folded row k out. */
static inline void leave_out(bench *b, uint32_t k)
{
    b->out[k] = 1;
    lose_fold(&b->b.c.model, k, b->frame);
}

/* As though so much noise had been learned, over the reference's rms. */
static inline void pretend_noise(eits_context *ctx, double noise)
{
    ctx->reference.noise_v = (eits_real)noise * ctx->reference.v0_rms;
    ctx->projection.stale = 1;
}

static inline uint32_t stage(bench *b)
{
    uint32_t masked = 0;
    uint64_t macs = 0;
    CHECK_OK(eits_frame_stage(b->b.c.ctx, b->frame, SMALL_ROWS, &masked, &macs));
    return masked;
}

/* Column j of F, or of F S: by the core's own map. */
static inline void whitening_column(eits_context *ctx, const double *column, int project,
                                    double *out)
{
    eits_real v[STRIDE] = {0};
    for (int i = 0; i < RANK; ++i)
        v[i] = (eits_real)column[i];
    if (project)
        (void)eits_forward(ctx, v);
    else
        (void)eits_whiten(ctx, v);
    for (int i = 0; i < RANK; ++i)
        out[i] = (double)v[i];
}

/* S'F'y of one row's datum, squared and summed over S's columns; with `whole` that of a frame with
 * all rows. */
static inline double energy_of_row(bench *b, uint32_t k, int whole)
{
    eits_context *ctx = b->b.c.ctx;
    eits_real y[STRIDE] = {0};
    for (int i = 0; i < RANK; ++i)
        y[i] = (eits_real)b->b.d.p[k * RANK + (uint32_t)i];
    if (!whole)
        (void)eits_whiten_data(ctx, y);
    double *back = dense_copy(whole ? y : eits_adjoint(ctx, y, ctx->solver.adjoint), RANK), sum = 0;
    for (int j = 0; j < N; ++j) {
        const double c = dense_dot(b->b.d.s + j * RANK, back, RANK);
        sum += c * c;
    }
    free(back);
    return sum;
}

/* The greatest eigenvalue of the seen S's, by power iteration from below. */
static inline double greatest_eigenvalue(const double *s)
{
    double v[RANK], w[RANK], size = 0;
    for (int i = 0; i < RANK; ++i)
        v[i] = 1 + 0.1 * i;
    for (int step = 0; step < 200; ++step) {
        memset(w, 0, sizeof w);
        for (int j = 0; j < N; ++j) {
            const double along = dense_dot(s + j * RANK, v, RANK);
            for (int i = 0; i < RANK; ++i)
                w[i] += along * s[j * RANK + i];
        }
        size = sqrt(dense_dot(w, w, RANK));
        for (int i = 0; i < RANK; ++i)
            v[i] = w[i] / size;
    }
    return size;
}

/* Each solver solves the problem of F S and y; the gap is the true one; the stated step suffices.
 * The frame is staged. */
static inline void solve_what_is_seen(bench *b, int sign)
{
    eits_context *ctx = b->b.c.ctx;
    double greatest;
    for (int j = 0; j < N; ++j)
        whitening_column(ctx, b->b.d.s + j * RANK, 1, b->b.d.s + j * RANK);
    greatest = greatest_eigenvalue(b->b.d.s);
    CHECK(greatest <= (double)b->b.c.model.lipschitz);
    if (ctx->projection.count == 0 && ctx->whitening.form == EITS_WHITENING_DIAGONAL)
        CHECK_NEAR(greatest, b->b.c.model.lipschitz, 1e-3);
    double *y = dense_copy(ctx->frame.y, RANK), min = 0;
    eits_options o = *eits_get_options(ctx);
    o.sign = (eits_sign)sign;
    o.lambda_rel = R(0.05);
    o.detection_factor = 0;
    /* the active set first: its gap bounds the optimum from below */
    for (int solver = SOLVERS - 1; solver >= 0; --solver) {
        o.solver = each_solver(solver);
        o.iterations = 4000;
        o.gap_rel = R(BOTH_WIDTHS(1e-5, 1e-9));
        CHECK_OK(eits_set_options(ctx, &o));
        eits_forget(ctx);
        CHECK_OK(eits_solve(ctx, NULL));
        const eits_info info = *eits_get_info(ctx);
        CHECK(info.gap >= 0 && info.nonzeros > 0 && info.step_halvings == 0);
        double *got = dense_copy(eits_get_coefficients(ctx), N);
        const double lambda = (double)info.lambda, scale = 0.5 * dense_dot(y, y, RANK);
        CHECK_NEAR(info.gap, dense_gap(&b->b.d, y, got, lambda, o.sign), 300 * EPS * scale);
        const double objective = dense_objective(&b->b.d, y, got, lambda), room = 300 * EPS * scale;
        if (o.solver == EITS_SOLVER_ACTIVE_SET) {
            CHECK(info.stop == EITS_STOP_GAP || info.stop == EITS_STOP_OPTIMUM);
            CHECK(info.gap <= BOTH_WIDTHS(1e-5, 1e-9) * scale);
            min = objective - (double)info.gap - room;
        }
        CHECK(objective >= min &&
              objective <= min + (double)info.gap + BOTH_WIDTHS(1.2e-4, 1e-8) * scale);
        CHECK(info.gap <= R(1e-3) * (eits_real)scale);
        free(got);
    }
    free(y);
}

#endif
