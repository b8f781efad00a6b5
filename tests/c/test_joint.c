/* The joint fit: data made by the multipole model come back as the touches that made them; what is
 * left out of the data, and when the touches stay as they were. */
#include "evidence_bench.h"

#include "base/cholesky.h"
#include "context/places.h"
#include "diagnostics/diagnostics.h"
#include "eitskin/solve.h"
#include "eitskin/touch.h"
#include "joint/constants.h"
#include "joint/joint.h"
#include "steps.h"

static const double NOISE_V = 1e-4, PIXEL = 6;
static const eits_poles OF_DISCS = {.orders = 3, .sent = 2},
                        OF_ELLIPSES = {.orders = 5, .sent = 3}; /* as the fit has them */
static const eits_shape DISCS[] = {{R(4.4), R(6.3), R(1.4), R(1.35), 0, 0},
                                   {R(7.8), R(7.4), R(1.2), R(1.45), 0, 0},
                                   {R(6.6), R(3.5), R(1.5), R(1.25), 0, 0}};

enum { VECTORS = 3, MOVED = 2, TERMS = 3 };
static float vectors[VECTORS * SMALL_FOLDED], moved[MOVED * SMALL_FOLDED],
    moves[2 * 2 * TERMS * MOVED];

static void fill_row_errors(eits_model *m)
{
    uint64_t state = 41;
    for (int i = 0; i < VECTORS * SMALL_FOLDED; ++i)
        vectors[i] = (float)(small_random(&state) * (i % VECTORS == 0 ? 0.2 : 0.1));
    for (int i = 0; i < MOVED * SMALL_FOLDED; ++i)
        moved[i] = (float)small_random(&state);
    for (int i = 0; i < 4 * TERMS * MOVED; ++i)
        moves[i] = (float)small_random(&state);
    m->row_errors = (eits_row_errors){.vectors = vectors,
                                      .count = VECTORS,
                                      .distance = 0.18f,
                                      .moved = moved,
                                      .moves = {moves, moves + 2 * TERMS * MOVED},
                                      .move_rows = MOVED};
}

static void add_noise(eits_real *v, uint64_t *state)
{
    for (int i = 0; i < SMALL_ROWS; ++i) {
        double sum = 0;
        for (int k = 0; k < 12; ++k)
            sum += small_random(state) / 2; /* near a normal number of deviation 1 */
        v[i] += (eits_real)(NOISE_V * sum);
    }
}

/* A context whose reference is the model's, with some noise learned. */
static eits_context *open_joint(int project)
{
    eits_context *ctx = set_up(&b, project);
    b.b.c.model.fields.volts = 2;
    fill_row_errors(&b.b.c.model);
    uint64_t state = 7;
    eits_real frames[16][SMALL_ROWS];
    const eits_real *list[16];
    for (int k = 0; k < 16; ++k) {
        small_reference(ctx->model, BOARD, frames[k]);
        add_noise(frames[k], &state);
        list[k] = frames[k];
    }
    LEARN(ctx, 16, list);
    CHECK(ctx->reference.noise_v > 0 && !ctx->reference.far);
    CHECK(eits_may_fit_jointly(ctx) && !eits_weighs_errors(ctx));
    return ctx;
}

/* The answers of the shapes in each fold by the multipole model, after its rounds have converged.
 */
static void answers_of(eits_context *ctx, const eits_shape *shape, uint32_t count, double *d)
{
    eits_real value[SMALL_FOLDED];
    const eits_pole_out out = {.value = value};
    const eits_poles *poles = shape->e1 != 0 ? &OF_ELLIPSES : &OF_DISCS;
    memset(d, 0, SMALL_FOLDED * sizeof *d);
    for (uint32_t k = 0; k < count; ++k)
        (void)eits_pole_home(ctx, k, &shape[k]);
    eits_pole_clear(ctx, count);
    (void)eits_pole_induced(ctx, shape, count, poles, 6);
    for (uint32_t k = 0; k < count; ++k) {
        (void)eits_pole_rows(ctx, k, &shape[k], poles, 0, SMALL_FOLDED, &out);
        for (int i = 0; i < SMALL_FOLDED; ++i)
            d[i] += (double)value[i];
    }
}

/* The frame of these shapes, with noise, times a gain. */
static void stage_shapes(eits_context *ctx, const eits_shape *shape, uint32_t count, double gain)
{
    double d[SMALL_FOLDED];
    uint64_t state = 99;
    answers_of(ctx, shape, count, d);
    small_reference(ctx->model, BOARD, b.frame);
    for (int k = 0; k < SMALL_FOLDED; ++k) {
        const eits_fold fold = ctx->model->fold[k];
        b.frame[fold.first] += (eits_real)(BOARD * d[k]);
        if (fold.second != EITS_FOLD_NONE)
            b.frame[fold.second] += (eits_real)(BOARD * fold.sign * d[k]);
    }
    for (int i = 0; i < SMALL_ROWS; ++i)
        b.frame[i] *= (eits_real)gain;
    add_noise(b.frame, &state);
    STAGE(ctx, b.frame);
}

