/* The reference frame: from one frame, and learned from reference frames. */
#include "check.h"
#include "dense.h"
#include "small_model.h"

#include "base/vec.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { UNTOUCHED = 20 };

typedef struct bench {
    small_model made;
    small_context c;
    eits_real frame[SMALL_ROWS];
} bench;

static bench b;

static void tear_down(bench *b)
{
    small_context_close(&b->c);
    small_model_free(&b->made);
}

static eits_context *set_up(bench *b)
{
    tear_down(b);
    b->made = small_model_make((small_spec){.rank = 12, .side = 4});
    small_context_open(&b->c, &b->made, 0);
    return b->c.ctx;
}

/* Frames around `gain` times the model's reference: relative noise `noise`, each channel with an
 * own error of 1 %. */
static void reference_frame(bench *b, double gain, double noise, uint64_t *state)
{
    uint64_t channels = 4;
    small_reference(&b->c.model, gain, b->frame);
    for (uint32_t i = 0; i < SMALL_ROWS; ++i)
        b->frame[i] *=
            (eits_real)((1 + 0.01 * small_random(&channels)) * (1 + noise * small_random(state)));
}

TEST(gain_and_correlation)
{
    eits_context *ctx = set_up(&b);
    static const double gains[] = {1, 2.5, -0.75, 1e-6, -1e6};
    for (size_t g = 0; g < sizeof gains / sizeof gains[0]; ++g) {
        small_reference(&b.c.model, gains[g], b.frame);
        CHECK_EQUAL(eits_reference_set(ctx, b.frame, SMALL_ROWS), EITS_OK);
        double squares = 0;
        for (uint32_t k = 0; k < SMALL_FOLDED; ++k)
            squares += pow((double)b.c.model.v_ref[k], 2);
        CHECK_NEAR(ctx->reference.gain * (eits_real)gains[g], 1, 8 * EPS);
        CHECK_NEAR(ctx->reference.correlation, gains[g] > 0 ? 1 : -1, 8 * EPS);
        CHECK_NEAR(ctx->reference.v0_rms / (eits_real)fabs(gains[g]), sqrt(squares / SMALL_FOLDED),
                   8 * EPS);
        CHECK(ctx->reference.noise_v == 0 && ctx->reference.lambda_noise == 0);
        CHECK(ctx->reference.ready == 1 && ctx->reference.count == 1);
    }
    uint64_t state = 3;
    double vv = 0, rr = 0, vr = 0; /* an arbitrary frame, against the formulas */
    for (uint32_t i = 0; i < SMALL_ROWS; ++i)
        b.frame[i] = (eits_real)small_random(&state);
    CHECK_EQUAL(eits_reference_set(ctx, b.frame, SMALL_ROWS), EITS_OK);
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
        const eits_fold fold = b.c.model.fold[k];
        const double first = (double)b.frame[fold.first], r = (double)b.c.model.v_ref[k];
        const double v = fold.second == EITS_FOLD_NONE
                             ? first
                             : 0.5 * (first + fold.sign * (double)b.frame[fold.second]);
        vv += v * v, rr += r * r, vr += v * r;
    }
    CHECK_NEAR(ctx->reference.correlation, vr / sqrt(vv * rr), 20 * EPS);
    CHECK_NEAR(ctx->reference.gain, copysign(sqrt(rr / vv), vr), 20 * EPS * sqrt(rr / vv));
    CHECK_NEAR(ctx->reference.v0_rms, sqrt(vv / SMALL_FOLDED), 20 * EPS);
}

