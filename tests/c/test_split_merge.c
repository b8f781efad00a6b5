/* Discs that are one touch are merged, those that are two are split; the image solved again
 * without the touches' interaction. */
#include "check.h"
#include "dense.h"
#include "small_model.h"

#include "api/stages.h"
#include "base/vec.h"
#include "diagnostics/diagnostics.h"
#include "eitskin/batch.h"
#include "eitskin/solve.h"
#include "eitskin/touch.h"
#include "kernels/kernels.h"
#include "touch/constants.h"
#include "touch/disc_fit.h"

#include <math.h>
#include <string.h>

static dense_bench b;

enum { SIDE = 20, RANK = 64 };
static const small_spec WAVES = {.rank = RANK, .side = SIDE, .shape = SMALL_WAVES};
static const small_spec WITH_FIELDS = {
    .rank = RANK, .side = SIDE, .shape = SMALL_WAVES, .fields = 1};

/* ctx->frame.y of these discs, each with its change. */
static void press(eits_context *ctx, const eits_disc *disc, uint32_t count)
{
    eits_real atom[RANK];
    eits_zero(ctx->frame.y, RANK);
    for (uint32_t k = 0; k < count; ++k) {
        (void)eits_disc_atom(ctx, &ctx->scratch, disc + k, atom, NULL);
        eits_axpy(ctx->kernels, ctx->frame.y, disc[k].change, atom, RANK);
    }
}

/* A fit of ctx->frame.y that begins with these discs. */
static eits_fit begin(eits_context *ctx, const eits_disc *disc, uint32_t count)
{
    eits_fit f = {.data = ctx->frame.y,
                  .residual = ctx->scratch.row[0],
                  .total = eits_dot(ctx->kernels, ctx->frame.y, ctx->frame.y, RANK),
                  .radius_weight = eits_get_options(ctx)->touch_radius_weight};
    f.count = count;
    memcpy(f.disc, disc, count * sizeof *disc);
    eits_fit_restart(ctx, &ctx->scratch, &f);
    f.macs = 0;
    return f;
}

/* Whether the fit has this disc, to `apart_mm` in place and radius. */
static int has(const eits_fit *f, const eits_disc *disc, double apart_mm)
{
    for (uint32_t k = 0; k < f->count; ++k) {
        const double dx = (double)(f->disc[k].x_mm - disc->x_mm),
                     dy = (double)(f->disc[k].y_mm - disc->y_mm);
        if (fabs(dx) < apart_mm && fabs(dy) < apart_mm &&
            fabs((double)(f->disc[k].radius_mm - disc->radius_mm)) < apart_mm)
            return 1;
    }
    return 0;
}

/* Whether the residual is what the fit's discs leave of its data. */
static void check_residual(eits_context *ctx, const eits_fit *f)
{
    eits_real left[RANK], atom[RANK];
    eits_copy(left, f->data, RANK);
    for (uint32_t k = 0; k < f->count; ++k) {
        (void)eits_disc_atom(ctx, &ctx->scratch, &f->disc[k], atom, NULL);
        eits_axpy(ctx->kernels, left, -f->disc[k].change, atom, RANK);
    }
    const double size = sqrt((double)f->total);
    for (int i = 0; i < RANK; ++i)
        CHECK_NEAR(f->residual[i], left[i], 100 * EPS * size);
}

/* They are found at any position in the list. */
static void two_halves_become_one(int first)
{
    eits_context *ctx = dense_bench_open(&b, WAVES, 0);
    const eits_disc one = {3, -3, 9, R(0.05), 1}, far = {-39, 33, 9, R(0.05), 1};
    const eits_disc truth[2] = {one, far};
    press(ctx, truth, 2);
    eits_disc halves[3] = {one, far, one};
    halves[0].x_mm -= 4, halves[2].x_mm += 4;
    halves[0].change = halves[2].change = R(0.025);
    const eits_disc place = halves[first];
    halves[first] = halves[0];
    halves[0] = place;
    eits_fit f = begin(ctx, halves, 3);
    CHECK_EQUAL(eits_fit_merge(ctx, &ctx->scratch, &f), 1);
    CHECK_EQUAL(f.count, 2);
    CHECK(has(&f, &one, 0.5) && has(&f, &far, 0.5));
    check_residual(ctx, &f);
    CHECK(f.macs > 0);
    CHECK_EQUAL(eits_fit_merge(ctx, &ctx->scratch, &f), 0);
}

