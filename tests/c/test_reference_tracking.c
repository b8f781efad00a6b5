/* A reference that follows the untouched skin: when and how far it moves, what it never follows,
 * and the gain that it could not follow. */
#include "steps.h"

#include "diagnostics/diagnostics.h"
#include "eitskin/batch.h"
#include "frame/reference.h"

enum { RANK = 4, FRAMES = 32, APART = 2, PACKED = SMALL_FOLDED * (SMALL_FOLDED + 1) / 2 };

typedef struct bench {
    dense_bench on;
    eits_real untouched[SMALL_ROWS], frame[SMALL_ROWS];
} bench;

static bench b;

/* Tared with one frame. Datum k of the first RANK folds is pixel k's alone. */
static eits_context *set_up_as(bench *b, uint32_t reference_frames, small_spec spec)
{
    spec.rank = RANK;
    spec.side = 5;
    spec.shape = SMALL_IDENTITY;
    eits_context *ctx = dense_bench_open(&b->on, spec, 0);
    CHECK_EQUAL(ctx->options.reference_frames, 0); /* a model has to ask for it */
    CHANGE_OPTIONS(ctx, o.project_reference = 0, o.reference_frames = reference_frames,
                   o.diagnostics = EITS_DIAGNOSTIC_STALE_REFERENCE);
    small_reference(ctx->model, 1, b->untouched);
    eits_copy(b->frame, b->untouched, SMALL_ROWS);
    CHECK_OK(eits_reference_set(ctx, b->untouched, SMALL_ROWS));
    return ctx;
}

static eits_context *set_up(bench *b, uint32_t reference_frames)
{
    return set_up_as(b, reference_frames, (small_spec){.storage = EITS_STORAGE_F32});
}

/* The frame is changed by `change` of its own value in each row of fold k. */
static void change_fold(bench *b, uint32_t k, double change)
{
    const eits_fold fold = b->on.c.model.fold[k];
    b->frame[fold.first] = (eits_real)(1 + change) * b->untouched[fold.first];
    if (fold.second != EITS_FOLD_NONE)
        b->frame[fold.second] = (eits_real)(1 + change) * b->untouched[fold.second];
}

static void change_all(bench *b, double change)
{
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k)
        change_fold(b, k, change);
}

/* `count` frames, untouched or with a touch on pixel 0; how often the reference moved. */
static int pass(bench *b, int count, int untouched)
{
    const eits_model *m = &b->on.c.model;
    const eits_touch touch = {.x_mm = (eits_real)(m->origin_x_mm + 0.5f * m->pixel_mm),
                              .y_mm = (eits_real)(m->origin_y_mm + 0.5f * m->pixel_mm)};
    const uint32_t touches = untouched ? 0 : 1;
    uint64_t macs = 0;
    int moved = 0;
    for (int k = 0; k < count; ++k) {
        CHECK_OK(eits_reconstruct(b->on.c.ctx, b->frame, SMALL_ROWS, NULL, NULL));
        moved += eits_reference_tracking_end(b->on.c.ctx, &b->on.c.ctx->scratch, &touch, touches, 1,
                                             &macs);
    }
    CHECK((macs > 0 || moved == 0) && macs < 10000);
    return moved;
}

/* The fraction of the way to the frame by which the reference of row i has moved. */
static double gone(const bench *b, uint32_t i)
{
    return (double)((b->on.c.ctx->reference.v0[i] - b->untouched[i]) /
                    (b->frame[i] - b->untouched[i]));
}

TEST(it_goes_a_part_of_the_way_after_as_large_a_part_of_its_time)
{
    static const struct {
        uint32_t frames;
        int passed, moves;
        double goes;
    } cases[] = {{0, 40, 0, 0},
                 {1, 1, 1, 1},
                 {2, 1, 1, 0.5},
                 {3, 2, 2, 5.0 / 9},
                 {15, 1, 1, 1.0 / 15},
                 {FRAMES, APART - 1, 0, 0},
                 {FRAMES, APART, 1, 0.0625},
                 {FRAMES, 5, 2, 0.12109375}};
    for (size_t k = 0; IN_TABLE(k, cases); ++k) {
        eits_context *ctx = set_up(&b, cases[k].frames);
        const eits_real gain = ctx->reference.gain;
        change_all(&b, 0.01);
        CHECK_EQUAL(pass(&b, cases[k].passed, 1), cases[k].moves);
        for (uint32_t i = 0; i < SMALL_ROWS; ++i)
            CHECK_NEAR(gone(&b, i), cases[k].goes, 3e4 * EPS);
        /* fitted again: a larger reference asks for less gain */
        CHECK_NEAR(ctx->reference.gain * (1 + 0.01 * cases[k].goes), gain, 20 * EPS * gain);
    }
}

