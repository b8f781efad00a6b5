/* Touches: discs laid into the model's own columns are found again, off the grid. */
#include "check.h"
#include "dense.h"
#include "small_model.h"

#include "base/vec.h"
#include "eitskin/solve.h"
#include "eitskin/touch.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SIDE = 20, RANK = 64 };
static const double PIXEL = 6, PI = 3.14159265358979323846;

typedef struct bench {
    small_model made;
    small_context c;
    dense d;
    eits_touch found[EITS_MAX_TOUCHES];
    uint32_t count;
} bench;

static bench b;

static void tear_down(bench *b)
{
    dense_free(&b->d);
    small_context_close(&b->c);
    small_model_free(&b->made);
}

typedef struct finger {
    double x, y, radius, change; /* mm, S/m */
} finger;

static eits_context *set_up(bench *b, eits_storage storage, int round)
{
    tear_down(b);
    b->made = small_model_make((small_spec){
        .rank = RANK, .side = SIDE, .shape = SMALL_WAVES, .storage = storage, .round = round});
    small_context_open(&b->c, &b->made, 1);
    b->d = dense_of(&b->c.model);
    return b->c.ctx;
}

/* y of these discs, pixels covered by area (12 x 12 points each), not by the core's own rule;
 * solved, and touches found. */
static void press(bench *b, const finger *fingers, uint32_t count, double noise)
{
    const eits_model *m = &b->c.model;
    double y[RANK] = {0};
    uint64_t state = 91;
    for (uint32_t j = 0; j < m->n_pixels; ++j) {
        double change = 0;
        for (uint32_t f = 0; f < count; ++f) {
            for (int p = 0; p < 144; ++p) {
                const double x = (double)m->origin_x_mm +
                                 (m->pixel[j].ix + (p % 12 + 0.5) / 12) * PIXEL - fingers[f].x;
                const double yy = (double)m->origin_y_mm +
                                  (m->pixel[j].iy + (p / 12 + 0.5) / 12) * PIXEL - fingers[f].y;
                change += x * x + yy * yy < fingers[f].radius * fingers[f].radius
                              ? fingers[f].change / 144
                              : 0;
            }
        }
        for (uint32_t i = 0; i < RANK; ++i)
            y[i] += change / (double)m->column_weight[j] * b->d.s[(size_t)j * RANK + i];
    }
    for (uint32_t i = 0; i < RANK; ++i)
        b->c.ctx->frame.y[i] = (eits_real)(y[i] + noise * small_random(&state));
    CHECK_EQUAL(eits_solve(b->c.ctx, NULL), EITS_OK);
    CHECK_EQUAL(eits_find_touches(b->c.ctx, b->found, EITS_MAX_TOUCHES, &b->count), EITS_OK);
    CHECK_EQUAL(eits_get_info(b->c.ctx)->touches, b->count);
}

static double strength(finger f)
{
    return f.change * PI * f.radius * f.radius;
}

/* The touch nearest to the finger must lie within `apart` mm and have its strength within
 * `fraction`.
 */
static const eits_touch *check_found(const bench *b, finger f, double apart, double fraction)
{
    const eits_touch *best = NULL;
    double nearest = 1e9;
    for (uint32_t k = 0; k < b->count; ++k) {
        const double from = hypot((double)b->found[k].x_mm - f.x, (double)b->found[k].y_mm - f.y);
        if (from < nearest) {
            nearest = from;
            best = &b->found[k];
        }
    }
    CHECK(best != NULL);
    CHECK_NEAR(nearest, 0, apart);
    if (best != NULL)
        CHECK_NEAR(best->strength_s_per_m_mm2, strength(f), fraction * fabs(strength(f)));
    return best;
}

TEST(one_touch_anywhere)
{
    uint64_t state = 92;
    for (int storage = 0; storage < 4; ++storage) {
        eits_context *ctx = set_up(&b, (eits_storage)storage, 0);
        /* the radius by the data: held at the seed's, it would bend the strength by some 5 % */
        CHANGE_OPTIONS(ctx, o.touch_radius_weight = R(1e-4), o.touch_sweeps = 40);
        double bias = 0;
        for (int round = 0; round < 15; ++round) {
            const finger f = {44 * small_random(&state), 44 * small_random(&state),
                              9 + 2 * small_random(&state), 0.05};
            press(&b, &f, 1, 0);
            CHECK_EQUAL(b.count, 1);
            const eits_touch *t = check_found(&b, f, 0.1 * PIXEL, 0.05);
            CHECK(t != NULL && t->explained > R(0.98) && t->explained <= 1);
            CHECK(eits_get_info(ctx)->touch_macs > 0);
            bias += t == NULL ? 1 : (double)t->strength_s_per_m_mm2 / strength(f) / 15;
        }
        CHECK_NEAR(bias, 1, 0.01); /* on average it is right */
    }
}

