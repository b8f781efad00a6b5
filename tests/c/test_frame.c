/* The frame stage: difference, fold, reduction, rows left out, drift; against the dense
 * computation. */
#include "steps.h"

enum { RANK = 12, SIDE = 4 };

typedef struct bench {
    dense_bench on;
    eits_real reference[SMALL_ROWS], frame[SMALL_ROWS];
    uint8_t out[SMALL_ROWS];
} bench;

static bench b;

static const struct {
    const char *name;
    eits_data_kind kind;
} KINDS[] = {{"differences", EITS_DATA_DIFFERENCE},
             {"normalised", EITS_DATA_NORMALISED},
             {"logarithms of ratios", EITS_DATA_LOG_RATIO}};

/* A context with a reference of `gain` times the model's, each channel off by up to 3 %, so that no
 * two reciprocal rows agree; and a frame that differs from it by up to 20 %. */
static eits_context *set_up(bench *b, eits_data_kind kind, double gain, int project)
{
    uint64_t state = 31;
    eits_context *ctx =
        dense_bench_open(&b->on, (small_spec){.rank = RANK, .side = SIDE, .kind = kind}, 0);
    memset(b->out, 0, sizeof b->out);
    small_reference(ctx->model, gain, b->reference);
    vary(b->reference, b->reference, 0.03, &state);
    vary(b->frame, b->reference, 0.2, &state);
    /* arbitrary frames: what is found wrong with them is for test_outliers.c */
    CHANGE_OPTIONS(ctx, o.project_reference = (uint32_t)project, o.diagnostics = 0);
    CHECK_OK(eits_reference_set(ctx, b->reference, SMALL_ROWS));
    return ctx;
}

static eits_status stage(bench *b, uint32_t *masked)
{
    uint64_t macs;
    return eits_frame_stage(b->on.c.ctx, b->frame, SMALL_ROWS, masked, &macs);
}

/* Run the stage; y must be what the dense computation gives with the rows in b->out left out. */
static void check_stage(bench *b, uint32_t masked_expected)
{
    eits_context *ctx = b->on.c.ctx;
    double *v0 = dense_copy(b->reference, SMALL_ROWS), y[RANK];
    uint32_t masked = 99;
    CHECK_OK(stage(b, &masked));
    CHECK_EQUAL(masked, masked_expected);
    dense_frame(&b->on.c.model, &b->on.d, v0, (double)ctx->reference.gain,
                eits_get_options(ctx)->project_reference ? v0 : NULL, b->frame, b->out, y);
    CHECK(sqrt(dense_dot(y, y, RANK)) > 0.01);
    CHECK_NEAR(dense_greatest_difference(y, ctx->frame.y, RANK), 0, 60 * EPS);
    for (uint32_t i = RANK; i < EITS_STRIDE(RANK); ++i)
        CHECK(ctx->frame.y[i] == 0);
    for (uint32_t k = 0; k < ctx->projection.count;
         ++k) { /* orthonormal, and y is orthogonal to it */
        double *a = dense_copy(ctx->projection.basis + EITS_STRIDE(RANK) * k, RANK),
               *yy = dense_copy(ctx->frame.y, RANK);
        for (uint32_t l = 0; l <= k; ++l) {
            double *other = dense_copy(ctx->projection.basis + EITS_STRIDE(RANK) * l, RANK);
            CHECK_NEAR(dense_dot(a, other, RANK), k == l, 10 * EPS);
            free(other);
        }
        CHECK_NEAR(dense_dot(a, yy, RANK), 0, 10 * EPS);
        free(a);
        free(yy);
    }
    free(v0);
}