TEST(a_touch_lets_go_what_came_before_and_as_much_behind_it)
{
    (void)set_up(&b, FRAMES);
    change_all(&b, 0.01);
    CHECK_EQUAL(pass(&b, APART - 1, 1), 0);
    CHECK_EQUAL(pass(&b, 50, 0), 0);
    CHECK_EQUAL(pass(&b, APART + APART - 1, 1), 0);
    CHECK_EQUAL(pass(&b, 1, 1), 1);
    CHECK_EQUAL(pass(&b, 1, 1), 0);
    eits_forget(b.on.c.ctx); /* frames that have nothing to do with those before */
    CHECK_EQUAL(pass(&b, 2 * APART - 1, 1), 0);
    CHECK_EQUAL(pass(&b, 1, 1), 1);
    /* nobody looked for touches in one of them, or one was of no use */
    CHECK_OK(eits_reconstruct(b.on.c.ctx, b.frame, SMALL_ROWS, NULL, NULL));
    CHECK_EQUAL(pass(&b, 2 * APART - 1, 1), 0);
    CHECK_EQUAL(pass(&b, 1, 1), 1);
    for (uint32_t i = 0; i < SMALL_ROWS; ++i)
        b.frame[i] = R(NAN);
    CHECK_EQUAL(eits_reconstruct(b.on.c.ctx, b.frame, SMALL_ROWS, NULL, NULL), EITS_E_FRAME_ROWS);
    change_all(&b, 0.01);
    CHECK_EQUAL(pass(&b, 2 * APART - 1, 1), 0);
    CHECK_EQUAL(pass(&b, 1, 1), 1);
}

/* A change that gives fold k the same datum as fold 0. */
static double as_much(const bench *b, uint32_t k)
{
    return 0.01 * (double)(b->on.c.model.v_ref[0] / b->on.c.model.v_ref[k]);
}

/* One pixel's data alone, or two pixels': the best column gives all, or half. */
TEST(what_looks_like_a_touch_is_not_followed)
{
    for (int k = 0; k < 4; ++k) {
        const uint32_t folds = 1 + (uint32_t)k % 2;
        eits_context *ctx =
            set_up_as(&b, 1, (small_spec){.storage = k < 2 ? EITS_STORAGE_F32 : EITS_STORAGE_I8});
        for (uint32_t fold = 0; fold < folds; ++fold)
            change_fold(&b, fold, as_much(&b, fold));
        CHECK_EQUAL(pass(&b, 3, 1), folds == 1 ? 0 : 3);
        if (folds == 2)
            CHECK_NEAR(gone(&b, ctx->model->fold[1].first), 1, 3e4 * EPS);
    }
}

/* Two frames of one pixel each: their mean is what counts. What untouched skin shows is learned
 * from the first. */
TEST(frames_are_averaged_before_they_are_compared)
{
    eits_context *ctx = set_up(&b, FRAMES);
    change_fold(&b, 0, as_much(&b, 0));
    CHECK_EQUAL(pass(&b, 1, 1), 0);
    eits_copy(b.frame, b.untouched, SMALL_ROWS);
    change_fold(&b, 1, as_much(&b, 1));
    CHECK_EQUAL(pass(&b, 1, 1), 1);
    CHECK_NEAR(gone(&b, ctx->model->fold[1].first), 0.03125, 3e4 * EPS);
    const eits_real level = ctx->reference.tracking.level;
    CHECK(level > 0 && level == ctx->info.lambda_max);
    change_all(&b, 0.02);
    CHECK_EQUAL(pass(&b, APART, 1), 1);
    CHECK(ctx->reference.tracking.level == level && ctx->info.lambda_max > level);
}

