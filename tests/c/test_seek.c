/* Touches that are sought in the data, whatever the sparse image shows; and the one touch of an
 * instrument that is far from the model. */
#include "steps.h"

#include "evidence/evidence.h"
#include "frame/constants.h"
#include "frame/whitening.h"
#include "kernels/kernels.h"
#include "touch/constants.h"
#include "touch/disc_fit.h"

enum { SIDE = 20, RANK = 64 };
static dense_bench b;
static const small_spec WAVES = {.rank = RANK, .side = SIDE, .shape = SMALL_WAVES};

/* The data of these discs, and an image with one peak far from them. */
static eits_context *pressed(const eits_disc *disc, uint32_t count, eits_sign sign)
{
    eits_context *ctx = dense_bench_open(&b, WAVES, 0);
    eits_options o = *eits_get_options(ctx);
    eits_real atom[RANK];
    CHECK_EQUAL(o.touch_seek, 0); /* this model was not taught */
    o.touch_seek = 1;
    o.sign = sign;
    o.touch_min_fraction = R(0.02);
    o.detection_factor = 0;
    CHECK_OK(eits_set_options(ctx, &o));
    eits_zero(ctx->frame.y, RANK);
    for (uint32_t k = 0; k < count; ++k) {
        (void)eits_disc_atom(ctx, &ctx->scratch, disc + k, atom, NULL);
        eits_axpy(ctx->kernels, ctx->frame.y, disc[k].change, atom, RANK);
    }
    CHECK_OK(eits_solve(ctx, NULL));
    for (uint32_t j = 0; j < b.c.model.n_pixels; ++j)
        ctx->solver.image[j] = j == 0 ? 1 : 0;
    return ctx;
}

static uint32_t found(eits_context *ctx, eits_touch *touch)
{
    uint32_t count = 0;
    CHECK_OK(eits_find_touches(ctx, touch, EITS_MAX_TOUCHES, &count));
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
    for (size_t c = 0; IN_TABLE(c, cases); ++c) {
        eits_touch touch[EITS_MAX_TOUCHES];
        eits_context *ctx = pressed(cases[c].disc, cases[c].count, cases[c].sign);
        const uint32_t count = found(ctx, touch);
        CHECK_EQUAL(count, cases[c].count);
        for (uint32_t k = 0; k < cases[c].count; ++k)
            CHECK(has(touch, count, &cases[c].disc[k]));
        CHECK(ctx->info.touch_macs > 0);
        /* the image's peak is none of them */
        CHANGE_OPTIONS(ctx, o.touch_seek = 0);
        CHECK(found(ctx, touch) < 2u);
    }
}

TEST(what_explains_too_little_is_no_touch)
{
    const eits_disc disc[2] = {{-21, 9, 9, R(0.05), 1}, {27, -15, 9, R(0.02), 1}};
    eits_touch touch[EITS_MAX_TOUCHES];
    eits_context *ctx = pressed(disc, 2, EITS_SIGN_INCREASE);
    /* it explains a seventh */
    CHANGE_OPTIONS(ctx, o.touch_min_fraction = R(0.2));
    CHECK_EQUAL(found(ctx, touch), 1);
    CHECK(has(touch, 1, &disc[0]));
    CHANGE_OPTIONS(ctx, o.touch_min_fraction = R(0.02), o.max_touches = 1);
    CHECK_EQUAL(found(ctx, touch), 1);
    CHANGE_OPTIONS(ctx, o.max_touches = EITS_MAX_TOUCHES);
    for (int i = 0; i < RANK; ++i) /* nothing of the sign that is looked for */
        ctx->frame.y[i] = 0;
    CHECK_EQUAL(found(ctx, touch), 0);
}

/* Sought discs go from a pixel's centre by whole pixels: so they come to lie there, and rounding
 * must not decide whether the rim's pixel is near. */