/* The datum of fold k of b.frame, by the definition of the kind of data. */
static double expected_datum(uint32_t k, eits_data_kind kind, double gain)
{
    const eits_fold fold = b.on.c.model.fold[k];
    double sum = 0, used = 0;
    for (int side = 0; side < 2; ++side) {
        const uint32_t row = side == 0 ? fold.first : fold.second;
        if (row == EITS_FOLD_NONE)
            continue;
        const double v = (double)b.frame[row], v0 = (double)b.reference[row];
        const double sign = side == 1 && kind != EITS_DATA_NORMALISED ? fold.sign : 1;
        sum += sign * (kind == EITS_DATA_DIFFERENCE   ? gain * (v - v0)
                       : kind == EITS_DATA_NORMALISED ? (v - v0) / v0
                                                      : gain * v0 * log(v / v0));
        used += 1;
    }
    return sum / used;
}

/* A reference of `factor` times the model's: the gain takes it up, polarity too. */
static void check_data(eits_data_kind kind, double factor, int project)
{
    eits_context *ctx = set_up(&b, kind, factor, project);
    check_stage(&b, 0);
    const double gain = (double)ctx->reference.gain;
    CHECK_NEAR(gain, 1 / factor, 0.02);
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k)
        CHECK_NEAR(ctx->frame.d[k], expected_datum(k, kind, gain), 10 * EPS);
    CHECK_EQUAL(ctx->projection.count, project);
    /* the option counts from the next frame on */
    CHANGE_OPTIONS(ctx, o.project_reference = !project);
    check_stage(&b, 0);
    CHECK_EQUAL(ctx->projection.count, !project);
}

TEST(data_of_each_kind)
{
    EACH_ROW(row, KINDS) {
        check_data(row->kind, 2, 0);
        check_data(row->kind, 2, 1);
        check_data(row->kind, -0.5, 0);
        check_data(row->kind, -0.5, 1);
    }
}

/* |y| of a frame that is its reference, all rows off by the same fraction. */
static double size_of_drift(eits_data_kind kind, double drift, int project)
{
    eits_context *ctx = set_up(&b, kind, 1.7, project);
    for (int i = 0; i < SMALL_ROWS; ++i)
        b.frame[i] = b.reference[i] * (eits_real)(1 + drift);
    STAGE(ctx, b.frame);
    double *y = dense_copy(ctx->frame.y, RANK);
    const double size = sqrt(dense_dot(y, y, RANK));
    free(y);
    return size;
}

TEST(drift_of_the_gain)
{
    static const double drifts[] = {1e-3, 0.05, -0.3, 0.8};
    EACH_ROW(row, KINDS) {
        for (size_t e = 0; IN_TABLE(e, drifts); ++e) {
            CHECK(size_of_drift(row->kind, drifts[e], 0) > 0.5 * fabs(drifts[e]));
            CHECK(size_of_drift(row->kind, drifts[e], 1) <= 30 * EPS * (1 + fabs(drifts[e])));
        }
    }
}

/* Rows that are NaN, infinite or saturated are left out and counted; they do not change the data.
 */
static void check_unusable(eits_data_kind kind, int project)
{
    eits_context *ctx = set_up(&b, kind, 1, project);
    const eits_fold pair = b.on.c.model.fold[2], other = b.on.c.model.fold[6],
                    single = b.on.c.model.fold[20];
    b.frame[pair.first] = (eits_real)NAN; /* the reciprocal stands in, sign turned */
    b.out[pair.first] = 1;
    check_stage(&b, 1);
    CHECK_EQUAL(ctx->projection.count, project);
    b.frame[other.second] = (eits_real)-INFINITY;
    b.out[other.second] = 1;
    check_stage(&b, 2);
    CHECK(ctx->rows.unusable[pair.first] && ctx->rows.unusable[other.second] &&
          !ctx->rows.unusable[pair.second]);
    b.frame[single.first] = (eits_real)INFINITY; /* a row without reciprocal */
    b.out[single.first] = 1;
    check_stage(&b, 3);
    CHECK_EQUAL(ctx->projection.count, 1 + project);
    b.frame[pair.second] = (eits_real)NAN; /* now both of a pair */
    b.out[pair.second] = 1;
    check_stage(&b, 4);
    CHECK_EQUAL(ctx->projection.count, 2 + project);
    CHANGE_OPTIONS(ctx, o.saturation_v = 5);
    b.frame[0] = 5; /* at the limit counts as beyond it */
    b.frame[1] = R(-5.5);
    b.out[0] = b.out[1] = 1;
    check_stage(&b, 6);
    memset(b.out, 0, sizeof b.out); /* all well again: the basis must be built again */
    memcpy(b.frame, b.reference, sizeof b.frame);
    b.frame[3] *= R(1.2);
    check_stage(&b, 0);
    CHECK_EQUAL(ctx->projection.count, project);
}

