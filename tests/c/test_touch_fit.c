/* Finding touches: what it costs, units, and which touches are kept, against dense computations. */
#include "check.h"
#include "dense.h"
#include "small_model.h"

#include "base/vec.h"
#include "diagnostics/diagnostics.h"
#include "eitskin/solve.h"
#include "eitskin/touch.h"
#include "touch/disc.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SIDE = 20, RANK = 64 };

static eits_context *set_up(small_model *made, small_context *c)
{
    *made = small_model_make((small_spec){.rank = RANK, .side = SIDE, .shape = SMALL_WAVES});
    small_context_open(c, made, 0);
    return c->ctx;
}

/* y of two discs at pixel centres, far from each other, or of the first alone; returns the pixels
 * that the first covers. */
static uint64_t press(eits_context *ctx, int both)
{
    const eits_disc discs[2] = {{-27, 3, 9, R(0.05), 1}, {33, -3, 9, R(0.02), 1}};
    eits_real atom[RANK];
    uint64_t covered = 0;
    memset(ctx->frame.y, 0, RANK * sizeof *ctx->frame.y);
    for (int d = 0; d <= both; ++d) {
        const uint64_t macs = eits_disc_atom(ctx, &ctx->scratch, &discs[d], atom, NULL);
        covered = d == 0 ? macs / RANK : covered;
        for (int i = 0; i < RANK; ++i)
            ctx->frame.y[i] += discs[d].change * atom[i];
    }
    CHECK_EQUAL(eits_solve(ctx, NULL), EITS_OK);
    return covered;
}

static uint64_t touch_macs(eits_context *ctx, uint32_t expected_touches)
{
    uint32_t count;
    CHECK_EQUAL(eits_find_touches(ctx, NULL, 0, &count), EITS_OK);
    CHECK_EQUAL(count, expected_touches);
    return eits_get_info(ctx)->touch_macs;
}

/* Discs at pixel centres, of the seed's radius, held there: every product can be counted. */
TEST(work_is_counted)
{
    small_model made;
    small_context c;
    eits_context *ctx = set_up(&made, &c);
    CHANGE_OPTIONS(ctx, o.touch_sweeps = 0, o.touch_threshold = R(0.2));
    const uint64_t covered = press(ctx, 0);
    /* within 2 pixels of the centre of one: itself, 4 + 4 neighbours; the next ones lie on the
     * edge */
    CHECK_EQUAL(covered, 9);
    const uint64_t strengths = covered * RANK + 10 * 4 * RANK; /* its response, ten passes */
    /* and one product of the Gram matrix */
    CHECK_EQUAL(touch_macs(ctx, 1), strengths + RANK);
    (void)press(ctx, 1);
    CHECK_EQUAL(touch_macs(ctx, 2), 2 * strengths + 3 * RANK);
    (void)press(ctx, 0);
    /* a detection threshold: two products of its own pixel, the next ones being a pixel away */
    ctx->reference.lambda_noise = R(1e-6);
    CHECK_EQUAL(touch_macs(ctx, 1), strengths + RANK + 2 * RANK);
    ctx->reference.lambda_noise = 0;
    /* a response with three slopes, 17 products, and each attempted step's response with 3
     * products */
    CHANGE_OPTIONS(ctx, o.touch_sweeps = 1);
    (void)press(ctx, 0);
    const uint64_t moved = touch_macs(ctx, 1) - strengths - RANK - (4 * covered * RANK + 17 * RANK);
    CHECK_EQUAL(moved % RANK, 0);
    CHECK(moved >= (covered + 3) * RANK && moved <= 3 * (covered + 12 + 3) * RANK);
    small_context_close(&c);
    small_model_free(&made);
}

