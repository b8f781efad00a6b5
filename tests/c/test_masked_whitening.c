/* Rows left out of a frame: the reduction whitened again, against the formula in double; and what
 * it must never do. */
#include "dense_whitening.h"

#include "eitskin/touch.h"

/* Numbers that the core documents: the law of the regularisation, the weight of a lost direction,
 * the margin of the step. */
static const double LOST = 0.01, MARGIN = 0.995, MIN_FRACTION = 0.1, NOISE_FACTOR = 5, MAX = 1;

/* In place, by Gauss-Jordan; the matrix is positive definite. */
static void invert(double a[RANK][RANK])
{
    for (int p = 0; p < RANK; ++p) {
        const double inverse = 1 / a[p][p];
        a[p][p] = 1;
        for (int j = 0; j < RANK; ++j)
            a[p][j] *= inverse;
        for (int i = 0; i < RANK; ++i) {
            const double factor = a[i][p];
            if (i == p)
                continue;
            a[i][p] = 0;
            for (int j = 0; j < RANK; ++j)
                a[i][j] -= factor * a[p][j];
        }
    }
}

/* The metric M = D^-1 (I - mu' (T + mu' I)^-1) D^-1 and its right side D^-1 (T + mu' I)^-1 diag(s)
 * U_o' d_o, with T = diag(s) (U_o' U_o + e I) diag(s) and D_i = s_i w_i, so scaled that no step
 * grows. */
static void by_formula(bench *b, double m[RANK][RANK], double right[RANK])
{
    const eits_context *ctx = b->b.c.ctx;
    const double *p = b->b.d.p;
    double k[RANK][RANK], s[RANK], w[RANK], left = 0;
    for (int f = 0; f < SMALL_FOLDED; ++f)
        left += !b->out[f] / (double)SMALL_FOLDED;
    const double asked =
        fmin(NOISE_FACTOR * (double)(ctx->reference.noise_v / ctx->reference.v0_rms), MAX);
    const double mu = fmax(SMALL_REGULARISATION * fmax(left * left * left, MIN_FRACTION),
                           left * asked),
                 lost = LOST * mu;
    const double scale = MARGIN / (1 + SMALL_REGULARISATION) * (1 + mu) / (1 + lost);
    for (int i = 0; i < RANK; ++i) {
        s[i] = pow(SMALL_DECAY, i);
        w[i] = 1 / sqrt(s[i] * s[i] + SMALL_REGULARISATION);
    }
    for (int i = 0; i < RANK; ++i) {
        for (int j = 0; j < RANK; ++j) {
            double sum = i == j ? lost : 0;
            for (int f = 0; f < SMALL_FOLDED; ++f)
                sum += b->out[f] ? 0 : p[f * RANK + i] / w[i] * p[f * RANK + j] / w[j];
            k[i][j] = s[i] * sum * s[j] + (i == j ? mu : 0);
        }
    }
    invert(k);
    for (int i = 0; i < RANK; ++i) {
        right[i] = 0;
        for (int j = 0; j < RANK; ++j) {
            m[i][j] = scale * ((i == j) - mu * k[i][j]) / (s[i] * w[i] * s[j] * w[j]);
            for (int f = 0; f < SMALL_FOLDED; ++f)
                right[i] += b->out[f] ? 0
                                      : scale * k[i][j] * s[j] * p[f * RANK + j] / w[j] *
                                            (double)ctx->frame.d[f] / (s[i] * w[i]);
        }
    }
}

/* F'F and F'y are the formula's, whichever rows are out; with none out and little noise there is no
 * map. */