TEST(unusable_rows)
{
    EACH_ROW(row, KINDS) {
        check_unusable(row->kind, 0);
        check_unusable(row->kind, 1);
    }
}

/* The mask changes from frame to frame in all ways: y is always what a fresh context gives. */
TEST(changing_masks)
{
    EACH_ROW(row, KINDS) {
        eits_context *ctx = set_up(&b, row->kind, -1.5, 1);
        uint64_t state = 41;
        eits_real good[SMALL_ROWS];
        memcpy(good, b.frame, sizeof good);
        for (int round = 0; round < 60; ++round) {
            uint32_t expected = 0;
            for (int i = 0; i < SMALL_ROWS; ++i) {
                b.out[i] = small_random(&state) < -0.7 + 0.4 * (round % 2);
                b.frame[i] = b.out[i] && i % 3 != 0 ? (eits_real)NAN : good[i];
                CHECK_OK(eits_mask_row(ctx, (uint32_t)i, b.out[i] && i % 3 == 0));
                expected += b.out[i];
            }
            if (expected <= eits_get_options(ctx)->max_masked)
                check_stage(&b, expected);
        }
    }
}

/* Rows left out on both sides: the answer does not depend on their values, and is the one that
 * minimises over them. */
TEST(left_out_is_minimised_over)
{
    eits_context *ctx = set_up(&b, EITS_DATA_DIFFERENCE, 1, 0);
    const uint32_t k = 5, first = b.on.c.model.fold[k].first, second = b.on.c.model.fold[k].second;
    double *v0 = dense_copy(b.reference, SMALL_ROWS), y[RANK], y_with[RANK];
    eits_real seen[2][RANK];
    for (int round = 0; round < 2; ++round) {
        b.frame[first] = round == 0 ? R(123.0) : R(-0.001);
        b.frame[second] = round == 0 ? R(-9.0) : R(77.0);
        CHECK_OK(eits_mask_row(ctx, first, 1));
        CHECK_OK(eits_mask_row(ctx, second, 1));
        uint32_t masked;
        CHECK_OK(stage(&b, &masked));
        CHECK_EQUAL(masked, 2);
        memcpy(seen[round], ctx->frame.y, sizeof seen[round]);
    }
    CHECK(memcmp(seen[0], seen[1], sizeof seen[0]) == 0);
    /* min over a of |y + a p|^2, p the row's column of P, is |projected y|^2, and any start gives
     * the same */
    dense_frame(&b.on.c.model, &b.on.d, v0, (double)ctx->reference.gain, NULL, b.frame, b.out,
                y_with);
    const double *p = b.on.d.p + k * RANK;
    const double a = -dense_dot(y_with, p, RANK) / dense_dot(p, p, RANK);
    for (int i = 0; i < RANK; ++i)
        y[i] = y_with[i] + a * p[i];
    CHECK(fabs(a) > 1);
    CHECK_NEAR(dense_greatest_difference(y, seen[0], RANK), 0, 60 * EPS);
    free(v0);
}