TEST(refused_frames)
{
    eits_context *ctx = set_up(&b);
    small_reference(&b.c.model, 1, b.frame);
    CHECK_EQUAL(eits_reference_set(NULL, b.frame, SMALL_ROWS), EITS_E_ARGUMENT);
    CHECK_EQUAL(eits_reference_set(ctx, NULL, SMALL_ROWS), EITS_E_ARGUMENT);
    CHECK_EQUAL(eits_reference_set(ctx, b.frame, SMALL_ROWS - 1), EITS_E_FRAME_LENGTH);
    CHECK_EQUAL(eits_reference_set(ctx, b.frame, SMALL_ROWS + 1), EITS_E_FRAME_LENGTH);
    CHECK_EQUAL(eits_reference_set(ctx, b.frame, 0), EITS_E_FRAME_LENGTH);
    CHECK(!ctx->reference.ready);
    for (int i = 0; i < SMALL_ROWS; ++i) {
        small_reference(&b.c.model, 1, b.frame);
        b.frame[i] = (eits_real)(i % 3 == 0 ? NAN : (i % 3 == 1 ? INFINITY : -INFINITY));
        CHECK_EQUAL(eits_reference_set(ctx, b.frame, SMALL_ROWS), EITS_E_FRAME_ROWS);
    }
    small_reference(&b.c.model, 1, b.frame);
    b.frame[7] = (eits_real)INFINITY;
    CHECK(!ctx->reference.ready);
    CHECK_EQUAL(eits_mask_row(ctx, 7, 1), EITS_OK);
    /* masked, it does not matter */
    CHECK_EQUAL(eits_reference_set(ctx, b.frame, SMALL_ROWS), EITS_OK);
    CHECK_NEAR(ctx->reference.gain, 1, 8 * EPS);
    CHECK_EQUAL(eits_mask_row(ctx, 7, 0), EITS_OK);
    CHANGE_OPTIONS(ctx, o.saturation_v = R(1.2));
    small_reference(&b.c.model, 1, b.frame); /* its greatest number is above 1.2 */
    CHECK_EQUAL(eits_reference_set(ctx, b.frame, SMALL_ROWS), EITS_E_FRAME_ROWS);
    small_reference(&b.c.model, -1, b.frame);
    CHECK_EQUAL(eits_reference_set(ctx, b.frame, SMALL_ROWS), EITS_E_FRAME_ROWS);
    small_reference(&b.c.model, 0.7, b.frame);
    CHECK_EQUAL(eits_reference_set(ctx, b.frame, SMALL_ROWS), EITS_OK);
    b.frame[3] = R(-1.2); /* at the limit counts as beyond it */
    CHECK_EQUAL(eits_reference_set(ctx, b.frame, SMALL_ROWS), EITS_E_FRAME_ROWS);
}

/* A reference that cannot be one leaves the old one in force, to the bit. */
TEST(all_zero_keeps_the_old)
{
    eits_context *ctx = set_up(&b);
    eits_real frame[SMALL_ROWS], wrong[SMALL_ROWS] = {0}, before[16], after[16], v0[SMALL_ROWS];
    uint64_t state = 8;
    CHECK_EQUAL(eits_reference_set(ctx, wrong, SMALL_ROWS), EITS_E_FRAME_ZERO);
    CHECK(!ctx->reference.ready);
    CHECK_EQUAL(eits_reconstruct(ctx, wrong, SMALL_ROWS, NULL, NULL), EITS_E_NO_REFERENCE);
    CHECK_EQUAL(eits_reference_begin(ctx, UNTOUCHED), EITS_OK);
    for (int k = 0; k < UNTOUCHED; ++k) {
        reference_frame(&b, 1.5, 1e-3, &state);
        CHECK_EQUAL(eits_reference_add(ctx, b.frame, SMALL_ROWS), EITS_OK);
    }
    CHECK_EQUAL(eits_reference_finish(ctx), EITS_OK);
    reference_frame(&b, 1.5, 0.05, &state);
    memcpy(frame, b.frame, sizeof frame);
    CHECK_EQUAL(eits_reconstruct(ctx, frame, SMALL_ROWS, before, NULL), EITS_OK);
    memcpy(v0, ctx->reference.v0, sizeof v0);
    const eits_reference kept = ctx->reference;
    /* nothing, and so little that it cannot be divided by */
    static const double sizes[] = {0, BOTH_WIDTHS(1e-40, 1e-310)};
    for (int s = 0; s < 2; ++s) {
        small_reference(&b.c.model, sizes[s], wrong);
        CHECK_EQUAL(eits_reference_set(ctx, wrong, SMALL_ROWS), EITS_E_FRAME_ZERO);
        CHECK(ctx->reference.gain == kept.gain && ctx->reference.correlation == kept.correlation);
        CHECK(ctx->reference.v0_rms == kept.v0_rms && ctx->reference.noise_v == kept.noise_v);
        CHECK(ctx->reference.lambda_noise == kept.lambda_noise &&
              ctx->reference.count == kept.count);
        CHECK(memcmp(v0, ctx->reference.v0, sizeof v0) == 0);
        CHECK_EQUAL(eits_reconstruct(ctx, frame, SMALL_ROWS, after, NULL), EITS_OK);
        CHECK(memcmp(before, after, sizeof before) == 0);
    }
}

