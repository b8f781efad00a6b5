/* The touch test: its linearisation, and the gain of each disc that is left out, compared with
 * dense problems that are solved again; which discs are dropped and which stay. */
#include "evidence_bench.h"

enum { MOST = 24 };

/* ---- the linearisation ---- */

/* A x = b by Gauss's elimination, all of them changed; n at most MOST. */
static void solve_dense(double a[MOST][MOST], double *x, int n)
{
    for (int i = 0; i < n; ++i) {
        for (int j = i + 1; j < n; ++j) {
            const double part = a[j][i] / a[i][i];
            for (int k = i; k < n; ++k)
                a[j][k] -= part * a[i][k];
            x[j] -= part * x[i];
        }
    }
    for (int i = n; i-- > 0;) {
        for (int k = i + 1; k < n; ++k)
            x[i] -= a[i][k] * x[k];
        x[i] /= a[i][i];
    }
}

/* F(s) = here - 2 g's + s'A s of the columns, data and priors as they stand. */
typedef struct square {
    double a[MOST][MOST], g[MOST], off[MOST], here;
} square;

static square written_out(const eits_context *ctx, const eits_answer *answer)
{
    square q = {.here = 0};
    const int n = (int)(answer->count * answer->parameters), p = (int)answer->parameters;
    double *left = dense_copy(ctx->evidence.left, RANK);
    q.here = dense_dot(left, left, RANK);
    for (int i = 0; i < n; ++i) {
        const int k = i / p, own = i % p;
        const double h =
            (double)(own < 3 ? EITS_FREE_PRECISION
                             : (own < 6 ? EITS_SHAPE_PRECISION : EITS_DIPOLE_PRECISION));
        double *column = dense_copy(ctx->evidence.column + STRIDE * i, RANK);
        q.off[i] = own < 3
                       ? 0
                       : (own == 3 ? (double)(answer->disc[k].radius_mm / answer->radius_mm[k]) - 1
                                   : (double)answer->shape[k][own - 4]);
        q.g[i] = dense_dot(column, left, RANK) - h * q.off[i];
        q.here += h * q.off[i] * q.off[i];
        for (int j = 0; j <= i; ++j) {
            double *other = dense_copy(ctx->evidence.column + STRIDE * j, RANK);
            q.a[i][j] = q.a[j][i] = dense_dot(column, other, RANK) + (i == j ? h : 0);
            free(other);
        }
        free(column);
    }
    free(left);
    return q;
}

/* F at its least, and where; parameters of discs that are `out` held at no strength and at their
 * priors' middle. */
static double least_without(const square *q, const eits_answer *answer, const int *out, double *s)
{
    const int n = (int)(answer->count * answer->parameters), p = (int)answer->parameters;
    double a[MOST][MOST], x[MOST], least = q->here;
    int free_ones[MOST], count = 0;
    for (int i = 0; i < n; ++i) {
        s[i] = out[i / p] ? (i % p == 0 ? -1 : -q->off[i]) : 0;
        if (!out[i / p])
            free_ones[count++] = i;
    }
    for (int i = 0; i < count; ++i) {
        x[i] = q->g[free_ones[i]] - dense_dot(q->a[free_ones[i]], s, (size_t)n);
        for (int j = 0; j < count; ++j)
            a[i][j] = q->a[free_ones[i]][free_ones[j]];
    }
    solve_dense(a, x, count);
    for (int i = 0; i < count; ++i)
        s[free_ones[i]] = x[i];
    for (int i = 0; i < n; ++i)
        least += s[i] * (dense_dot(q->a[i], s, (size_t)n) - 2 * q->g[i]);
    return least;
}

/* Three discs of four parameters and two of eight: the step leads to the minimum of F, the matrix
 * is the inverse there, and leaving out one disc after another gives the same as solving again
 * without them. */