static double x_mm(const eits_shape *s)
{
    return ((double)s->x - 0.5 * SIDE) * PIXEL;
}

static double y_mm(const eits_shape *s)
{
    return ((double)s->y - 0.5 * SIDE) * PIXEL;
}

/* A tested fit whose discs are the shapes, each 2 mm off, of the expected size and strength. */
static eits_fit start_near(const eits_context *ctx, const eits_shape *shape, uint32_t count)
{
    eits_fit f = {.count = count, .tested = 1};
    const double sheet = 1 / (2 * 3.14159265358979323846 * (double)ctx->model->fields.per_sheet);
    for (uint32_t k = 0; k < count; ++k)
        f.disc[k] = (eits_disc){.x_mm = (eits_real)(x_mm(&shape[k]) + (k % 2 ? 2 : -2)),
                                .y_mm = (eits_real)(y_mm(&shape[k]) + (k < 2 ? 1 : -1)),
                                .radius_mm = 8,
                                .change = (eits_real)((shape[k].amplitude < 0 ? -1 : 1) * sheet)};
    return f;
}

/* As after a test that left the touches as they were. */
static void fit_jointly(eits_context *ctx, eits_fit *f)
{
    eits_joint j = {.count = 0};
    eits_fit_jointly(ctx, &ctx->scratch, f, &j);
}

static double place_error(const eits_fit *f, const eits_shape *shape, uint32_t k)
{
    return hypot((double)f->disc[k].x_mm - x_mm(&shape[k]),
                 (double)f->disc[k].y_mm - y_mm(&shape[k]));
}

static int unchanged(const eits_fit *f, const eits_fit *before)
{
    return memcmp(f->disc, before->disc, sizeof f->disc) == 0 &&
           memcmp(f->long_mm, before->long_mm, sizeof f->long_mm) == 0 &&
           memcmp(f->place_mm2, before->place_mm2, sizeof f->place_mm2) == 0 &&
           f->count == before->count;
}

/* ---- what comes back ---- */

/* The touches start 2.2 mm away. Noise, and the error of the model that the metric allows, leave
 * .1 mm of one or two touches, and .6 mm of three, because 20 rows hardly determine their 12
 * parameters. */
TEST(discs_come_back_with_place_radius_and_strength)
{
    static const double most_mm[] = {0.15, 0.15, 0.75};
    for (uint32_t count = 1; count <= 3; ++count) {
        eits_context *ctx = open_joint(1);
        stage_shapes(ctx, DISCS, count, 1);
        eits_fit f = start_near(ctx, DISCS, count);
        fit_jointly(ctx, &f);
        for (uint32_t k = 0; k < count; ++k) {
            const double off = place_error(&f, DISCS, k);
            CHECK_NEAR(off, 0, most_mm[count - 1]);
            CHECK_NEAR(f.disc[k].radius_mm, (double)DISCS[k].radius * PIXEL, 0.7);
            CHECK(off * off < 16 * ((double)f.place_mm2[k][0] + (double)f.place_mm2[k][2]));
            CHECK(f.place_mm2[k][0] > 0 && f.place_mm2[k][2] > 0 &&
                  f.place_mm2[k][1] * f.place_mm2[k][1] < f.place_mm2[k][0] * f.place_mm2[k][2]);
            CHECK(f.long_mm[k][0] == 0 && f.long_mm[k][1] == 0); /* no ellipse without need */
        }
        CHECK(f.macs > 0);
    }
}

TEST(touches_that_conduct_less_come_back)
{
    eits_shape two[2] = {DISCS[0], DISCS[1]};
    two[1].amplitude = -R(1.3);
    eits_context *ctx = open_joint(1);
    stage_shapes(ctx, two, 2, 1);
    eits_fit f = start_near(ctx, two, 2);
    fit_jointly(ctx, &f);
    CHECK(f.disc[0].change > 0 && f.disc[1].change < 0);
    for (uint32_t k = 0; k < 2; ++k)
        CHECK_NEAR(place_error(&f, two, k), 0, 0.35); /* of unlike kinds, radii are known less */
}