static void the_reduction_without_those_rows(double noise)
{
    eits_context *ctx = set_up(&b, WHITENED, 0);
    CHECK(ctx->whitening.possible);
    (void)stage(&b);
    CHECK(!ctx->whitening.form &&
          eits_adjoint(ctx, ctx->frame.y, ctx->solver.adjoint) == ctx->frame.y);
    pretend_noise(ctx, noise);
    for (uint32_t count = 1; count < SMALL_FOLDED; ++count) {
        double m[RANK][RANK], right[RANK];
        leave_out(&b, (5 * count) % SMALL_FOLDED);
        (void)stage(&b);
        CHECK_EQUAL(ctx->whitening.form, EITS_WHITENING_TRIANGLE);
        CHECK_EQUAL(ctx->projection.count, 0);
        by_formula(&b, m, right);
        /* P is stored as float: orthogonal to its rounding */
        const double bound = BOTH_WIDTHS(3e-4, 1e-5);
        for (int j = 0; j < RANK; ++j) {
            double unit[RANK] = {0}, column[RANK];
            eits_real f_unit[STRIDE] = {0};
            unit[j] = 1;
            whitening_column(ctx, unit, 0, column);
            for (int i = 0; i < RANK; ++i)
                f_unit[i] = (eits_real)column[i];
            const eits_real *back = eits_adjoint(ctx, f_unit, ctx->solver.adjoint);
            for (int i = 0; i < RANK; ++i)
                CHECK_NEAR(back[i], m[i][j], bound);
        }
        const eits_real *pulled = eits_adjoint(ctx, ctx->frame.y, ctx->solver.adjoint);
        for (int i = 0; i < RANK; ++i)
            CHECK_NEAR(pulled[i], right[i], bound);
    }
}

/* White noise on the rows that are left, in the correlations: that with all rows and the
 * regularisation that the noise asks for, times the root mean square over that to the power 1.25.
 * Of a sheet that has no more directions than there are probes it is exact, but for what keeps lost
 * directions from being singular. */
static void noise_in_the_correlations(double noise, int directions)
{
    eits_context *ctx = set_up(&b, WHITENED, 0);
    double all = 0;
    for (int i = directions; i < RANK; ++i) {
        ctx->whitening.row_strength[i] = 0;
        for (int j = 0; j < N; ++j)
            b.b.d.s[j * RANK + i] = 0;
    }
    ctx->reference.lambda_noise = R(3.0);
    (void)stage(&b);
    CHECK(ctx->whitening.noise_ratio == 1 && eits_lambda_noise(ctx) == R(3.0));
    pretend_noise(ctx, noise);
    (void)stage(&b);
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k)
        all += energy_of_row(&b, k, !ctx->whitening.form);
    for (uint32_t count = 1; count < 16; ++count) {
        double sum = 0, whole = 0;
        leave_out(&b, (5 * count) % SMALL_FOLDED);
        (void)stage(&b);
        for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
            whole += energy_of_row(&b, k, 1);
            sum += b.out[k] ? 0 : energy_of_row(&b, k, 0);
        }
        const double expected = 3 * sqrt(all / whole) * pow(sum / all, 0.625);
        const double bound = directions > 8 ? (noise > 0 ? 0.06 : 0.04) : 4e-3;
        CHECK_NEAR(eits_lambda_noise(ctx), expected, bound * expected);
    }
}

/* The map is made once for the rows that are out, and what it costs is counted: the Gram matrix of
 * the fewer rows, two factorisations, a solve of triangles, two products for each of 8 probes. */
TEST(what_the_map_costs)
{
    eits_context *ctx = set_up(&b, WHITENED, 0);
    const uint64_t triangle = RANK * (RANK + 1) / 2;
    uint64_t factor = 0, metric = 0;
    for (uint64_t j = 0; j < RANK; ++j) { /* row j, of RANK - j numbers, for each row above it */
        factor += j * (RANK - j);
        metric += (j + 1) * (2 * (RANK - j) - 1);
    }
    for (uint32_t count = 1; count < 16; ++count) {
        uint32_t masked = 0;
        uint64_t first = 0, second = 0;
        leave_out(&b, (5 * count) % SMALL_FOLDED);
        CHECK_OK(eits_frame_stage(ctx, b.frame, SMALL_ROWS, &masked, &first));
        CHECK_OK(eits_frame_stage(ctx, b.frame, SMALL_ROWS, &masked, &second));
        const uint64_t fewer = count <= SMALL_FOLDED - count ? count : SMALL_FOLDED - count;
        CHECK_EQUAL(first - second, (fewer + 2 * 8) * triangle + 2 * factor + metric);
    }
}