TEST(order_of_learning)
{
    eits_context *ctx = set_up(&b);
    uint64_t state = 9;
    reference_frame(&b, 1, 1e-3, &state);
    CHECK_EQUAL(eits_reference_add(ctx, b.frame, SMALL_ROWS), EITS_E_ARGUMENT); /* before begin */
    CHECK_EQUAL(eits_reference_finish(ctx), EITS_E_REFERENCE_SHORT);
    CHECK_EQUAL(eits_reference_begin(NULL, 8), EITS_E_ARGUMENT);
    for (uint32_t few = 0; few < 4; ++few)
        CHECK_EQUAL(eits_reference_begin(ctx, few), EITS_E_ARGUMENT);
    CHECK_EQUAL(eits_reference_set(ctx, b.frame, SMALL_ROWS), EITS_OK);
    /* a single reference is not learned further */
    CHECK_EQUAL(eits_reference_add(ctx, b.frame, SMALL_ROWS), EITS_E_ARGUMENT);
    CHECK_EQUAL(eits_reference_begin(ctx, 6), EITS_OK);
    /* the old one is gone */
    CHECK_EQUAL(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, NULL), EITS_E_NO_REFERENCE);
    CHECK_EQUAL(eits_reference_add(NULL, b.frame, SMALL_ROWS), EITS_E_ARGUMENT);
    CHECK_EQUAL(eits_reference_add(ctx, NULL, SMALL_ROWS), EITS_E_ARGUMENT);
    CHECK_EQUAL(eits_reference_finish(NULL), EITS_E_ARGUMENT);
    for (uint32_t k = 0; k < 6; ++k) {
        CHECK_EQUAL(ctx->reference.count, k);
        CHECK_EQUAL(eits_reference_finish(ctx), EITS_E_REFERENCE_SHORT);
        /* refused frames do not count */
        CHECK_EQUAL(eits_reference_add(ctx, b.frame, SMALL_ROWS - 1), EITS_E_FRAME_LENGTH);
        reference_frame(&b, 1, 1e-3, &state);
        const eits_real good = b.frame[5];
        b.frame[5] = (eits_real)NAN;
        CHECK_EQUAL(eits_reference_add(ctx, b.frame, SMALL_ROWS), EITS_E_FRAME_ROWS);
        b.frame[5] = good;
        CHECK_EQUAL(eits_reference_add(ctx, b.frame, SMALL_ROWS), EITS_OK);
    }
    CHECK_EQUAL(eits_reference_add(ctx, b.frame, SMALL_ROWS), EITS_E_ARGUMENT); /* one too many */
    CHECK_EQUAL(eits_reference_finish(ctx), EITS_OK);
    CHECK_EQUAL(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, NULL), EITS_OK);
    CHECK_EQUAL(eits_reference_set(ctx, b.frame, SMALL_ROWS), EITS_OK);
    /* nor after a learned one was replaced */
    CHECK_EQUAL(eits_reference_add(ctx, b.frame, SMALL_ROWS), EITS_E_ARGUMENT);
    CHECK_EQUAL(eits_reference_begin(ctx, 8), EITS_OK);
    CHECK_EQUAL(eits_reference_set(ctx, b.frame, SMALL_ROWS), EITS_OK); /* in place of learning */
    CHECK_EQUAL(eits_reference_add(ctx, b.frame, SMALL_ROWS), EITS_E_ARGUMENT);
    CHECK_EQUAL(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, NULL), EITS_OK);
    eits_real zero[SMALL_ROWS] = {0};
    CHECK_EQUAL(eits_reference_begin(ctx, 4), EITS_OK);
    CHECK_EQUAL(eits_reference_add(ctx, zero, SMALL_ROWS), EITS_OK);
    CHECK_EQUAL(eits_reference_add(ctx, zero, SMALL_ROWS), EITS_OK);
    /* the first half must be a reference */
    CHECK_EQUAL(eits_reference_add(ctx, zero, SMALL_ROWS), EITS_E_FRAME_ZERO);
    CHECK_EQUAL(eits_reference_finish(ctx), EITS_E_REFERENCE_SHORT);
    CHECK(!ctx->reference.ready);
}