/* Half of the long axis is r ((1 + eta) / (1 - eta))^1/2 along half the angle of (e1, e2). */
TEST(ellipses_are_taken_where_the_data_have_them)
{
    eits_shape one = DISCS[0];
    one.e1 = R(0.2), one.e2 = R(-0.2);
    const double eta = hypot(0.2, 0.2), angle = atan2(-0.2, 0.2) / 2,
                 half = (double)one.radius * PIXEL * sqrt((1 + eta) / (1 - eta));
    eits_context *ctx = open_joint(1);
    stage_shapes(ctx, &one, 1, 1);
    eits_fit f = start_near(ctx, &one, 1);
    fit_jointly(ctx, &f);
    CHECK_NEAR(place_error(&f, &one, 0), 0, 0.15);
    const double x = (double)f.long_mm[0][0], y = (double)f.long_mm[0][1],
                 along = x * cos(angle) + y * sin(angle), across = y * cos(angle) - x * sin(angle);
    CHECK_NEAR(fabs(along), half, 0.15 * half);
    CHECK_NEAR(across, 0, 0.1 * half);
}

TEST(rows_that_are_left_out_do_not_count)
{
    eits_context *ctx = open_joint(1);
    mask_fold(ctx, 3);
    mask_fold(ctx, 11);
    stage_shapes(ctx, DISCS, 2, 1);
    CHECK_EQUAL(ctx->frame.sides[3], EITS_SIDE_NONE);
    CHECK_EQUAL(eits_joint_folds(ctx), SMALL_FOLDED - 2);
    ctx->frame.d[3] = 40, ctx->frame.d[11] = -50; /* whatever is there */
    eits_fit f = start_near(ctx, DISCS, 2);
    fit_jointly(ctx, &f);
    for (uint32_t k = 0; k < 2; ++k)
        CHECK_NEAR(place_error(&f, DISCS, k), 0, 0.35);
}

/* A gain that drifts by two per cent adds to the data what no touch makes. */
TEST(drift_of_the_gain_moves_no_place)
{
    double moved_mm[2] = {0, 0};
    for (int project = 0; project < 2; ++project) {
        eits_fit fits[2];
        for (int drifts = 0; drifts < 2; ++drifts) {
            eits_context *ctx = open_joint(project);
            stage_shapes(ctx, DISCS, 1, drifts ? 1.02 : 1);
            fits[drifts] = start_near(ctx, DISCS, 1);
            const eits_fit before = fits[drifts];
            fit_jointly(ctx, &fits[drifts]);
            /* without projection the drifted data fit no disc, and the start stays */
            CHECK(!project || !unchanged(&fits[drifts], &before));
        }
        moved_mm[project] = hypot((double)(fits[1].disc[0].x_mm - fits[0].disc[0].x_mm),
                                  (double)(fits[1].disc[0].y_mm - fits[0].disc[0].y_mm));
    }
    CHECK_NEAR(moved_mm[1], 0, 0.06);
    CHECK(moved_mm[0] > 0.3);
}

/* ---- the number of touches ---- */

/* The first `count` discs as shapes, all free, in the metric of the frame. */
static eits_joint shapes_of(eits_context *ctx, const eits_shape *shape, uint32_t count)
{
    eits_joint j = {.count = count, .parameters = EITS_JOINT_DISC, .most = UINT64_MAX};
    for (uint32_t k = 0; k < count; ++k)
        j.shape[k] = shape[k];
    eits_joint_free_all(&j);
    eits_pole_forget(ctx);
    eits_pole_clear(ctx, count);
    (void)eits_joint_metric(ctx);
    return j;
}

/* Shapes that are held answer as in an evaluation of all: F is the same, and so are the normal
 * equations of the free one. */
TEST(shapes_that_are_held_answer_as_before)
{
    eits_context *ctx = open_joint(1);
    stage_shapes(ctx, DISCS, 2, 1);
    eits_joint all = shapes_of(ctx, DISCS, 2), one = all;
    (void)eits_joint_evaluate(ctx, &all, 6);
    const eits_real whole = eits_lower_row(ctx->joint.normal, 4)[4];
    eits_joint_free_one(&one, 1);
    CHECK(eits_joint_hold(ctx, &one, 1) > 0);
    (void)eits_joint_evaluate(ctx, &one, 1);
    CHECK_NEAR(one.cost, all.cost, 0.05 * (double)all.cost); /* held ones send one order more */
    CHECK_NEAR(ctx->joint.normal[0], whole, 0.001 * (double)whole);
    one.shape[1].x += 1; /* another place, and back */
    (void)eits_joint_evaluate(ctx, &one, 2);
    CHECK(one.cost > 2 * all.cost);
    (void)eits_joint_restore(ctx, &all, 1);
    (void)eits_joint_evaluate(ctx, &all, 1);
    const eits_real again = all.cost;
    (void)eits_joint_evaluate(ctx, &all, 6);
    CHECK_NEAR(again, all.cost, 0.05 * (double)all.cost);
}

/* A disc that is not there scores nothing; one that is missing scores much, and its strength is
 * about that of the true one. */