TEST(solvers_solve_the_seen_problem)
{
    for (int storage = 0; storage < 4; ++storage) {
        for (int sign = 0; sign < 3; ++sign) {
            small_spec spec = WHITENED;
            spec.storage = (eits_storage)storage;
            spec.lipschitz_factor = 1.0001;
            eits_context *ctx = set_up(&b, spec, storage % 2);
            for (uint32_t k = 0; k < 7; ++k)
                leave_out(&b, 3 * k % 20);
            (void)stage(&b);
            CHECK(ctx->whitening.form);
            CHECK_EQUAL(ctx->projection.count, storage % 2);
            solve_what_is_seen(&b, sign);
        }
    }
}

/* Rows drop out one after another until none is left, with and without the drift: finite
 * throughout, zero where nothing is left, the same bits from both kernels and from a fresh context,
 * and the whole frame's own once all are back. */
TEST(until_nothing_is_left)
{
    for (int project = 0; project < 2; ++project) {
        bench b = {0}, fresh = {0};
        eits_context *ctx = set_up(&b, WHITENED, project);
        eits_real whole[N], image[N], good[SMALL_ROWS], norm = 0;
        memcpy(good, b.frame, sizeof good);
        CHECK_OK(eits_reconstruct(ctx, b.frame, SMALL_ROWS, whole, NULL));
        for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
            leave_out(&b, k);
            CHECK_OK(eits_reconstruct(ctx, b.frame, SMALL_ROWS, image, NULL));
            uint32_t count = 99;
            CHECK_OK(eits_find_touches(ctx, NULL, 0, &count));
            for (int j = 0; j < N; ++j)
                CHECK(eits_is_finite(image[j]));
            const uint32_t left = SMALL_FOLDED - 1 - k;
            CHECK(eits_is_finite(ctx->info.data_norm) && ctx->info.gap >= 0);
            CHECK((ctx->info.data_norm > 0) == (left > (uint32_t)project));
            if (left <= (uint32_t)project)
                CHECK(ctx->info.stop == EITS_STOP_ZERO && ctx->info.nonzeros == 0 && count == 0);
            norm = k == 0 ? ctx->info.data_norm : norm;
            CHECK(ctx->info.data_norm < 4 * norm); /* 1 / sqrt(MIN_FRACTION), and some */
            eits_context *other = set_up(&fresh, WHITENED, project);
            CHECK_OK(eits_use_portable_kernels(other, 1));
            CHECK_OK(eits_reconstruct(other, b.frame, SMALL_ROWS, NULL, NULL));
            CHECK(memcmp(eits_get_image(other), image, sizeof image) == 0 &&
                  memcmp(other->frame.y, ctx->frame.y, RANK * sizeof *ctx->frame.y) == 0);
            dense_bench_close(&fresh.b);
        }
        memcpy(b.frame, good, sizeof good);
        CHECK_OK(eits_reconstruct(ctx, b.frame, SMALL_ROWS, image, NULL));
        CHECK(!ctx->whitening.form && memcmp(whole, image, sizeof whole) == 0);
        dense_bench_close(&b.b);
    }
}

/* The values of rows left out are nothing to the answer, and drift of the gain is still ignored. */
TEST(rows_out_do_not_count)
{
    eits_context *ctx = set_up(&b, WHITENED, 1);
    eits_real seen[2][STRIDE];
    for (int round = 0; round < 2; ++round) {
        for (uint32_t k = 2; k < 20; k += 4) {
            const eits_fold fold = ctx->model->fold[k];
            b.frame[fold.first] = round ? R(1e6) : R(-2);
            b.frame[fold.second == EITS_FOLD_NONE ? fold.first : fold.second] =
                round ? R(3) : R(-1e-9);
            mask_fold(ctx, k);
        }
        (void)stage(&b);
        memcpy(seen[round], ctx->frame.y, sizeof seen[round]);
    }
    CHECK(ctx->whitening.form && memcmp(seen[0], seen[1], sizeof seen[0]) == 0);
    for (int i = 0; i < SMALL_ROWS; ++i)
        b.frame[i] = b.reference[i] * R(1.3);
    (void)stage(&b);
    for (int i = 0; i < RANK; ++i)
        CHECK_NEAR(ctx->frame.y[i], 0, 200 * EPS);
}