/* Tried or not, what is not joined stays as it was, bit for bit. */
TEST(two_touches_stay_two)
{
    static const eits_real distances[] = {20, 24, 36};
    for (int d = 0; d < 3; ++d) {
        eits_context *ctx = dense_bench_open(&b, WAVES, 0);
        const eits_disc truth[2] = {{-distances[d] / 2, 3, 9, R(0.05), 1},
                                    {distances[d] / 2, 3, 9, R(0.04), 1}};
        press(ctx, truth, 2);
        eits_fit f = begin(ctx, truth, 2);
        CHECK_EQUAL(eits_fit_merge(ctx, &ctx->scratch, &f), 0);
        CHECK_EQUAL(f.count, 2);
        /* only those within 0.7 of a radius are tried: 9 x 0.7 + 18 = 24.3 mm */
        CHECK((f.macs > 0) == (d < 2));
        for (int k = 0; k < 2; ++k) {
            CHECK(f.disc[k].x_mm == truth[k].x_mm && f.disc[k].y_mm == truth[k].y_mm &&
                  f.disc[k].radius_mm == truth[k].radius_mm);
            CHECK(f.disc[k].change == truth[k].change);
        }
        check_residual(ctx, &f);
    }
}

TEST(opposite_signs_are_never_one)
{
    eits_context *ctx = dense_bench_open(&b, WAVES, 0);
    const eits_disc truth[2] = {{-3, 3, 9, R(0.05), 1}, {3, 3, 9, R(-0.05), -1}};
    press(ctx, truth, 2);
    eits_fit f = begin(ctx, truth, 2);
    CHECK_EQUAL(eits_fit_merge(ctx, &ctx->scratch, &f), 0);
    CHECK_EQUAL(f.count, 2);
    CHECK_EQUAL(f.macs, 0);
}

/* Nearest first: of three in a row whose outer ones are nearer to the middle than to each other,
 * one is left for one touch. */
TEST(three_thirds_become_one)
{
    eits_context *ctx = dense_bench_open(&b, WAVES, 0);
    const eits_disc one = {3, 3, 12, R(0.05), 1};
    press(ctx, &one, 1);
    eits_disc thirds[3] = {one, one, one};
    for (int k = 0; k < 3; ++k)
        thirds[k].x_mm += R(5.0) * (eits_real)(k - 1), thirds[k].change /= 3;
    eits_fit f = begin(ctx, thirds, 3);
    CHECK_EQUAL(eits_fit_merge(ctx, &ctx->scratch, &f), 1);
    CHECK_EQUAL(f.count, 1);
    CHECK(has(&f, &one, 2));
}

TEST(one_disc_over_two_touches_becomes_two)
{
    static const eits_real along[4][2] = {
        {1, 0}, {R(0.70711), R(0.70711)}, {0, 1}, {R(-0.70711), R(0.70711)}};
    for (int d = 0; d < 4; ++d) {
        eits_context *ctx = dense_bench_open(&b, WAVES, 0);
        eits_disc truth[3] = {
            {0, 0, 9, R(0.05), 1}, {0, 0, 9, R(0.05), 1}, {-42, -36, 9, R(0.05), 1}};
        for (int k = 0; k < 2; ++k) {
            truth[k].x_mm = R(4.0) + (k ? -14 : 14) * along[d][0];
            truth[k].y_mm = R(6.0) + (k ? -14 : 14) * along[d][1];
        }
        press(ctx, truth, 3);
        const eits_disc seen[2] = {truth[2], {4, 6, 14, R(0.04), 1}};
        eits_fit f = begin(ctx, seen, 2);
        eits_fit_move_all(ctx, &ctx->scratch, &f, 3);
        CHANGE_OPTIONS(ctx, o.max_touches = 2);
        eits_fit full = f;
        CHECK_EQUAL(eits_fit_split(ctx, &ctx->scratch, &full), 0); /* no room for a third */
        CHECK_EQUAL(full.count, 2);
        CHANGE_OPTIONS(ctx, o.max_touches = 3);
        eits_fit_restart(ctx, &ctx->scratch, &f);
        CHECK_EQUAL(eits_fit_split(ctx, &ctx->scratch, &f), 1);
        CHECK_EQUAL(f.count, 3);
        for (int k = 0; k < 3; ++k)
            CHECK(has(&f, &truth[k], 2.0));
        check_residual(ctx, &f);
        CHECK_EQUAL(eits_fit_merge(ctx, &ctx->scratch, &f), 0);
    }
}

