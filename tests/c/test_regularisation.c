/* The regularisation of the whitening, raised with the noise of the reference: the whitening
 * against the formula in double, the noise that it lets through, and when nothing is raised. */
#include "dense_whitening.h"

#include "eitskin/frame.h"
#include "eitskin/touch.h"
#include "frame/whitening.h"

static const double FACTOR = 5, MAX = 1;

static void choose_factor(eits_context *ctx, double factor)
{
    CHANGE_OPTIONS(ctx, o.regularisation_noise_factor = (eits_real)factor);
}

/* D_i of the formula; the strongest direction's is 1. */
static double weight(int i, double mu)
{
    const double square = pow(SMALL_DECAY, 2 * i);
    return sqrt((square + SMALL_REGULARISATION) / (square + mu) * (1 + mu) /
                (1 + SMALL_REGULARISATION));
}

/* F is D, and y is D P d, of the regularisation that the noise asks for. */
TEST(the_formula)
{
    const double noises[] = {2.1e-3, 0.01, 0.1, 0.9};
    for (size_t n = 0; IN_TABLE(n, noises); ++n) {
        /* P and S are stored as float */
        const double mu = fmin(FACTOR * noises[n], MAX), bound = BOTH_WIDTHS(1e-5, 1e-6);
        eits_context *ctx = set_up(&b, WHITENED, 0);
        (void)stage(&b);
        double *stored = dense_copy(ctx->frame.y, RANK);
        ctx->projection.basis[STRIDE + RANK] = R(NAN); /* as a map that overflowed may leave it */
        pretend_noise(ctx, noises[n]);
        (void)stage(&b);
        CHECK_EQUAL(ctx->whitening.form, EITS_WHITENING_DIAGONAL);
        CHECK_NEAR(ctx->whitening.mu_in_force, mu, 1e-5 * mu);
        CHECK_EQUAL(eits_adjoint_macs(ctx), RANK);
        CHECK_EQUAL(eits_forward_macs(ctx), RANK);
        eits_real v[STRIDE];
        for (int i = 0; i < STRIDE; ++i)
            v[i] = 1; /* also in the padding, which no map may bring in */
        eits_real once[STRIDE];
        memcpy(once, v, sizeof once);
        CHECK_EQUAL(eits_whiten(ctx, once), RANK);
        const eits_real *back = eits_adjoint(ctx, v, ctx->solver.adjoint);
        for (int i = 0; i < STRIDE; ++i) {
            CHECK_NEAR(once[i], i < RANK ? weight(i, mu) : 0, bound);
            CHECK(once[i] <= 1 && back[i] == once[i]);
        }
        for (int i = 0; i < RANK; ++i)
            CHECK_NEAR(ctx->frame.y[i], weight(i, mu) * stored[i], bound * fabs(stored[i]));
        free(stored);
    }
}

/* White noise on all rows: in the correlations, as a root mean square over S's columns, and in
 * |y|^2. */
TEST(noise_through_it)
{
    eits_context *ctx = set_up(&b, WHITENED, 0);
    const double stored = (double)ctx->whitening.energy;
    double energy = 0, sum = 0, whole = 0;
    ctx->reference.lambda_noise = R(3.0);
    pretend_noise(ctx, 0.01);
    (void)stage(&b);
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
        for (int i = 0; i < RANK; ++i)
            energy += pow(weight(i, 0.05) * b.b.d.p[k * RANK + (uint32_t)i], 2);
        sum += energy_of_row(&b, k, 0);
        whole += energy_of_row(&b, k, 1);
    }
    CHECK_NEAR(eits_lambda_noise(ctx), 3 * sqrt(sum / whole), 1e-4);
    CHECK(sum < 0.7 * whole && energy < 0.7 * stored);
    CHECK_NEAR(ctx->whitening.energy, energy, 1e-4 * energy);
    leave_out(&b, 3);
    (void)stage(&b);
    CHECK_NEAR(ctx->whitening.energy, stored, 0);
}

TEST(solvers_solve_the_seen_problem)
{
    for (int storage = 0; storage < 4; ++storage) {
        for (int sign = 0; sign < 3; ++sign) {
            small_spec spec = WHITENED;
            spec.storage = (eits_storage)storage;
            spec.lipschitz_factor = 1.0002; /* the small model finds it from below */
            eits_context *ctx = set_up(&b, spec, storage % 2);
            pretend_noise(ctx, storage < 2 ? 0.02 : 0.1);
            (void)stage(&b);
            CHECK_EQUAL(ctx->whitening.form, EITS_WHITENING_DIAGONAL);
            CHECK_EQUAL(ctx->projection.count, storage % 2);
            solve_what_is_seen(&b, sign);
        }
    }
}

static void reconstruct(bench *b, eits_real image[N])
{
    CHECK_OK(eits_reconstruct(b->b.c.ctx, b->frame, SMALL_ROWS, image, NULL));
}

/* The model's own bits where nothing is known of the noise, or no more is asked for than there is;
 * raised ones are the same from all kernels, and go with the option. */
