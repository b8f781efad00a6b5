/* The weights of the touch test, compared with the formulas in double: the covariance of the data's
 * errors and its factor; and the changes of the data per parameter of a disc, and of other shapes.
 */
#include "evidence_bench.h"

#include "frame/fold.h"
#include "frame/whitening.h"

#include <complex.h>

/* ---- the covariance ---- */

/* Sigma as documented, from the frame and the matrices; `w`: the whitening's weights, or NULL. */
static void covariance(const bench *b, int drift, double noise_v, const double *w,
                       double sigma[RANK][RANK])
{
    const eits_context *ctx = b->b.c.ctx;
    double square = 0, along = 0, reference = 0;
    for (int k = 0; k < SMALL_FOLDED; ++k) {
        const double v = (double)ctx->model->v_ref[k];
        square += b->d[k] * b->d[k];
        along += b->d[k] * v;
        reference += v * v;
    }
    if (ctx->options.project_reference)
        square -= along * along / reference;
    const double least = (double)EITS_ERROR_MIN_NOISE * sqrt(reference / SMALL_FOLDED),
                 variance = pow(fmax(noise_v / BOARD, least), 2);
    for (int i = 0, at = 0; i < RANK; ++i) {
        for (int j = 0; j <= i; ++j, ++at) {
            sigma[i][j] = (double)EITS_ERROR_SHARE * square * (double)b->errors[at] +
                          (drift ? (double)b->drift[at] : 0) +
                          (i == j ? variance * energy(b, i) : 0);
            sigma[i][j] *= w == NULL ? 1 : w[i] * w[j];
            sigma[j][i] = sigma[i][j];
        }
    }
}

/* Sigma's element i, j <= i, of the factor R in the rows of evidence.factor: Sigma = R'R. */
static double factored(const eits_context *ctx, int i, int j)
{
    double sum = 0;
    for (int k = 0; k <= j; ++k)
        sum += (double)ctx->evidence.factor[STRIDE * k + i] *
               (double)ctx->evidence.factor[STRIDE * k + j];
    return sum;
}

/* In place: the lower triangle becomes L. Returns log det. */
static double dense_cholesky(double a[RANK][RANK])
{
    double sum = 0;
    for (int i = 0; i < RANK; ++i) {
        for (int j = 0; j <= i; ++j) {
            const double left = a[i][j] - dense_dot(a[i], a[j], (size_t)j);
            a[i][j] = i == j ? sqrt(left) : left / a[j][j];
        }
        sum += 2 * log(a[i][i]);
    }
    return sum;
}

static void solve_lower(double l[RANK][RANK], double *v)
{
    for (int i = 0; i < RANK; ++i)
        v[i] = (v[i] - dense_dot(l[i], v, (size_t)i)) / l[i][i];
}

/* With and without drift, with and without a direction that is ignored, with the model's
 * regularisation and a raised one. */