TEST(a_disc_a_whole_pixel_beyond_the_rim_is_no_touch)
{
    static const struct {
        eits_real beyond; /* of the rim's pixel, pixels */
        uint32_t count;
    } cases[] = {{R(0.99), 1}, {R(0.9999), 0}, {1, 0}, {R(1.0001), 0}};
    for (size_t c = 0; IN_TABLE(c, cases); ++c) {
        const eits_disc at = {0, 0, 9, R(0.05), 1};
        eits_context *ctx = pressed(&at, 1, EITS_SIGN_INCREASE);
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
    eits_context *ctx = pressed(disc, 2, EITS_SIGN_INCREASE);
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
}

/* A touch that nothing is left beside has no place to be unsure of. */
TEST(without_a_residual_a_place_is_not_rated)
{
    static const eits_disc disc = {-21, 9, 9, R(0.05), 1};
    eits_context *ctx = pressed(&disc, 1, EITS_SIGN_INCREASE);
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
}

/* ---- an instrument that is far from the model ---- */

static float errors[RANK * (RANK + 1) / 2];

/* A reference whose folds are the model's times exp(by), alternately up and down, and whose second
 * sides differ by `apart` of the reference's rms. */
static eits_reference tared(eits_context *ctx, double by, double apart)
{
    eits_real frame[SMALL_ROWS];
    double square = 0;
    small_reference(ctx->model, 0.5, frame);
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k)
        square += pow((double)frame[ctx->model->fold[k].first], 2) / SMALL_FOLDED;
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
        const eits_fold fold = ctx->model->fold[k];
        const double factor = exp(k % 2 ? by : -by), off = 0.5 * apart * sqrt(square);
        frame[fold.first] *= (eits_real)factor;
        if (fold.second == EITS_FOLD_NONE)
            continue;
        frame[fold.second] *= (eits_real)factor;
        frame[fold.first] += (eits_real)off;
        frame[fold.second] -= (eits_real)(fold.sign * off);
    }
    CHECK_OK(eits_reference_set(ctx, frame, SMALL_ROWS));
    return ctx->reference;
}

/* The tare alone decides: the reference differs row by row, or from its own reciprocals, by more
 * than a skin does. This holds only for models with model errors, and not for ratio data. */
TEST(the_tare_says_that_the_instrument_is_far)
{
    eits_context *ctx = dense_bench_open(&b, WAVES, 0);
    const double limit = (double)EITS_MAX_DISTANCE;
    b.c.model.uncertainty = (eits_uncertainty){.errors = errors, .drift = errors, .row_gains = 1};
    for (int far = 0; far < 2; ++far) {
        eits_reference r = tared(ctx, limit * (far ? 1.1 : 0.9), 0);
        CHECK_NEAR((double)r.distance / limit, far ? 1.1 : 0.9, 0.06); /* the gain takes some */
        CHECK(r.far == (uint32_t)far && r.row_gains == !far);
        CHECK_EQUAL(eits_regularisation_of_all(ctx) == 1, far);
        r = tared(ctx, 0, (double)EITS_MAX_RECIPROCITY * (far ? 1.1 : 0.7));
        CHECK(r.far == (uint32_t)far && r.row_gains == !far);
    }
    CHECK_EQUAL(tared(ctx, 0, 0).far, 0);
    b.c.model.data_kind = EITS_DATA_NORMALISED;
    CHECK_EQUAL(tared(ctx, 2 * limit, 0).far, 0);
    b.c.model.data_kind = EITS_DATA_DIFFERENCE;
    b.c.model.uncertainty.errors = NULL;
    CHECK_EQUAL(tared(ctx, 2 * limit, 0).far, 0);
}

/* A fit as the touch test may leave it: one disc, far from the place that the data show. */
static eits_fit one_left(eits_context *ctx, double confidence)
{
    eits_fit f = eits_fit_none(ctx, &ctx->scratch);
    ctx->reference.far = f.count = f.tested = 1;
    f.confidence[0] = (eits_real)confidence;
    f.disc[0] = (eits_disc){40, 40, 3, R(0.01), 1};
    f.place_mm2[0][0] = f.place_mm2[0][2] = f.long_mm[0][1] = 9;
    eits_fit_restart(ctx, &ctx->scratch, &f);
    return f;
}

/* sum over the blob of share a b, a and b mm from `middle`, along the axes given. */
static double moment(const eits_context *ctx, const double *image, double peak,
                     const double middle[2], int axis, int other)
{
    double sum = 0, total = 0;
    for (uint32_t j = 0; j < ctx->model->n_pixels; ++j) {
        const double pixel = (double)ctx->model->pixel_mm, share = image[j] / peak,
                     at[3] = {(double)ctx->model->origin_x_mm +
                                  pixel * (ctx->model->pixel[j].ix + 0.5) - middle[0],
                              (double)ctx->model->origin_y_mm +
                                  pixel * (ctx->model->pixel[j].iy + 0.5) - middle[1],
                              1};
        if (share < (double)EITS_CENTRE_SHARE)
            continue;
        total += share;
        sum += share * at[axis] * at[other];
    }
    return sum / total;
}

