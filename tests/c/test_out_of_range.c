/* Numbers at the ends of the range: what would not be finite is left out, unknown or zero, and
 * never comes out. Found by fuzzing. */
#include "steps.h"

static const small_spec SPEC = {.rank = 6, .side = 4};

static dense_bench b;

static void finite_touches(const eits_context *ctx, const eits_touch *touches, uint32_t count)
{
    CHECK(count <= EITS_MAX_TOUCHES && count == ctx->info.touches);
    for (uint32_t k = 0; k < count; ++k)
        CHECK(isfinite(touches[k].x_mm) && isfinite(touches[k].y_mm) &&
              isfinite(touches[k].radius_mm) && isfinite(touches[k].strength_s_per_m_mm2) &&
              isfinite(touches[k].explained));
}

/* Pixels of 1e38 mm make a touch's strength infinite, and weights may have no inverse: then the
 * disc's response is. */
TEST(touches_are_finite_whatever_the_units)
{
    static const float units[][2] = {
        {1e38f, 0.02f}, {6.0f, 1e-45f}, {6.0f, 1e-39f}, {6.0f, 1e36f}, {1e-38f, 3e38f}};
    for (size_t u = 0; IN_TABLE(u, units); ++u) {
        small_spec spec = SPEC;
        spec.pixel_mm = units[u][0];
        small_model made = small_model_make(spec);
        uint8_t *weight = small_model_section(&made, "COLW", NULL);
        for (uint32_t j = 0; j < 16; ++j)
            small_put_f32(weight + 4 * j, units[u][1]);
        eits_context *ctx = dense_bench_take(&b, made, 0);
        eits_real frame[SMALL_ROWS];
        small_reference(ctx->model, 1.0, frame);
        CHECK_OK(eits_reference_set(ctx, frame, SMALL_ROWS));
        for (uint32_t i = 0; i < SMALL_ROWS; i += 3)
            frame[i] *= (eits_real)(1.0 + 0.01 * (i % 7));
        eits_touch touches[EITS_MAX_TOUCHES];
        uint32_t count = 0;
        (void)eits_reconstruct(ctx, frame, SMALL_ROWS, NULL, NULL);
        CHECK_OK(eits_find_touches(ctx, touches, EITS_MAX_TOUCHES, &count));
        finite_touches(ctx, touches, count);
    }
}

/* Six reference frames, the first `first` times the model's volts, the others `others` times; the
 * noise that was learned. */
static eits_real learn_noise(double first, double others)
{
    eits_context *ctx = dense_bench_open(&b, SPEC, 0);
    CHANGE_OPTIONS(ctx, o.diagnostics = 0);
    eits_real frame[SMALL_ROWS];
    CHECK_OK(eits_reference_begin(ctx, 6));
    for (int k = 0; k < 6; ++k) {
        small_reference(ctx->model, k == 0 ? first : others, frame);
        for (uint32_t i = 0; i < SMALL_ROWS; ++i)
            frame[i] *= (eits_real)(1.0 + 1e-3 * ((i + (uint32_t)k) % 5));
        CHECK_OK(eits_reference_add(ctx, frame, SMALL_ROWS));
    }
    CHECK_OK(eits_reference_finish(ctx));
    CHECK(ctx->reference.ready && isfinite(ctx->reference.lambda_noise) &&
          ctx->reference.lambda_noise > 0);
    return ctx->reference.noise_v;
}

/* Deviations whose squares, in the first frame's unit, overflow: the noise is unknown, the
 * reference good all the same. Without that, however great the volts are, it is known. */
TEST(noise_out_of_range_is_unknown)
{
    const double great = BOTH_WIDTHS(1e28, 1e250);
    CHECK_EQUAL(learn_noise(BOTH_WIDTHS(1e-25, 1e-200), 1), 0);
    CHECK_NEAR(learn_noise(great, great) / (eits_real)great, learn_noise(1, 1),
               1e-5 * (double)learn_noise(1, 1));
}

/* A reference frame that leads beyond the range is refused and does not count. */
TEST(a_reference_frame_out_of_range_is_refused)
{
    small_model made = small_model_make(SPEC);
    uint8_t *reduction = small_model_section(&made, "REDU", NULL);
    for (uint32_t i = 0; i < SMALL_FOLDED * 8; ++i)
        small_put_f32(reduction + 4 * i, i % 8 < 6 ? 1e19f : 0.0f);
    small_put_f32(small_model_section(&made, "SENS", NULL), 3e38f);
    eits_context *ctx = dense_bench_take(&b, made, 0);
    CHANGE_OPTIONS(ctx, o.diagnostics = 0);
    eits_real frame[SMALL_ROWS];
    CHECK_OK(eits_reference_begin(ctx, 4));
    small_reference(ctx->model, 1.0, frame);
    CHECK_OK(eits_reference_add(ctx, frame, SMALL_ROWS));
    CHECK_OK(eits_reference_add(ctx, frame, SMALL_ROWS));
    frame[0] *= (eits_real)1.5;
    const eits_status status = eits_reference_add(ctx, frame, SMALL_ROWS);
    CHECK_EQUAL(status, BOTH_WIDTHS(EITS_E_NOT_FINITE, EITS_OK));
    CHECK_EQUAL(ctx->reference.count, status == EITS_OK ? 3 : 2);
    CHECK(isfinite(ctx->reference.lambda_noise));
}

/* Data whose squares underflow: norms and gaps are zero, so that every solver returns zero. */
TEST(data_too_small_to_square_give_zero)
{
    eits_context *ctx = dense_bench_open(&b, SPEC, 0);
    for (int solver = 0; solver < SOLVERS; ++solver) {
        CHANGE_OPTIONS(ctx, o.solver = each_solver(solver));
        small_new_data(ctx, 3);
        for (uint32_t i = 0; i < SPEC.rank; ++i)
            ctx->frame.y[i] *= (eits_real)BOTH_WIDTHS(1e-24, 1e-165);
        CHECK_OK(eits_solve(ctx, NULL));
        CHECK_EQUAL(ctx->info.stop, EITS_STOP_ZERO);
        CHECK(ctx->info.lambda_max > ctx->info.lambda);
        CHECK(ctx->info.residual <= ctx->info.data_norm && ctx->info.gap == 0 &&
              ctx->info.nonzeros == 0);
        for (uint32_t j = 0; j < 16; ++j)
            CHECK(eits_get_image(ctx)[j] == 0);
    }
}

RUN_TESTS("out_of_range", dense_bench_close(&b))