TEST(leaving_out_is_solving_again_without)
{
    static const eits_disc third = {2, 19, 11, R(0.01), 1};
    const eits_disc discs[] = {ONE, OTHER, third};
    const double room = BOTH_WIDTHS(3e-3, 1e-8);
    for (uint32_t count = 2; count < 4; ++count) {
        eits_context *ctx = set_up(&b, 1);
        eits_real log_determinant;
        eits_likelihood now;
        uint64_t macs = 0;
        stage_discs(&b, discs, 2);
        CHECK(eits_factor_covariance(ctx, &ctx->scratch, 0, &log_determinant, &macs));
        eits_copy(ctx->evidence.data, ctx->frame.y, STRIDE);
        (void)eits_whiten_errors(ctx, ctx->evidence.data);
        eits_answer answer = answer_of(discs, count, count == 2 ? 8 : 4);
        answer.disc[0].x_mm += 2;
        answer.disc[1].change *= R(0.8);
        CHECK(eits_linearise(ctx, &ctx->scratch, &answer, &now) > 0);
        const square q = written_out(ctx, &answer);
        const int n = (int)now.count;
        int out[3] = {0};
        double s[MOST];
        CHECK_EQUAL(n, count == 2 ? 16 : 12);
        CHECK_NEAR(now.here, q.here, 1e4 * EPS * q.here);
        CHECK_NEAR(now.least, least_without(&q, &answer, out, s), room * q.here);
        const eits_answer whole = answer;
        uint32_t is[3] = {0, 1, 2}; /* which disc of the whole answer each is */
        for (uint32_t round = 0; round < count; ++round) {
            const double before = least_without(&q, &whole, out, s);
            const uint32_t p = answer.parameters, left = (count - round) * p;
            CHECK_EQUAL(now.count, left);
            for (uint32_t i = 0; i < left; ++i) {
                const uint32_t of_i = is[i / p] * p + i % p;
                CHECK_NEAR(now.step[i], s[of_i], 10 * room * (1 + fabs(s[of_i])));
                for (uint32_t j = 0; j < left; ++j) { /* A^-1 A, within the discs that are left */
                    const uint32_t of_j = is[j / p] * p + j % p;
                    double unit = 0;
                    for (uint32_t k = 0; k < left; ++k)
                        unit += (double)ctx->scratch.square[EITS_STRIDE(left) * i + k] *
                                q.a[is[k / p] * p + k % p][of_j];
                    CHECK_NEAR(unit, i == j,
                               30 * room * sqrt(q.a[of_j][of_j] / q.a[of_i][of_i]) + 10 * room);
                }
            }
            for (uint32_t k = 0; k < answer.count; ++k) {
                out[is[k]] = 1;
                const double rise = least_without(&q, &whole, out, s) - before;
                CHECK(rise > 0);
                CHECK_NEAR(eits_linear_rise(&ctx->scratch, &answer, &now, k), rise,
                           10 * room * rise);
                out[is[k]] = 0;
            }
            const uint32_t gone = round == 0 ? 1 : 0;
            CHECK(eits_linear_drop(ctx, &ctx->scratch, &answer, &now, gone) > 0);
            CHECK_EQUAL(answer.count, count - round - 1);
            out[is[gone]] = 1;
            for (uint32_t k = gone; k < answer.count; ++k)
                is[k] = is[k + 1];
            const double least = least_without(&q, &whole, out, s);
            CHECK_NEAR(now.least, least, 10 * room * least);
            if (answer.count == 1) { /* as the other linearised by itself */
                eits_likelihood alone;
                (void)eits_linearise(ctx, &ctx->scratch, &answer, &alone);
                CHECK_NEAR(now.here, alone.here, 1e4 * EPS * q.here);
            }
        }
    }
}

/* From a place and a strength that are off: F falls, and the disc ends nearer; from far off no step
 * is longer than a pixel, a radius stays in its range, a strength keeps its sign. Without discs F
 * is that of the data. */
