/* Diagnostics that do not mask rows (mismatch, stale reference, crowded), and outliers of
 * reference frames: from numbers that are set by hand, on both sides of each limit. */
#include "steps.h"

#include "diagnostics/diagnostics.h"
#include "kernels/kernels.h"
#include "touch/disc_fit.h"

static dense_bench b;

enum { RANK = 13, SIDE = 6, N = SIDE * SIDE };

static eits_context *set_up(dense_bench *b, eits_data_kind kind)
{
    eits_context *ctx = dense_bench_open(
        b, (small_spec){.rank = RANK, .side = SIDE, .shape = SMALL_WHITENED, .kind = kind}, 0);
    eits_real reference[SMALL_ROWS];
    small_reference(ctx->model, 1, reference);
    CHECK_OK(eits_reference_set(ctx, reference, SMALL_ROWS));
    ctx->info.diagnostics = 0;
    return ctx;
}

/* ---- crowds ---- */

static int crowded(eits_context *ctx, const eits_touch *touches, uint32_t count)
{
    const eits_fit fit = eits_fit_none(ctx, &ctx->scratch); /* the residual is what a test wrote */
    ctx->info.unexplained = fit.total > 0 ? eits_fit_left(ctx, &fit) / fit.total : 0;
    eits_check_crowd(ctx, touches, count);
    return (ctx->info.diagnostics & EITS_DIAGNOSTIC_CROWDED) != 0;
}

/* The score of crowded.c, in double, from its features. */
static double score_of(double found, double electrodes, double near, double wide, double left,
                       double above, double clear)
{
    return -0.3583 - 0.2429 * found * 16 / electrodes + 3.645 * near - 4.607 * wide -
           3.659 * sqrt(left) + 0.1329 * above + 0.7892 * clear;
}

/* Whether the frame is said to be crowded just as its score asks; a score too near the limit would
 * test rounding. */
static void said_as(eits_context *ctx, const eits_touch *touches, uint32_t count, double score,
                    int expected)
{
    CHECK(fabs(score - 1.078) > 0.01);
    CHECK_EQUAL(score < 1.078, expected);
    CHECK_EQUAL(crowded(ctx, touches, count), expected);
}

TEST(crowds_on_both_sides_of_the_limit)
{
    eits_context *ctx = set_up(&b, EITS_DATA_DIFFERENCE);
    CHANGE_OPTIONS(ctx, o.max_touches = 4, o.touch_seed_radius_mm = 9);
    eits_zero(ctx->frame.y, EITS_STRIDE(RANK));
    eits_zero(ctx->solver.residual, EITS_STRIDE(RANK));
    /* all folds are in use, of one row each */
    memset(ctx->frame.sides, EITS_SIDE_FIRST, ctx->model->n_folded);
    ctx->frame.y[0] = ctx->info.data_norm = 10;
    ctx->solver.residual[0] = 1; /* 0.01 of |y|^2 */
    ctx->info.lambda_max = 20, ctx->info.lambda_noise = 2;
    eits_touch t[4] = {{.radius_mm = 9, .explained = 1},
                       {.x_mm = 18, .y_mm = 24, .radius_mm = 9, .explained = R(0.04)}};
    said_as(ctx, t, 2, score_of(2, 8, 30.0 / 18, 1, 0.01, 2, 2), 0);
    CHECK_NEAR(ctx->info.unexplained, 0.01, 1e-6);
    t[1].x_mm = 12, t[1].y_mm = 16; /* nearer */
    said_as(ctx, t, 2, score_of(2, 8, 20.0 / 18, 1, 0.01, 2, 2), 1);
    t[1].x_mm = 0, t[1].y_mm = 30; /* no matter which way */
    said_as(ctx, t, 2, score_of(2, 8, 30.0 / 18, 1, 0.01, 2, 2), 0);
    t[1].radius_mm = 11; /* wider */
    said_as(ctx, t, 2, score_of(2, 8, 30.0 / 20, 11.0 / 9, 0.01, 2, 2), 1);
    t[1].radius_mm = 9;
    ctx->solver.residual[0] = R(2.7); /* more left, which the weakest is no longer clear of */
    said_as(ctx, t, 2, score_of(2, 8, 30.0 / 18, 1, 0.0729, 2, 2 / 2.7), 1);
    t[1].x_mm = 100;
    said_as(ctx, t, 2, score_of(2, 8, 2, 1, 0.0729, 2, 2 / 2.7), 0); /* far is far */
    ctx->info.lambda_max = R(6.1); /* not far above noise: worth a sixth of a logit */
    said_as(ctx, t, 2, score_of(2, 8, 2, 1, 0.0729, 0.61, 2 / 2.7), 1);
    ctx->info.lambda_max = R(5.9); /* it may be noise */
    CHECK_EQUAL(crowded(ctx, t, 2), 0);
    ctx->info.lambda_noise = 0; /* none was learned */
    said_as(ctx, t, 2, score_of(2, 8, 2, 1, 0.0729, 10, 2 / 2.7), 0);
    ctx->info.lambda_noise = 2, ctx->info.lambda_max = 20;
    t[1].explained = R(0.0004); /* the weakest explains next to nothing */
    said_as(ctx, t, 2, score_of(2, 8, 2, 1, 0.0729, 0.2, 0.2 / 2.7), 1);
    t[1].explained = R(0.04);
    ctx->solver.residual[0] = 1;
    said_as(ctx, t, 1, score_of(1, 8, 2, 1, 0.01, 10, 3), 0);
    CHECK_EQUAL(crowded(ctx, t, 0), 0);
    t[2] = (eits_touch){.x_mm = -40, .radius_mm = 9, .explained = R(0.04)};
    t[3] = (eits_touch){.x_mm = -80, .radius_mm = 9, .explained = R(0.04)};
    said_as(ctx, t, 3, score_of(3, 8, 2, 1, 0.01, 2, 2), 0);
    CHECK_EQUAL(crowded(ctx, t, 4), 1); /* as many as may be */
    CHANGE_OPTIONS(ctx, o.max_touches = 5);
    said_as(ctx, t, 4, score_of(4, 8, 2, 1, 0.01, 2, 2), 0);
    CHANGE_OPTIONS(ctx, o.diagnostics &= ~(uint32_t)EITS_DIAGNOSTIC_CROWDED);
    t[3].x_mm = -41;
    CHECK_EQUAL(crowded(ctx, t, 4), 0);
}

