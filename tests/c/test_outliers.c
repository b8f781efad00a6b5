/* Outliers of a frame and the rows that are left out because of them; outliers in reference frames.
 */
#include "spoiled_frame.h"

TEST(a_clean_frame_has_no_diagnostics)
{
    for (int known = 0; known < 2; ++known) {
        eits_context *ctx = set_up(&b, known);
        reconstruct(&b);
        CHECK_EQUAL(ctx->info.diagnostics, 0);
        CHECK_EQUAL(ctx->info.masked, 0);
        CHECK(ctx->reference.outliers == 0 && (ctx->reference.noise_v > 0) == known);
    }
}

/* The small model's P is arbitrary, so that no row predicts another: both sides of a fold are left
 * out. The noise is known, or estimated from all folds. */
TEST(one_outlier_is_left_out)
{
    for (int known = 0; known < 2; ++known) {
        for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
            eits_context *ctx = set_up(&b, known);
            const eits_fold fold = b.on.c.model.fold[k];
            CHECK(!ctx->range.known);
            b.frame[fold.first] *= R(1.3);
            reconstruct(&b);
            if (fold.second == EITS_FOLD_NONE) {
                CHECK_EQUAL(ctx->info.outliers, 0);
            } else {
                CHECK_EQUAL(ctx->info.diagnostics, EITS_DIAGNOSTIC_OUTLIER);
                CHECK_EQUAL(ctx->info.outliers, 2);
                CHECK_EQUAL(ctx->info.masked, 2);
                CHECK(ctx->rows.unusable[fold.first] == EITS_ROW_OUTLIER &&
                      ctx->rows.unusable[fold.second] == EITS_ROW_OUTLIER);
            }
            look_for(ctx, EITS_DIAGNOSTICS_ALL & ~(uint32_t)EITS_DIAGNOSTIC_OUTLIER);
            reconstruct(&b);
            CHECK_EQUAL(ctx->info.masked, 0);
        }
    }
}

/* Many folds whose sides disagree: those that share an electrode leave with it; those that
 * share none are no network's. */
TEST(many_outliers)
{
    eits_context *ctx = set_up(&b, 1);
    look_for(ctx, EITS_DIAGNOSTICS_ALL);
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
        const uint32_t i = b.on.c.model.fold[k].first;
        b.frame[i] *= row_uses(ctx, i, 5) ? R(1.2) : R(1);
    }
    reconstruct(&b);
    CHECK_EQUAL(ctx->info.diagnostics, EITS_DIAGNOSTIC_ELECTRODE_NOISY);
    CHECK_EQUAL(ctx->info.noisy_electrodes, 1u << 5);
    for (uint32_t i = 0; i < SMALL_ROWS; ++i)
        CHECK_EQUAL(ctx->rows.unusable[i], row_uses(ctx, i, 5) ? EITS_ROW_NOISY : 0);
    look_for(ctx, EITS_DIAGNOSTICS_ALL & ~(uint32_t)EITS_DIAGNOSTIC_ELECTRODE_NOISY);
    reconstruct(&b);
    CHECK_EQUAL(ctx->info.masked, 0);
    memcpy(b.frame, b.untouched[0], sizeof b.frame);
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k)
        b.frame[b.on.c.model.fold[k].first] *= k % 2 == 0 ? R(1.2) : R(0.9);
    look_for(ctx, EITS_DIAGNOSTICS_ALL);
    reconstruct(&b);
    CHECK((ctx->info.diagnostics & EITS_DIAGNOSTIC_MODEL_MISMATCH) != 0 && ctx->info.masked == 0);
}