/* Its one touch lies at the middle of the blob that one regularised step gives, as wide as that; by
 * the image written out, of the sign that is looked for. */
TEST(the_unsure_touch_of_a_far_instrument_is_the_images_middle)
{
    const eits_sign signs[] = {EITS_SIGN_INCREASE, EITS_SIGN_DECREASE, EITS_SIGN_BOTH};
    for (int k = 0; k < 6; ++k) {
        const int down = k % 3 == 1 || k == 5;
        const eits_disc at[2] = {{-21, 9, 11, down ? R(-0.05) : R(0.05), 1},
                                 {18, -14, 8, down ? R(0.01) : R(-0.01), 1}};
        eits_context *ctx = pressed(at, k < 3 ? 1 : 2, signs[k % 3]);
        double *y = dense_copy(ctx->frame.y, RANK), *image = dense_numbers(b.d.n), peak = 0;
        const double origin[2] = {0, 0};
        dense_correlate(&b.d, y, image);
        for (uint32_t j = 0; j < b.d.n; ++j) {
            image[j] *= (double)ctx->model->column_weight[j];
            peak = (down ? -image[j] : image[j]) > fabs(peak) ? image[j] : peak;
        }
        const double middle[2] = {moment(ctx, image, peak, origin, 0, 2),
                                  moment(ctx, image, peak, origin, 1, 2)},
                     own = pow((double)ctx->model->pixel_mm, 2) / 12;
        eits_fit f = one_left(ctx, 0.5);
        eits_fit_centre(ctx, &ctx->scratch, &f);
        CHECK_NEAR(f.disc[0].x_mm, middle[0], 1e-3);
        CHECK_NEAR(f.disc[0].y_mm, middle[1], 1e-3);
        CHECK(hypot(middle[0] + 21, middle[1] - 9) < 3);
        CHECK(f.disc[0].radius_mm == ctx->options.touch_seed_radius_mm);
        CHECK(f.disc[0].change * (down ? -1 : 1) > 0 && f.explained[0] > R(0.5));
        for (int i = 0; i < 3; ++i)
            CHECK_NEAR(
                f.place_mm2[0][i],
                (double)EITS_CENTRE_SPREAD *
                    (moment(ctx, image, peak, middle, i / 2, (i + 1) / 2) + (i == 1 ? 0 : own)),
                1e-2);
        CHECK_EQUAL(f.count, 1);
        free(y);
        free(image);
    }
}

/* The touch stays as the test left it in these cases: it is certain, or was not tested, or is one
 * of two; the instrument fits; or the image is empty, has nothing of that sign, or has two halves
 * with the other sign between them. */
TEST(other_touches_stay)
{
    static const eits_disc at[] = {{-21, 9, 11, R(0.05), 1},
                                   {9, 9, 11, R(0.05), 1},
                                   {-6, 9, 11, R(-0.1), -1},
                                   {0, 0, 90, R(-0.01), -1}};
    for (int k = 0; k < 8; ++k) {
        eits_context *ctx = pressed(at + (k == 7 ? 3 : 0), k == 6 ? 3 : 1, EITS_SIGN_INCREASE);
        eits_fit f = one_left(ctx, k == 0 ? (double)EITS_CENTRE_SURE : 0.5);
        f.tested = k != 1;
        f.count = k == 2 ? 2 : k == 3 ? 0 : 1;
        ctx->reference.far = k != 4;
        if (k == 5)
            eits_zero(ctx->frame.y, RANK);
        const eits_fit before = f;
        eits_fit_centre(ctx, &ctx->scratch, &f);
        CHECK(memcmp(&f.disc, &before.disc, sizeof f.disc) == 0 && f.count == before.count);
        CHECK(f.place_mm2[0][0] == 9 && f.long_mm[0][1] == 9);
    }
}

RUN_TESTS("seek", dense_bench_close(&b))