TEST(a_row_that_one_frame_lacks_stays)
{
    eits_context *ctx = set_up(&b, FRAMES);
    change_all(&b, 0.01);
    const eits_real kept = b.frame[7];
    b.frame[7] = R(NAN);
    CHECK_EQUAL(pass(&b, 1, 1), 0);
    b.frame[7] = kept;
    CHECK_EQUAL(pass(&b, 1, 1), 1);
    CHECK(ctx->reference.v0[7] == b.untouched[7]);
    CHECK_NEAR(gone(&b, 8), 0.0625, 3e4 * EPS);
}

/* After N / 4 frames the reference is as large as the frame beside the touch, which may press as it
 * will. */
TEST(under_a_touch_only_its_size_follows)
{
    static const struct {
        double all;    /* change of all rows from the second mean on */
        double beside; /* and of pixel 1's, which no touch gives */
        double goes;   /* so far goes the reference, relative */
    } cases[] = {{0.01, 0, 0.01}, {0, 0.03, 0.01}, {-0.01, 0, -0.01}, {0.03, 0, 0}};
    for (size_t k = 0; IN_TABLE(k, cases); ++k) {
        eits_context *ctx = set_up(&b, FRAMES);
        change_fold(&b, 0, 0.2);
        CHECK_EQUAL(pass(&b, 2 * APART, 0), 0); /* it lands; the first mean */
        const eits_real gain = ctx->reference.gain;
        change_all(&b, cases[k].all);
        if (cases[k].beside > 0)
            change_fold(&b, 1, cases[k].beside);
        change_fold(&b, 0, 0.3);
        CHECK_EQUAL(pass(&b, 4 * APART - 1, 0), 0);
        const int moves = cases[k].goes != 0;
        CHECK_EQUAL(pass(&b, 1, 0), moves);
        /* folds 1 to 3 are all that the model sees beside pixel 0, and have like squares */
        for (uint32_t i = 0; i < SMALL_ROWS; ++i)
            CHECK_NEAR(ctx->reference.v0[i] / b.untouched[i], 1 + cases[k].goes,
                       cases[k].beside > 0 ? 0.02 : 100 * EPS);
        if (moves)
            CHECK(ctx->reference.gain != gain);
        (void)pass(&b, APART, 0); /* on, from where it is */
        if (cases[k].beside == 0)
            CHECK_NEAR(ctx->reference.v0[9] / b.untouched[9], 1 + cases[k].goes, 200 * EPS);
    }
}

/* Beside so many touches there is nothing to tell the size by; beside one pixel's, wherever the
 * places beyond the skin's edge are, there is. */
TEST(where_touches_may_give_all_it_stays)
{
    eits_context *ctx = set_up(&b, 1);
    const eits_model *m = &b.on.c.model;
    for (int k = 0; k < 2; ++k) {
        eits_touch touches[2 * RANK];
        for (int t = 0; t < 2 * RANK; ++t)
            touches[t] = (eits_touch){
                .x_mm = (eits_real)(m->origin_x_mm + (0.5f + (float)(t % RANK)) * m->pixel_mm),
                .y_mm = (eits_real)(k == 0 ? m->origin_y_mm + 0.5f * m->pixel_mm : 1e6f)};
        for (int frame = 0; frame < 3; ++frame) {
            uint64_t macs = 0;
            change_all(&b, 0.001 * frame);
            CHECK_OK(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, NULL));
            CHECK_EQUAL(
                eits_reference_tracking_end(ctx, &ctx->scratch, touches, 2 * RANK, 1, &macs),
                k == 1 && frame > 0);
        }
        CHECK_NEAR(ctx->reference.v0[9] / b.untouched[9], k == 0 ? 1 : 1.002, 100 * EPS);
        eits_forget(ctx);
    }
}