TEST(refitting_lowers_the_misfit_by_limited_steps)
{
    eits_context *ctx = set_up(&b, 1);
    eits_real log_determinant;
    eits_likelihood now;
    uint64_t macs = 0;
    stage_discs(&b, &ONE, 1);
    CHECK(eits_factor_covariance(ctx, &ctx->scratch, 0, &log_determinant, &macs));
    eits_copy(ctx->evidence.data, ctx->frame.y, STRIDE);
    (void)eits_whiten_errors(ctx, ctx->evidence.data);
    eits_answer near = answer_of(&ONE, 1, EITS_SHAPE_PARAMETERS);
    near.radius_mm[0] = ONE.radius_mm;
    memset(near.shape, 0, sizeof near.shape);
    near.disc[0].x_mm += 2;
    near.disc[0].change *= R(0.8);
    ctx->evidence.columns_most = UINT32_MAX;
    (void)eits_linearise(ctx, &ctx->scratch, &near, &now);
    const eits_real here = now.here;
    CHECK(eits_refit(ctx, &ctx->scratch, &near, &now, 0, R(INFINITY)) > 0);
    CHECK(near.misfit < R(0.05) * here);
    CHECK_NEAR(near.disc[0].x_mm, ONE.x_mm, 0.2);
    CHECK_NEAR(near.disc[0].change, ONE.change, 0.05 * (double)ONE.change);
    for (int k = 0; k < 8; ++k) {
        eits_answer far = answer_of(&ONE, 1, k % 2 ? EITS_SHAPE_PARAMETERS : EITS_PLACE_PARAMETERS);
        far.disc[0].x_mm += (eits_real)(30 * cos(k));
        far.disc[0].y_mm += (eits_real)(30 * sin(k));
        far.disc[0].change *= k < 4 ? R(8.0) : R(0.05);
        const eits_disc before = far.disc[0];
        (void)eits_linearise(ctx, &ctx->scratch, &far, &now);
        const eits_real from = now.here;
        (void)eits_refit(ctx, &ctx->scratch, &far, &now, 0, R(INFINITY));
        const eits_disc *after = &far.disc[0];
        CHECK(far.misfit <= from && after->change > 0);
        CHECK(after->change >= R(0.031) * before.change &&
              after->change <= R(32.1) * before.change);
        CHECK(eits_fabs(after->x_mm - before.x_mm) <= R(30.01) &&
              eits_fabs(after->y_mm - before.y_mm) <= R(30.01) &&
              eits_fabs(after->radius_mm - before.radius_mm) <= R(15.01));
        CHECK(after->radius_mm >= ctx->options.touch_min_radius_mm &&
              after->radius_mm <= ctx->options.touch_max_radius_mm);
    }
    /* F without slopes is F, of any shape; what is hopeless is left as it is, linearised */
    eits_answer oblong = answer_of(&ONE, 1, EITS_SHAPE_PARAMETERS);
    oblong.disc[0].x_mm += 2;
    (void)eits_linearise(ctx, &ctx->scratch, &oblong, &now);
    const eits_answer before = oblong;
    (void)eits_refit(ctx, &ctx->scratch, &oblong, &now, 0, now.least * R(0.5));
    CHECK(now.at_hand && memcmp(oblong.disc, before.disc, sizeof before.disc) == 0);
    (void)eits_refit(ctx, &ctx->scratch, &oblong, &now, 0, R(INFINITY));
    CHECK(oblong.shape[0][0] != 0 && oblong.shape[0][2] != 0);
    (void)eits_linearise(ctx, &ctx->scratch, &oblong, &now);
    CHECK_NEAR(now.here, oblong.misfit, 1000 * EPS * (double)(oblong.misfit + 1));
    eits_answer none = {.count = 0, .parameters = 8};
    (void)eits_refit(ctx, &ctx->scratch, &none, &now, 0, R(INFINITY));
    CHECK_EQUAL(now.at_hand, 0);
    double *data = dense_copy(ctx->evidence.data, RANK);
    CHECK_NEAR(none.misfit, dense_dot(data, data, RANK), 100 * EPS * (double)none.misfit);
    free(data);
}

/* ---- which discs stay ---- */

/* E (or D) of one direction v and of this size, and nothing else. */
static void one_direction(float *packed, const double *v, double size)
{
    for (int i = 0, at = 0; i < RANK; ++i) {
        for (int j = 0; j <= i; ++j)
            packed[at++] = (float)(size * v[i] * v[j]);
    }
}

static double squared(const double *d)
{
    return dense_dot(d, d, SMALL_FOLDED);
}