TEST(both_signs)
{
    eits_context *ctx = set_up(&b, EITS_STORAGE_F32, 0);
    const finger pair[2] = {{-25, 10, 9, 0.05}, {25, -12, 9, -0.03}};
    CHANGE_OPTIONS(ctx, o.sign = EITS_SIGN_BOTH);
    press(&b, pair, 2, 0);
    CHECK_EQUAL(b.count, 2);
    (void)check_found(&b, pair[0], 1, 0.05);
    (void)check_found(&b, pair[1], 1, 0.05);
    /* the strongest first, by size */
    CHECK(b.found[0].strength_s_per_m_mm2 > 0 && b.found[1].strength_s_per_m_mm2 < 0);
    CHANGE_OPTIONS(ctx, o.sign = EITS_SIGN_DECREASE);
    press(&b, pair + 1, 1, 0);
    CHECK_EQUAL(b.count, 1);
    (void)check_found(&b, pair[1], 1, 0.05);
    CHANGE_OPTIONS(ctx, o.sign = EITS_SIGN_INCREASE);
    press(&b, pair + 1, 1,
          0); /* places at which a decrease is only weaker are not touches of the other sign */
    for (uint32_t k = 0; k < b.count; ++k)
        CHECK(b.found[k].strength_s_per_m_mm2 >= 0 &&
              (double)b.found[k].strength_s_per_m_mm2 < 0.5 * fabs(strength(pair[1])));
}

TEST(two_touches_and_one)
{
    (void)set_up(&b, EITS_STORAGE_F32, 0);
    const finger three[3] = {{-30, -25, 9, 0.05}, {30, -20, 8, 0.04}, {0, 30, 10, 0.06}};
    press(&b, three, 3, 0);
    CHECK_EQUAL(b.count, 3);
    for (int k = 0; k < 3; ++k)
        (void)check_found(&b, three[k], 0.15 * PIXEL, 0.06);
    for (uint32_t k = 1; k < b.count; ++k)
        CHECK(b.found[k].strength_s_per_m_mm2 <= b.found[k - 1].strength_s_per_m_mm2);
    double apart = 36; /* two that come together, step by step: two, then one, and never more */
    uint32_t before = 2, seen[3] = {0};
    for (; apart >= 4; apart -= 4) {
        const finger two[2] = {{-apart / 2, 3, 8, 0.05}, {apart / 2, 3, 8, 0.05}};
        press(&b, two, 2, 0);
        CHECK(b.count == 1 || b.count == 2);
        CHECK(b.count <= before);
        if (b.count == 2 && apart >= 24) {
            (void)check_found(&b, two[0], 0.25 * PIXEL, 0.1);
            (void)check_found(&b, two[1], 0.25 * PIXEL, 0.1);
        }
        before = b.count;
        seen[before < 3 ? before : 0] += 1;
    }
    CHECK(seen[2] >= 4 && seen[1] >= 1);
}

TEST(dropped_and_limited)
{
    eits_context *ctx = set_up(&b, EITS_STORAGE_F32, 0);
    const finger two[2] = {{-27, 3, 9, 0.05}, {25, 5, 9, 0.015}};
    const eits_options defaults = *eits_get_options(ctx);
    eits_options o = defaults;
    press(&b, two, 2, 0);
    CHECK_EQUAL(b.count, 2);
    const double fraction = (double)b.found[1].explained;
    CHECK_NEAR(fraction, 0.09 / 1.09, 0.02); /* energies go with the square of the strengths */
    o.touch_min_fraction = (eits_real)(1.2 * fraction);
    CHECK_EQUAL(eits_set_options(ctx, &o), EITS_OK);
    press(&b, two, 2, 0);
    CHECK_EQUAL(b.count, 1);
    (void)check_found(&b, two[0], 2, 0.1);
    o.touch_min_fraction = (eits_real)(0.8 * fraction);
    CHECK_EQUAL(eits_set_options(ctx, &o), EITS_OK);
    press(&b, two, 2, 0);
    CHECK_EQUAL(b.count, 2);
    o = defaults;
    o.touch_threshold = R(0.6); /* the weaker peak starts nothing */
    CHECK_EQUAL(eits_set_options(ctx, &o), EITS_OK);
    press(&b, two, 2, 0);
    CHECK_EQUAL(b.count, 1);
    o = defaults;
    for (uint32_t max = 0; max <= 2; ++max) {
        o.max_touches = max;
        CHECK_EQUAL(eits_set_options(ctx, &o), EITS_OK);
        press(&b, two, 2, 0);
        CHECK_EQUAL(b.count, max);
        if (max == 1)
            CHECK(b.found[0].x_mm < 0); /* the strongest */
    }
}