/* ---- a reference that is another skin's ---- */

TEST(a_reference_unlike_the_model_is_named_where_that_is_asked_for)
{
    eits_context *ctx = set_up(&b, EITS_DATA_DIFFERENCE);
    for (uint32_t k = 0; k < 4; ++k) {
        ctx->reference.far = k & 1u;
        ctx->options.diagnostics = k & 2u ? EITS_DIAGNOSTICS_ALL : EITS_DIAGNOSTIC_CROWDED;
        ctx->info.diagnostics = 0;
        eits_check_unlike_model(ctx);
        CHECK_EQUAL(ctx->info.diagnostics, k == 3 ? EITS_DIAGNOSTIC_UNLIKE_MODEL : 0);
    }
}

/* ---- a stale reference ---- */

TEST(stale_references_on_both_sides_of_the_limit)
{
    static const struct {
        eits_sign sign;
        double up, down, noise; /* the greatest correlations either way; lambda_noise */
        int stale;
    } CASES[] = {
        {EITS_SIGN_INCREASE, 1, 1.8, 0.1, 1}, {EITS_SIGN_INCREASE, 1, 1.6, 0.1, 0},
        {EITS_SIGN_DECREASE, 1.8, 1, 0.1, 1}, {EITS_SIGN_DECREASE, 1, 1.8, 0.1, 0},
        {EITS_SIGN_INCREASE, 1, 1.8, 0.4, 0}, {EITS_SIGN_INCREASE, 1, 1.8, 0.35, 1},
        {EITS_SIGN_INCREASE, 1, 9, 0, 0},     {EITS_SIGN_BOTH, 1, 9, 0.1, 0},
    };
    eits_context *ctx = set_up(&b, EITS_DATA_DIFFERENCE);
    for (size_t k = 0; IN_TABLE(k, CASES); ++k) {
        CHANGE_OPTIONS(ctx, o.sign = CASES[k].sign);
        eits_zero(ctx->solver.gradient, N);
        ctx->solver.gradient[5] = (eits_real)CASES[k].up;
        ctx->solver.gradient[N - 1] = (eits_real)-CASES[k].down;
        ctx->info.lambda_max =
            (eits_real)(ctx->options.sign == EITS_SIGN_DECREASE ? CASES[k].down : CASES[k].up);
        ctx->info.lambda_noise = (eits_real)CASES[k].noise;
        ctx->info.diagnostics = 0;
        eits_check_stale_reference(ctx, ctx->solver.gradient);
        CHECK_EQUAL(ctx->info.diagnostics, CASES[k].stale ? EITS_DIAGNOSTIC_STALE_REFERENCE : 0);
    }
}

