/* Touches that are sought in the data, whatever the image shows. */
#include "check.h"
#include "dense.h"
#include "small_model.h"

#include "base/vec.h"
#include "eitskin/solve.h"
#include "eitskin/touch.h"
#include "evidence/evidence.h"
#include "kernels/kernels.h"
#include "touch/disc_fit.h"

#include <math.h>
#include <string.h>

enum { SIDE = 20, RANK = 64 };
static const small_spec WAVES = {.rank = RANK, .side = SIDE, .shape = SMALL_WAVES};

/* The data of these discs, and an image with one peak far from them. */
static eits_context *pressed(dense_bench *b, const eits_disc *disc, uint32_t count, eits_sign sign)
{
    eits_context *ctx = dense_bench_open(b, WAVES, 0);
    eits_options o = *eits_get_options(ctx);
    eits_real atom[RANK];
    CHECK_EQUAL(o.touch_seek, 0); /* this model was not taught */
    o.touch_seek = 1;
    o.sign = sign;
    o.touch_min_fraction = R(0.02);
    o.detection_factor = 0;
    CHECK_EQUAL(eits_set_options(ctx, &o), EITS_OK);
    eits_zero(ctx->frame.y, RANK);
    for (uint32_t k = 0; k < count; ++k) {
        (void)eits_disc_atom(ctx, &ctx->scratch, disc + k, atom, NULL);
        eits_axpy(ctx->kernels, ctx->frame.y, disc[k].change, atom, RANK);
    }
    CHECK_EQUAL(eits_solve(ctx, NULL), EITS_OK);
    for (uint32_t j = 0; j < b->c.model.n_pixels; ++j)
        ctx->solver.image[j] = j == 0 ? 1 : 0;
    return ctx;
}

static uint32_t found(eits_context *ctx, eits_touch *touch)
{
    uint32_t count = 0;
    CHECK_EQUAL(eits_find_touches(ctx, touch, EITS_MAX_TOUCHES, &count), EITS_OK);
    return count;
}

static int has(const eits_touch *touch, uint32_t count, const eits_disc *disc)
{
    for (uint32_t k = 0; k < count; ++k) {
        if (fabs((double)(touch[k].x_mm - disc->x_mm)) < 1 &&
            fabs((double)(touch[k].y_mm - disc->y_mm)) < 1 &&
            touch[k].strength_s_per_m_mm2 * disc->polarity > 0)
            return 1;
    }
    return 0;
}

TEST(touches_that_the_image_does_not_show_are_found)
{
    static const struct {
        uint32_t count;
        eits_sign sign;
        eits_disc disc[6];
    } cases[] = {
        {1, EITS_SIGN_INCREASE, {{-21, 9, 9, R(0.05), 1}}},
        {2, EITS_SIGN_INCREASE, {{-21, 9, 9, R(0.05), 1}, {27, -15, 9, R(0.01), 1}}},
        /* what answers most lies between them */
        {2, EITS_SIGN_INCREASE, {{-10, 3, 9, R(0.05), 1}, {12, 3, 9, R(0.05), 1}}},
        {2, EITS_SIGN_DECREASE, {{-21, 9, 9, R(-0.05), -1}, {27, -15, 9, R(-0.02), -1}}},
        {2, EITS_SIGN_BOTH, {{-21, 9, 9, R(0.05), 1}, {27, -15, 9, R(-0.04), -1}}},
        /* more than are exchanged */
        {6,
         EITS_SIGN_INCREASE,
         {{-39, -39, 9, R(0.05), 1},
          {39, -39, 9, R(0.045), 1},
          {-39, 39, 9, R(0.04), 1},
          {39, 39, 9, R(0.05), 1},
          {0, 0, 9, R(0.04), 1},
          {3, -45, 9, R(0.05), 1}}},
    };
    for (size_t c = 0; c < sizeof cases / sizeof cases[0]; ++c) {
        dense_bench b = {0};
        eits_touch touch[EITS_MAX_TOUCHES];
        eits_context *ctx = pressed(&b, cases[c].disc, cases[c].count, cases[c].sign);
        const uint32_t count = found(ctx, touch);
        CHECK_EQUAL(count, cases[c].count);
        for (uint32_t k = 0; k < cases[c].count; ++k)
            CHECK(has(touch, count, &cases[c].disc[k]));
        CHECK(eits_get_info(ctx)->touch_macs > 0);
        eits_options o = *eits_get_options(ctx);
        o.touch_seek = 0; /* the image's peak is none of them */
        CHECK_EQUAL(eits_set_options(ctx, &o), EITS_OK);
        CHECK(found(ctx, touch) < 2u);
        dense_bench_close(&b);
    }
}

