/* Numbers at the ends of the width: what overflows or vanishes on the way is refused or answered
 * with zero, never NaN. */
#include "steps.h"

enum { SIDE = 4, N = SIDE * SIDE, MAX_RANK = 40 };
static const double GREATEST = BOTH_WIDTHS((double)FLT_MAX, DBL_MAX);

static dense_bench b;

static small_model make(uint32_t rank)
{
    return small_model_make((small_spec){.rank = rank, .side = SIDE});
}

/* Every number of VREF. */
static void set_v_ref(small_model *made, float value)
{
    uint8_t *at = small_model_section(made, "VREF", NULL);
    for (int k = 0; k < SMALL_FOLDED; ++k)
        small_put_f32(at + 4 * k, value);
}

/* The reference of a model of equal voltages, `volts` each, and what becomes of a frame of
 * `measured` volts. */
static void reference(float volts, double measured, eits_status expected)
{
    small_model made = make(12);
    set_v_ref(&made, volts);
    eits_context *ctx = dense_bench_take(&b, made, 0);
    eits_real frame[SMALL_ROWS];
    for (int i = 0; i < SMALL_ROWS; ++i)
        frame[i] = (eits_real)measured;
    CHECK_EQUAL(eits_reference_set(ctx, frame, SMALL_ROWS), expected);
    CHECK_EQUAL(ctx->reference.ready, expected == EITS_OK);
    CHECK(expected != EITS_OK ||
          (isfinite((double)ctx->reference.gain) && ctx->reference.gain != 0));
}

TEST(references_out_of_proportion_never_give_nan)
{
    const eits_status narrow_only = BOTH_WIDTHS(EITS_E_FRAME_ZERO, EITS_OK);
    reference(1, 1, EITS_OK);
    reference(0, 1, EITS_E_FRAME_ZERO);
    /* one over the model's volts overflows */
    reference(1e-40f, 1, narrow_only);
    reference(1, GREATEST, EITS_E_FRAME_ZERO);                         /* the fold's sum does */
    reference(FLT_MAX, BOTH_WIDTHS(1e-30, 1e-300), EITS_E_FRAME_ZERO); /* the gain does */
    reference(1e-30f, BOTH_WIDTHS(1e25, 1e300), EITS_E_FRAME_ZERO);    /* the gain vanishes */
}

/* Every column of S: `first` in the first eight rows, `rest` in the others. */
static void set_columns(small_model *made, uint32_t rank, float first, float rest)
{
    uint32_t size;
    uint8_t *at = small_model_section(made, "SENS", &size);
    const uint32_t stride = size / 4 / N;
    for (uint32_t j = 0; j < N; ++j) {
        for (uint32_t i = 0; i < rank; ++i)
            small_put_f32(at + 4 * ((size_t)j * stride + i), i < 8 ? first : rest);
    }
}

static void check_cleared(const eits_context *ctx)
{
    CHECK(is_cleared(ctx));
    CHECK(isfinite((double)ctx->info.gap) && isfinite((double)ctx->info.residual) &&
          isfinite((double)ctx->info.lambda));
}

TEST(correlations_that_overflow_never_give_nan)
{
    for (int solver = 0; solver < SOLVERS; ++solver) {
        small_model made = make(12);
        set_columns(&made, 12, 1e36f, 1e36f);
        eits_context *ctx = dense_bench_take(&b, made, 0);
        for (int i = 0; i < 12; ++i)
            ctx->frame.y[i] = R(BOTH_WIDTHS(1e5, 1e150));
        ctx->options.solver = each_solver(solver);
        CHECK_EQUAL(eits_solve(ctx, NULL), BOTH_WIDTHS(EITS_E_NOT_FINITE, EITS_OK));
        CHECK(BOTH_WIDTHS(1, 0) ==
              (ctx->info.stop == EITS_STOP_DIVERGED && ctx->info.lambda_max == 0));
        if (sizeof(eits_real) == 4)
            check_cleared(ctx);
    }
}

/* The columns are so small that their squares are sums of the smallest numbers there are, and come
 * out too small by more than half. In float32 the steps of the active set are then too long, the
 * objective shows it, and FISTA takes over: x is finite and better than zero, whatever the limit of
 * multiply-accumulates. With great data the factor's numbers overflow as well. */
static eits_info solve_vanishing(double size, uint32_t mac_limit)
{
    small_model made = make(MAX_RANK);
    set_columns(&made, MAX_RANK, 3.75e-23f, 2.6e-23f);
    /* the least that a model may state */
    small_put_f32(small_model_section(&made, "DIMS", NULL) + 56, 1.2e-38f);
    eits_context *ctx = dense_bench_take(&b, made, 0);
    for (int i = 0; i < MAX_RANK; ++i)
        ctx->frame.y[i] = (eits_real)(size * (i < 8 ? 3.75 : 2.6));
    CHANGE_OPTIONS(ctx, o.solver = EITS_SOLVER_ACTIVE_SET, o.sign = EITS_SIGN_BOTH,
                   o.lambda_rel = R(0.01), o.iterations = 50, o.mac_limit = mac_limit);
    CHECK_OK(eits_solve(ctx, NULL));
    const eits_info info = *eits_get_info(ctx);
    CHECK(is_finite(ctx) && isfinite((double)info.gap) && info.residual <= info.data_norm);
    return info;
}

TEST(columns_whose_squares_vanish_never_give_nan)
{
    static const double sizes[] = {1, 1e16};
    for (size_t s = 0; IN_TABLE(s, sizes); ++s) {
        const eits_info info = solve_vanishing(sizes[s], 0);
        CHECK_EQUAL(info.stop, BOTH_WIDTHS(EITS_STOP_ITERATIONS, EITS_STOP_OPTIMUM));
        CHECK(info.residual < R(BOTH_WIDTHS(0.99, 0.02)) * info.data_norm);
        for (uint32_t limit = MAX_RANK; sizeof(eits_real) == 4 && limit < info.macs;
             limit += limit < 2000 ? MAX_RANK : limit / 3) {
            const eits_info limited = solve_vanishing(sizes[s], limit);
            CHECK(limited.macs <= limit && limited.stop == EITS_STOP_MACS);
        }
    }
}

RUN_TESTS("overflow", dense_bench_close(&b))