static int scale_is_off(eits_context *ctx, const eits_real *frame)
{
    ctx->info.diagnostics = 0;
    eits_check_scale(ctx, frame);
    CHECK(ctx->info.diagnostics == 0 || ctx->info.diagnostics == EITS_DIAGNOSTIC_STALE_REFERENCE);
    return ctx->info.diagnostics != 0;
}

TEST(a_frame_of_another_scale_than_the_reference_is_named)
{
    static const struct {
        double scale;
        int off;
    } CASES[] = {{1, 0},    {0.51, 0}, {0.49, 1}, {1.99, 0}, {2.01, 1},
                 {0.01, 1}, {1e6, 1},  {-1, 1},   {0, 1},    {1e37, 1}};
    eits_context *ctx = set_up(&b, EITS_DATA_DIFFERENCE);
    eits_real frame[SMALL_ROWS];
    memset(ctx->rows.unusable, 0, SMALL_ROWS);
    for (size_t k = 0; IN_TABLE(k, CASES); ++k) {
        for (uint32_t i = 0; i < SMALL_ROWS; ++i)
            frame[i] = (eits_real)CASES[k].scale * ctx->reference.v0[i];
        CHECK_EQUAL(scale_is_off(ctx, frame), CASES[k].off);
    }
    memcpy(frame, ctx->reference.v0, sizeof frame);
    frame[3] = 1000; /* one row alone, which counts unless it is left out */
    CHECK_EQUAL(scale_is_off(ctx, frame), 1);
    ctx->rows.unusable[3] = EITS_ROW_OUTLIER;
    CHECK_EQUAL(scale_is_off(ctx, frame), 0);
    frame[4] = 1000;
    CHANGE_OPTIONS(ctx, o.diagnostics &= ~(uint32_t)EITS_DIAGNOSTIC_STALE_REFERENCE);
    CHECK_EQUAL(scale_is_off(ctx, frame), 0);
    CHANGE_OPTIONS(ctx, o.diagnostics = EITS_DIAGNOSTICS_ALL);
    memset(ctx->rows.unusable, EITS_ROW_MASKED, SMALL_ROWS); /* nothing to judge by */
    CHECK_EQUAL(scale_is_off(ctx, frame), 0);
}

/* ---- mismatch ---- */

/* d = data that a sheet can give, plus `off` times data that no sheet gives; 1 if this is called a
 * mismatch. */
static int model_mismatch(eits_context *ctx, double off)
{
    const double pi = 3.14159265358979323846;
    uint32_t index[SMALL_FOLDED];
    uint64_t macs = 0;
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
        index[k] = k;
        ctx->frame.d[k] = (eits_real)(cos(pi * 2 * (k + 0.5) / SMALL_FOLDED) +
                                      off * cos(pi * (RANK + 2) * (k + 0.5) / SMALL_FOLDED));
        ctx->frame.sides[k] = EITS_SIDE_BOTH;
        ctx->frame.reciprocity_error[k] = 0;
    }
    ctx->kernels->mul(&ctx->model->reduction, index, ctx->frame.d, SMALL_FOLDED, ctx->frame.y);
    eits_zero(ctx->projection.gain_drift, SMALL_FOLDED);
    ctx->info.model_mismatch = 0;
    return eits_check_model_mismatch(ctx, &ctx->scratch, &macs);
}

TEST(mismatches_on_both_sides_of_the_limits)
{
    eits_context *ctx = set_up(&b, EITS_DATA_DIFFERENCE);
    CHECK(ctx->range.known);
    for (int i = 0; i < RANK; ++i) { /* the ridge: s^2 / (s^2 + 1e-4 s_1^2), over |P_i|^2 */
        const double s2 = pow(SMALL_DECAY, 2.0 * i), inverse = s2 + SMALL_REGULARISATION;
        CHECK_NEAR(ctx->range.shrink[i], s2 / (s2 + 1e-4) * inverse, 1e-4 * inverse);
        CHECK_NEAR(ctx->range.inverse[i], inverse, 1e-5);
    }
    CHECK(!model_mismatch(ctx, 0.5) && ctx->info.model_mismatch == 0); /* the noise is not known */
    ctx->reference.noise_v = R(1e-4);
    CHECK(model_mismatch(ctx, 0.06));
    CHECK_NEAR(ctx->info.model_mismatch, 0.06, 2e-4);
    CHECK(!model_mismatch(ctx, 0.045));
    CHECK_NEAR(ctx->info.model_mismatch, 0.045, 2e-4);
    /* of |d|^2 = (1 + off^2) 21/2; noise leaves 8 times noise_v^2 outside */
    const double off = 0.4, outside = off * off * SMALL_FOLDED / 2.0;
    ctx->reference.noise_v = (eits_real)sqrt(outside / (8 * 8.5));
    CHECK(!model_mismatch(ctx, off));
    CHECK_NEAR(ctx->info.model_mismatch, sqrt(off * off * 7.5 / 8.5 / (1 + off * off)), 1e-3);
    ctx->reference.noise_v = (eits_real)sqrt(outside / (8 * 9.5));
    CHECK(model_mismatch(ctx, off));
    ctx->reference.noise_v = (eits_real)sqrt(outside / (8 * 0.9));
    CHECK(!model_mismatch(ctx, off) && ctx->info.model_mismatch == 0);
}

