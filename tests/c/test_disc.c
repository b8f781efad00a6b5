/* A disc's response and its derivatives, against sums written out and against differences. */
#include "check.h"
#include "dense.h"
#include "small_model.h"

#include "base/vec.h"
#include "touch/disc.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SIDE = 12, RANK = 36 };

typedef dense_bench bench;

static bench b;

static eits_context *set_up(bench *b, eits_storage storage)
{
    return dense_bench_open(
        b,
        (small_spec){
            .rank = RANK, .side = SIDE, .shape = SMALL_WAVES, .round = 1, .storage = storage},
        0);
}

/* The documented cover, over all pixels; with the gradient's basis taken out. Returns the number of
 * covered pixels. */
static uint32_t expected_atom(const bench *b, const eits_disc *disc, double *atom)
{
    const eits_model *m = &b->c.model;
    const double pixel = (double)m->pixel_mm;
    uint32_t covered = 0;
    memset(atom, 0, RANK * sizeof *atom);
    for (uint32_t j = 0; j < m->n_pixels; ++j) {
        const double dx =
            (double)m->origin_x_mm + (m->pixel[j].ix + 0.5) * pixel - (double)disc->x_mm;
        const double dy =
            (double)m->origin_y_mm + (m->pixel[j].iy + 0.5) * pixel - (double)disc->y_mm;
        const double fraction = 0.5 + ((double)disc->radius_mm - sqrt(dx * dx + dy * dy)) / pixel;
        const double cover = fmin(1, fmax(0, fraction)) / (double)m->column_weight[j];
        covered += cover > 0;
        for (uint32_t i = 0; i < RANK; ++i)
            atom[i] += cover * b->d.s[(size_t)j * RANK + i];
    }
    for (uint32_t k = 0; k < b->c.ctx->projection.count; ++k) {
        double *basis = dense_copy(b->c.ctx->projection.basis + k * EITS_STRIDE(RANK), RANK);
        const double along = dense_dot(basis, atom, RANK);
        for (uint32_t i = 0; i < RANK; ++i)
            atom[i] -= along * basis[i];
        free(basis);
    }
    return covered;
}

/* The strength of a touch has a factor, its area. This is the sum of the disc's covers at its
 * place; the mean over places is pi (radius^2 + pixel^2 / 12). */
TEST(the_area_is_that_of_the_covers)
{
    eits_context *ctx = set_up(&b, EITS_STORAGE_F32);
    const double pixel = (double)b.c.model.pixel_mm, span = SIDE * pixel;
    for (double radius = 3; radius <= 15; radius += 4) {
        double mean = 0;
        /* within a pixel, then all over and beyond the image */
        for (int place = 0; place < 24 * 24 + 60; ++place) {
            const int inside = place < 24 * 24;
            const eits_disc disc = {
                .x_mm = (eits_real)(inside ? place % 24 * pixel / 24 : 0.7 * span * sin(place)),
                .y_mm =
                    (eits_real)(inside ? place / 24 * pixel / 24 : 0.7 * span * cos(1.3 * place)),
                .radius_mm = (eits_real)radius};
            double sum = 0;
            for (uint32_t j = 0; j < b.c.model.n_pixels; ++j) {
                const double dx =
                    ((double)b.c.model.pixel[j].ix + 0.5 - SIDE / 2.0) * pixel - (double)disc.x_mm;
                const double dy =
                    ((double)b.c.model.pixel[j].iy + 0.5 - SIDE / 2.0) * pixel - (double)disc.y_mm;
                sum += fmin(1, fmax(0, 0.5 + (radius - hypot(dx, dy)) / pixel)) * pixel * pixel;
            }
            const double got = (double)eits_disc_area(ctx, &disc);
            CHECK_NEAR(got, sum, 1000 * EPS * fmax(sum, pixel * pixel));
            mean += inside ? got / (24 * 24) : 0;
        }
        CHECK_NEAR(mean, 3.14159265358979 * (radius * radius + pixel * pixel / 12), 0.005 * mean);
    }
    const eits_disc far = {.x_mm = R(1e6), .y_mm = R(-1e6), .radius_mm = R(5.0)};
    CHECK(eits_disc_area(ctx, &far) == 0);
}

static eits_disc random_disc(uint64_t *state)
{
    /* the image ends at 36 mm */
    const eits_disc disc = {.x_mm = (eits_real)(45 * small_random(state)),
                            .y_mm = (eits_real)(45 * small_random(state)),
                            .radius_mm = (eits_real)(11 + 9 * small_random(state)),
                            .change = 1,
                            .polarity = 1};
    return disc;
}