static void check_what_stays(eits_context *ctx, const eits_fit *f)
{
    eits_fit again = *f;
    eits_real residual[STRIDE];
    CHECK_EQUAL(f->tested, 1);
    eits_copy(residual, f->residual, STRIDE);
    eits_fit_restart(ctx, &ctx->scratch, &again);
    double *expected = dense_copy(again.residual, RANK);
    CHECK_NEAR(dense_greatest_difference(expected, residual, RANK), 0,
               100 * EPS * sqrt((double)f->total));
    free(expected);
    for (uint32_t k = 0; k < f->count; ++k) {
        const eits_real *place = f->place_mm2[k];
        CHECK(f->rise[k] > EITS_TOUCH_EVIDENCE && f->explained[k] > 0);
        CHECK(place[0] > 0 && place[2] > 0 && place[1] * place[1] <= place[0] * place[2]);
    }
}

/* The same two discs. If the model has no errors, both are touches and keep their bits. If its
 * errors look exactly like the weaker one, that disc is dropped. */
TEST(what_model_errors_could_have_made_goes)
{
    for (int errs = 0; errs < 2; ++errs) {
        eits_context *ctx = set_up(&b, 1);
        eits_disc discs[2] = {ONE, OTHER};
        double ghost[RANK] = {0};
        discs[1].change *= R(0.2);
        add_disc(&b, &discs[1], 1, ghost);
        stage_discs(&b, discs, 2);
        one_direction(b.errors, ghost, errs ? 1 / (0.25 * squared(b.d)) : 0);
        eits_fit f = fit_of(ctx, discs, 2);
        eits_test_touches(ctx, &ctx->scratch, &f);
        CHECK_EQUAL(f.count, errs ? 1 : 2);
        check_what_stays(ctx, &f);
        CHECK_NEAR(f.disc[0].x_mm, ONE.x_mm, errs ? 1 : 0);
        CHECK_NEAR(f.disc[0].y_mm, ONE.y_mm, errs ? 1 : 0);
        CHECK(errs || memcmp(f.disc, discs, sizeof discs) == 0);
    }
}

/* The work of the fit is taken from what the test may compute. */
TEST(fit_and_test_share_what_may_be_made)
{
    static const uint32_t left[] = {1000, 120, 80, 1, 0};
    for (uint32_t i = 0; i < sizeof left / sizeof left[0]; ++i) {
        for (uint32_t most = 0; most < 300; most += 50) {
            eits_context *ctx = set_up(&b, 1);
            const uint32_t rank = ctx->model->rank, each = rank * (rank + EITS_COLUMN_ROWS);
            CHANGE_OPTIONS(ctx, o.test_columns = most);
            eits_fit f = fit_of(ctx, &(eits_disc){0}, 0);
            const uint64_t work = eits_fit_limit(ctx, EITS_TEST_WORK), kept = left[i] * each;
            f.macs = work > kept ? work - kept : 0;
            const uint32_t all = (uint32_t)((work - f.macs) / each);
            eits_test_touches(ctx, &ctx->scratch, &f);
            CHECK_EQUAL(ctx->evidence.columns_most, most > 0 && most < all ? most : all);
            f.macs = work + 1;
            eits_test_touches(ctx, &ctx->scratch, &f);
            CHECK_EQUAL(ctx->evidence.columns_most, 0);
        }
    }
}

TEST(halves_of_a_touch_become_one)
{
    eits_context *ctx = set_up(&b, 1);
    eits_disc halves[2] = {ONE, ONE};
    stage_discs(&b, &ONE, 1);
    halves[0].x_mm -= 4;
    halves[1].x_mm += 4;
    halves[0].change = halves[1].change = R(0.5) * ONE.change;
    eits_fit f = fit_of(ctx, halves, 2);
    eits_test_touches(ctx, &ctx->scratch, &f);
    CHECK_EQUAL(f.count, 1);
    check_what_stays(ctx, &f);
    CHECK_NEAR(f.disc[0].x_mm, ONE.x_mm, 1.5);
    CHECK_NEAR(f.disc[0].y_mm, ONE.y_mm, 1.5);
}