/* Two explain more than one, but little of what is left: that may as well be something else. */
TEST(a_split_that_gains_little_is_undone)
{
    eits_context *ctx = dense_bench_open(&b, WAVES, 0);
    const eits_disc truth[2] = {{-10, 6, 9, R(0.05), 1}, {18, 6, 9, R(0.05), 1}},
                    one = {4, 6, 14, R(0.04), 1};
    eits_real rest[RANK];
    uint64_t state = 8;
    for (int i = 0; i < RANK; ++i)
        rest[i] = (eits_real)small_random(&state);
    for (int noisy = 0; noisy < 2; ++noisy) {
        press(ctx, truth, 2);
        eits_fit f = begin(ctx, &one, 1);
        eits_fit_move_all(ctx, &ctx->scratch, &f, 5);
        const eits_real left =
            eits_dot(ctx->kernels, ctx->solver.residual, ctx->solver.residual, RANK);
        if (noisy) /* ten times as much that no disc explains */
            eits_axpy(ctx->kernels, ctx->frame.y,
                      eits_sqrt(10 * left / eits_dot(ctx->kernels, rest, rest, RANK)), rest, RANK);
        f = begin(ctx, f.disc, 1);
        CHECK_EQUAL(eits_fit_split(ctx, &ctx->scratch, &f), !noisy);
        CHECK_EQUAL(f.count, noisy ? 1 : 2);
    }
}

TEST(one_large_touch_stays_one)
{
    static const eits_real others[] = {0, R(0.01), R(0.05), R(0.2)};
    int given_up = 0;                      /* before the sweep over all */
    for (int rest = 0; rest < 4; ++rest) { /* whatever else is in the data */
        eits_context *ctx = dense_bench_open(&b, WAVES, 0);
        const eits_disc truth[2] = {{3, 5, 20, R(0.05), 1}, {-39, -33, 9, others[rest], 1}};
        press(ctx, truth, 2);
        eits_fit f = begin(ctx, truth, 1);
        f.macs = 0;
        eits_fit_move_all(ctx, &ctx->scratch, &f, 1);
        const uint64_t step = f.macs;
        f = begin(ctx, truth, 1);
        const eits_disc before = f.disc[0];
        CHECK_EQUAL(eits_fit_split(ctx, &ctx->scratch, &f), 0);
        CHECK_EQUAL(f.count, 1);
        CHECK((f.macs > 0) == (rest > 0)); /* nothing left: nothing is tried */
        given_up += f.macs > 4 * step && f.macs < 3 * EITS_SPLIT_SWEEPS * step;
        CHECK(memcmp(&before, &f.disc[0], sizeof before) == 0);
        check_residual(ctx, &f);
        f.noise = f.total; /* all that is left may be noise */
        f.macs = 0;
        CHECK_EQUAL(eits_fit_split(ctx, &ctx->scratch, &f), 0);
        CHECK_EQUAL(f.macs, 0);
    }
    CHECK(given_up > 0);
}

/* Once the frame's work has reached its limit, discs stay as many and where they are; a step that
 * has begun is completed. */