TEST(a_missing_disc_scores_by_what_the_others_cannot_take_up)
{
    eits_context *ctx = open_joint(1);
    eits_real gain[2], scale[2];
    uint64_t macs = 0;
    stage_shapes(ctx, DISCS, 2, 1);
    eits_joint j = shapes_of(ctx, DISCS, 1);
    eits_joint_descend(ctx, &j, 2, R(INFINITY), &macs);
    j.shape[1] = eits_joint_usual(ctx, DISCS[1].x, DISCS[1].y, 0);
    j.shape[2] = eits_joint_usual(ctx, DISCS[1].x, DISCS[1].y, 1);
    CHECK(j.shape[1].amplitude > 0 && j.shape[2].amplitude < 0 &&
          j.shape[1].radius == j.shape[2].radius);
    CHECK(eits_joint_score(ctx, &j, 2, gain, scale) > 0);
    CHECK(gain[0] > 50 && scale[0] > 0);
    CHECK(gain[1] == 0 && scale[1] == 0); /* of the other sign */
    stage_shapes(ctx, DISCS, 1, 1);
    eits_joint true_one = shapes_of(ctx, DISCS, 1);
    true_one.shape[1] = j.shape[1];
    eits_joint_descend(ctx, &true_one, 2, R(INFINITY), &macs);
    (void)eits_joint_score(ctx, &true_one, 1, gain, scale);
    CHECK(gain[0] < 10);
}

/* Just the first two of DISCS, in their places but for so many pixels. */
static void check_the_two(const eits_joint *j, double within)
{
    CHECK_EQUAL(j->count, 2);
    for (uint32_t k = 0; k < j->count; ++k)
        CHECK_NEAR(
            hypot((double)(j->shape[k].x - DISCS[k].x), (double)(j->shape[k].y - DISCS[k].y)), 0,
            within);
}

/* The image of this bench is not that of its multipoles, so that none can be found here. */
TEST(a_search_drops_a_disc_that_the_data_do_without)
{
    eits_context *ctx = open_joint(1);
    stage_shapes(ctx, DISCS, 2, 1);
    eits_joint j = shapes_of(ctx, DISCS, 3);
    j.shape[2].radius = R(0.5);
    j.shape[2].y -= R(0.5);
    j.shape[0].x += R(0.7);
    CHECK(!eits_joint_near(&j.shape[0], &j.shape[2], EITS_JOINT_CLEAR_APART));
    (void)eits_joint_evaluate(ctx, &j, 2);
    CHECK(j.misfit > EITS_JOINT_SEARCHED * eits_joint_freedom(ctx, &j));
    uint64_t macs = 0;
    eits_joint_search(ctx, &ctx->scratch, &j, &macs);
    CHECK(macs > 0);
    check_the_two(&j, 0.1);
}

/* The first disc is in two halves, which overlap. */
TEST(a_search_merges_the_halves_of_a_touch)
{
    eits_context *ctx = open_joint(1);
    stage_shapes(ctx, DISCS, 2, 1);
    eits_joint j = shapes_of(ctx, DISCS, 3);
    j.shape[2] = DISCS[0];
    j.shape[0].radius *= R(0.7);
    j.shape[2].radius *= R(0.7);
    j.shape[0].x -= R(0.6);
    j.shape[2].x += R(0.6);
    (void)eits_joint_evaluate(ctx, &j, 2);
    uint64_t macs = 0;
    eits_joint_search(ctx, &ctx->scratch, &j, &macs);
    CHECK(macs > 0);
    check_the_two(&j, 0.3);
}

TEST(nothing_is_sought_where_the_discs_leave_no_more_than_noise)
{
    eits_context *ctx = open_joint(1);
    uint64_t macs = 0;
    stage_shapes(ctx, DISCS, 2, 1);
    eits_joint j = shapes_of(ctx, DISCS, 2);
    eits_joint_descend(ctx, &j, 2, R(INFINITY), &macs);
    const uint64_t once = eits_joint_evaluate(ctx, &j, 1);
    macs = 0;
    eits_joint_search(ctx, &ctx->scratch, &j, &macs);
    CHECK(macs < once);
    CHECK_EQUAL(j.count, 2);
}

/* It fits noise, or the rest of what the model errs by. */
TEST(a_disc_that_is_not_needed_goes_though_all_leave_no_more_than_noise)
{
    eits_context *ctx = open_joint(1);
    uint64_t macs = 0;
    stage_shapes(ctx, DISCS, 2, 1);
    eits_joint j = shapes_of(ctx, DISCS, 3);
    j.shape[2] = DISCS[0];
    j.shape[2].x = DISCS[1].x;
    j.shape[2].radius *= R(0.1);
    j.shape[2].amplitude *= R(0.1);
    eits_joint_descend(ctx, &j, 2, R(INFINITY), &macs);
    eits_joint_search(ctx, &ctx->scratch, &j, &macs);
    check_the_two(&j, 0.3);
}