/* Data that a drift of the sheet explains and discs do not: the discs that were found in them are
 * dropped, and the true one stays. If the sheet cannot drift so, the data fit badly, and a touch
 * has less confidence. */
TEST(discs_found_in_a_drift_go)
{
    eits_real rise[2];
    for (int drifts = 0; drifts < 2; ++drifts) {
        eits_context *ctx = set_up(&b, 0);
        eits_disc discs[2] = {ONE, OTHER};
        double y[RANK] = {0}, drift[RANK];
        uint64_t state = 29;
        add_disc(&b, &ONE, 1, y);
        const double size = sqrt(dense_dot(y, y, RANK));
        for (int i = 0; i < RANK; ++i) {
            drift[i] = 0.1 * size * small_random(&state);
            y[i] += drift[i];
        }
        stage(&b, y);
        memset(b.errors, 0, sizeof b.errors);
        one_direction(b.drift, drift, drifts);
        discs[1].change *= R(0.1);
        eits_fit f = fit_of(ctx, discs, 2);
        eits_test_touches(ctx, &ctx->scratch, &f);
        CHECK_EQUAL(f.tested, 1);
        CHECK(f.count >= 1);
        rise[drifts] = f.rise[0];
        if (drifts) {
            CHECK_EQUAL(f.count, 1);
            check_what_stays(ctx, &f);
            CHECK_NEAR(f.disc[0].x_mm, ONE.x_mm, 0.5);
            CHECK_NEAR(f.disc[0].y_mm, ONE.y_mm, 0.5);
        }
    }
    CHECK(rise[1] > 10 * rise[0]);
}

/* A frame with rows left out is tested like any other. */
TEST(rows_left_out_do_not_stop_the_test)
{
    eits_context *ctx = set_up(&b, 1);
    const eits_disc discs[2] = {ONE, OTHER};
    CHECK_EQUAL(eits_mask_row(ctx, ctx->model->fold[4].first, 1), EITS_OK);
    CHECK_EQUAL(eits_mask_row(ctx, ctx->model->fold[4].second, 1), EITS_OK);
    stage_discs(&b, &ONE, 1);
    CHECK_EQUAL(ctx->whitening.form, EITS_WHITENING_TRIANGLE);
    eits_fit f = fit_of(ctx, discs, 2);
    eits_test_touches(ctx, &ctx->scratch, &f);
    CHECK(f.tested == 1 && f.count == 1);
    CHECK_NEAR(f.disc[0].x_mm, ONE.x_mm, 0.5);
}

/* No such section, not asked for, numbers out of range: discs stay as they are. */
TEST(what_cannot_be_tested_is_left_alone)
{
    for (int way = 0; way < 6; ++way) {
        eits_context *ctx = set_up(&b, 1);
        eits_disc ghosts[6];
        if (way == 0)
            b.b.c.model.uncertainty.errors = NULL;
        CHANGE_OPTIONS(ctx, o.touch_test = way != 1);
        stage_discs(&b, &ONE, 1);
        for (int i = 0; i < PACKED; ++i) {
            b.errors[i] = way == 2 ? 1e30f : (way == 3 ? 0 : b.errors[i]);
            b.drift[i] = way == 3 ? 0 : b.drift[i];
        }
        if (way == 2) /* the product with |d|^2 overflows a float */
            ctx->frame.d[0] = R(BOTH_WIDTHS(1e15, 1e150));
        if (way == 3) /* no error at all, and a reference of nothing */
            ctx->reference.v0_rms = 0;
        if (way == 4)
            ctx->frame.d[0] = R(NAN);
        for (int k = 0; k < 6; ++k) {
            ghosts[k] = k == 0 ? ONE : OTHER;
            ghosts[k].x_mm -= (eits_real)(4 * k);
        }
        /* 6 discs have 24 parameters, the data are 20 */
        eits_fit f = fit_of(ctx, ghosts, way == 5 ? 6 : 2);
        const eits_fit before = f;
        eits_test_touches(ctx, &ctx->scratch, &f);
        CHECK_EQUAL(f.tested, 0);
        CHECK_EQUAL(f.count, before.count);
        CHECK(memcmp(f.disc, before.disc, sizeof f.disc) == 0);
    }
}