TEST(units_do_not_matter)
{
    small_model made;
    small_context c;
    eits_context *ctx = set_up(&made, &c);
    eits_touch first[2], found[2];
    uint32_t count;
    /* not the discs' own: the radius is a compromise of data and expectation */
    CHANGE_OPTIONS(ctx, o.touch_seed_radius_mm = 8, o.touch_radius_weight = R(3e-4));
    (void)press(ctx, 1);
    CHECK_EQUAL(eits_find_touches(ctx, first, 2, &count), EITS_OK);
    CHECK_EQUAL(count, 2);
    CHECK(first[0].radius_mm > R(8.02) && first[0].radius_mm < R(8.98));
    for (int power = -24; power <= 24; power += 12) {
        const eits_real unit =
            (eits_real)(power < 0 ? 1.0 / (double)(1 << -power) : (double)(1 << power));
        (void)press(ctx, 1);
        for (int i = 0; i < RANK; ++i)
            ctx->frame.y[i] *= unit;
        CHECK_EQUAL(eits_solve(ctx, NULL), EITS_OK);
        CHECK_EQUAL(eits_find_touches(ctx, found, 2, &count), EITS_OK);
        CHECK_EQUAL(count, 2);
        for (int k = 0; k < 2; ++k) { /* powers of two: the same bits */
            CHECK(found[k].x_mm == first[k].x_mm && found[k].y_mm == first[k].y_mm &&
                  found[k].radius_mm == first[k].radius_mm);
            CHECK(found[k].explained == first[k].explained && found[k].id == first[k].id);
            CHECK(found[k].strength_s_per_m_mm2 == first[k].strength_s_per_m_mm2 * unit);
        }
    }
    small_context_close(&c);
    small_model_free(&made);
}

/* |y - best fit by the atoms|^2, without atom `left_out` (-1: with all). */
static double unexplained(const double *y, const double *atoms, uint32_t count, int left_out)
{
    double directions[4 * RANK], rest[RANK];
    uint32_t used = 0;
    for (uint32_t k = 0; k < count; ++k) {
        if ((int)k != left_out)
            memcpy(directions + RANK * used++, atoms + RANK * k, RANK * sizeof *atoms);
    }
    memcpy(rest, y, sizeof rest);
    dense_project_out(rest, directions, used, RANK);
    return dense_dot(rest, rest, RANK);
}

/* A touch explains the fraction of |y|^2 that remains unexplained if it is left out and the
 * strengths of the others are fitted again: for overlapping discs, at pixel centres. One peak of
 * the image is empty: the data have no touch there. */
TEST(explained_is_what_leaving_out_costs)
{
    /* x, y mm, change */
    static const double places[4][3] = {{-27, -27, 0}, {-3, 3, 0.05}, {15, 9, 0.04}, {3, 21, 0.03}};
    small_model made;
    small_context c;
    eits_context *ctx = set_up(&made, &c);
    eits_real atom[RANK];
    double atoms[4 * RANK], y[RANK];
    CHANGE_OPTIONS(ctx, o.touch_sweeps = 0, o.touch_threshold = 0, o.touch_seed_radius_mm = 12);
    memset(ctx->frame.y, 0, RANK * sizeof *ctx->frame.y);
    CHECK_EQUAL(eits_solve(ctx, NULL), EITS_OK);
    ctx->info.stop = EITS_STOP_ITERATIONS; /* an image made by hand, the empty peak the highest */
    for (int k = 0; k < 4; ++k) {
        const eits_disc disc = {(eits_real)places[k][0], (eits_real)places[k][1], 12, 1, 1};
        (void)eits_disc_atom(ctx, &ctx->scratch, &disc, atom, NULL);
        for (int i = 0; i < RANK; ++i) {
            atoms[k * RANK + i] = (double)atom[i];
            ctx->frame.y[i] +=
                (eits_real)places[k][2] * atom[i] + (k == 0 ? R(-0.02) * atom[i] : 0);
        }
        ctx->solver
            .image[lround((places[k][1] + 57) / 6) * SIDE + lround((places[k][0] + 57) / 6)] =
            (eits_real)(4 - k);
    }
    for (int i = 0; i < RANK; ++i)
        y[i] = (double)ctx->frame.y[i];
    eits_touch found[4];
    uint32_t count;
    CHECK_EQUAL(eits_find_touches(ctx, found, 4, &count), EITS_OK);
    CHECK_EQUAL(count, 3);
    const double all = unexplained(y, atoms + RANK, 3, -1), total = dense_dot(y, y, RANK);
    for (uint32_t t = 0; t < count && t < 4; ++t) {
        int k = 1;
        while (k < 3 && hypot(places[k][0] - (double)found[t].x_mm,
                              places[k][1] - (double)found[t].y_mm) > 0.1)
            ++k;
        const double fraction = (unexplained(y, atoms + RANK, 3, k - 1) - all) / total;
        CHECK(fraction > 0.03 && fraction < 0.6);
        /* strengths come by ten passes, not exactly */
        CHECK_NEAR(found[t].explained, fraction, 0.01 * fraction);
    }
    small_context_close(&c);
    small_model_free(&made);
}