/* One disc stands between the last two of DISCS, with the strength of both. */
TEST(one_of_few_discs_between_two_touches_becomes_both)
{
    eits_context *ctx = open_joint(1);
    uint64_t macs = 0;
    stage_shapes(ctx, DISCS, 3, 1);
    eits_joint j = shapes_of(ctx, DISCS, 2);
    j.searches = 1;
    j.shape[1].x = (DISCS[1].x + DISCS[2].x) / 2;
    j.shape[1].y = (DISCS[1].y + DISCS[2].y) / 2;
    j.shape[1].radius *= R(1.4);
    eits_joint_set_apart(ctx, &j, &macs);
    CHECK(macs > 0);
    CHECK_EQUAL(j.count, 3);
    for (uint32_t k = 0; k < 3; ++k) {
        double least = 99;
        for (uint32_t i = 0; i < 3; ++i) {
            const double away =
                hypot((double)(j.shape[k].x - DISCS[i].x), (double)(j.shape[k].y - DISCS[i].y));
            least = away < least ? away : least;
        }
        CHECK(least < 0.2);
    }
}

/* A disc that reaches beyond the rim becomes as small as it has to be. */
TEST(discs_stay_within_the_rim)
{
    eits_context *ctx = open_joint(1);
    stage_shapes(ctx, DISCS, 1, 1);
    eits_shape large = DISCS[0];
    large.radius = 40;
    eits_joint j = shapes_of(ctx, &large, 1);
    (void)eits_joint_evaluate(ctx, &j, 2);
    CHECK_NEAR(j.shape[0].radius, eits_pole_room(ctx, 0, &large), 1e-6);
    CHECK(j.shape[0].radius < 40 && isfinite((double)j.cost));
    large.radius = R(1.1) * eits_pole_room(ctx, 0, &large);
    j = shapes_of(ctx, &large, 1);
    (void)eits_joint_evaluate(ctx, &j, 2);
    CHECK(j.shape[0].radius < large.radius);
    CHECK_NEAR(eits_joint_strength(&j.shape[0]) / eits_joint_strength(&large), 1, 1e-5);
}

/* ---- the metric ---- */

/* a' (diag(variance) + errors + much g g')^-1 c, densely, by Gauss's elimination. */
static double dense_product(const eits_context *ctx, double errors, const eits_real *a,
                            const eits_real *c)
{
    double m[SMALL_FOLDED][SMALL_FOLDED + 1], sum = 0, drift = 0;
    const double much = 1e5 / pow((double)ctx->joint.weight[0], 2);
    for (int i = 0; i < SMALL_FOLDED; ++i)
        drift += pow((double)ctx->projection.gain_drift[i], 2);
    for (int i = 0; i < SMALL_FOLDED; ++i) {
        for (int j = 0; j < SMALL_FOLDED; ++j) {
            m[i][j] = i == j ? 1 / pow((double)ctx->joint.weight[i], 2) : 0;
            for (uint32_t v = 0; v < ctx->joint.errors; ++v)
                m[i][j] += errors * (double)vectors[VECTORS * i + (int)v] *
                           (double)vectors[VECTORS * j + (int)v];
            m[i][j] += much * (double)ctx->projection.gain_drift[i] *
                       (double)ctx->projection.gain_drift[j] / drift;
        }
        m[i][SMALL_FOLDED] = (double)c[i];
    }
    for (int p = 0; p < SMALL_FOLDED; ++p) {
        for (int i = 0; i < SMALL_FOLDED; ++i) {
            const double by = i == p ? 0 : m[i][p] / m[p][p];
            for (int j = p; j <= SMALL_FOLDED; ++j)
                m[i][j] -= by * m[p][j];
        }
    }
    for (int i = 0; i < SMALL_FOLDED; ++i)
        sum += (double)a[i] * m[i][SMALL_FOLDED] / m[i][i];
    return sum;
}

/* A fold's variance has its noise, a part of the whole data and a part of its own datum. */
TEST(weights_fall_with_the_datum_of_a_fold)
{
    eits_context *ctx = open_joint(1);
    stage_shapes(ctx, DISCS, 2, 1);
    (void)eits_joint_metric(ctx);
    const double model = (double)EITS_JOINT_MODEL_ERROR, own = (double)EITS_JOINT_OWN_ERROR;
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
        const double d = (double)ctx->frame.d[k], noise = (double)eits_fold_noise(ctx, k),
                     common = model * model * (double)ctx->joint.whole / SMALL_FOLDED,
                     variance = noise + common + own * own * d * d;
        CHECK(noise > 0);
        CHECK_NEAR(pow((double)ctx->joint.weight[k], -2) / variance, 1, 1e-4);
    }
}