/* More peaks than there is room for: the highest are kept, in order, and no memory beyond is
 * touched. */
TEST(many_peaks)
{
    eits_context *ctx = set_up(&b, EITS_STORAGE_F32, 0);
    CHANGE_OPTIONS(ctx, o.touch_sweeps = 0, o.touch_threshold = 0, o.touch_min_fraction = 0,
                   o.touch_seed_radius_mm = o.touch_min_radius_mm = R(3.0));
    for (uint32_t max = 1; max <= EITS_MAX_TOUCHES; max += 5) {
        CHANGE_OPTIONS(ctx, o.max_touches = max);
        memset(ctx->frame.y, 0, RANK * sizeof *ctx->frame.y);
        CHECK_EQUAL(eits_solve(ctx, NULL), EITS_OK);
        ctx->info.stop = EITS_STOP_ITERATIONS;
        /* 100 peaks, the height rising with the number in a scrambled order; pixel 0 is the
         * highest */
        for (uint32_t iy = 0; iy < 10; ++iy) {
            for (uint32_t ix = 0; ix < 10; ++ix) {
                const uint32_t number = (37 * (10 * iy + ix) + 99) % 100;
                ctx->solver.image[(2 * iy) * SIDE + 2 * ix] = (eits_real)(0.01 * (1 + number));
                /* data that agree, so that each keeps a strength */
                for (uint32_t i = 0; i < RANK; ++i)
                    ctx->frame.y[i] += (eits_real)(0.01 * (1 + number) *
                                                   b.d.s[((2 * iy) * SIDE + 2 * ix) * RANK + i]);
            }
        }
        eits_touch found[EITS_MAX_TOUCHES];
        uint32_t count;
        CHECK_EQUAL(eits_find_touches(ctx, found, EITS_MAX_TOUCHES, &count), EITS_OK);
        CHECK(count >= 1 && count <= max);
        for (uint32_t k = 0; k < count; ++k) { /* each at one of the `max` highest peaks */
            const uint32_t ix = (uint32_t)lround(((double)found[k].x_mm + 57) / PIXEL),
                           iy = (uint32_t)lround(((double)found[k].y_mm + 57) / PIXEL);
            CHECK_NEAR(found[k].x_mm, -57 + PIXEL * ix, 1e-4);
            CHECK(ix % 2 == 0 && iy % 2 == 0);
            CHECK((37 * (10 * (iy / 2) + ix / 2) + 99) % 100 >= 100 - max);
        }
    }
}

TEST(no_touch_below_the_detection_threshold)
{
    eits_context *ctx = set_up(&b, EITS_STORAGE_F32, 0);
    const finger two[2] = {{-25, 0, 9, 0.05}, {25, 5, 9, 0.015}};
    CHANGE_OPTIONS(ctx, o.lambda_noise_factor = 0, o.detection_factor = 1);
    press(&b, two + 1, 1, 0);
    const eits_real weak = eits_get_info(ctx)->lambda_max;
    press(&b, two, 2, 0);
    CHECK_EQUAL(b.count, 2);
    ctx->reference.lambda_noise = R(0.8) * weak; /* the weaker one stands out of such noise */
    press(&b, two, 2, 0);
    CHECK_EQUAL(b.count, 2);
    /* of this it does not, though the frame as a whole does */
    ctx->reference.lambda_noise = R(1.25) * weak;
    press(&b, two, 2, 0);
    CHECK_EQUAL(eits_get_info(ctx)->stop, EITS_STOP_ITERATIONS);
    CHECK_EQUAL(b.count, 1);
    CHECK(b.found[0].x_mm < 0);
    press(&b, two + 1, 1, 0); /* alone it does not even pass the frame's detection threshold */
    CHECK(eits_get_info(ctx)->stop == EITS_STOP_BELOW_THRESHOLD && b.count == 0 &&
          eits_get_info(ctx)->touch_macs == 0);
}

TEST(without_sweeps)
{
    eits_context *ctx = set_up(&b, EITS_STORAGE_F32, 0);
    const finger f = {16.5, -8.5, 9, 0.05};
    CHANGE_OPTIONS(ctx, o.touch_sweeps = 0, o.touch_seed_radius_mm = R(7.5));
    press(&b, &f, 1, 0);
    CHECK(b.count >= 1);
    const eits_touch t = b.found[0];
    CHECK_NEAR(t.x_mm, 15, 0); /* the centre of the pixel, the seed's radius */
    CHECK_NEAR(t.y_mm, -9, 0);
    CHECK_NEAR(t.radius_mm, 7.5, 0);
    CHECK_NEAR(t.strength_s_per_m_mm2, strength(f), 0.15 * strength(f));
}