TEST(work_is_bounded)
{
    const eits_disc near[2] = {{-10, 6, 9, R(0.05), 1}, {12, 6, 9, R(0.05), 1}},
                    one = {1, 6, 14, R(0.04), 1};
    eits_context *ctx = dense_bench_open(&b, WAVES, 0);
    press(ctx, near, 2);
    for (uint32_t left = 0; left < 2; ++left) {
        eits_fit f = begin(ctx, near, 2);
        f.macs = eits_fit_limit(ctx, EITS_FIT_WORK) - left;
        CHECK_EQUAL(eits_fit_merge(ctx, &ctx->scratch, &f), 0);
        CHECK((f.macs > eits_fit_limit(ctx, EITS_FIT_WORK)) == left);
        f = begin(ctx, &one, 1);
        f.macs = eits_fit_limit(ctx, EITS_SPLIT_WORK) - left;
        CHECK_EQUAL(eits_fit_split(ctx, &ctx->scratch, &f), left);
        CHECK((f.macs > eits_fit_limit(ctx, EITS_SPLIT_WORK)) == left);
        f = begin(ctx, near, 2);
        f.disc[0].x_mm += 2;
        eits_fit_restart(ctx, &ctx->scratch, &f);
        f.macs = eits_fit_limit(ctx, EITS_FIT_WORK) - left;
        eits_fit_move_all(ctx, &ctx->scratch, &f, 4);
        CHECK_EQUAL(f.disc[0].x_mm != near[0].x_mm + 2, left);
        CHECK_EQUAL(f.disc[1].x_mm, near[1].x_mm);
        CHECK_EQUAL(f.cut, 1);
    }
}

/* ---- the whole search ---- */

static uint32_t found(eits_context *ctx, uint32_t bits, eits_touch *touch)
{
    uint32_t count = 0;
    CHANGE_OPTIONS(ctx, o.touch_fit = bits);
    CHECK_EQUAL(eits_find_touches(ctx, touch, EITS_MAX_TOUCHES, &count), EITS_OK);
    return count;
}

/* Two touches that the image shows as one peak. */
TEST(one_peak_two_touches)
{
    eits_touch touch[EITS_MAX_TOUCHES];
    eits_context *ctx = dense_bench_open(&b, WAVES, 0);
    const eits_disc truth[2] = {{-13, 3, 9, R(0.05), 1}, {15, 3, 9, R(0.05), 1}};
    press(ctx, truth, 2);
    CHECK_EQUAL(eits_solve(ctx, NULL), EITS_OK);
    for (uint32_t j = 0; j < b.c.model.n_pixels; ++j) /* one peak */
        ctx->solver.image[j] =
            b.c.model.pixel[j].ix == SIDE / 2 && b.c.model.pixel[j].iy == SIDE / 2 ? 1 : 0;
    /* without log data nothing is split: non-linearity would look like another touch */
    CHECK_EQUAL(found(ctx, EITS_TOUCH_FIT_ALL, touch), 1);
    eits_copy(ctx->frame.y_log, ctx->frame.y, EITS_STRIDE(RANK));
    ctx->frame.has_y_log = 1;
    CHECK_EQUAL(found(ctx, EITS_TOUCH_FIT_ALL - EITS_TOUCH_FIT_SPLIT_MERGE, touch), 1);
    CHECK_EQUAL(found(ctx, EITS_TOUCH_FIT_ALL, touch), 2);
    CHANGE_OPTIONS(ctx, o.max_touches = 1);
    CHECK_EQUAL(found(ctx, EITS_TOUCH_FIT_ALL, touch), 1);
}

/* ---- the image solved again ---- */

static const eits_disc PAIR[2] = {{-21, 9, 9, R(0.05), 1}, {21, 3, 9, R(0.05), 1}};

static eits_context *open_pair(dense_bench *b, small_spec spec, uint32_t second_pass,
                               uint32_t mac_limit)
{
    eits_context *ctx = dense_bench_open(b, spec, 0);
    eits_options o = *eits_get_options(ctx);
    o.second_pass = second_pass;
    o.mac_limit = mac_limit;
    b->c.model.fields.volts *= 0.01f; /* the interaction some percent of the data */
    CHECK_EQUAL(eits_set_options(ctx, &o), EITS_OK);
    memset(ctx->frame.sides, EITS_SIDE_BOTH, b->c.model.n_folded); /* all folds are in use */
    press(ctx, PAIR, 2);
    CHECK_EQUAL(eits_solve(ctx, NULL), EITS_OK);
    return ctx;
}