/* The products that the fit makes of weighed columns are those of the inverse covariance; vectors
 * of errors far below the noise are left out, and all of them on a skin that is the model's. */
TEST(products_are_those_of_the_inverse_covariance)
{
    static const double distances[] = {0, 0.05, 0.09, 0.18, 0.5};
    for (size_t k = 0; IN_TABLE(k, distances); ++k) {
        eits_context *ctx = open_joint(1);
        stage_shapes(ctx, DISCS, 2, 1);
        ctx->reference.distance = (eits_real)distances[k];
        const eits_joint_memory *m = &ctx->joint;
        (void)eits_joint_metric(ctx);
        CHECK_EQUAL(m->errors > 0, distances[k] > 0);
        eits_real columns[2][SMALL_FOLDED], along[2][EITS_JOINT_NUISANCES] = {{0}};
        const eits_real part = R(0.2);
        double far = distances[k] / 0.18, square = 0, drift = 0, along_drift = 0, got = 0;
        for (int i = 0; i < SMALL_FOLDED; ++i) {
            columns[0][i] = ctx->frame.d[i];
            columns[1][i] = part * (eits_real)sin(i + 1.0);
            square += pow((double)ctx->frame.d[i], 2);
            drift += pow((double)ctx->projection.gain_drift[i], 2);
            along_drift += (double)ctx->frame.d[i] * (double)ctx->projection.gain_drift[i];
        }
        const double energy = square - along_drift * along_drift / drift;
        const double errors = (double)EITS_JOINT_ERROR_SHARE * fmin(1, far * far) * energy;
        const double expected[3] = {dense_product(ctx, errors, columns[0], columns[0]),
                                    dense_product(ctx, errors, columns[0], columns[1]),
                                    dense_product(ctx, errors, columns[1], columns[1])};
        for (int c = 0; c < 2; ++c) {
            for (int i = 0; i < SMALL_FOLDED; ++i)
                columns[c][i] *= m->weight[i];
            eits_joint_add_along(ctx, columns[c], 1, 0, 9, along[c]); /* in blocks */
            eits_joint_add_along(ctx, columns[c] + 9, 1, 9, SMALL_FOLDED - 9, along[c]);
            eits_joint_finish_along(ctx, along[c]);
        }
        for (int c = 0; c < 3; ++c) {
            const int left = c == 2, right = c > 0;
            got = 0;
            for (int i = 0; i < SMALL_FOLDED; ++i)
                got += (double)columns[left][i] * (double)columns[right][i];
            for (uint32_t i = 0; i < 1 + m->errors; ++i)
                got -= (double)along[left][i] * (double)along[right][i];
            CHECK_NEAR(got, expected[c], 1e-3 * sqrt(expected[0] * expected[2]) + 1e-3);
        }
        CHECK_NEAR(m->whole, energy, 1e-3 * energy);
    }
}

/* Columns are multiplied two at a time; an odd one alone. Each gets the bits that it has alone. */
TEST(columns_at_once_have_the_products_that_each_has_alone)
{
    eits_context *ctx = open_joint(1);
    stage_shapes(ctx, DISCS, 2, 1);
    ctx->reference.distance = R(0.18);
    (void)eits_joint_metric(ctx);
    CHECK(ctx->joint.errors > 0);
    static eits_real columns[3][EITS_JOINT_BLOCK];
    eits_real alone[3][EITS_JOINT_NUISANCES] = {{0}}, at_once[3][EITS_JOINT_NUISANCES] = {{0}};
    for (int c = 0; c < 3; ++c) {
        for (int i = 0; i < SMALL_FOLDED; ++i)
            columns[c][i] = (eits_real)sin(1.0 + i + 7.0 * c);
        eits_joint_add_along(ctx, columns[c], 1, 0, SMALL_FOLDED, alone[c]);
    }
    eits_joint_add_along(ctx, columns[0], 3, 0, SMALL_FOLDED, at_once[0]);
    CHECK(memcmp(alone, at_once, sizeof alone) == 0);
}

/* A column of the inverse costs less than two solves with a unit vector, and has their bits. */
TEST(columns_of_an_inverse_are_those_of_two_solves)
{
    enum { N = 9, FIRST = 4 };
    eits_real lower[EITS_LOWER_SIZE(N)];
    for (uint32_t i = 0; i < N; ++i) {
        for (uint32_t k = 0; k <= i; ++k)
            eits_lower_row(lower, i)[k] = (eits_real)sin(1.0 + 3.0 * i + k) + (i == k ? 4 : 0);
    }
    for (uint32_t last = FIRST + 1; last <= N; ++last) {
        eits_real both[N] = {0}, column[N];
        both[last - 1] = 1;
        eits_lower_solve(lower, N, both);
        eits_lower_solve_transposed(lower, N, both);
        eits_lower_inverse(lower, N, FIRST, last, column);
        CHECK(memcmp(both + FIRST, column + FIRST, (last - FIRST) * sizeof both[0]) == 0);
    }
}