/* Mean, noise and lambda_noise against two passes in double. Row 11 is masked, and both rows of the
 * first fold. */
static void learned_numbers(int project)
{
    eits_context *ctx = set_up(&b);
    dense d = dense_of(&b.c.model);
    static eits_real frames[UNTOUCHED][SMALL_ROWS];
    uint64_t state = 10;
    CHANGE_OPTIONS(ctx, o.project_reference = (uint32_t)project);
    const eits_fold whole = b.c.model.fold[0];
    const uint32_t masked[3] = {11, whole.first, whole.second};
    for (int k = 0; k < 3; ++k)
        CHECK_EQUAL(eits_mask_row(ctx, masked[k], 1), EITS_OK);
    CHECK_EQUAL(eits_reference_begin(ctx, UNTOUCHED), EITS_OK);
    double mean[SMALL_ROWS] = {0}, half[SMALL_ROWS] = {0}, squares = 0, lambda_noise = 0, gain = 0;
    uint8_t out[SMALL_ROWS] = {0};
    for (int k = 0; k < 3; ++k)
        out[masked[k]] = 1;
    CHECK(whole.first != 11 && whole.second < SMALL_ROWS);
    for (uint32_t k = 0; k < UNTOUCHED; ++k) {
        reference_frame(&b, -2, 2e-3, &state);
        memcpy(frames[k], b.frame, sizeof frames[k]);
        frames[k][11] = frames[k][whole.first] = frames[k][whole.second] =
            (eits_real)(k % 2 == 0 ? NAN : 1e9);
        if (k == UNTOUCHED / 2) {
            double vv = 0, rr = 0;
            memcpy(half, mean, sizeof half);
            for (uint32_t f = 0; f < SMALL_FOLDED; ++f) {
                const eits_fold fold = b.c.model.fold[f];
                double sum = 0, used = 0;
                if (!out[fold.first])
                    sum += half[fold.first], used += 1;
                if (fold.second != EITS_FOLD_NONE && !out[fold.second])
                    sum += fold.sign * half[fold.second], used += 1;
                vv += used > 0 ? sum * sum / (used * used) : 0;
                rr += used > 0 ? pow((double)b.c.model.v_ref[f], 2) : 0;
            }
            gain = -sqrt(rr / vv);
        }
        if (k >= UNTOUCHED / 2) {
            double y[12], c[16];
            dense_frame(&b.c.model, &d, mean, gain, project ? half : NULL, frames[k], out, y);
            dense_correlate(&d, y, c);
            for (int j = 0; j < 16; ++j)
                lambda_noise = fmax(lambda_noise, fabs(c[j]));
        }
        for (uint32_t i = 0; i < SMALL_ROWS; ++i)
            mean[i] += out[i] ? 0 : ((double)frames[k][i] - mean[i]) / (k + 1);
        CHECK_EQUAL(eits_reference_add(ctx, frames[k], SMALL_ROWS), EITS_OK);
        CHECK_NEAR(ctx->reference.lambda_noise, lambda_noise, 2e-3 * lambda_noise);
    }
    CHECK_EQUAL(eits_reference_finish(ctx), EITS_OK);
    memset(mean, 0, sizeof mean);
    for (uint32_t i = 0; i < SMALL_ROWS; ++i) {
        for (uint32_t k = 0; k < UNTOUCHED && !out[i]; ++k)
            mean[i] += (double)frames[k][i] / UNTOUCHED;
        for (uint32_t k = 0; k < UNTOUCHED && !out[i]; ++k)
            squares += pow((double)frames[k][i] - mean[i], 2);
        if (!out[i])
            CHECK_NEAR(ctx->reference.v0[i], mean[i], 10 * EPS * fabs(mean[i]));
    }
    const double noise = sqrt(squares / ((SMALL_ROWS - 3) * (UNTOUCHED - 1.0)));
    CHECK(noise > 1e-3 && noise < 1e-2);
    CHECK_NEAR(ctx->reference.noise_v, noise, BOTH_WIDTHS(2e-4, 1e-10) * noise);
    CHECK(lambda_noise > 1e-5 && ctx->reference.lambda_noise > 0);
    CHECK_NEAR(ctx->reference.gain, gain, 1e-3);
    CHECK_EQUAL(ctx->reference.count, UNTOUCHED);
    dense_free(&d);
}