TEST(the_second_pass_solves_the_separate_data)
{
    dense_bench b = {0}, plain = {0};
    eits_touch touch[EITS_MAX_TOUCHES];
    eits_context *ctx = open_pair(&b, WITH_FIELDS, 1, 0),
                 *other = open_pair(&plain, WITH_FIELDS, 0, 0);
    CHECK_EQUAL(found(ctx, EITS_TOUCH_FIT_ALL, touch), 2);
    CHECK_EQUAL(found(other, EITS_TOUCH_FIT_ALL, touch), 2);
    const eits_info first = *eits_get_info(other);
    CHECK_EQUAL(eits_get_info(ctx)->touch_macs, first.touch_macs);
    CHECK(memcmp(other->frame.y, other->touch.y_separate, RANK * sizeof *other->frame.y) != 0);
    CHECK(memcmp(ctx->frame.y, other->touch.y_separate, RANK * sizeof *ctx->frame.y) == 0);
    eits_copy(other->frame.y, other->touch.y_separate, RANK);
    eits_forget(other);
    CHECK_EQUAL(eits_solve(other, NULL), EITS_OK);
    CHECK(memcmp(eits_get_image(ctx), eits_get_image(other),
                 b.c.model.n_pixels * sizeof(eits_real)) == 0);
    CHECK_EQUAL(eits_get_info(ctx)->iterations,
                first.iterations + eits_get_info(other)->iterations);
    CHECK_EQUAL(eits_get_info(ctx)->macs, first.macs + eits_get_info(other)->macs);
    CHECK_EQUAL(eits_get_info(ctx)->step_halvings,
                first.step_halvings + eits_get_info(other)->step_halvings);
    CHECK_EQUAL(eits_get_info(ctx)->touches, 2);
    CHECK_EQUAL(eits_get_info(ctx)->diagnostics, first.diagnostics);
    CHECK(eits_get_info(ctx)->data_norm == eits_get_info(other)->data_norm &&
          eits_get_info(ctx)->stop == eits_get_info(other)->stop &&
          eits_get_info(ctx)->lambda == eits_get_info(other)->lambda);
    dense_bench_close(&plain);
    dense_bench_close(&b);
}

/* One solve more than without: not for one touch, without fields, uncoupled, or with a limit of
 * multiply-accumulates. */
TEST(when_there_is_no_second_pass)
{
    static const struct {
        small_spec spec;
        uint32_t bits, mac_limit, touches;
    } cases[] = {{{.rank = RANK, .side = SIDE, .shape = SMALL_WAVES}, EITS_TOUCH_FIT_ALL, 0, 2},
                 {{.rank = RANK, .side = SIDE, .shape = SMALL_WAVES, .fields = 1},
                  EITS_TOUCH_FIT_ALL - EITS_TOUCH_FIT_INTERACTION,
                  0,
                  2},
                 {{.rank = RANK, .side = SIDE, .shape = SMALL_WAVES, .fields = 1},
                  EITS_TOUCH_FIT_ALL,
                  2000000000u,
                  2},
                 {{.rank = RANK, .side = SIDE, .shape = SMALL_WAVES, .fields = 1},
                  EITS_TOUCH_FIT_ALL,
                  0,
                  1}};
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; ++k) {
        eits_touch touch[EITS_MAX_TOUCHES];
        eits_context *ctx = open_pair(&b, cases[k].spec, 1, cases[k].mac_limit);
        CHANGE_OPTIONS(ctx, o.max_touches = cases[k].touches);
        const uint64_t macs = eits_get_info(ctx)->macs;
        CHECK_EQUAL(found(ctx, cases[k].bits, touch), cases[k].touches);
        CHECK_EQUAL(eits_get_info(ctx)->macs, macs);
    }
}