/* Data that have an error of the model of the size that ROWE states: the metric that knows it is
 * moved less than the one that does not. */
TEST(errors_of_the_model_move_places_less_where_they_are_known)
{
    double off[2] = {0, 0};
    for (int knows = 0; knows < 2; ++knows) {
        for (int sign = -1; sign < 2; sign += 2) {
            eits_context *ctx = open_joint(1);
            stage_shapes(ctx, DISCS, 1, 1);
            double size = 0;
            for (int i = 0; i < SMALL_FOLDED; ++i)
                size += pow((double)ctx->frame.d[i], 2);
            for (int i = 0; i < SMALL_FOLDED; ++i)
                ctx->frame.d[i] += (eits_real)(0.15 * sign * sqrt(size)) * vectors[VECTORS * i];
            ctx->reference.distance = knows ? R(0.18) : 0;
            eits_fit f = start_near(ctx, DISCS, 1);
            fit_jointly(ctx, &f);
            off[knows] += place_error(&f, DISCS, 0);
        }
    }
    CHECK(off[0] > 0.3);
    CHECK(off[1] < 0.6 * off[0]);
}

/* ---- without the test ---- */

/* Clear touches need no test: they are reported as tested, each far likelier than its absence. */
TEST(clear_touches_need_no_test)
{
    static const eits_shape apart[] = {{R(3.4), R(6.2), R(1.35), R(1.35), 0, 0},
                                       {R(8.7), R(6.6), R(1.35), R(1.35), 0, 0},
                                       {R(6.1), R(2.4), R(1.35), R(1.35), 0, 0}};
    eits_context *ctx = open_joint(1);
    stage_shapes(ctx, apart, 2, 1);
    eits_fit f = start_near(ctx, apart, 2);
    f.tested = 0;
    eits_joint j;
    CHECK_EQUAL(eits_fit_clearly(ctx, &ctx->scratch, &f, &j), 1);
    CHECK(f.tested == 1 && f.count == 2);
    for (uint32_t k = 0; k < 2; ++k)
        CHECK(place_error(&f, apart, k) < 0.2 && f.rise[k] > 10 && f.confidence[k] > R(0.9));
    /* with a third disc that no touch is under, the test decides */
    f = start_near(ctx, apart, 3);
    f.tested = 0;
    const eits_fit before = f;
    CHECK_EQUAL(eits_fit_clearly(ctx, &ctx->scratch, &f, &j), 0);
    CHECK(unchanged(&f, &before) && f.tested == 0);
}

/* ---- what it costs, and when it stays away ---- */

static uint64_t many_touches(uint32_t count, eits_fit *f, eits_fit *before)
{
    eits_context *ctx = open_joint(1);
    eits_shape many[16];
    for (uint32_t k = 0; k < count; ++k)
        many[k] = (eits_shape){.x = (eits_real)(3 + 2 * (k % 4)),
                               .y = (eits_real)(2.5 + 2.2 * (k / 4)),
                               .radius = R(0.8),
                               .amplitude = R(1.35)};
    stage_shapes(ctx, many, count, 1);
    *f = start_near(ctx, many, count);
    *before = *f;
    fit_jointly(ctx, f);
    return f->macs;
}

TEST(work_is_limited_and_more_touches_than_there_is_room_for_stay)
{
    eits_fit f, before;
    const uint64_t one = many_touches(1, &f, &before),
                   most =
                       2 * eits_fit_limit(open_joint(1), EITS_JOINT_WORK + EITS_JOINT_SPLIT_WORK);
    CHECK(one > 0 && one < 200000);
    CHECK(!unchanged(&f, &before));
    for (uint32_t count = 2; count <= EITS_JOINT_PARAMETERS / EITS_JOINT_DISC; count += 2) {
        const uint64_t macs = many_touches(count, &f, &before);
        CHECK(macs > one && macs < most);
    }
    CHECK_EQUAL(many_touches(EITS_JOINT_PARAMETERS / EITS_JOINT_DISC + 1, &f, &before), 0);
    CHECK(unchanged(&f, &before));
}

