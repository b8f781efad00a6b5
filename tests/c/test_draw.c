/* The picture of touches, against covers from fine sampling. */
#include "check.h"
#include "small_model.h"

#include "base/vec.h"
#include "eitskin/touch.h"

#include <math.h>

enum { SIDE = 16, PIXELS = SIDE * SIDE, SAMPLES = 40 };

static const double PI = 3.14159265358979323846, PIXEL_MM = 6;
static const float HEIGHT = 0.0135f;

static small_model memory;
static eits_model model;
static eits_defaults defaults;
static eits_real image[PIXELS];

static void set_up(float expected_change)
{
    memory = small_model_make((small_spec){.rank = 3, .side = SIDE});
    CHECK_EQUAL(eits_model_open(&model, memory.blob, memory.size), EITS_OK);
    CHECK_EQUAL(model.n_pixels, PIXELS);
    defaults = *model.defaults;
    defaults.touch_change_s_per_m = expected_change;
    model.defaults = &defaults;
}

/* A touch near the middle of the grid; with `ratio` above 1 an ellipse whose long axis is so many
 * times the short one. */
static eits_touch at(double x_mm, double y_mm, double radius_mm, double ratio, double angle)
{
    const double middle = 0.5 * SIDE * PIXEL_MM, length = ratio > 1 ? radius_mm * sqrt(ratio) : 0;
    return (eits_touch){.id = 1,
                        .x_mm = (eits_real)((double)model.origin_x_mm + middle + x_mm),
                        .y_mm = (eits_real)((double)model.origin_y_mm + middle + y_mm),
                        .radius_mm = (eits_real)radius_mm,
                        .strength_s_per_m_mm2 = 1,
                        .explained = R(0.5),
                        .long_x_mm = (eits_real)(length * cos(angle)),
                        .long_y_mm = (eits_real)(length * sin(angle))};
}

/* The fraction of pixel j that lies in the touch. */
static double sampled(const eits_touch *t, uint32_t j)
{
    const double length = hypot((double)t->long_x_mm, (double)t->long_y_mm),
                 radius = (double)t->radius_mm, a = length > 0 ? length : radius,
                 b = radius * radius / a, c = length > 0 ? (double)t->long_x_mm / length : 1,
                 s = length > 0 ? (double)t->long_y_mm / length : 0;
    int inside = 0;
    for (int k = 0; k < SAMPLES * SAMPLES; ++k) {
        const double dx = (double)model.origin_x_mm - (double)t->x_mm +
                          PIXEL_MM * (model.pixel[j].ix + (k % SAMPLES + 0.5) / SAMPLES),
                     dy = (double)model.origin_y_mm - (double)t->y_mm +
                          PIXEL_MM *
                              (model.pixel[j].iy + (double)(k / SAMPLES) / SAMPLES + 0.5 / SAMPLES);
        inside += hypot((c * dx + s * dy) / a, (c * dy - s * dx) / b) <= 1;
    }
    return inside / (double)(SAMPLES * SAMPLES);
}

static void draw(const eits_touch *touches, uint32_t count)
{
    for (uint32_t j = 0; j < PIXELS; ++j)
        image[j] = R(NAN); /* every pixel must be written */
    CHECK_EQUAL(eits_draw_touches(&model, touches, count, image), EITS_OK);
}

/* An edge that crosses a pixel at 45 degrees covers up to 4.3 % less or more of it than one that
 * crosses it squarely; a curved edge adds to that. The soft edge adds pixel^2 / 12 to the square of
 * the radius, averaged over places. */