/* A touch on the edge of two pixels is of both: rounding does not choose one. */
TEST(on_the_edge_of_pixels_rounding_decides_nothing)
{
    double goes[2];
    for (int side = 0; side < 2; ++side) {
        eits_context *ctx = set_up(&b, 2);
        const eits_model *m = &b.on.c.model;
        const double edge = (double)m->origin_x_mm + (double)m->pixel_mm;
        const eits_touch touch = {.x_mm = (eits_real)(edge * (1 + (side == 0 ? -4 : 4) * EPS)),
                                  .y_mm = (eits_real)(m->origin_y_mm + 0.5f * m->pixel_mm)};
        for (int frame = 0; frame < 2; ++frame) {
            uint64_t macs = 0;
            change_fold(&b, 0, 0.01 * frame);
            CHECK_OK(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, NULL));
            CHECK_EQUAL(eits_reference_tracking_end(ctx, &ctx->scratch, &touch, 1, 1, &macs),
                        frame);
        }
        goes[side] = (double)(ctx->reference.v0[9] / b.untouched[9]) - 1;
    }
    CHECK(fabs(goes[0]) > 1e-4);
    CHECK_NEAR(goes[0], goes[1], 100 * EPS);
}

/* A round skin has no pixel in the corner where the touch is; ratios know no size. */
TEST(the_size_of_differences_follows_on_any_outline)
{
    static const struct {
        small_spec spec;
        int moves;
    } cases[] = {{{.round = 1}, 1}, {{.kind = EITS_DATA_LOG_RATIO}, 0}};
    for (size_t k = 0; IN_TABLE(k, cases); ++k) {
        (void)set_up_as(&b, 2, cases[k].spec);
        CHECK_EQUAL(pass(&b, 1, 0), 0);
        change_all(&b, 0.01);
        CHECK_EQUAL(pass(&b, 1, 0), cases[k].moves);
    }
}

/* As many touches as before are no hand that rests, where they are others. */
TEST(the_size_follows_under_the_same_touches_alone)
{
    for (uint32_t apart = 0; apart <= 3; apart += 3) {
        eits_context *ctx = set_up(&b, 2);
        eits_touch touches[EITS_MAX_TOUCHES];
        uint32_t count = 0;
        CHANGE_OPTIONS(ctx, o.follow_mm = b.on.c.model.pixel_mm);
        for (uint32_t k = 0; k < 8; ++k) {
            const uint32_t pixel = k % 2 * apart;
            change_all(&b, 0.001 * k);
            change_fold(&b, pixel, b.on.c.model.v_ref[pixel] < 0 ? -0.5 : 0.5);
            CHECK_OK(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, NULL));
            CHECK_OK(eits_find_touches(ctx, touches, EITS_MAX_TOUCHES, &count));
            CHECK_EQUAL(count, 1);
        }
        CHECK_EQUAL(ctx->reference.v0[9] != b.untouched[9], apart == 0);
    }
}

TEST(a_frame_of_no_use_is_not_followed)
{
    eits_context *ctx = set_up(&b, 1);
    uint64_t macs = 0;
    change_all(&b, 0.01);
    CHECK_OK(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, NULL));
    CHECK_EQUAL(eits_reference_tracking_end(ctx, &ctx->scratch, NULL, 0, 0, &macs), 0);
    CHECK_EQUAL(pass(&b, 1, 1), 1);
}

/* Section PREC makes it a taught one. */
static small_model taught(void)
{
    uint8_t bytes[4 * PACKED] = {0};
    for (uint32_t i = 0, at = 0; i < SMALL_FOLDED; ++i, at += i + 1)
        small_put_f32(bytes + 4 * at, 1);
    small_model bare =
        small_model_make((small_spec){.rank = RANK, .side = 5, .shape = SMALL_IDENTITY});
    memcpy(small_model_entry(&bare, "WHIT"), "XTRW", 4);
    const small_model made = small_model_with_section(&bare, "PREC", bytes, sizeof bytes);
    small_model_free(&bare);
    return made;
}