/* One reading of any of the reference frames: left out, and the reference is as without it. */
TEST(an_outlier_in_the_reference)
{
    for (int at = 0; at < UNTOUCHED; ++at) {
        eits_context *ctx = set_up(&b, 1);
        const eits_real noise = ctx->reference.noise_v, lambda_noise = ctx->reference.lambda_noise;
        const uint32_t row = at % 3 ? b.on.c.model.fold[at].second : b.on.c.model.fold[at].first;
        b.untouched[at][row] += R(0.5);
        CHECK_OK(eits_reference_begin(ctx, UNTOUCHED));
        for (int k = 0; k < UNTOUCHED; ++k) {
            CHECK_OK(eits_reference_add(ctx, b.untouched[k], SMALL_ROWS));
            CHECK_EQUAL(ctx->reference.count, k + 1);
        }
        CHECK_OK(eits_reference_finish(ctx));
        CHECK_EQUAL(ctx->reference.outliers, 1);
        CHECK_NEAR(eits_fabs(ctx->reference.v0[row]), 1, 2e-3);
        CHECK_NEAR(ctx->reference.noise_v, noise, 0.05 * (double)noise);
        CHECK_NEAR(ctx->reference.lambda_noise, lambda_noise, 0.3 * (double)lambda_noise);
        for (uint32_t i = 0; i < SMALL_ROWS; ++i)
            CHECK_EQUAL(ctx->rows.masked[i], 0);
        look_for(ctx, 0);
        LEARN(ctx, UNTOUCHED, b.untouched);
        CHECK(ctx->reference.outliers == 0 && ctx->reference.noise_v > 5 * noise);
    }
}

/* Small voltages beside a row that is left out and reads nonsense: outliers are judged by the rows
 * in use alone, and so is the unit that deviations are summed in. */
TEST(an_outlier_beside_an_unused_row)
{
    eits_context *ctx = set_up(&b, 0);
    const uint32_t unused = b.on.c.model.fold[1].first;
    b.untouched[4][b.on.c.model.fold[3].first] += R(0.5);
    CHECK_OK(eits_mask_row(ctx, unused, 1));
    CHECK_OK(eits_reference_begin(ctx, UNTOUCHED));
    for (int k = 0; k < UNTOUCHED; ++k) {
        for (uint32_t i = 0; i < SMALL_ROWS; ++i)
            b.untouched[k][i] *= R(1e-4);
        b.untouched[k][unused] = R(1e20);
        CHECK_OK(eits_reference_add(ctx, b.untouched[k], SMALL_ROWS));
    }
    CHECK_OK(eits_reference_finish(ctx));
    CHECK_EQUAL(ctx->reference.outliers, 1);
    CHECK(ctx->reference.m2_unit == R(0x1p-14)); /* the power of two up to 1e-4 V */
}

/* More readings of a reference frame than outliers are: it counts as it is. */
TEST(reference_frame_of_another_kind)
{
    eits_context *ctx = set_up(&b, 1);
    for (uint32_t count = 1; count <= EITS_OUTLIER_MAX + 1; ++count) {
        b.untouched[5][b.on.c.model.fold[count].first] += R(0.5);
        LEARN(ctx, UNTOUCHED, b.untouched);
        CHECK_EQUAL(ctx->reference.outliers, count <= EITS_OUTLIER_MAX ? count : 0);
        CHECK((ctx->reference.noise_v < R(2e-3)) == (count <= EITS_OUTLIER_MAX));
    }
}

TEST(medians)
{
    uint64_t state = 5;
    for (uint32_t n = 1; n < 40; ++n) {
        eits_real v[40], sorted[40];
        for (uint32_t k = 0; k < n; ++k)
            sorted[k] = (eits_real)((int)(5 * small_random(&state)));
        for (uint32_t k = 0; k < n; ++k) {
            memcpy(v, sorted, sizeof v);
            const eits_real found = eits_kth(v, n, k);
            uint32_t below = 0, up_to = 0;
            for (uint32_t l = 0; l < n; ++l) {
                below += sorted[l] < found;
                up_to += sorted[l] <= found;
            }
            CHECK(below <= k && k < up_to);
        }
    }
}

TEST(options_and_names)
{
    eits_context *ctx = set_up(&b, 0);
    eits_options o = *eits_get_options(ctx);
    CHECK_EQUAL(o.diagnostics, EITS_DIAGNOSTICS_ALL);
    o.diagnostics = EITS_DIAGNOSTICS_ALL + 1;
    CHECK_REFUSED(eits_set_options(ctx, &o));
    uint32_t all = 0;
    for (uint32_t bit = 1; bit <= EITS_DIAGNOSTICS_ALL; bit <<= 1) {
        CHECK(strcmp(eits_diagnostic_text((eits_diagnostic)bit), "unknown diagnostic") != 0);
        all |= bit;
    }
    CHECK_EQUAL(all, EITS_DIAGNOSTICS_ALL);
    CHECK(strcmp(eits_diagnostic_text((eits_diagnostic)0), "unknown diagnostic") == 0);
}

RUN_TESTS("diagnostics", dense_bench_close(&b.on))