TEST(what_is_not_finite_is_never_reported)
{
    const eits_real odd[] = {R(NAN), R(INFINITY), -R(INFINITY), BOTH_WIDTHS(R(3e38), R(1e308))};
    for (size_t k = 0; IN_TABLE(k, odd); ++k) {
        for (int where = 0; where < 5; ++where) {
            eits_context *ctx = open_joint(1);
            stage_shapes(ctx, DISCS, 2, 1);
            eits_fit f = start_near(ctx, DISCS, 2);
            eits_real *at[] = {&ctx->frame.d[5], &f.disc[1].x_mm, &f.disc[0].y_mm,
                               &f.disc[1].radius_mm, &f.disc[0].change};
            *at[where] = odd[k];
            const eits_fit before = f;
            fit_jointly(ctx, &f);
            if (unchanged(&f, &before))
                continue;
            for (uint32_t i = 0; i < 2; ++i) {
                CHECK(isfinite((double)f.disc[i].x_mm) && isfinite((double)f.disc[i].y_mm) &&
                      isfinite((double)f.disc[i].radius_mm) && isfinite((double)f.disc[i].change));
                CHECK(isfinite((double)f.place_mm2[i][0]) && isfinite((double)f.place_mm2[i][1]) &&
                      isfinite((double)f.place_mm2[i][2]));
            }
            CHECK(where != 0); /* data that are no numbers fit nothing */
        }
    }
}

TEST(data_that_no_touch_makes_leave_the_discs_as_they_were)
{
    eits_context *ctx = open_joint(1);
    stage_shapes(ctx, DISCS, 2, 1);
    uint64_t state = 3;
    for (int i = 0; i < SMALL_FOLDED; ++i)
        ctx->frame.d[i] = (eits_real)(0.1 * small_random(&state));
    eits_fit f = start_near(ctx, DISCS, 2);
    const eits_fit before = f;
    fit_jointly(ctx, &f);
    CHECK(unchanged(&f, &before));
}

static void no_option(eits_context *ctx, eits_fit *f)
{
    (void)f;
    CHANGE_OPTIONS(ctx, o.touch_fit = 7);
}
static void no_fields(eits_context *ctx, eits_fit *f)
{
    (void)ctx, (void)f;
    b.b.c.model.fields.at.data = NULL;
}
static void no_row_errors(eits_context *ctx, eits_fit *f)
{
    (void)ctx, (void)f;
    b.b.c.model.row_errors = (eits_row_errors){0};
}
static void no_differences(eits_context *ctx, eits_fit *f)
{
    (void)ctx, (void)f;
    b.b.c.model.data_kind = EITS_DATA_LOG_RATIO;
}
static void not_tested(eits_context *ctx, eits_fit *f)
{
    (void)ctx;
    f->tested = 0;
}
static void another_instrument(eits_context *ctx, eits_fit *f)
{
    (void)f;
    ctx->reference.far = 1;
}
static void no_touch(eits_context *ctx, eits_fit *f)
{
    (void)ctx;
    f->count = 0;
}

TEST(it_stays_away_where_it_does_not_hold)
{
    static const struct {
        const char *name;
        void (*change)(eits_context *ctx, eits_fit *f);
    } cases[] = {{"no option", no_option},
                 {"no fields", no_fields},
                 {"no row errors", no_row_errors},
                 {"no differences", no_differences},
                 {"not tested", not_tested},
                 {"another instrument", another_instrument},
                 {"no touch", no_touch}};
    EACH_ROW(row, cases) {
        eits_context *ctx = open_joint(1);
        stage_shapes(ctx, DISCS, 2, 1);
        eits_fit f = start_near(ctx, DISCS, 2);
        row->change(ctx, &f);
        const eits_fit before = f;
        fit_jointly(ctx, &f);
        CHECK(unchanged(&f, &before));
        CHECK_EQUAL(f.macs, before.macs);
    }
}

/* From the frame to the touches: without fields or row errors the option changes no bit. */
TEST(a_model_without_what_it_needs_behaves_as_without_the_option)
{
    static const eits_disc two[] = {{-13, 4, 12, R(0.02), 1}, {15, -8, 13, R(0.015), 1}};
    for (int lacks = 0; lacks < 2; ++lacks) {
        eits_touch touches[2][EITS_MAX_TOUCHES];
        uint32_t count[2];
        for (int option = 0; option < 2; ++option) {
            eits_context *ctx = set_up(&b, 1);
            if (lacks == 0) /* ROWE without FLDS */
                fill_row_errors(&b.b.c.model), b.b.c.model.fields.at.data = NULL;
            CHANGE_OPTIONS(ctx, o.touch_fit = option ? EITS_TOUCH_FIT_ALL
                                                     : EITS_TOUCH_FIT_ALL - EITS_TOUCH_FIT_JOINT);
            stage_discs(&b, two, 2);
            CHECK_OK(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, NULL));
            CHECK_OK(eits_find_touches(ctx, touches[option], EITS_MAX_TOUCHES, &count[option]));
        }
        CHECK(count[0] > 0);
        CHECK_EQUAL(count[0], count[1]);
        for (uint32_t k = 0; k < count[0] && k < count[1]; ++k)
            CHECK(small_same_touch(&touches[0][k], &touches[1][k]));
    }
}

RUN_TESTS("joint", dense_bench_close(&b.b))