/* Nothing to explain, or nothing that is a number: the test comes to an end, and discs with data of
 * nothing go. */
TEST(zeros_and_nan_come_to_an_end)
{
    for (int way = 0; way < 3; ++way) {
        eits_context *ctx = set_up(&b, way == 1);
        eits_disc discs[2] = {ONE, OTHER};
        discs[0].change *= R(0.1), discs[1].change *= R(0.1); /* beyond it F is rounding */
        double y[RANK] = {0};
        stage(&b, y);
        if (way == 2)
            ctx->frame.y[3] = R(NAN);
        eits_fit f = fit_of(ctx, discs, 2);
        eits_test_touches(ctx, &ctx->scratch, &f);
        CHECK_EQUAL(f.tested, 1);
        CHECK_EQUAL(f.count, way == 2 ? 2 : 0);
        f = fit_of(ctx, discs, 0);
        eits_test_touches(ctx, &ctx->scratch, &f);
        CHECK(f.count == 0 && f.tested == 0);
    }
}

/* Two touches and up to three further discs at random, with errors of several sizes: some discs
 * stay, and both touches if the model's errors are not large. On an instrument that is far from
 * the model one disc stays, whatever its errors could have caused. */
TEST(ghosts_beside_touches_go)
{
    uint64_t state = 41;
    for (int round = 0; round < 48; ++round) {
        eits_context *ctx = set_up(&b, round & 1);
        const int size = round / 2 % 4;
        eits_disc discs[5] = {ONE, OTHER, ONE, OTHER, ONE};
        stage_discs(&b, discs, 2);
        ctx->reference.far = round >= 24;
        for (int i = 0; i < PACKED; ++i) {
            b.errors[i] *= (float)pow(10, size - 1);
            b.drift[i] *= size == 3 ? 0 : (float)pow(10, 2 * size - 3);
        }
        for (int k = 2; k < 5; ++k) {
            discs[k].x_mm += (eits_real)(14 * small_random(&state));
            discs[k].y_mm += (eits_real)(14 * small_random(&state));
            discs[k].change *= (eits_real)(0.2 + 0.1 * small_random(&state));
        }
        eits_fit f = fit_of(ctx, discs, (round < 24 ? 2 : 1) + (uint32_t)round / 3 % 4);
        const uint32_t before = f.count;
        eits_test_touches(ctx, &ctx->scratch, &f);
        CHECK_EQUAL(f.tested, 1);
        /* one disc for two touches may become two */
        CHECK(f.count >= ctx->reference.far && f.count <= (before > 2 ? before : 2));
        for (uint32_t k = 0; k < f.count; ++k)
            CHECK(f.rise[k] > 0 && f.place_mm2[k][0] > 0 && f.place_mm2[k][2] > 0);
        for (uint32_t k = 0; size == 0 && before > 1 && k < 2; ++k) {
            double nearest = 1e9;
            for (uint32_t l = 0; l < f.count; ++l)
                nearest = fmin(nearest, hypot((double)(f.disc[l].x_mm - discs[k].x_mm),
                                              (double)(f.disc[l].y_mm - discs[k].y_mm)));
            CHECK(nearest < 3);
        }
    }
}

/* After a first look at each touch, at most options.test_columns columns are computed. The
 * reported touches have the same numbers as after a complete test, and the count is called
 * uncertain if, and only if, a step was left out. */
