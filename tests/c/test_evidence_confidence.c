/* The numbers of the touch test: the confidence of a touch and the covariance of its place (neither
 * without a test), and the frames that are called crowded because of them. */
#include "check.h"
#include "dense.h"
#include "small_model.h"

#include "evidence/constants.h"
#include "evidence/evidence.h"

#include <math.h>
#include <string.h>

static eits_context *ctx;

static eits_fit rated(double rise, uint32_t tested, const eits_real *place_mm2, double x, double y)
{
    eits_fit f = {.count = 1, .tested = tested, .rise = {(eits_real)rise}};
    for (int i = 0; i < 3; ++i)
        f.place_mm2[0][i] = place_mm2[i];
    f.apart_mm[0][0] = (eits_real)x;
    f.apart_mm[0][1] = (eits_real)y;
    eits_rate_touches(ctx, &f);
    return f;
}

static const eits_real PLACE[3] = {R(0.5), R(-0.25), R(0.75)};

TEST(probability_is_logistic_in_the_logarithm_of_the_rise)
{
    const double half = (double)EITS_CONFIDENCE_HALF;
    double before = -1;
    for (double rise = 0.125; rise < 1e6; rise *= 1.25) {
        const double got = (double)rated(rise, 1, PLACE, 0, 0).confidence[0];
        CHECK_NEAR(got, 1 / (1 + exp(-log(rise / half))), 1e-5);
        CHECK(got >= before && got <= 1);
        before = got;
    }
    const double odd[] = {0, -1, NAN};
    for (int k = 0; k < 3; ++k)
        CHECK(rated(odd[k], 1, PLACE, 0, 0).confidence[0] == 0);
    CHECK(rated(1e38, 1, PLACE, 0, 0).confidence[0] <= 1);
}

TEST(places_get_factor_floor_distance_and_what_the_test_would_move)
{
    const double reach = (double)EITS_MAX_MOVE * (double)ctx->model->pixel_mm;
    const double apart[][2] = {{0, 0}, {0.5, -1}, {1e6, 0.25}};
    for (int k = 0; k < 3; ++k) {
        ctx->reference.distance = (eits_real)(0.125 * k);
        const double x = (double)EITS_PLACE_APART * fmin(apart[k][0], reach),
                     y = (double)EITS_PLACE_APART * apart[k][1],
                     least = pow((double)ctx->model->pixel_mm, 2) * (double)EITS_PLACE_MIN +
                             pow((double)ctx->model->pixel_mm, 2) * (double)EITS_PLACE_DISTANCE *
                                 0.125 * k,
                     add[3] = {x * x + least, x * y, y * y + least};
        const eits_fit f = rated(100, 1, PLACE, apart[k][0], apart[k][1]);
        for (int i = 0; i < 3; ++i)
            CHECK_NEAR(f.place_mm2[0][i], (double)EITS_PLACE_FACTOR * (double)PLACE[i] + add[i],
                       1e-4);
        CHECK(f.place_mm2[0][0] * f.place_mm2[0][2] > f.place_mm2[0][1] * f.place_mm2[0][1]);
    }
    ctx->reference.distance = 0;
}

/* If places are corrected, their covariance contains what the correction leaves; otherwise it
 * contains the part that follows from the distance of the reference. */
TEST(places_widen_by_what_their_correction_leaves)
{
    eits_model copy = *ctx->model;
    const eits_model *before = ctx->model;
    copy.uncertainty.move_terms = 1;
    ctx->model = &copy;
    ctx->reference.row_gains = 1;
    ctx->reference.place_trust = R(0.75);
    ctx->reference.distance = R(0.25);
    ctx->reference.place_mm2 = 2;
    const double pixel = (double)copy.pixel_mm, floor = pixel * pixel * (double)EITS_PLACE_MIN,
                 own = (double)EITS_PLACE_FACTOR * (double)PLACE[0] + floor;
    CHECK_NEAR(rated(100, 1, PLACE, 0, 0).place_mm2[0][0],
               own + 0.75 * 2 * (double)EITS_PLACE_GEOMETRY +
                   0.25 * pixel * pixel * (double)EITS_PLACE_DISTANCE * 0.25,
               1e-5);
    ctx->reference.row_gains = 0;
    CHECK_NEAR(rated(100, 1, PLACE, 0, 0).place_mm2[0][0],
               own + pixel * pixel * (double)EITS_PLACE_DISTANCE * 0.25, 1e-5);
    ctx->reference.distance = ctx->reference.place_mm2 = 0;
    ctx->model = before;
}

TEST(what_is_not_known_is_zero)
{
    const eits_fit not_tested = rated(100, 0, PLACE, 0, 0);
    CHECK(not_tested.confidence[0] == 0 && not_tested.place_mm2[0][0] == 0);
    const eits_real bad[][3] = {{R(NAN), 0, 1}, {1, R(INFINITY), 1}, {0, 0, 1}, {1, 0, -1}};
    for (int k = 0; k < 5; ++k) {
        const eits_fit f =
            k < 4 ? rated(100, 1, bad[k], 0, 0) : rated(100, 1, PLACE, (double)NAN, 0);
        for (int i = 0; i < 3; ++i)
            CHECK(f.place_mm2[0][i] == 0);
        CHECK(f.confidence[0] > 0);
    }
}

static uint32_t said(const eits_fit *f)
{
    ctx->info.diagnostics = 0;
    eits_check_count(ctx, f);
    return ctx->info.diagnostics;
}

