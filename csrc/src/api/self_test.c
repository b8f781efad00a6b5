/* The golden frames that each model carries.
 *
 * A board with a wrong compiler flag or damaged flash may give images that look
 * plausible. The model carries a reference, a frame, and the image that the float32 core
 * made of them when it was built; since every sum has one order, the same bits must come out here
 * (difference 0; within rounding in float64). In: the section GOLD. Out: the greatest deviation
 * over the image's peak. It replaces the reference: a caller saves its own before (eits_save).
 *
 * One image cannot test code that did not run for it. The section SUMS therefore has a checksum for
 * each of a set of frames made from these two: with noise on the rows, a lost electrode, each
 * solver and sign, touches with their test, a learned reference. No frame is stored for it. */
#include "base/vec.h"
#include "context/context.h"
#include "eitskin/frame.h"
#include "eitskin/solve.h"
#include "eitskin/touch.h"

#ifndef EITS_DOUBLE

enum { TRIALS = 6, SCENES = 4 };

_Static_assert(TRIALS < EITS_SELF_TEST_SUMS, "the others are of scenes");

typedef struct trial {
    eits_solver solver;
    eits_sign sign;
    eits_real strength; /* factor on the touch's part of the golden frame */
    eits_real gap_rel;
    uint32_t lost;    /* 1: an electrode is lost */
    uint32_t learned; /* 1: the reference is learned from touched frames too */
} trial;

static const trial trials[TRIALS] = {
    {EITS_SOLVER_FISTA, EITS_SIGN_INCREASE, R(1), 0, 0, 0},
    {EITS_SOLVER_FISTA, EITS_SIGN_INCREASE, R(0.375), 0, 1, 0},
    {EITS_SOLVER_WORKING_SET, EITS_SIGN_INCREASE, R(1.25), R(1e-3), 0, 0},
    {EITS_SOLVER_ACTIVE_SET, EITS_SIGN_BOTH, R(-1.5), R(1e-4), 0, 0},
    {EITS_SOLVER_ACTIVE_SET, EITS_SIGN_INCREASE, R(0.75), R(1e-4), 0, 0},
    {EITS_SOLVER_FISTA, EITS_SIGN_INCREASE, R(2), R(1e-3), 0, 1},
};

static eits_status learn(eits_context *ctx, const trial *t)
{
    const eits_golden *golden = &ctx->model->golden;
    eits_status status = eits_reference_begin(ctx, 4);
    for (int k = 0; k < 4 && status == EITS_OK; ++k)
        status = eits_reference_add(ctx, t->learned && k == 2 ? golden->frame : golden->reference,
                                    ctx->model->n_rows);
    return status == EITS_OK ? eits_reference_finish(ctx) : status;
}

/* Make the golden frame with the trial's strength; each row has noise of about 2^-13 of its voltage
 * (rms). */
static void make_frame(const eits_context *ctx, const trial *t, eits_real *frame)
{
    const eits_model *model = ctx->model;
    uint32_t random = 1;
    for (uint32_t i = 0; i < model->n_rows; ++i) {
        const uint8_t *row = eits_row(ctx, i);
        const eits_real v0 = model->golden.reference[i],
                        v = v0 + t->strength * (model->golden.frame[i] - v0);
        random = random * 1664525u + 1013904223u;
        frame[i] = v * (1 + ((eits_real)(random >> 28) - R(7.5)) * R(0x1p-15));
        for (int k = 0; t->lost && k < 4; ++k)
            frame[i] = row[k] == model->protocol[0] ? R(NAN) : frame[i];
    }
}

/* Set the options of a trial and learn the reference with them. */
static uint32_t begin_trial(eits_context *ctx, const trial *t)
{
    eits_options options;
    (void)eits_options_default(ctx->model, &options);
    options.iterations = 12; /* a few iterations show a difference of bits as well as all would */
    options.solver = t->solver;
    options.sign = t->sign;
    options.gap_rel = t->gap_rel;
    options.second_pass = t->learned;
    options.noise_floor_v = R(0x1p-10) * ctx->reference.v0_rms;
    const int32_t status[2] = {eits_set_options(ctx, &options), learn(ctx, t)};
    return eits_crc32(0, status, sizeof status);
}

/* Add the touches, and the numbers reported about them and the image, to the checksum. */
static uint32_t add_result(eits_context *ctx, uint32_t sum)
{
    eits_touch touches[EITS_MAX_TOUCHES];
    uint32_t count = 0;
    sum = eits_crc32(sum, ctx->solver.image, ctx->model->n_pixels * sizeof(eits_real));
    (void)eits_find_touches(ctx, touches, EITS_MAX_TOUCHES, &count);
    sum = eits_crc32(sum, touches, count * sizeof touches[0]);
    const eits_info *info = &ctx->info;
    const eits_real reported[] = {info->lambda,         info->lambda_noise, info->gap_rel,
                                  info->residual,       info->data_norm,    info->unexplained,
                                  info->model_mismatch, ctx->reference.gain};
    return eits_crc32(sum, reported, sizeof reported);
}