TEST(no_more_columns_are_made_than_allowed)
{
    int cut = 0, whole = 0;
    for (int round = 0; round < 6; ++round) {
        uint32_t needs = 0;
        for (uint32_t most = 0; most < 200; most += most < 40 ? 4 : 16) {
            uint64_t state = (uint64_t)(7 + round / 2);
            eits_context *ctx = set_up(&b, round & 1);
            eits_disc discs[4] = {ONE, OTHER, ONE, ONE};
            CHANGE_OPTIONS(ctx, o.test_columns = most, o.diagnostics = EITS_DIAGNOSTIC_CROWDED);
            stage_discs(&b, discs, 2);
            for (int i = 0; i < PACKED; ++i)
                b.errors[i] *= round < 2 ? 0.01f : 1.0f;
            for (int k = 2; k < 4; ++k) {
                discs[k].x_mm += (eits_real)(14 * small_random(&state));
                discs[k].y_mm += (eits_real)(14 * small_random(&state));
                discs[k].change *= R(0.2);
            }
            const uint32_t first = 4 * EITS_PLACE_PARAMETERS;
            eits_fit f = fit_of(ctx, discs, 4);
            eits_test_touches(ctx, &ctx->scratch, &f);
            const uint32_t made = ctx->evidence.columns_made;
            needs = most == 0 ? made : needs;
            CHECK(made >= first && (most == 0 || made <= (most > first ? most : first)));
            CHECK_EQUAL(f.tested, 1);
            CHECK(made == needs || ctx->evidence.spent);
            CHECK(most == 0 ? !ctx->evidence.spent : ctx->evidence.spent || made == needs);
            for (uint32_t k = 0; k < f.count; ++k) {
                CHECK(f.rise[k] > 0 && f.place_mm2[k][0] > 0 && f.place_mm2[k][2] > 0);
                f.pair[k] = -1;
                f.confidence[k] = 1;
            }
            ctx->info.diagnostics = 0;
            eits_check_count(ctx, &f);
            CHECK_EQUAL((ctx->info.diagnostics & EITS_DIAGNOSTIC_CROWDED) != 0,
                        ctx->evidence.spent && f.count > 0);
            cut += most > 0 && ctx->evidence.spent;
            whole += most > 0 && !ctx->evidence.spent;
        }
    }
    CHECK(cut > 20 && whole > 5);
}

/* One wide disc stands for two random discs side by side. If two are found, they lie near the true
 * ones. One disc for one stays one; so do as many discs as are allowed. */
TEST(two_side_by_side_are_split)
{
    uint64_t state = 5;
    int split = 0, left = 0;
    for (int round = 0; round < 60; ++round) {
        eits_context *ctx = set_up(&b, round & 1);
        const double angle = 3 * small_random(&state), apart = 8 + 3 * small_random(&state),
                     c = cos(angle), s = sin(angle);
        eits_disc two[2] = {ONE, ONE}, one = ONE;
        for (int k = 0; k < 2; ++k) {
            two[k].x_mm = (eits_real)((k == 0 ? apart : -apart) * c);
            two[k].y_mm = (eits_real)((k == 0 ? apart : -apart) * s);
            two[k].radius_mm = 7;
        }
        one.x_mm = one.y_mm = 0;
        one.radius_mm = R(11.5);
        one.change = R(0.0125);
        for (int i = 0; i < PACKED; ++i)
            b.errors[i] *= round % 3 == 0 ? 1.0f : 0.001f;
        stage_discs(&b, round < 50 ? two : &one, round < 50 ? 2 : 1);
        ctx->options.max_touches = round % 10 == 9 ? 1 : 8;
        eits_fit f = fit_of(ctx, &one, 1);
        eits_test_touches(ctx, &ctx->scratch, &f);
        CHECK_EQUAL(f.tested, 1);
        CHECK(f.count == 1 || (f.count == 2 && round < 50 && round % 10 < 9));
        left += f.count == 1 && round < 50 && round % 10 < 9;
        split += f.count == 2;
        for (uint32_t k = 0; f.count == 2 && k < 2; ++k) {
            double nearest = 1e9;
            for (uint32_t l = 0; l < 2; ++l)
                nearest = fmin(nearest, hypot((double)(f.disc[l].x_mm - two[k].x_mm),
                                              (double)(f.disc[l].y_mm - two[k].y_mm)));
            CHECK(nearest < 4);
            CHECK(f.rise[k] > 0 && f.place_mm2[k][0] > 0 && f.place_mm2[k][2] > 0);
        }
    }
    CHECK(split > 5);
    CHECK(left > 0);
}

RUN_TESTS("evidence", dense_bench_close(&b.b))