/* A touch must stand out of the noise at its own place: at the greatest S_j'(its part) of the 3 x 3
 * pixels around it. */
TEST(each_touch_must_exceed_the_detection_threshold)
{
    small_model made;
    small_context c;
    eits_context *ctx = set_up(&made, &c);
    dense d = dense_of(&c.model);
    CHANGE_OPTIONS(ctx, o.touch_sweeps = 0, o.touch_min_fraction = 0, o.lambda_noise_factor = 0,
                   o.detection_factor = 1);
    const eits_disc weak = {33, -3, 9, R(0.02), 1};
    eits_real atom[RANK];
    (void)eits_disc_atom(ctx, &ctx->scratch, &weak, atom, NULL);
    double *part = dense_copy(atom, RANK), max = 0;
    for (int iy = 8; iy <= 10; ++iy) { /* pixel (15, 9) */
        for (int ix = 14; ix <= 16; ++ix)
            max = fmax(max, 0.02 * dense_dot(d.s + (iy * SIDE + ix) * RANK, part, RANK));
    }
    for (int k = 0; k < 2; ++k) {
        ctx->reference.lambda_noise = 0;
        (void)press(ctx, 1);
        ctx->reference.lambda_noise = (eits_real)(max * (k == 0 ? 0.999 : 1.001));
        CHECK(eits_get_info(ctx)->lambda_max > R(1.5) * ctx->reference.lambda_noise);
        (void)touch_macs(ctx, k == 0 ? 2 : 1);
    }
    free(part);
    dense_free(&d);
    small_context_close(&c);
    small_model_free(&made);
}

/* If the data are well above the noise, they determine the radius; otherwise the radius follows
 * from the strength. */
TEST(radius_by_the_data_or_by_the_noise)
{
    static const double noises[] = {1e-5, 0.02, 4};
    static const double radii[] = {12, 12, 9};
    for (int k = 0; k < 3; ++k) {
        small_model made;
        small_context c;
        eits_context *ctx = set_up(&made, &c);
        eits_touch found[2];
        uint32_t count;
        CHANGE_OPTIONS(ctx, o.touch_radius_weight = 0, o.touch_seed_radius_mm = 9,
                       o.touch_change_s_per_m = 0, o.max_touches = 1, o.touch_sweeps = 60);
        const eits_disc disc = {-25, 2, 12, R(0.05), 1};
        (void)eits_disc_atom(ctx, &ctx->scratch, &disc, ctx->frame.y, NULL);
        for (int i = 0; i < RANK; ++i)
            ctx->frame.y[i] *= disc.change;
        memset(ctx->frame.sides, EITS_SIDE_FIRST, ctx->model->n_folded);
        ctx->reference.gain = 1;
        ctx->reference.noise_v = (eits_real)noises[k];
        CHECK_EQUAL(eits_solve(ctx, NULL), EITS_OK);
        CHECK_EQUAL(eits_find_touches(ctx, found, 2, &count), EITS_OK);
        CHECK_EQUAL(count, 1);
        CHECK_NEAR(found[0].radius_mm, radii[k], 0.4);
        small_context_close(&c);
        small_model_free(&made);
    }
}

RUN_TESTS("touch_fit")