TEST(covers_are_those_of_fine_sampling)
{
    static const struct {
        double x, y, radius, ratio, angle, each;
    } cases[] = {
        {0, 0, 12, 1, 0, 0.09},     {1.7, -2.9, 8, 1, 0, 0.09},  {2.5, 0.6, 25, 1, 0, 0.07},
        {0, 0, 10, 1.5, 0.4, 0.09}, {-3, 1, 14, 2.2, 1.1, 0.09}, {0.4, 2.2, 20, 3, -0.7, 0.11},
    };
    set_up(HEIGHT);
    for (size_t i = 0; IN_TABLE(i, cases); ++i) {
        const eits_touch t =
            at(cases[i].x, cases[i].y, cases[i].radius, cases[i].ratio, cases[i].angle);
        double worst = 0, area = 0;
        draw(&t, 1);
        for (uint32_t j = 0; j < PIXELS; ++j) {
            const double cover = (double)image[j] / (double)HEIGHT;
            area += cover * PIXEL_MM * PIXEL_MM;
            worst = fmax(worst, fabs(cover - sampled(&t, j)));
            CHECK(cover >= 0 && cover <= 1 + 4 * EPS);
        }
        CHECK_NEAR(worst, 0, cases[i].each);
        const double soft = cases[i].radius * cases[i].radius + PIXEL_MM * PIXEL_MM / 12;
        CHECK_NEAR(area / (PI * soft), 1, 0.02);
    }
    small_model_free(&memory);
}

/* Covers add up to one height, a resistive touch is negative, and one that is held is not drawn. */
TEST(touches_have_one_height_and_their_signs)
{
    set_up(HEIGHT);
    eits_touch t[3] = {at(-20, 0, 14, 1, 0), at(-16, 3, 14, 1, 0), at(25, 0, 14, 1, 0)};
    t[0].strength_s_per_m_mm2 = 5;
    t[2].strength_s_per_m_mm2 = -3;
    draw(t, 3);
    double top = 0, bottom = 0;
    for (uint32_t j = 0; j < PIXELS; ++j) {
        top = fmax(top, (double)image[j]);
        bottom = fmin(bottom, (double)image[j]);
    }
    CHECK_NEAR(top, HEIGHT, 4 * EPS);
    CHECK_NEAR(bottom, -HEIGHT, 4 * EPS);
    t[2].explained = 0; /* held */
    draw(t, 3);
    for (uint32_t j = 0; j < PIXELS; ++j)
        CHECK(image[j] >= 0);
    draw(NULL, 0);
    for (uint32_t j = 0; j < PIXELS; ++j)
        CHECK(image[j] == 0);
    small_model_free(&memory);
}

/* A taught model expects no change: the touches' own mean is the height. */
TEST(without_an_expected_change_the_height_is_the_mean)
{
    set_up(0);
    eits_touch t[2] = {at(-20, 0, 12, 1, 0), at(20, 0, 18, 1, 0)};
    t[0].strength_s_per_m_mm2 = 2;
    t[1].strength_s_per_m_mm2 = -7;
    draw(t, 2);
    double top = 0;
    for (uint32_t j = 0; j < PIXELS; ++j)
        top = fmax(top, (double)image[j]);
    const double height = 9 / (PI * (12.0 * 12.0 + 18.0 * 18.0));
    CHECK_NEAR(top, height, 8 * EPS * height);
    small_model_free(&memory);
}

/* Numbers of a damaged packet leave an image of finite numbers. */
TEST(whatever_the_numbers_the_image_is_finite)
{
    static const eits_real odd[] = {0,       R(-1),    R(1e-38), R(1e30),
                                    R(3e38), R(-3e38), R(NAN),   R(INFINITY)};
    set_up(0);
    for (uint32_t field = 0; field < 6; ++field) {
        for (uint32_t k = 0; k < sizeof odd / sizeof odd[0]; ++k) {
            eits_touch t[2] = {at(0, 0, 10, 1.5, 0.3), at(0, 0, 10, 1.5, 0.3)};
            eits_real *const of[] = {&t[0].x_mm,      &t[0].y_mm,      &t[0].radius_mm,
                                     &t[0].long_x_mm, &t[0].long_y_mm, &t[0].strength_s_per_m_mm2};
            *of[field] = odd[k];
            draw(t, 2);
            CHECK(eits_all_finite(image, PIXELS));
        }
    }
    small_model_free(&memory);
}

TEST(wrong_arguments)
{
    set_up(HEIGHT);
    const eits_touch t = at(0, 0, 10, 1, 0);
    CHECK_EQUAL(eits_draw_touches(NULL, &t, 1, image), EITS_E_ARGUMENT);
    CHECK_EQUAL(eits_draw_touches(&model, NULL, 1, image), EITS_E_ARGUMENT);
    CHECK_EQUAL(eits_draw_touches(&model, &t, 1, NULL), EITS_E_ARGUMENT);
    small_model_free(&memory);
}

RUN_TESTS("draw", (void)0)