TEST(what_explains_too_little_is_no_touch)
{
    const eits_disc disc[2] = {{-21, 9, 9, R(0.05), 1}, {27, -15, 9, R(0.02), 1}};
    dense_bench b = {0};
    eits_touch touch[EITS_MAX_TOUCHES];
    eits_context *ctx = pressed(&b, disc, 2, EITS_SIGN_INCREASE);
    eits_options o = *eits_get_options(ctx);
    o.touch_min_fraction = R(0.2); /* it explains a seventh */
    CHECK_EQUAL(eits_set_options(ctx, &o), EITS_OK);
    CHECK_EQUAL(found(ctx, touch), 1);
    CHECK(has(touch, 1, &disc[0]));
    o.touch_min_fraction = R(0.02);
    o.max_touches = 1;
    CHECK_EQUAL(eits_set_options(ctx, &o), EITS_OK);
    CHECK_EQUAL(found(ctx, touch), 1);
    o.max_touches = EITS_MAX_TOUCHES;
    CHECK_EQUAL(eits_set_options(ctx, &o), EITS_OK);
    for (int i = 0; i < RANK; ++i) /* nothing of the sign that is looked for */
        ctx->frame.y[i] = 0;
    CHECK_EQUAL(found(ctx, touch), 0);
    dense_bench_close(&b);
}

/* Sought discs go from a pixel's centre by whole pixels: so they come to lie there, and rounding
 * must not decide whether the rim's pixel is near. */
TEST(a_disc_a_whole_pixel_beyond_the_rim_is_no_touch)
{
    static const struct {
        eits_real beyond; /* of the rim's pixel, pixels */
        uint32_t count;
    } cases[] = {{R(0.99), 1}, {R(0.9999), 0}, {1, 0}, {R(1.0001), 0}};
    for (size_t c = 0; c < sizeof cases / sizeof cases[0]; ++c) {
        dense_bench b = {0};
        const eits_disc at = {0, 0, 9, R(0.05), 1};
        eits_context *ctx = pressed(&b, &at, 1, EITS_SIGN_INCREASE);
        const eits_model *model = ctx->model;
        const eits_real pixel = (eits_real)model->pixel_mm;
        eits_fit f = eits_fit_none(ctx, &ctx->scratch);
        f.disc[0] =
            (eits_disc){(eits_real)model->origin_x_mm + (SIDE - R(0.5) + cases[c].beyond) * pixel,
                        (eits_real)model->origin_y_mm + R(9.5) * pixel, 2 * pixel, 0, 1};
        (void)eits_disc_atom(ctx, &ctx->scratch, &f.disc[0], ctx->frame.y, NULL);
        f.total = eits_dot(ctx->kernels, ctx->frame.y, ctx->frame.y, RANK);
        f.count = 1;
        ctx->options.detection_factor = 1;
        ctx->reference.lambda_noise = R(1e-6);
        eits_fit_strengths(ctx, &ctx->scratch, &f);
        eits_fit_prune(ctx, &ctx->scratch, &f);
        CHECK_EQUAL(f.count, cases[c].count);
        dense_bench_close(&b);
    }
}

/* The answer to disc k of `touch`, moved, in doubles. */
static void answer(eits_context *ctx, const eits_touch *touch, double dx, double dy, double *out)
{
    eits_real atom[RANK];
    const eits_disc disc = {.x_mm = touch->x_mm + (eits_real)dx,
                            .y_mm = touch->y_mm + (eits_real)dy,
                            .radius_mm = touch->radius_mm};
    (void)eits_disc_atom(ctx, &ctx->scratch, &disc, atom, NULL);
    for (int i = 0; i < RANK; ++i)
        out[i] = (double)atom[i];
}