TEST(radius_by_strength)
{
    eits_context *ctx = set_up(&b, EITS_STORAGE_F32, 0);
    const eits_options defaults = *eits_get_options(ctx);
    eits_options o = defaults;
    for (double radius = 6; radius <= 10; radius += 2) {
        const finger f = {5.5, -13, radius, 0.05};
        o = defaults;
        o.touch_sweeps = 30;
        /* the change under a touch is known: strength tells the area */
        o.touch_change_s_per_m = R(0.05);
        o.touch_radius_weight = R(0.1);
        CHECK_EQUAL(eits_set_options(ctx, &o), EITS_OK);
        press(&b, &f, 1, 0);
        CHECK_EQUAL(b.count, 1);
        CHECK_NEAR(b.found[0].radius_mm, radius, 0.05 * radius);
        /* it is not known, and data count for little: the seed's radius */
        o.touch_change_s_per_m = 0;
        o.touch_radius_weight = R(1e4);
        CHECK_EQUAL(eits_set_options(ctx, &o), EITS_OK);
        press(&b, &f, 1, 0);
        CHECK(b.count >= 1);
        CHECK_NEAR(b.found[0].radius_mm, 9, 0.05);
        o.touch_radius_weight = 0; /* data alone, within the limits */
        o.touch_max_radius_mm = R(9.5);
        CHECK_EQUAL(eits_set_options(ctx, &o), EITS_OK);
        press(&b, &f, 1, 0);
        CHECK(b.count >= 1 && b.found[0].radius_mm <= R(9.5) &&
              b.found[0].radius_mm >= o.touch_min_radius_mm);
    }
}

TEST(at_rim_and_corner)
{
    static const finger edges[] = {{-57, -57, 9, 0.05}, {57, 57, 9, 0.05},  {60, 0, 9, 0.05},
                                   {-60, 10, 9, 0.05},  {-57, 57, 9, 0.05}, {7, -58, 9, 0.05},
                                   {59, -59, 9, 0.05}};
    (void)set_up(&b, EITS_STORAGE_F32, 0);
    for (size_t k = 0; k < sizeof edges / sizeof edges[0]; ++k) {
        press(&b, &edges[k], 1, 0);
        CHECK(b.count >= 1);
        const double off =
            hypot((double)b.found[0].x_mm - edges[k].x, (double)b.found[0].y_mm - edges[k].y);
        CHECK_NEAR(off, 0, 0.5 * PIXEL);
        CHECK(b.found[0].strength_s_per_m_mm2 > 0 && b.found[0].explained > R(0.9));
    }
    (void)set_up(&b, EITS_STORAGE_I8, 1); /* a round image has corners without pixels */
    for (int k = 0; k < 12; ++k) {
        const finger f = {55 * cos(k * PI / 6), 55 * sin(k * PI / 6), 8, 0.05};
        press(&b, &f, 1, 0);
        CHECK(b.count >= 1);
        CHECK_NEAR(hypot((double)b.found[0].x_mm - f.x, (double)b.found[0].y_mm - f.y), 0,
                   0.5 * PIXEL);
    }
}

TEST(nothing_to_find)
{
    eits_context *ctx = set_up(&b, EITS_STORAGE_F32, 0);
    const finger f = {10, 10, 9, 0.05}, two[2] = {{-25, 0, 9, 0.05}, {25, 5, 9, 0.03}};
    uint32_t count = 9;
    eits_touch one;
    /* before any frame */
    CHECK_EQUAL(eits_find_touches(ctx, b.found, EITS_MAX_TOUCHES, &count), EITS_OK);
    CHECK_EQUAL(count, 0);
    press(&b, &f, 0, 0); /* y = 0 */
    CHECK(b.count == 0 && eits_get_info(ctx)->touches == 0 && eits_get_info(ctx)->touch_macs == 0);
    CHECK_EQUAL(eits_find_touches(NULL, b.found, 1, &count), EITS_E_ARGUMENT);
    CHECK_EQUAL(eits_find_touches(ctx, NULL, 1, &count), EITS_E_ARGUMENT);
    press(&b, two, 2, 0);
    eits_real image[SIDE * SIDE];
    memcpy(image, eits_get_image(ctx), sizeof image);
    /* room for one: the strongest, both counted */
    CHECK_EQUAL(eits_find_touches(ctx, &one, 1, &count), EITS_OK);
    CHECK_EQUAL(count, 2);
    CHECK(small_same_touch(&one, &b.found[0])); /* asked again, the same with the same id */
    CHECK_EQUAL(eits_find_touches(ctx, NULL, 0, NULL), EITS_OK);
    CHECK_EQUAL(eits_get_info(ctx)->touches, 2);
    /* the image is not changed by looking for touches */
    CHECK(memcmp(image, eits_get_image(ctx), sizeof image) == 0);
}

RUN_TESTS("touch", tear_down(&b))