/* So many rows left out that no direction is left: nothing is seen, not the rounding of nothing. */
TEST(nothing_left)
{
    eits_context *ctx = set_up(&b, EITS_DATA_DIFFERENCE, 1, 1);
    CHANGE_OPTIONS(ctx, o.max_masked = SMALL_ROWS);
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
        lose_fold(&b.on.c.model, k, b.frame);
        CHECK_OK(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, NULL));
        CHECK_EQUAL(ctx->projection.count, k + 2 < RANK ? k + 2 : RANK);
        if (ctx->projection.count < RANK)
            CHECK(ctx->info.data_norm > R(1e-3));
        else
            CHECK(ctx->info.data_norm == 0 && ctx->info.stop == EITS_STOP_ZERO &&
                  ctx->info.nonzeros == 0);
    }
    CHECK_EQUAL(ctx->info.masked, SMALL_ROWS);
}

/* The first `count` rows of the frame become `value`, of turns of sign where that is asked for. */
static void set_rows(int count, eits_real value, int turns)
{
    for (int i = 0; i < count; ++i)
        b.frame[i] = turns && i % 2 ? -value : value;
}

TEST(refused_frames_clear_the_image)
{
    static const struct {
        const char *name;
        int count; /* of rows that are `value` */
        double value;
        int turns;
        size_t length;
        eits_status expected;
        uint32_t masked;
    } refused[] = {
        {"more missing than may be", 4, NAN, 0, SMALL_ROWS, EITS_E_FRAME_ROWS, 4},
        {"no rows", 0, 0, 0, 0, EITS_E_FRAME_LENGTH, 0},
        {"a row too few", 0, 0, 0, SMALL_ROWS - 1, EITS_E_FRAME_LENGTH, 0},
        {"a row too many", 0, 0, 0, SMALL_ROWS + 1, EITS_E_FRAME_LENGTH, 0},
        {"too large to square", SMALL_ROWS, BOTH_WIDTHS(1e38, 1e307), 1, SMALL_ROWS,
         EITS_E_NOT_FINITE, 0},
        {"zeros", SMALL_ROWS, -0.0, 0, SMALL_ROWS, EITS_E_FRAME_ZERO, 0},
    };
    eits_context *ctx = set_up(&b, EITS_DATA_DIFFERENCE, 1, 1);
    eits_real image[SIDE * SIDE], again[SIDE * SIDE], good[SMALL_ROWS];
    eits_info info;
    CHANGE_OPTIONS(ctx, o.max_masked = 3);
    memcpy(good, b.frame, sizeof good);
    EACH_ROW(row, refused) {
        memcpy(b.frame, good, sizeof good);
        CHECK_OK(eits_reconstruct(ctx, b.frame, SMALL_ROWS, image, &info));
        CHECK(info.nonzeros > 0 && info.iterations > 0);
        set_rows(row->count, (eits_real)row->value, row->turns);
        CHECK_EQUAL(eits_reconstruct(ctx, b.frame, row->length, again, &info), row->expected);
        for (int j = 0; j < SIDE * SIDE; ++j)
            CHECK(again[j] == 0 && eits_get_image(ctx)[j] == 0 &&
                  eits_get_coefficients(ctx)[j] == 0);
        CHECK(info.nonzeros == 0 && info.iterations == 0 && info.stop == EITS_STOP_BELOW_THRESHOLD);
        CHECK_EQUAL(info.masked, row->masked);
        uint32_t count = 9;
        CHECK_OK(eits_find_touches(ctx, NULL, 0, &count));
        CHECK_EQUAL(count, 0);
        memcpy(b.frame, good, sizeof good); /* and nothing of it stays */
        CHECK_OK(eits_reconstruct(ctx, b.frame, SMALL_ROWS, again, &info));
        CHECK(memcmp(image, again, sizeof image) == 0);
    }
    for (int i = 0; i < 3; ++i)
        b.frame[i] = (eits_real)NAN;
    /* three may be missing */
    CHECK_OK(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, &info));
    CHECK_EQUAL(info.masked, 3);
    CHECK_REFUSED(eits_reconstruct(NULL, b.frame, SMALL_ROWS, NULL, NULL));
    CHECK_REFUSED(eits_reconstruct(ctx, NULL, SMALL_ROWS, NULL, NULL));
    uint32_t masked;
    uint64_t macs;
    CHECK_REFUSED(eits_frame_stage(NULL, good, SMALL_ROWS, &masked, &macs));
    CHECK_REFUSED(eits_frame_stage(ctx, NULL, SMALL_ROWS, &masked, &macs));
    CHECK_REFUSED(eits_frame_stage(ctx, good, SMALL_ROWS, NULL, &macs));
    CHECK_REFUSED(eits_frame_stage(ctx, good, SMALL_ROWS, &masked, NULL));
}