TEST(the_covariance_is_noise_and_model_errors)
{
    for (int way = 0; way < 8; ++way) {
        const int drift = way & 1, project = way >> 1 & 1, noisy = way >> 2;
        eits_context *ctx = set_up(&b, project);
        const double noise_v = noisy ? 0.02 * (double)ctx->reference.v0_rms : 0;
        ctx->reference.noise_v = (eits_real)noise_v;
        ctx->projection.stale = 1;
        stage_discs(&b, &ONE, 1);
        CHECK_EQUAL(ctx->whitening.form, noisy ? EITS_WHITENING_DIAGONAL : EITS_WHITENING_STORED);
        double sigma[RANK][RANK], *w = noisy ? dense_copy(ctx->whitening.map, RANK) : NULL;
        covariance(&b, drift, noise_v, w, sigma);
        eits_real log_determinant, v[STRIDE];
        uint64_t macs = 0, state = 3;
        CHECK(eits_factor_covariance(ctx, &ctx->scratch, drift, &log_determinant, &macs));
        CHECK_EQUAL(macs, RANK * RANK * RANK / 6 + (project ? RANK * (RANK + 1) / 2 : 0));
        for (int i = 0; i < RANK; ++i) {
            for (int j = 0; j <= i; ++j)
                CHECK_NEAR(factored(ctx, i, j), sigma[i][j],
                           BOTH_WIDTHS(2e-4, 2e-7) * sqrt(sigma[i][i] * sigma[j][j]));
        }
        CHECK_NEAR(log_determinant, dense_cholesky(sigma), BOTH_WIDTHS(0.01, 1e-5));
        double expected[RANK], along[RANK];
        for (int i = 0; i < RANK; ++i) {
            expected[i] = small_random(&state);
            v[i] = (eits_real)expected[i];
            along[i] = project ? (double)ctx->projection.basis[i] : 0;
        }
        solve_lower(sigma, expected);
        solve_lower(sigma, along);
        CHECK_EQUAL(ctx->evidence.drifts, project);
        const double part = dense_dot(expected, along, RANK), whole = dense_dot(along, along, RANK),
                     size = sqrt(dense_dot(expected, expected, RANK));
        for (int i = 0; project && i < RANK; ++i)
            expected[i] -= part / whole * along[i];
        CHECK_EQUAL(eits_whiten_errors(ctx, v), RANK * (RANK + 1) / 2 + (project ? 2 * RANK : 0));
        CHECK_NEAR(dense_greatest_difference(expected, v, RANK), 0, BOTH_WIDTHS(1e-3, 1e-6) * size);
        free(w);
    }
}

/* A frame that is drift of the gain alone has no energy that a touch could have: rounding of either
 * sign is none. */
TEST(a_frame_of_drift_alone_has_errors_of_noise)
{
    eits_context *ctx = set_up(&b, 1);
    eits_real log_determinant, noise_alone;
    uint64_t macs = 0;
    for (int k = 0; k < 20; ++k) {
        double y[RANK] = {0};
        stage(&b, y);
        CHECK(eits_factor_covariance(ctx, &ctx->scratch, 0, &noise_alone, &macs));
        for (int i = 0; i < SMALL_FOLDED; ++i)
            ctx->frame.d[i] = (eits_real)(1 + 0.37 * k) * (eits_real)ctx->model->v_ref[i];
        fill_errors(b.errors, 1e-4);
        CHECK(eits_factor_covariance(ctx, &ctx->scratch, 0, &log_determinant, &macs));
        CHECK(log_determinant >= noise_alone);
        CHECK_NEAR(log_determinant, noise_alone, BOTH_WIDTHS(5, 1e-6));
    }
}

/* ---- shapes ---- */

/* The answer to a disc of 1 S/m that a parameter has moved by so many mm: 1 x, 2 y, 3 radius; 4 and
 * 5 the rim, times cos and sin of twice the angle. */
static void shaped_answer(const bench *b, const eits_disc *disc, int parameter, double by,
                          double *out)
{
    const eits_model *m = &b->b.c.model;
    const double pixel = (double)m->pixel_mm, x = (double)disc->x_mm + (parameter == 1 ? by : 0),
                 y = (double)disc->y_mm + (parameter == 2 ? by : 0);
    memset(out, 0, RANK * sizeof *out);
    for (uint32_t j = 0; j < m->n_pixels; ++j) {
        const double dx = (double)m->origin_x_mm + (m->pixel[j].ix + 0.5) * pixel - x,
                     dy = (double)m->origin_y_mm + (m->pixel[j].iy + 0.5) * pixel - y,
                     twice = 2 * atan2(dy, dx);
        const double further[] = {0, 0, 0, by, by * cos(twice), by * sin(twice)};
        const double radius = (double)disc->radius_mm + further[parameter];
        const double cover = fmin(1, fmax(0, 0.5 + (radius - hypot(dx, dy)) / pixel));
        for (int i = 0; i < RANK; ++i)
            out[i] += cover / (double)m->column_weight[j] * b->b.d.s[j * RANK + (uint32_t)i];
    }
}