/* Data of which nothing comes: the frame's own image stays, and its data. */
TEST(nothing_comes_of_it)
{
    eits_context *ctx = open_pair(&b, WITH_FIELDS, 1, 0);
    const eits_real nothing[RANK] = {0}, infinite[RANK] = {R(INFINITY)};
    eits_real image[SIDE * SIDE], y[RANK];
    eits_copy(image, eits_get_image(ctx), SIDE * SIDE);
    eits_copy(y, ctx->frame.y, RANK);
    const eits_info before = *eits_get_info(ctx);
    ctx->info.diagnostics = 4;
    eits_solve_again(ctx, &ctx->scratch, nothing);
    CHECK(memcmp(y, ctx->frame.y, sizeof y) == 0);
    for (int j = 0; j < SIDE * SIDE; ++j)
        CHECK(eits_get_image(ctx)[j] == image[j]);
    CHECK(eits_get_info(ctx)->stop == before.stop &&
          eits_get_info(ctx)->data_norm == before.data_norm &&
          eits_get_info(ctx)->diagnostics == 4);
    CHECK_EQUAL(eits_get_info(ctx)->iterations, 2 * before.iterations);
    CHECK_EQUAL(ctx->frame.has_y_log, 0);
    eits_solve_again(ctx, &ctx->scratch, infinite);
    CHECK(memcmp(y, ctx->frame.y, sizeof y) == 0 &&
          memcmp(image, eits_get_image(ctx), sizeof image) == 0);
}

/* The batch's image is the one that eits_find_touches leaves. */
TEST(images_of_a_batch)
{
    eits_real frame[2][SMALL_ROWS], image[2][SIDE * SIDE];
    eits_touch touch[2][EITS_MAX_TOUCHES], alone[EITS_MAX_TOUCHES];
    eits_result result[2];
    uint64_t state = 4;
    uint32_t count, after_second_pass = 0;
    eits_context *ctx = open_pair(&b, WITH_FIELDS, 1, 0);
    small_reference(&b.c.model, 1, frame[0]);
    CHECK_EQUAL(eits_reference_set(ctx, frame[0], SMALL_ROWS), EITS_OK);
    for (int i = 0; i < SMALL_ROWS; ++i) {
        frame[1][i] = frame[0][i] * (eits_real)(1 + 0.1 * small_random(&state));
        frame[0][i] *= (eits_real)(1 + 0.05 * small_random(&state));
    }
    /* the drift's direction is known from now on */
    CHECK_EQUAL(eits_reconstruct(ctx, frame[0], SMALL_ROWS, NULL, NULL), EITS_OK);
    CHECK_EQUAL(
        eits_reconstruct_batch(ctx, frame[0], SMALL_ROWS, 2, image[0], NULL, touch[0], result),
        EITS_OK);
    for (int k = 0; k < 2; ++k) {
        eits_forget(ctx);
        CHECK_EQUAL(eits_reconstruct(ctx, frame[k], SMALL_ROWS, NULL, NULL), EITS_OK);
        const uint64_t macs = eits_get_info(ctx)->macs;
        CHECK_EQUAL(eits_find_touches(ctx, alone, EITS_MAX_TOUCHES, &count), EITS_OK);
        after_second_pass += eits_get_info(ctx)->macs > macs;
        CHECK_EQUAL(result[k].count, count);
        CHECK_EQUAL(result[k].info.macs, eits_get_info(ctx)->macs);
        CHECK(memcmp(image[k], eits_get_image(ctx), sizeof image[k]) == 0);
    }
    CHECK(after_second_pass > 0);
}

TEST(options_have_ranges)
{
    eits_context *ctx = dense_bench_open(&b, WAVES, 0);
    eits_options o;
    CHECK_EQUAL(eits_options_default(&b.c.model, &o), EITS_OK);
    CHECK(o.touch_fit == EITS_TOUCH_FIT_ALL && EITS_TOUCH_FIT_ALL == 39 && o.second_pass == 0);
    for (uint32_t bits = 0; bits < 70; ++bits) {
        o.touch_fit = bits;
        CHECK_EQUAL(eits_set_options(ctx, &o),
                    (bits & ~EITS_TOUCH_FIT_ALL) == 0 ? EITS_OK : EITS_E_ARGUMENT);
    }
    o.touch_fit = 0;
    o.second_pass = 1;
    CHECK_EQUAL(eits_set_options(ctx, &o), EITS_OK);
    o.second_pass = 2;
    CHECK_EQUAL(eits_set_options(ctx, &o), EITS_E_ARGUMENT);
    CHECK_EQUAL(eits_get_options(ctx)->second_pass, 1);
}

int main(void)
{
    two_halves_become_one(0);
    two_halves_become_one(1);
    run_tests();
    dense_bench_close(&b);
    return checks_report("regroup");
}