TEST(crowded_where_one_may_be_two_or_none)
{
    eits_fit f = {.count = 2, .tested = 1, .confidence = {R(0.99), R(0.99)}, .pair = {-3, -3}};
    CHECK_EQUAL(said(&f), 0);
    f.pair[1] = EITS_PAIR_ODDS + R(0.01);
    CHECK_EQUAL(said(&f), EITS_DIAGNOSTIC_CROWDED);
    f.tested = 0;
    CHECK_EQUAL(said(&f), 0);
    f.tested = 1;
    f.pair[1] = EITS_PAIR_ODDS - R(0.01);
    CHECK_EQUAL(said(&f), 0);
    f.confidence[0] = EITS_MIN_CONFIDENCE - R(0.01);
    CHECK_EQUAL(said(&f), EITS_DIAGNOSTIC_CROWDED);
    ctx->options.diagnostics = 0;
    CHECK_EQUAL(said(&f), 0);
}

/* The score of pair.c by hand: a bulge along x, and a dipole along it or across. */
TEST(pairs_bulge_where_their_dipole_does_not)
{
    enum { N = EITS_SHAPE_PARAMETERS };
    eits_answer answer = {.count = 1, .parameters = N};
    answer.disc[0].radius_mm = answer.radius_mm[0] = 8;
    eits_likelihood likelihood = {.count = N};
    eits_scratch scratch = ctx->scratch;
    eits_real square[N * N] = {0};
    scratch.square = square;
    for (int i = 0; i < N; ++i)
        square[i * N + i] = R(0.01);
    likelihood.step[4] = R(0.2);
    answer.shape[0][0] = R(0.1);
    double score[2];
    for (int k = 0; k < 2; ++k) {
        likelihood.step[6] = k == 0 ? R(-0.06) : R(0.06);
        score[k] = (double)eits_pair_score(&scratch, &answer, &likelihood, 0);
        const double hand = (double)EITS_PAIR_OFFSET + (double)EITS_PAIR_BULGE * 3 +
                            (double)EITS_PAIR_DIPOLE * (k == 0 ? -0.6 : 0.6) +
                            (double)EITS_PAIR_BOTH * 0.3 * 0.06;
        CHECK_NEAR(score[k], hand, 1e-4);
    }
    CHECK(score[0] > score[1]);
    answer.parameters = EITS_PLACE_PARAMETERS;
    CHECK(eits_pair_score(&scratch, &answer, &likelihood, 0) == -1);
}

/* The line of a bulge at some angle, and two discs on it, of the area and strength of the one; none
 * where they would lie off the skin, or there is no shape. */
TEST(two_lie_on_the_line_of_the_bulge)
{
    eits_likelihood likelihood = {.count = 2 * EITS_SHAPE_PARAMETERS};
    eits_answer one = {.count = 2, .parameters = EITS_SHAPE_PARAMETERS}, two;
    const eits_disc disc = {5, -3, 8, R(0.02), 1};
    one.disc[0] = one.disc[1] = disc;
    one.shape[0][0] = R(0.1);
    eits_real line[2];
    for (int k = -17; k <= 18; ++k) {
        const double angle = k * 3.14159265358979 / 36;
        likelihood.step[4] = (eits_real)(0.3 * cos(2 * angle) - 0.1);
        likelihood.step[5] = (eits_real)(0.3 * sin(2 * angle));
        eits_pair_line(&one, &likelihood, 0, line);
        CHECK_NEAR(fabs((double)line[0] * cos(angle) + (double)line[1] * sin(angle)), 1, 1e-4);
        ctx->options.touch_min_radius_mm = k < 0 ? 7 : 2;
        CHECK(eits_split_disc(ctx, &one, 0, line, &two));
        const eits_disc *a = &two.disc[0], *b = &two.disc[2];
        CHECK(two.count == 3 && two.disc[1].x_mm == disc.x_mm);
        CHECK_NEAR((double)(a->x_mm + b->x_mm) / 2, 5, 1e-5);
        CHECK_NEAR((double)(a->x_mm - b->x_mm), 2 * (double)EITS_SPLIT_APART * 8 * (double)line[0],
                   1e-4);
        CHECK_NEAR((double)(a->y_mm - b->y_mm), 2 * (double)EITS_SPLIT_APART * 8 * (double)line[1],
                   1e-4);
        CHECK_NEAR((double)a->radius_mm, k < 0 ? 7 : 8 / sqrt(2), 1e-5);
        CHECK_NEAR((double)(a->change * a->radius_mm * a->radius_mm), 0.02 * 64 / 2, 1e-5);
    }
    eits_pair_line(&one, &likelihood, 1, line); /* which has no bulge */
    for (int k = 0; k < 2; ++k) {
        one.disc[0].x_mm = k == 0 ? 1000 : -1000;
        CHECK(!eits_split_disc(ctx, &one, 0, line, &two));
    }
    one.disc[0].x_mm = 0;
    one.count = 8; /* more than there are data for */
    CHECK(!eits_split_disc(ctx, &one, 0, line, &two));
    one.parameters = EITS_PLACE_PARAMETERS;
    eits_pair_line(&one, &likelihood, 0, line);
    CHECK(line[0] == 0 && line[1] == 0);
}

int main(void)
{
    static dense_bench bench;
    ctx = dense_bench_open(&bench, (small_spec){.rank = 13, .side = 6, .shape = SMALL_WHITENED}, 0);
    run_tests();
    dense_bench_close(&bench);
    return checks_report("evidence_confidence");
}