/* A row masked in any of the reference frames has no reference, and does not disturb the others'
 * noise.
 */
TEST(masked_while_learning)
{
    double noise[2];
    for (int masked = 0; masked < 2; ++masked) {
        eits_context *ctx = set_up(&b);
        uint64_t state = 33;
        CHECK_EQUAL(eits_reference_begin(ctx, UNTOUCHED), EITS_OK);
        for (int k = 0; k < UNTOUCHED; ++k) {
            CHECK_EQUAL(eits_mask_row(ctx, 4, masked && (k == 3 || k == 13)), EITS_OK);
            reference_frame(&b, 1, 1e-3, &state);
            if (masked && (k == 3 || k == 13))
                b.frame[4] = R(1e20);
            CHECK_EQUAL(eits_reference_add(ctx, b.frame, SMALL_ROWS), EITS_OK);
        }
        CHECK_EQUAL(eits_reference_finish(ctx), EITS_OK);
        noise[masked] = (double)ctx->reference.noise_v;
        CHECK_EQUAL(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, NULL), EITS_OK);
        CHECK_EQUAL(eits_get_info(ctx)->masked, masked);
        CHECK(ctx->rows.unusable[4] == masked &&
              (isnan((double)ctx->reference.v0[4]) != 0) == masked);
        CHECK_NEAR(ctx->reference.correlation, 1, 1e-3);
        /* until the next reference */
        CHECK_EQUAL(eits_reference_set(ctx, b.frame, SMALL_ROWS), EITS_OK);
        CHECK_EQUAL(eits_reconstruct(ctx, b.frame, SMALL_ROWS, NULL, NULL), EITS_OK);
        CHECK_EQUAL(eits_get_info(ctx)->masked, 0);
    }
    CHECK(noise[0] > 1e-4 && noise[0] != noise[1]);
    CHECK_NEAR(noise[1], noise[0], 0.05 * noise[0]);
}