TEST(masked_rows)
{
    eits_context *ctx = set_up(&b, EITS_DATA_DIFFERENCE, 1, 1);
    eits_real image[SIDE * SIDE], again[SIDE * SIDE];
    CHECK_REFUSED(eits_mask_row(NULL, 0, 1));
    CHECK_REFUSED(eits_mask_row(ctx, SMALL_ROWS, 1));
    CHECK_REFUSED(eits_mask_row(ctx, 0xFFFFFFFFu, 1));
    CHECK_OK(eits_reconstruct(ctx, b.frame, SMALL_ROWS, image, NULL));
    CHECK_OK(eits_mask_row(ctx, SMALL_ROWS - 1, 7));
    CHECK_OK(eits_reconstruct(ctx, b.frame, SMALL_ROWS, again, NULL));
    CHECK_EQUAL(ctx->info.masked, 1);
    CHECK(memcmp(image, again, sizeof image) != 0);
    CHECK_OK(eits_mask_row(ctx, SMALL_ROWS - 1, 0));
    CHECK_OK(eits_reconstruct(ctx, b.frame, SMALL_ROWS, again, NULL));
    CHECK(ctx->info.masked == 0 && memcmp(image, again, sizeof image) == 0);
}

/* A row that was left out while the reference was taken has none: it stays out until the next
 * reference. */
TEST(row_without_reference)
{
    for (int learned = 0; learned < 2; ++learned) {
        eits_context *ctx = set_up(&b, EITS_DATA_DIFFERENCE, 1, 1);
        CHECK_OK(eits_mask_row(ctx, 9, 1));
        b.out[9] = 1;
        if (learned) {
            CHECK_OK(eits_reference_begin(ctx, 6));
            for (int k = 0; k < 6; ++k)
                CHECK_OK(eits_reference_add(ctx, b.reference, SMALL_ROWS));
            CHECK_OK(eits_reference_finish(ctx));
            CHECK(ctx->reference.noise_v <= R(1e-6) * ctx->reference.v0_rms);
        } else {
            CHECK_OK(eits_reference_set(ctx, b.reference, SMALL_ROWS));
        }
        check_stage(&b, 1);
        CHECK_OK(eits_mask_row(ctx, 9, 0));
        check_stage(&b, 1);
        CHECK_OK(eits_reference_set(ctx, b.reference, SMALL_ROWS));
        b.out[9] = 0;
        check_stage(&b, 0);
    }
}