TEST(responses_are_sums_over_the_covers)
{
    uint64_t state = 81;
    for (int storage = 0; storage < 4; ++storage) {
        eits_context *ctx = set_up(&b, (eits_storage)storage);
        for (int round = 0; round < 60; ++round) {
            if (round == 30) { /* from here on with a direction to ignore */
                for (int i = 0; i < RANK; ++i)
                    ctx->projection.basis[i] = R(1.0 / 6.0);
                ctx->projection.count = 1;
            }
            const eits_disc disc = random_disc(&state);
            eits_real atom[EITS_STRIDE(RANK)];
            double expected[RANK];
            const uint32_t covered = expected_atom(&b, &disc, expected);
            const uint64_t macs = eits_disc_atom(ctx, &ctx->scratch, &disc, atom, NULL);
            CHECK_EQUAL(macs, covered * RANK + ctx->projection.count * 2 * RANK);
            CHECK_NEAR(dense_greatest_difference(expected, atom, RANK), 0, 2000 * EPS);
            const uint64_t both =
                eits_disc_atom(ctx, &ctx->scratch, &disc, atom, &ctx->scratch.row[5]);
            CHECK(macs <= both && both <= 4 * macs); /* the slopes are the rim's */
            CHECK_EQUAL(
                eits_disc_shape(ctx, &ctx->scratch, &disc, NULL, &ctx->scratch.row[5], NULL),
                both - macs);
            CHECK_NEAR(dense_greatest_difference(expected, atom, RANK), 0, 2000 * EPS);
        }
    }
}

TEST(far_away_there_is_nothing)
{
    eits_context *ctx = set_up(&b, EITS_STORAGE_F32);
    static const double places[] = {200, -200, 1e6, -1e6, 1e30, -1e30};
    for (int p = 0; p < 6; ++p) {
        for (int axis = 0; axis < 2; ++axis) {
            const eits_disc disc = {.x_mm = axis ? 0 : (eits_real)places[p],
                                    .y_mm = axis ? (eits_real)places[p] : 0,
                                    .radius_mm = 9,
                                    .polarity = 1};
            eits_real atom[EITS_STRIDE(RANK)];
            CHECK_EQUAL(eits_disc_atom(ctx, &ctx->scratch, &disc, atom, &ctx->scratch.row[5]), 0);
            for (int i = 0; i < RANK; ++i)
                CHECK(atom[i] == 0 && ctx->scratch.row[5 + 0][i] == 0 &&
                      ctx->scratch.row[5 + 1][i] == 0 && ctx->scratch.row[5 + 2][i] == 0);
        }
    }
}

/* Derivatives by x, y and radius against central differences of the response written out in double.
 * If the cover of a pixel reaches 0 or 1 within the step, the derivative jumps; such discs are left
 * out. */
static int smooth_around(const bench *b, const eits_disc *disc, double step)
{
    const eits_model *m = &b->c.model;
    const double pixel = (double)m->pixel_mm;
    for (uint32_t j = 0; j < m->n_pixels; ++j) {
        const double dx =
            (double)m->origin_x_mm + (m->pixel[j].ix + 0.5) * pixel - (double)disc->x_mm;
        const double dy =
            (double)m->origin_y_mm + (m->pixel[j].iy + 0.5) * pixel - (double)disc->y_mm;
        const double from = sqrt(dx * dx + dy * dy),
                     fraction = 0.5 + ((double)disc->radius_mm - from) / pixel;
        if (fabs(fraction) < 2 * step / pixel || fabs(fraction - 1) < 2 * step / pixel ||
            from < 0.1)
            return 0;
    }
    return 1;
}