/* References that say nothing of the model, and masks that leave nothing of the reference. */
TEST(nothing_to_compare)
{
    eits_context *ctx = set_up(&b);
    uint64_t state = 34;
    CHANGE_OPTIONS(ctx, o.max_masked = 0);
    CHECK_EQUAL(eits_mask_row(ctx, 2, 1), EITS_OK);
    CHECK_EQUAL(eits_reference_begin(ctx, 4), EITS_OK);
    /* the second half runs the frame stage, which allows no masked row */
    for (int k = 0; k < 4; ++k) {
        reference_frame(&b, 1, 1e-3, &state);
        CHECK_EQUAL(eits_reference_add(ctx, b.frame, SMALL_ROWS),
                    k < 2 ? EITS_OK : EITS_E_FRAME_ROWS);
    }
    CHECK_EQUAL(ctx->reference.count, 2);
    CHANGE_OPTIONS(ctx, o.max_masked = 1);
    for (int k = 0; k < 2; ++k)
        CHECK_EQUAL(eits_reference_add(ctx, b.frame, SMALL_ROWS), EITS_OK);
    for (uint32_t i = 0; i < SMALL_ROWS; ++i)
        CHECK_EQUAL(eits_mask_row(ctx, i, 1), EITS_OK);
    CHECK_EQUAL(eits_reference_finish(ctx), EITS_E_FRAME_ZERO);
    CHECK(!ctx->reference.ready);
    CHECK_EQUAL(eits_reference_set(ctx, b.frame, SMALL_ROWS), EITS_E_FRAME_ZERO);
    for (uint32_t i = 0; i < SMALL_ROWS; ++i)
        CHECK_EQUAL(eits_mask_row(ctx, i, 0), EITS_OK);
    CHECK_EQUAL(eits_reference_set(ctx, b.frame, SMALL_ROWS), EITS_OK);
    /* a model that is zero on all rows but one fold's */
    small_model made = small_model_make((small_spec){.rank = 12, .side = 4});
    for (uint32_t k = 1; k < SMALL_FOLDED; ++k)
        small_put_f32(small_model_section(&made, "VREF", NULL) + 4 * k, 0);
    small_model_seal(&made);
    small_context c;
    small_context_open(&c, &made, 0);
    CHECK_EQUAL(eits_mask_row(c.ctx, c.model.fold[0].first, 1), EITS_OK);
    CHECK_EQUAL(eits_mask_row(c.ctx, c.model.fold[0].second, 1), EITS_OK);
    CHECK_EQUAL(eits_reference_set(c.ctx, b.frame, SMALL_ROWS), EITS_E_FRAME_ZERO);
    CHECK_EQUAL(eits_mask_row(c.ctx, c.model.fold[0].first, 0), EITS_OK);
    CHECK_EQUAL(eits_reference_set(c.ctx, b.frame, SMALL_ROWS), EITS_OK);
    /* and one that is zero throughout, read in place */
    small_put_f32(small_model_section(&made, "VREF", NULL), 0);
    CHECK_EQUAL(eits_reference_set(c.ctx, b.frame, SMALL_ROWS), EITS_E_FRAME_ZERO);
    small_context_close(&c);
    small_model_free(&made);
}

/* Offsets far above the noise do not drown it (Welford). */
TEST(noise_on_a_large_offset)
{
    eits_context *ctx = set_up(&b);
    uint64_t state = 21;
    double squares = 0;
    static double frames[64][SMALL_ROWS];
    CHECK_EQUAL(eits_reference_begin(ctx, 64), EITS_OK);
    for (int k = 0; k < 64; ++k) {
        reference_frame(&b, 1000, 3e-5, &state);
        for (int i = 0; i < SMALL_ROWS; ++i)
            frames[k][i] = (double)b.frame[i];
        CHECK_EQUAL(eits_reference_add(ctx, b.frame, SMALL_ROWS), EITS_OK);
    }
    CHECK_EQUAL(eits_reference_finish(ctx), EITS_OK);
    for (int i = 0; i < SMALL_ROWS; ++i) {
        double mean = 0;
        for (int k = 0; k < 64; ++k)
            mean += frames[k][i] / 64;
        for (int k = 0; k < 64; ++k)
            squares += pow(frames[k][i] - mean, 2);
    }
    const double noise = sqrt(squares / (SMALL_ROWS * 63.0));
    CHECK_NEAR(ctx->reference.noise_v, noise, BOTH_WIDTHS(0.02, 1e-9) * noise);
}

int main(void)
{
    run_tests();
    learned_numbers(0);
    learned_numbers(1);
    tear_down(&b);
    return checks_report("reference");
}