TEST(touches_that_explain_little_are_drift)
{
    static const struct {
        double unexplained, lambda_max, noise, level;
        uint32_t frames, seen, diagnostics;
        int drift;
    } cases[] = {
        {0.4, 3, 1, 0, 32, 3, EITS_DIAGNOSTICS_ALL, 1},
        {0.2, 2, 1, 0, 32, 3, EITS_DIAGNOSTICS_ALL, 1}, /* the fainter, the less they may leave */
        {0.2, 3, 1, 0, 32, 3, EITS_DIAGNOSTICS_ALL, 0}, /* they explain it */
        {0.4, 5, 1, 0, 32, 3, EITS_DIAGNOSTICS_ALL, 0}, /* they are clear */
        {0.4, 3, 1, 0, 0, 3, EITS_DIAGNOSTICS_ALL, 0},  /* it does not follow */
        {0.4, 3, 1, 0, 32, 2, EITS_DIAGNOSTICS_ALL, 0}, /* as yet a single frame */
        {0.4, 3, 1, 0, 32, 3, EITS_DIAGNOSTIC_CROWDED, 0}, /* not looked for */
        {0.4, 50, 0, 0, 32, 3, EITS_DIAGNOSTICS_ALL, 1},   /* nothing is known of noise */
        {0.4, 3, 0, 1, 32, 3, EITS_DIAGNOSTICS_ALL, 1},
        {0.4, 5, 0, 1, 32, 3, EITS_DIAGNOSTICS_ALL, 0},
    };
    for (int physics = 0; physics < 2; ++physics) {
        const small_spec spec = {.rank = RANK, .side = 5, .shape = SMALL_IDENTITY};
        eits_context *ctx = dense_bench_take(&b.on, physics ? small_model_make(spec) : taught(), 0);
        for (size_t k = 0; IN_TABLE(k, cases); ++k) {
            ctx->options.reference_frames = cases[k].frames;
            ctx->options.diagnostics = cases[k].diagnostics;
            ctx->options.detection_factor = 1;
            ctx->reference.lambda_noise = ctx->info.lambda_noise = (eits_real)cases[k].noise;
            ctx->reference.tracking.level = (eits_real)cases[k].level;
            ctx->reference.tracking.seen = cases[k].seen;
            ctx->info.lambda_max = (eits_real)cases[k].lambda_max;
            ctx->info.unexplained = (eits_real)cases[k].unexplained;
            ctx->info.diagnostics = 0;
            const int drift = cases[k].drift && !physics;
            CHECK_EQUAL(eits_check_drift(ctx), drift);
            CHECK_EQUAL(ctx->info.diagnostics, drift ? EITS_DIAGNOSTIC_STALE_REFERENCE : 0);
        }
    }
}

/* By the public functions: drift while nothing is touched, a touch, a batch, and put by. */
TEST(as_a_caller_sees_it)
{
    eits_context *ctx = set_up(&b, 1);
    eits_touch touches[EITS_MAX_TOUCHES];
    eits_result results[2];
    uint32_t count = 0;
    void *memory = NULL;
    const size_t size = eits_saved_size(&b.on.c.model);
    void *saved = small_aligned(&memory, size);
    change_all(&b, -0.01); /* less data than nothing: no touch by its sign */
    CHECK_OK(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, NULL));
    CHECK_OK(eits_find_touches(ctx, touches, EITS_MAX_TOUCHES, &count));
    CHECK_EQUAL(count, 0);
    CHECK_NEAR(gone(&b, 5), 1, 3e4 * EPS);
    CHECK_OK(eits_save(ctx, saved, size));
    eits_real kept[SMALL_ROWS];
    eits_copy(kept, ctx->reference.v0, SMALL_ROWS);
    eits_copy(b.untouched, kept, SMALL_ROWS);
    change_all(&b, 0);
    change_fold(&b, 1, b.on.c.model.v_ref[1] < 0 ? -0.5 : 0.5);
    CHECK_OK(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, NULL));
    CHECK_OK(eits_find_touches(ctx, touches, EITS_MAX_TOUCHES, &count));
    CHECK_EQUAL(count, 1);
    CHECK(memcmp(kept, ctx->reference.v0, sizeof kept) == 0);
    change_all(&b, -0.01);
    const eits_real *frames = b.frame;
    CHECK_OK(eits_reconstruct_batch(ctx, frames, SMALL_ROWS, 1, NULL, NULL, touches, results));
    CHECK_EQUAL(eits_get_options(ctx)->reference_frames, 1);
    CHECK(memcmp(kept, ctx->reference.v0, sizeof kept) == 0);
    CHECK_OK(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, NULL));
    CHECK_OK(eits_find_touches(ctx, touches, EITS_MAX_TOUCHES, &count));
    CHECK_NEAR(gone(&b, 5), 1, 3e4 * EPS);
    CHECK_OK(eits_restore(ctx, saved, size));
    CHECK(memcmp(kept, ctx->reference.v0, sizeof kept) == 0);
    free(memory);
}

RUN_TESTS("follow", dense_bench_close(&b.on))