TEST(derivatives_agree_with_differences)
{
    uint64_t state = 82;
    const double step = 1e-4;
    eits_context *ctx = set_up(&b, EITS_STORAGE_F32);
    int tried = 0;
    for (int round = 0; round < 60; ++round) {
        eits_disc disc = random_disc(&state);
        eits_real atom[EITS_STRIDE(RANK)];
        if (!smooth_around(&b, &disc, 1e-3))
            continue;
        ++tried;
        (void)eits_disc_atom(ctx, &ctx->scratch, &disc, atom, &ctx->scratch.row[5]);
        if (sizeof(eits_real) == 4)
            /* the difference itself needs doubles; that both widths agree is seen below */
            continue;
        for (int k = 0; k < 3; ++k) {
            double up[RANK], down[RANK], size = 0;
            eits_disc moved = disc;
            eits_real *place = k == 0 ? &moved.x_mm : (k == 1 ? &moved.y_mm : &moved.radius_mm);
            *place += (eits_real)step;
            (void)expected_atom(&b, &moved, up);
            *place -= (eits_real)(2 * step);
            (void)expected_atom(&b, &moved, down);
            for (int i = 0; i < RANK; ++i)
                size = fmax(size, fabs(up[i] - down[i]) / (2 * step));
            for (int i = 0; i < RANK; ++i)
                CHECK_NEAR(ctx->scratch.row[5 + k][i], (up[i] - down[i]) / (2 * step),
                           1e-5 * size + 1e-9);
        }
    }
    CHECK(tried >= 20);
    /* one disc that touches no corner: numbers of the double build */
    const eits_disc disc = {.x_mm = R(3.5), .y_mm = R(-8.25), .radius_mm = R(10.0), .polarity = 1};
    eits_real atom[EITS_STRIDE(RANK)];
    double up[RANK], down[RANK];
    CHECK(smooth_around(&b, &disc, 1e-3));
    (void)eits_disc_atom(ctx, &ctx->scratch, &disc, atom, &ctx->scratch.row[5]);
    for (int k = 0; k < 3; ++k) {
        eits_disc moved = disc;
        eits_real *place = k == 0 ? &moved.x_mm : (k == 1 ? &moved.y_mm : &moved.radius_mm);
        *place += R(1.0 / 1024.0); /* exact in either width */
        (void)expected_atom(&b, &moved, up);
        *place -= R(1.0 / 512.0);
        (void)expected_atom(&b, &moved, down);
        for (int i = 0; i < RANK; ++i)
            CHECK_NEAR(ctx->scratch.row[5 + k][i], (up[i] - down[i]) * 512, 2e-3);
    }
}

/* Places on the skin are those in a kept cell or one beside it. */
TEST(on_the_skin)
{
    eits_context *ctx = set_up(&b, EITS_STORAGE_F32);
    const double pixel = (double)ctx->model->pixel_mm;
    uint32_t off = 0;
    for (int iy = -3; iy < SIDE + 3; ++iy) {
        for (int ix = -3; ix < SIDE + 3; ++ix) {
            const double x = (double)ctx->model->origin_x_mm + (ix + 0.4) * pixel,
                         y = (double)ctx->model->origin_y_mm + (iy + 0.6) * pixel;
            const eits_disc disc = {.x_mm = (eits_real)x, .y_mm = (eits_real)y, .radius_mm = 3};
            int near = 0;
            for (uint32_t j = 0; j < ctx->model->n_pixels; ++j)
                near |= abs((int)ctx->model->pixel[j].ix - ix) <= 1 &&
                        abs((int)ctx->model->pixel[j].iy - iy) <= 1;
            CHECK_EQUAL(eits_disc_on_skin(ctx, &disc), near);
            off += !near && ix >= 0 && iy >= 0 && ix < SIDE && iy < SIDE;
        }
    }
    CHECK(off > 0);
    for (int i = 0; i < 2000; ++i) { /* along a line across the grid, from beside it on */
        const double at = (i - 500) * pixel * SIDE / 1000.0;
        const eits_real x = (eits_real)(at + (double)ctx->model->origin_x_mm),
                        y = (eits_real)(0.61 * at + (double)ctx->model->origin_y_mm);
        eits_real to_x = x, to_y = y;
        eits_bring_onto_skin(ctx, &to_x, &to_y);
        double least = 1e9;
        for (uint32_t j = 0; j < ctx->model->n_pixels; ++j) {
            const double low_x = (double)ctx->model->origin_x_mm + ctx->model->pixel[j].ix * pixel,
                         low_y = (double)ctx->model->origin_y_mm + ctx->model->pixel[j].iy * pixel;
            const double dx = fmax(0, fmax(low_x - (double)x, (double)x - low_x - pixel)),
                         dy = fmax(0, fmax(low_y - (double)y, (double)y - low_y - pixel));
            least = fmin(least, hypot(dx, dy));
        }
        const double moved = hypot((double)(to_x - x), (double)(to_y - y));
        if (least < 0.9 * pixel)
            CHECK_NEAR(moved, least, 1e-4);
        if (least == 0)
            CHECK(to_x == x && to_y == y);
    }
    const eits_disc none = {.x_mm = R(NAN)};
    CHECK(!eits_disc_on_skin(ctx, &none));
}

RUN_TESTS("disc", dense_bench_close(&b))