/* Rows left out: the errors go through F, and white noise of each row in use through the reduction
 * of the rest, written out row by row. What the factor adds lest a lost direction be singular is a
 * hundredth of the regularisation. */
TEST(the_covariance_of_the_rows_left_is_theirs)
{
    eits_context *ctx = set_up(&b, 0);
    CHECK_EQUAL(eits_mask_row(ctx, ctx->model->fold[4].first, 1), EITS_OK);
    CHECK_EQUAL(eits_mask_row(ctx, ctx->model->fold[4].second, 1), EITS_OK);
    stage_discs(&b, &ONE, 1);
    CHECK_EQUAL(ctx->whitening.form, EITS_WHITENING_TRIANGLE);
    eits_real log_determinant;
    uint64_t macs = 0;
    CHECK(eits_factor_covariance(ctx, &ctx->scratch, 1, &log_determinant, &macs));
    double f[RANK][RANK], noise[RANK][RANK] = {{0}}, square = 0;
    for (int j = 0; j < RANK; ++j) { /* F, column by column */
        eits_real unit[STRIDE] = {0};
        unit[j] = 1;
        (void)eits_whiten(ctx, unit);
        for (int i = 0; i < RANK; ++i)
            f[i][j] = (double)unit[i];
    }
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
        eits_real moved[STRIDE];
        square += (double)ctx->frame.d[k] * (double)ctx->frame.d[k];
        if (ctx->frame.sides[k] == EITS_SIDE_NONE)
            continue;
        ctx->scratch.index[0] = k;
        ctx->scratch.value[0] = 1;
        (void)eits_reduce(ctx, &ctx->scratch, 1, moved);
        for (int i = 0; i < RANK; ++i) {
            for (int j = 0; j < RANK; ++j)
                noise[i][j] += (double)moved[i] * (double)moved[j];
        }
    }
    const double least =
        (double)(EITS_ERROR_MIN_NOISE * ctx->reference.v0_rms * ctx->reference.gain);
    for (int i = 0; i < RANK; ++i) {
        for (int j = 0; j <= i; ++j) {
            double sigma = least * least * noise[i][j];
            for (int k = 0; k < RANK; ++k) {
                for (int l = 0; l < RANK; ++l) {
                    const int at = k > l ? k * (k + 1) / 2 + l : l * (l + 1) / 2 + k;
                    sigma += f[i][k] * f[j][l] *
                             ((double)EITS_ERROR_SHARE * square * (double)b.errors[at] +
                              (double)b.drift[at]);
                }
            }
            CHECK_NEAR(factored(ctx, i, j), sigma,
                       0.01 * factored(ctx, i, i) + BOTH_WIDTHS(1e-9, 1e-12));
        }
    }
}

/* Re or Im of E_drive E_measure, E the small model's fields at the disc's middle, times -volts
 * change area. */
static void dipole_answer(const bench *b, const eits_disc *disc, int part, double *out)
{
    const eits_model *m = &b->b.c.model;
    const double pixel = (double)m->pixel_mm, pi = 3.14159265358979323846,
                 rim = 0.75 * SIDE * pixel;
    const double complex middle = (double)disc->x_mm + I * (double)disc->y_mm;
    double complex field[SMALL_ELECTRODES];
    for (int e = 0; e < SMALL_ELECTRODES; ++e)
        field[e] = rim / 20 / conj(middle - rim * cexp(2 * pi * I * e / SMALL_ELECTRODES));
    const double radius = (double)disc->radius_mm,
                 moment = (double)disc->change * pi * (radius * radius + pixel * pixel / 12);
    memset(out, 0, RANK * sizeof *out);
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
        const uint8_t *row = m->protocol + 4 * (size_t)m->fold[k].first;
        const double complex answer = (field[row[0]] - field[row[1]]) *
                                      (field[row[2]] - field[row[3]]) * -(double)m->fields.volts *
                                      moment;
        for (int i = 0; i < RANK; ++i)
            out[i] += b->b.d.p[k * RANK + (uint32_t)i] * (part ? cimag(answer) : creal(answer));
    }
}