/* Ratios need a reference that is not all but zero, and are bounded. */
TEST(ratios_at_their_limits)
{
    for (int kind = EITS_DATA_NORMALISED; kind <= EITS_DATA_LOG_RATIO; ++kind) {
        eits_context *ctx = set_up(&b, (eits_data_kind)kind, 1, 0);
        const uint32_t row = b.on.c.model.fold[20].first;
        b.reference[row] = R(1e-8);
        CHECK_OK(eits_reference_set(ctx, b.reference, SMALL_ROWS));
        b.out[row] = 1; /* left out as if masked, though not counted as unusable */
        check_stage(&b, 0);
        CHECK_EQUAL(ctx->projection.count, 1);
    }
    eits_context *ctx = set_up(&b, EITS_DATA_LOG_RATIO, 1, 0);
    const uint32_t row = b.on.c.model.fold[20].first;
    static const struct {
        const char *name;
        double factor, ratio;
    } limits[] = {
        {"the greatest", 16, 16},         {"above it", 17, 16},  {"far above it", 1e6, 16},
        {"the other sign", -1, 1.0 / 16}, {"zero", 0, 1.0 / 16}, {"the least", 1.0 / 16, 1.0 / 16},
        {"below it", 1.0 / 17, 1.0 / 16},
    };
    EACH_ROW(limit, limits) {
        b.frame[row] = b.reference[row] * (eits_real)limit->factor;
        uint32_t masked;
        CHECK_OK(stage(&b, &masked));
        CHECK_NEAR(ctx->frame.d[20],
                   (double)ctx->reference.gain * (double)b.reference[row] * log(limit->ratio),
                   20 * EPS);
    }
}

/* Directions of rows left out that nearly agree are orthogonal all the same. */
TEST(directions_that_nearly_agree)
{
    small_model made = small_model_make((small_spec){.rank = RANK, .side = 4});
    uint8_t *p = small_model_section(&made, "REDU", NULL);
    uint64_t state = 9;
    for (uint32_t i = 0; i < RANK; ++i) {
        float value;
        memcpy(&value, p + 4 * (EITS_STRIDE(RANK) * 4 + i), 4);
        small_put_f32(p + 4 * (EITS_STRIDE(RANK) * 5 + i),
                      value * (float)(1 + 3e-3 * small_random(&state)));
    }
    eits_context *ctx = dense_bench_take(&b.on, made, 0);
    CHANGE_OPTIONS(ctx, o.project_reference = o.diagnostics = 0, o.max_masked = SMALL_ROWS);
    eits_real frame[SMALL_ROWS];
    small_reference(ctx->model, 1, frame);
    CHECK_OK(eits_reference_set(ctx, frame, SMALL_ROWS));
    frame[0] *= R(1.1);
    for (uint32_t k = 4; k < 6; ++k) {
        mask_fold(ctx, k);
    }
    STAGE(ctx, frame);
    CHECK_EQUAL(ctx->projection.count, 2);
    double *a = dense_copy(ctx->projection.basis, RANK),
           *c = dense_copy(ctx->projection.basis + EITS_STRIDE(RANK), RANK);
    CHECK_NEAR(dense_dot(a, c, RANK), 0, 4 * EPS);
    free(a), free(c);
}

/* The difference of the two rows of a fold counts as zero if it is below the rounding of their
 * references. */
TEST(reciprocals_that_agree)
{
    static const struct {
        const char *name;
        double off; /* of the second row's reference, in units of the last place */
        int agree;
    } rows[] = {{"equal", 0, 1}, {"2 ulp", 2, 1}, {"4 ulp", 4, 1}, {"40 ulp", 40, 0}};
    for (int kind = EITS_DATA_DIFFERENCE; kind <= EITS_DATA_NORMALISED; ++kind) {
        eits_context *ctx = set_up(&b, (eits_data_kind)kind, 2, 0);
        const eits_fold fold = b.on.c.model.fold[4]; /* sign 1 */
        CHECK_EQUAL(fold.sign, 1);
        EACH_ROW(row, rows) {
            const eits_real v0 = ctx->reference.v0[fold.first];
            ctx->reference.v0[fold.second] = v0 * (eits_real)(1 + row->off * EPS);
            b.frame[fold.first] = b.frame[fold.second] = R(1.01) * v0;
            STAGE(ctx, b.frame);
            CHECK((ctx->frame.reciprocity_error[4] == 0) == row->agree);
            CHECK(ctx->frame.reciprocity_error[5] != 0);
        }
    }
}

RUN_TESTS("frame", dense_bench_close(&b.on))