/* C = unit (G'G)^-1, G by finite differences, beside the answers of both touches. */
TEST(a_place_is_as_sure_as_the_fit_and_the_models_factor_say)
{
    static const eits_disc disc[2] = {{-10, 3, 9, R(0.05), 1}, {14, 3, 9, R(0.05), 1}};
    const double step = sizeof(eits_real) == 4 ? 0.02 : 1e-4, factor = 2.5;
    eits_touch touch[EITS_MAX_TOUCHES];
    dense_bench b = {0};
    eits_context *ctx = pressed(&b, disc, 2, EITS_SIGN_INCREASE);
    for (uint32_t i = 0; i < RANK; i += 3)
        ctx->frame.y[i] *= R(0.98);
    const double total = (double)eits_dot(ctx->kernels, ctx->frame.y, ctx->frame.y, RANK);
    CHECK_EQUAL(found(ctx, touch), 2);
    CHECK(touch[0].x_variance_mm2 == 0 && touch[0].y_variance_mm2 == 0);
    b.c.model.place_factor = (float)factor;
    CHECK_EQUAL(found(ctx, touch), 2);
    const double unit = factor * (double)ctx->info.unexplained * total / (RANK - 2 * 4);
    CHECK(unit > 0);
    for (int k = 0; k < 2; ++k) {
        double g[2][RANK], back[RANK], both[2 * RANK], h[3];
        const eits_disc at = {touch[k].x_mm, touch[k].y_mm, touch[k].radius_mm, 0, 1};
        const double change = (double)(touch[k].strength_s_per_m_mm2 / eits_disc_area(ctx, &at));
        for (int axis = 0; axis < 2; ++axis) {
            const double dx = axis == 0 ? step : 0, dy = axis == 1 ? step : 0;
            answer(ctx, &touch[k], dx, dy, g[axis]);
            answer(ctx, &touch[k], -dx, -dy, back);
            for (int i = 0; i < RANK; ++i)
                g[axis][i] = change * (g[axis][i] - back[i]) / (2 * step);
            answer(ctx, &touch[0], 0, 0, both);
            answer(ctx, &touch[1], 0, 0, both + RANK);
            dense_project_out(g[axis], both, 2, RANK);
        }
        for (int i = 0; i < 3; ++i)
            h[i] = dense_dot(g[i / 2], g[(i + 1) / 2], RANK);
        const double det = h[0] * h[2] - h[1] * h[1];
        CHECK_NEAR((double)touch[k].x_variance_mm2 / (unit * h[2] / det), 1, 0.03);
        CHECK_NEAR((double)touch[k].y_variance_mm2 / (unit * h[0] / det), 1, 0.03);
        CHECK_NEAR((double)touch[k].xy_covariance_mm2 / (unit * h[2] / det), -h[1] / h[2], 0.03);
    }
    dense_bench_close(&b);
}

/* A touch that nothing is left beside has no place to be unsure of. */
TEST(without_a_residual_a_place_is_not_rated)
{
    static const eits_disc disc = {-21, 9, 9, R(0.05), 1};
    dense_bench b = {0};
    eits_context *ctx = pressed(&b, &disc, 1, EITS_SIGN_INCREASE);
    eits_fit f = eits_fit_none(ctx, &ctx->scratch);
    b.c.model.place_factor = 1;
    f.count = 1;
    f.disc[0] = disc;
    eits_fit_restart(ctx, &ctx->scratch, &f);
    eits_zero(f.residual, RANK);
    f.place_mm2[0][0] = 7;
    f.tested = 1;
    eits_place_touches(ctx, &ctx->scratch, &f);
    CHECK(f.place_mm2[0][0] == 7); /* the test has said it */
    f.tested = 0;
    eits_place_touches(ctx, &ctx->scratch, &f);
    CHECK(f.place_mm2[0][0] == 0);
    dense_bench_close(&b);
}

RUN_TESTS("seek")