/* All in Sigma's metric. */
TEST(shapes_move_the_data_as_ellipses_do)
{
    eits_context *ctx = set_up(&b, 0);
    eits_real log_determinant;
    uint64_t macs = 0;
    stage_discs(&b, &ONE, 1);
    CHECK(eits_factor_covariance(ctx, &ctx->scratch, 0, &log_determinant, &macs));
    const eits_answer answer = answer_of(&ONE, 1, EITS_SHAPE_PARAMETERS);
    const double change = (double)ONE.change, radius = (double)ONE.radius_mm, step = 1e-3;
    double expected[EITS_SHAPE_PARAMETERS][RANK], left[RANK] = {0};
    for (int p = 0; p < EITS_SHAPE_PARAMETERS; ++p) {
        double up[RANK], down[RANK];
        eits_real v[STRIDE];
        const double unit[] = {1, 6, 6, 0.9 * radius, radius, radius};
        if (p >= EITS_EDGE_PARAMETERS) {
            dipole_answer(&b, &ONE, p - EITS_EDGE_PARAMETERS, expected[p]);
        } else {
            shaped_answer(&b, &ONE, p, step, up);
            shaped_answer(&b, &ONE, p, -step, down);
            for (int i = 0; i < RANK; ++i)
                expected[p][i] =
                    change * unit[p] *
                    (p == 0 ? 0.5 * (up[i] + down[i]) : (up[i] - down[i]) / (2 * step));
        }
        for (int i = 0; i < RANK; ++i)
            v[i] = (eits_real)expected[p][i];
        (void)eits_whiten_errors(ctx, v);
        for (int i = 0; i < RANK; ++i)
            expected[p][i] = (double)v[i];
    }
    eits_zero(ctx->evidence.left, STRIDE);
    CHECK(eits_shape_columns(ctx, &ctx->scratch, &answer, 0) > 0);
    for (int p = 0; p < EITS_SHAPE_PARAMETERS; ++p) {
        const double size = sqrt(dense_dot(expected[p], expected[p], RANK)),
                     part = p == 0 ? 1 : (p < 4 ? 0 : (double)answer.shape[0][p - 4]);
        CHECK(size > 0);
        /* dipoles to what halves and a polynomial make of the fields */
        CHECK_NEAR(dense_greatest_difference(expected[p], ctx->evidence.column + STRIDE * p, RANK),
                   0, (p < EITS_EDGE_PARAMETERS ? BOTH_WIDTHS(1e-3, 1e-6) : 2e-3) * size);
        for (int i = 0; i < RANK; ++i)
            left[i] -= part * (double)ctx->evidence.column[STRIDE * p + i];
    }
    CHECK_NEAR(dense_greatest_difference(left, ctx->evidence.left, RANK), 0,
               1000 * EPS * sqrt(dense_dot(left, left, RANK)));
}

/* A disc has eight parameters if there is room, otherwise four, otherwise none; it has dipoles if
 * the model has fields. */
TEST(parameters_fit_the_data)
{
    eits_context *ctx = set_up(&b, 0);
    const uint32_t expected[] = {8, 8, 8, 4, 4, 4, 0};
    for (uint32_t count = 0; count < 7; ++count)
        CHECK_EQUAL(eits_shape_parameters(ctx, count), expected[count]);
    b.b.c.model.data_kind = EITS_DATA_NORMALISED;
    CHECK_EQUAL(eits_shape_parameters(ctx, 1), 6);
}

RUN_TESTS("covariance", dense_bench_close(&b.b))