static uint32_t run_trial(eits_context *ctx, const trial *t)
{
    uint32_t sum = begin_trial(ctx, t);
    eits_real *frame = ctx->reference.m2; /* m2 is free once the reference is learned */
    make_frame(ctx, t, frame);
    const int32_t status = eits_reconstruct(ctx, frame, ctx->model->n_rows, NULL, NULL);
    return add_result(ctx, eits_crc32(sum, &status, sizeof status));
}

/* Make reduced data of one to four touches, two pixels wide, all over the skin and sometimes side
 * by side: they test parts of fit, merging, splitting and test that the golden frame's two touches
 * do not reach. */
static void make_data(const eits_context *ctx, eits_real norm, uint32_t *random, eits_real *y)
{
    const uint32_t rank = ctx->model->rank, pixels = ctx->model->n_pixels;
    eits_real *column = ctx->scratch.row[1];
    uint32_t pixel = 0;
    eits_zero(y, rank);
    for (uint32_t k = 0; k <= (*random & 3u); ++k) {
        const uint32_t drawn = *random >> (3u + 5u * k);
        pixel = (k == 1 ? pixel + 3 : drawn * 2654435761u >> 8) % pixels;
        for (uint32_t side = 0; side < 2; ++side) {
            eits_read_column(&ctx->model->sensitivity, (pixel + side) % pixels, column);
            const eits_real square = eits_dot(ctx->kernels, column, column, rank),
                            share = (1 + (eits_real)(drawn & 15u)) / 16 * norm / eits_sqrt(square);
            for (uint32_t i = 0; i < rank && square > 0; ++i)
                y[i] = eits_fma(share, column[i], y[i]);
        }
    }
    *random = *random * 1664525u + 1013904223u;
}

static uint32_t run_scenes(eits_context *ctx, uint32_t random)
{
    uint32_t sum = run_trial(ctx, &trials[2]);
    const eits_real norm = ctx->info.data_norm;
    for (int k = 0; k < SCENES; ++k) {
        make_data(ctx, norm, &random, ctx->scratch.row[0]);
        const int32_t status = eits_solve(ctx, ctx->scratch.row[0]);
        sum = add_result(ctx, eits_crc32(sum, &status, sizeof status));
    }
    return sum;
}

eits_status eits_self_test_sums(eits_context *ctx, uint32_t sums[EITS_SELF_TEST_SUMS])
{
    if (ctx == NULL || sums == NULL)
        return EITS_E_ARGUMENT;
    eits_status status = eits_reference_set(ctx, ctx->model->golden.reference, ctx->model->n_rows);
    const eits_options kept = ctx->options;
    for (uint32_t k = 0; k < EITS_SELF_TEST_SUMS && status == EITS_OK; ++k)
        sums[k] = k < TRIALS ? run_trial(ctx, &trials[k]) : run_scenes(ctx, k);
    (void)eits_set_options(ctx, &kept);
    eits_forget(ctx);
    return status;
}

static eits_status compare_sums(eits_context *ctx)
{
    uint32_t sums[EITS_SELF_TEST_SUMS];
    if (ctx->model->golden.sums == NULL)
        return EITS_OK;
    const eits_status status = eits_self_test_sums(ctx, sums);
    if (status != EITS_OK)
        return status;
    return memcmp(sums, ctx->model->golden.sums, sizeof sums) == 0 ? EITS_OK : EITS_E_ARITHMETIC;
}

#else

eits_status eits_self_test_sums(eits_context *ctx, uint32_t sums[EITS_SELF_TEST_SUMS])
{
    return ctx == NULL || sums == NULL ? EITS_E_ARGUMENT : EITS_E_ARITHMETIC;
}

static eits_status compare_sums(eits_context *ctx)
{
    (void)ctx;
    return EITS_OK;
}

#endif

eits_status eits_self_test(eits_context *ctx, eits_real *difference)
{
    if (ctx == NULL || difference == NULL)
        return EITS_E_ARGUMENT;
    const eits_model *model = ctx->model;
    /* m2 has n_rows numbers that a single reference frame leaves unused.
     *
     * So the caller need not give memory for a frame. Afterwards the squares of deviations are zero
     * again, as eits_reference_set leaves them. */
    eits_real *frame = ctx->reference.m2;
    *difference = 0;
    const eits_status sums = compare_sums(ctx);
    for (uint32_t i = 0; i < model->n_rows; ++i)
        ctx->reference.v0[i] = (eits_real)model->golden.reference[i];
    eits_status status = eits_reference_set(ctx, ctx->reference.v0, model->n_rows);
    if (status != EITS_OK)
        return status;
    for (uint32_t i = 0; i < model->n_rows; ++i)
        frame[i] = (eits_real)model->golden.frame[i];
    status = eits_reconstruct(ctx, frame, model->n_rows, NULL, NULL);
    eits_real largest = 0, peak = 0;
    for (uint32_t j = 0; j < model->n_pixels; ++j) {
        const eits_real expected = (eits_real)model->golden.image[j],
                        off = eits_fabs(ctx->solver.image[j] - expected);
        largest = off > largest ? off : largest;
        peak = eits_fabs(expected) > peak ? eits_fabs(expected) : peak;
    }
    *difference = peak > 0 ? largest / peak : largest;
    eits_zero(frame, model->n_rows);
    return status == EITS_OK && largest == 0 ? sums : status;
}