/* Two norms of the folds' data and one of the reduced: where the gain is not ignored nothing is
 * learned of its drift. */
TEST(a_gain_that_counts_costs_nothing)
{
    uint64_t macs = 0;
    eits_context *ctx = set_up(&b, EITS_DATA_DIFFERENCE);
    ctx->reference.noise_v = R(1e-4);
    (void)model_mismatch(ctx, 0.06);
    ctx->range.off_range_build = ctx->projection.builds + 1;
    (void)eits_check_model_mismatch(ctx, &ctx->scratch, &macs);
    CHECK_EQUAL(macs, 0);
}

/* Two measurements of a fold have half the variance of one; a copy is none. Ratios have that of the
 * voltage over the reference. */
TEST(noise_of_the_data)
{
    for (int kind = 0; kind < 2; ++kind) {
        eits_context *ctx = set_up(&b, kind ? EITS_DATA_NORMALISED : EITS_DATA_DIFFERENCE);
        ctx->reference.noise_v = R(0.25);
        double sum = 0;
        for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
            const int two = k % 3 == 0 && k < SMALL_PAIRS;
            ctx->frame.sides[k] = k < SMALL_PAIRS ? (k % 3 == 1 ? EITS_SIDE_SECOND : EITS_SIDE_BOTH)
                                                  : EITS_SIDE_FIRST;
            ctx->frame.reciprocity_error[k] = two ? R(0.1) : 0;
            const double one =
                kind ? 0.25 / (double)ctx->model->v_ref[k] : 0.25 * (double)ctx->reference.gain;
            sum += one * one / (two ? 2 : 1);
        }
        CHECK_NEAR(eits_noise_energy(ctx), sum, 1e-5 * sum);
    }
}

/* ---- readings of reference frames ---- */

static uint32_t odd_folds(eits_context *ctx, const eits_real *newer, const eits_real *older,
                          uint32_t marked[SMALL_FOLDED])
{
    memset(ctx->scratch.index, 0xFF, SMALL_FOLDED * sizeof *ctx->scratch.index);
    const uint32_t count = eits_reference_compare(ctx, &ctx->scratch, newer, older, 4);
    uint32_t bits = 0;
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
        CHECK_EQUAL(ctx->scratch.index[k] | 4u, 0xFFFFFFFFu); /* the other bits are not touched */
        marked[k] = (ctx->scratch.index[k] & 4u) != 0;
        bits += marked[k];
    }
    CHECK_EQUAL(bits, count);
    return count;
}

/* All rows change by 0.04, each pair alike but for 0.1 %: then a reading is odd beyond 12 robust
 * deviations and 5 % of its own. */
TEST(odd_readings_on_both_sides_of_the_limit)
{
    eits_context *ctx = set_up(&b, EITS_DATA_DIFFERENCE);
    eits_real older[SMALL_ROWS], newer[SMALL_ROWS], spoilt[SMALL_ROWS];
    uint32_t marked[SMALL_FOLDED];
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
        const eits_fold fold = ctx->model->fold[k];
        const eits_real sign = fold.sign, size = k == 4 ? R(0.01) : (k == 5 ? R(0.5) : 1),
                        spread = k % 2 ? R(1e-3) : R(-1e-3);
        older[fold.first] = size, newer[fold.first] = size + R(0.04);
        if (fold.second != EITS_FOLD_NONE)
            older[fold.second] = sign * size, newer[fold.second] = sign * (size + R(0.04) + spread);
    }
    CHECK_EQUAL(odd_folds(ctx, newer, older, marked), 0);
    static const struct {
        uint32_t fold;
        double off;
        int odd;
    } CASES[] = {{4, 0.022, 1}, {4, 0.015, 0}, {5, 0.03, 1},
                 {5, 0.022, 0}, {6, 0.06, 1},  {6, 0.045, 0}};
    for (size_t n = 0; IN_TABLE(n, CASES); ++n) {
        memcpy(spoilt, newer, sizeof spoilt);
        spoilt[ctx->model->fold[CASES[n].fold].first] += (eits_real)CASES[n].off;
        CHECK_EQUAL(odd_folds(ctx, spoilt, older, marked), CASES[n].odd);
        CHECK_EQUAL(marked[CASES[n].fold], CASES[n].odd);
    }
    memcpy(spoilt, newer, sizeof spoilt);
    /* as many are no outliers */
    for (uint32_t count = 1; count <= EITS_OUTLIER_MAX + 1; ++count) {
        spoilt[ctx->model->fold[count].first] += R(0.2);
        CHECK_EQUAL(odd_folds(ctx, spoilt, older, marked), count <= EITS_OUTLIER_MAX ? count : 0);
    }
}