TEST(only_where_asked_for)
{
    bench b = {0}, other = {0};
    eits_real plain[N], image[N], raised[N];
    eits_context *ctx = set_up(&b, WHITENED, 1);
    reconstruct(&b, plain);
    CHECK(ctx->info.regularisation == ctx->whitening.mu);
    CHECK_NEAR(ctx->whitening.mu, SMALL_REGULARISATION, 1e-5);
    const double little[] = {1e-4, 0.999 * SMALL_REGULARISATION / FACTOR};
    for (size_t k = 0; IN_TABLE(k, little); ++k) {
        pretend_noise(ctx, little[k]);
        reconstruct(&b, image);
        CHECK(!ctx->whitening.form && ctx->info.regularisation == ctx->whitening.mu &&
              memcmp(image, plain, sizeof image) == 0);
    }
    pretend_noise(ctx, 1.002 * SMALL_REGULARISATION / FACTOR);
    reconstruct(&b, image);
    CHECK_EQUAL(ctx->whitening.form, EITS_WHITENING_DIAGONAL);
    CHECK(memcmp(image, plain, sizeof image) != 0);
    pretend_noise(ctx, 0.02);
    reconstruct(&b, raised);
    CHECK_NEAR(ctx->info.regularisation, 0.1, 1e-5);
    choose_factor(ctx, 0);
    reconstruct(&b, image);
    CHECK(memcmp(image, plain, sizeof image) == 0);
    choose_factor(ctx, FACTOR);
    reconstruct(&b, image);
    CHECK(memcmp(image, raised, sizeof image) == 0);
    choose_factor(ctx, 1e29);
    reconstruct(&b, image);
    CHECK(ctx->info.regularisation == R(1.0));
    eits_context *portable = set_up(&other, WHITENED, 1);
    pretend_noise(portable, 0.02);
    CHECK_OK(eits_use_portable_kernels(portable, 1));
    reconstruct(&other, image);
    CHECK(memcmp(image, raised, sizeof image) == 0);
    /* of one frame nothing is known of the noise */
    CHECK_OK(eits_reference_set(ctx, b.reference, SMALL_ROWS));
    reconstruct(&b, image);
    CHECK(memcmp(image, plain, sizeof image) == 0);
    dense_bench_close(&other.b);
    dense_bench_close(&b.b);
}

/* Models of another form stay as they are, and so do those whose numbers overflow; one without a
 * regularisation gets one. */
TEST(models_of_other_forms)
{
    small_spec spec = WHITENED;
    spec.shape = SMALL_RANDOM;
    eits_context *ctx = set_up(&b, spec, 0);
    pretend_noise(ctx, 0.1);
    (void)stage(&b);
    reconstruct(&b, NULL);
    CHECK(!ctx->whitening.form && ctx->info.regularisation == 0);
    spec.shape =
        SMALL_IDENTITY; /* whitened with no regularisation at all; all directions are alike */
    ctx = set_up(&b, spec, 0);
    pretend_noise(ctx, 0.1);
    reconstruct(&b, NULL);
    CHECK_EQUAL(ctx->whitening.form, EITS_WHITENING_DIAGONAL);
    CHECK_NEAR(ctx->info.regularisation, 0.5, 1e-6);
    for (int i = 0; i < RANK; ++i)
        CHECK_NEAR(ctx->frame.y[i], ctx->frame.d[i], 1e-5);
    /* as of a row of P that is far greater than the others */
    ctx->whitening.row_scale[2] = R(BOTH_WIDTHS(1e-20, 1e-160));
    pretend_noise(ctx, 0.1);
    reconstruct(&b, NULL);
    CHECK(!ctx->whitening.form && ctx->whitening.noise_ratio == 1 && ctx->info.regularisation == 0);
}

/* The reference frames' own noise raises the regularisation for the second half of them already,
 * and lambda_noise is as with the model's. */
TEST(learned_with_it)
{
    enum { UNTOUCHED = 4 };
    eits_context *ctx = set_up(&b, WHITENED, 0);
    eits_real untouched[UNTOUCHED][SMALL_ROWS], mean[SMALL_ROWS];
    uint64_t state = 5;
    double square = 0;
    for (int k = 0; k < UNTOUCHED; ++k) {
        for (int i = 0; i < SMALL_ROWS; ++i)
            untouched[k][i] = b.reference[i] + (eits_real)(0.03 * small_random(&state));
    }
    for (int i = 0; i < SMALL_ROWS; ++i) {
        mean[i] = R(0.5) * (untouched[0][i] + untouched[1][i]);
        square += pow((double)(untouched[1][i] - untouched[0][i]), 2) / 2;
        /* gives no information; only the third does */
        untouched[3][i] = (mean[i] + mean[i] + untouched[2][i]) / 3;
    }
    LEARN(ctx, UNTOUCHED, untouched);
    const double learned = (double)ctx->reference.lambda_noise, noise = sqrt(square / SMALL_ROWS);
    CHECK_OK(eits_reference_set(ctx, mean, SMALL_ROWS));
    pretend_noise(ctx, noise / (double)ctx->reference.v0_rms);
    memcpy(b.frame, untouched[2], sizeof b.frame);
    (void)stage(&b);
    CHECK_EQUAL(ctx->whitening.form, EITS_WHITENING_DIAGONAL);
    double *back = dense_copy(eits_adjoint(ctx, ctx->frame.y, ctx->solver.adjoint), RANK), max = 0;
    for (int j = 0; j < N; ++j)
        max = fmax(max, fabs(dense_dot(b.b.d.s + j * RANK, back, RANK)));
    CHECK_NEAR(learned, max / (double)ctx->whitening.noise_ratio, 1e-4 * learned);
    CHECK(ctx->whitening.noise_ratio < R(0.8));
    free(back);
}

RUN_TESTS("floor", dense_bench_close(&b.b))