static void scale(uint8_t *at, double factor)
{
    float value;
    memcpy(&value, at, 4);
    small_put_f32(at, (float)(value * factor));
}

/* The model in another unit of the data, 1 / factor of the old one, or without saying how it was
 * whitened (factor 0): whether frames with rows left out are whitened again. */
static uint32_t can_whiten_masked_with(double factor, eits_real first_of_whitening[RANK])
{
    small_model made = small_model_make(WHITENED);
    uint8_t *p = small_model_section(&made, "REDU", NULL),
            *form = small_model_section(&made, "WHIT", NULL);
    for (uint32_t i = 0; factor > 0 && i < SMALL_FOLDED * STRIDE; ++i)
        scale(p + 4 * i, factor);
    for (uint32_t i = 0; factor > 0 && i < STRIDE; ++i) {
        scale(form + 16 + 4 * (2 * STRIDE + i), factor * factor);
        scale(form + 16 + 4 * (3 * STRIDE + i), 1 / (factor * factor));
    }
    if (factor > 0)
        scale(form + 4, 1 / factor);
    else
        memcpy(small_model_entry(&made, "WHIT"), "XTRW", 4);
    eits_context *ctx = dense_bench_take(&b.b, made, 0);
    small_reference(ctx->model, 1, b.reference);
    memcpy(b.frame, b.reference, sizeof b.frame);
    b.frame[3] *= R(1.1);
    CHECK_OK(eits_reference_set(ctx, b.reference, SMALL_ROWS));
    leave_out(&b, 4);
    leave_out(&b, 9);
    (void)stage(&b);
    const uint32_t can_whiten_masked = ctx->whitening.form;
    CHECK(can_whiten_masked <= ctx->whitening.possible);
    CHECK(can_whiten_masked ? ctx->projection.count == 1
                            : ctx->projection.count <= 3 && ctx->whitening.noise_ratio == 1);
    CHECK_OK(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, NULL));
    for (uint32_t i = 0; i < RANK && can_whiten_masked; ++i)
        first_of_whitening[i] = ctx->projection.basis[STRIDE + i];
    return can_whiten_masked;
}

/* A model that does not say how it was whitened keeps the projection; the unit of the data does
 * not matter. */
TEST(models_of_another_form)
{
    eits_real plain[RANK], scaled[RANK];
    CHECK(can_whiten_masked_with(1, plain));
    CHECK(!can_whiten_masked_with(0, scaled));
    CHECK(can_whiten_masked_with(1099511627776.0, scaled));
    CHECK(memcmp(plain, scaled, sizeof plain) == 0);
    CHECK(can_whiten_masked_with(1 / 1099511627776.0, scaled));
    CHECK(memcmp(plain, scaled, sizeof plain) == 0);
    small_spec other = WHITENED;
    other.shape = SMALL_RANDOM;
    CHECK(!set_up(&b, other, 0)->whitening.possible);
    other.shape = SMALL_IDENTITY; /* whitened with no regularisation at all */
    eits_context *ctx = set_up(&b, other, 0);
    CHECK(ctx->whitening.possible && ctx->whitening.mu == 0);
    leave_out(&b, 1);
    (void)stage(&b);
    CHECK(ctx->whitening.form);
    for (int i = 0; i < RANK; ++i)
        CHECK_NEAR(ctx->frame.y[i], i == 1 ? 0 : sqrt(MARGIN) * (double)ctx->frame.d[i], 1e-4);
}

int main(void)
{
    the_reduction_without_those_rows(0);
    the_reduction_without_those_rows(3e-3);
    the_reduction_without_those_rows(0.5);
    noise_in_the_correlations(0, RANK);
    noise_in_the_correlations(0, 8);
    noise_in_the_correlations(0.02, RANK);
    noise_in_the_correlations(0.02, 8);
    run_tests();
    dense_bench_close(&b.b);
    return checks_report("observed");
}