/* Rows that are not in use are neither volts nor a change. */
TEST(rows_out_of_use)
{
    eits_context *ctx = set_up(&b, EITS_DATA_DIFFERENCE);
    const uint32_t rows[2] = {ctx->model->fold[4].first, ctx->model->fold[4].second};
    eits_real older[SMALL_ROWS], newer[SMALL_ROWS];
    uint32_t marked[SMALL_FOLDED];
    for (int out = 0; out < 2; ++out) {
        for (uint32_t i = 0; i < SMALL_ROWS; ++i)
            older[i] = newer[i] = R(0.02);
        ctx->rows.masked[rows[out]] = 1;
        CHECK_EQUAL(odd_folds(ctx, newer, older, marked), 0);
        newer[rows[1 - out]] += R(0.009);
        CHECK_EQUAL(odd_folds(ctx, newer, older, marked), 1);
        CHECK(marked[4]);
        ctx->rows.masked[rows[out]] = 0;
    }
}

/* ---- noise that is learned ---- */

/* The noise of voltages whose squares are out of range, and lambda of this noise. */
TEST(noise_of_any_size)
{
    static const double sizes[] = {1, BOTH_WIDTHS(1e-24, 1e-170), BOTH_WIDTHS(1e24, 1e170)};
    enum { FRAMES = 8 };
    for (int n = 0; n < 3; ++n) {
        eits_context *ctx = set_up(&b, EITS_DATA_DIFFERENCE);
        uint64_t state = 3;
        eits_real reference[SMALL_ROWS], frame[SMALL_ROWS];
        double mean[SMALL_ROWS] = {0}, squares[SMALL_ROWS] = {0}, sum = 0;
        small_reference(ctx->model, 1, reference);
        CHECK_OK(eits_reference_begin(ctx, FRAMES));
        for (int k = 0; k < FRAMES; ++k) {
            for (int i = 0; i < SMALL_ROWS; ++i) {
                const double off = 0.01 * small_random(&state);
                frame[i] = (eits_real)(sizes[n] * ((double)reference[i] + off));
                mean[i] += off / FRAMES;
                squares[i] += off * off;
            }
            CHECK_OK(eits_reference_add(ctx, frame, SMALL_ROWS));
        }
        CHECK_OK(eits_reference_finish(ctx));
        for (int i = 0; i < SMALL_ROWS; ++i)
            sum += (squares[i] - FRAMES * mean[i] * mean[i]) / (FRAMES - 1) / SMALL_ROWS;
        CHECK_NEAR((double)ctx->reference.noise_v / sizes[n], sqrt(sum), 1e-4);
        CHECK_EQUAL(ctx->reference.outliers, 0);
        memset(frame, 0, sizeof frame); /* a dead front end is no reference frame */
        CHECK_OK(eits_reference_begin(ctx, FRAMES));
        for (int k = 0; k < FRAMES; ++k) {
            for (int i = 0; i < SMALL_ROWS; ++i)
                frame[i] = k < FRAMES / 2 ? reference[i] : 0;
            CHECK_EQUAL(eits_reference_add(ctx, frame, SMALL_ROWS),
                        k < FRAMES / 2 ? EITS_OK : EITS_E_FRAME_ZERO);
        }
    }
    eits_context *ctx = set_up(&b, EITS_DATA_DIFFERENCE);
    small_new_data(ctx, 5);
    ctx->reference.lambda_noise = R(0.25);
    CHANGE_OPTIONS(ctx, o.lambda_rel = R(1e-3), o.lambda_noise_factor = R(0.5),
                   o.detection_factor = 0);
    CHECK_OK(eits_solve(ctx, NULL));
    CHECK(ctx->info.lambda == R(0.125) && ctx->info.lambda_noise == R(0.25));
}

RUN_TESTS("diagnostic limits", dense_bench_close(&b))
