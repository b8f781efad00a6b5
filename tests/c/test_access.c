/* Functions that read a context from outside: they examine frames, and save and restore the state.
 */
#include "steps.h"

enum { RANK = 13, SIDE = 6, N = SIDE * SIDE };
static const small_spec WHITENED = {.rank = RANK, .side = SIDE, .shape = SMALL_WHITENED};

static dense_bench bench[2];

/* The size is a constant expression. */
static uint8_t constant[EITS_SAVED_SIZE(SMALL_ROWS)];

static void tare(eits_context *ctx, uint64_t state, double gain)
{
    eits_real reference[SMALL_ROWS], frames[6][SMALL_ROWS];
    small_reference(eits_get_model(ctx), gain, reference);
    for (int k = 0; k < 6; ++k)
        vary(frames[k], reference, 1e-4, &state);
    LEARN(ctx, 6, frames);
}

/* A frame of changes, with `unknown` rows that are no numbers. */
static void make_frame(const eits_context *ctx, uint64_t state, uint32_t unknown, eits_real *frame)
{
    small_reference(eits_get_model(ctx), 1, frame);
    for (uint32_t i = 0; i < SMALL_ROWS; ++i)
        frame[i] = i < unknown ? R(NAN) : frame[i] * (eits_real)(1 + 0.05 * small_random(&state));
}

static void reconstruct(eits_context *ctx, uint64_t state, uint32_t unknown, eits_real *image)
{
    eits_real frame[SMALL_ROWS];
    make_frame(ctx, state, unknown, frame);
    CHECK_OK(eits_reconstruct(ctx, frame, SMALL_ROWS, image, NULL));
}

TEST(accessors_give_what_calls_give)
{
    eits_context *ctx = dense_bench_open(&bench[0], WHITENED, 0);
    eits_real image[N];
    eits_reference_info reference;
    CHECK(eits_get_model(ctx) == &bench[0].c.model);
    CHECK_REFUSED(eits_get_reference(NULL, &reference));
    CHECK_REFUSED(eits_get_reference(ctx, NULL));
    CHECK_OK(eits_get_reference(ctx, &reference));
    CHECK(!reference.ready && reference.count == 0);
    CHECK_OK(eits_mask_row(ctx, 2, 1));
    CHECK(eits_is_masked(ctx, 2) && !eits_is_masked(ctx, 3));
    tare(ctx, 1, 2);
    CHECK_OK(eits_get_reference(ctx, &reference));
    CHECK(reference.ready && reference.count == 6 && reference.noise_v > 0);
    CHECK_NEAR(reference.gain, 0.5, 1e-3);
    CHECK_NEAR(reference.correlation, 1, 1e-3);
    CHECK(isnan((double)reference.v0[2]) && isfinite((double)reference.v0[3]));
    tare(ctx, 1, 1);
    reconstruct(ctx, 3, 1, image);
    CHECK(memcmp(eits_get_image(ctx), image, sizeof image) == 0);
    CHECK_EQUAL(eits_get_row_states(ctx)[0] & EITS_ROW_UNKNOWN, EITS_ROW_UNKNOWN);
    CHECK_EQUAL(eits_get_row_states(ctx)[2] & EITS_ROW_MASKED, EITS_ROW_MASKED);
    CHECK_EQUAL(eits_get_electrode_states(ctx)[0], 0);
    /* the data that the solver saw, given again, give the same image; so do those that it has */
    eits_real y[RANK];
    memcpy(y, eits_get_reduced_data(ctx), sizeof y);
    CHECK_OK(eits_solve(ctx, NULL));
    CHECK(memcmp(eits_get_image(ctx), image, sizeof image) == 0);
    reconstruct(ctx, 4, 1, NULL);
    CHECK(memcmp(eits_get_image(ctx), image, sizeof image) != 0);
    CHECK_OK(eits_solve(ctx, y));
    CHECK(memcmp(eits_get_image(ctx), image, sizeof image) == 0);
}

/* Frames between, of other rows, change neither image nor touches of those that are solved. */
TEST(examined_frames_leave_no_trace)
{
    eits_context *ctx[2];
    eits_real frame[SMALL_ROWS], image[2][N];
    for (int k = 0; k < 2; ++k) {
        ctx[k] = dense_bench_open(&bench[k], WHITENED, 0);
        CHECK_EQUAL(eits_examine(ctx[k], frame, SMALL_ROWS), EITS_E_NO_REFERENCE);
        tare(ctx[k], 1, 1);
    }
    CHECK_REFUSED(eits_examine(NULL, frame, SMALL_ROWS));
    CHECK_REFUSED(eits_examine(ctx[0], NULL, SMALL_ROWS));
    CHECK_EQUAL(eits_examine(ctx[0], frame, SMALL_ROWS - 1), EITS_E_FRAME_LENGTH);
    for (uint32_t round = 0; round < 6; ++round) {
        const uint32_t unknown = round / 3;
        make_frame(ctx[1], 40 + round, (round + 1) % 4, frame);
        CHECK_OK(eits_examine(ctx[1], frame, SMALL_ROWS));
        CHECK_EQUAL(eits_get_info(ctx[1])->masked, (round + 1) % 4);
        CHECK_EQUAL(eits_get_info(ctx[1])->iterations, 0);
        for (int k = 0; k < 2; ++k)
            reconstruct(ctx[k], round, unknown, image[k]);
        CHECK(memcmp(image[0], image[1], sizeof image[0]) == 0);
        CHECK(eits_get_info(ctx[0])->lambda == eits_get_info(ctx[1])->lambda);
    }
    /* all is unknown: said, and the next frame is as ever */
    for (int i = 0; i < SMALL_ROWS; ++i)
        frame[i] = R(NAN);
    CHECK_EQUAL(eits_examine(ctx[1], frame, SMALL_ROWS), EITS_E_FRAME_ROWS);
    for (int k = 0; k < 2; ++k)
        reconstruct(ctx[k], 9, 0, image[k]);
    CHECK(memcmp(image[0], image[1], sizeof image[0]) == 0);
}

/* A frame that is refused after it was folded leaves a basis that fits no frame: the next one, of
 * the same rows, must not take it. */
TEST(a_refused_frame_leaves_no_basis)
{
    eits_context *ctx[2];
    eits_real frame[SMALL_ROWS], image[2][N];
    for (int k = 0; k < 2; ++k) {
        ctx[k] = dense_bench_open(&bench[k], WHITENED, 0);
        CHANGE_OPTIONS(ctx[k], o.max_masked = 2);
        tare(ctx[k], 1, 1);
        reconstruct(ctx[k], 7, 0, NULL);
    }
    /* two unknown rows, and a third whose reciprocal differs */
    const eits_fold fold = ctx[0]->model->fold[SMALL_FOLDED - 2];
    make_frame(ctx[0], 8, 2, frame);
    frame[fold.first] *= R(3);
    const eits_status status = eits_reconstruct(ctx[0], frame, SMALL_ROWS, NULL, NULL);
    CHECK(status == EITS_OK || status == EITS_E_FRAME_ROWS);
    for (int k = 0; k < 2; ++k)
        reconstruct(ctx[k], 8, 2, image[k]);
    CHECK(memcmp(image[0], image[1], sizeof image[0]) == 0);
}

TEST(saved_and_restored)
{
    eits_context *ctx = dense_bench_open(&bench[0], WHITENED, 0);
    eits_real before[N], after[N];
    CHECK_EQUAL(eits_saved_size(NULL), 0);
    const size_t size = eits_saved_size(&bench[0].c.model);
    CHECK_EQUAL(size, sizeof constant);
    void *memory;
    uint8_t *saved = small_aligned(&memory, size + 16);
    memset(saved, 0xC3, size + 16);
    CHECK_REFUSED(eits_save(NULL, saved, size));
    CHECK_REFUSED(eits_save(ctx, NULL, size));
    CHECK_EQUAL(eits_save(ctx, saved, size - 1), EITS_E_WORKSPACE);
    CHECK_EQUAL(eits_save(ctx, saved + 8, size), EITS_E_WORKSPACE);
    CHECK_REFUSED(eits_restore(NULL, saved, size));
    CHECK_REFUSED(eits_restore(ctx, NULL, size));
    CHECK_EQUAL(eits_restore(ctx, saved, size - 1), EITS_E_WORKSPACE);
    CHECK_EQUAL(eits_restore(ctx, saved + 8, size), EITS_E_WORKSPACE);
    CHANGE_OPTIONS(ctx, o.iterations = 33);
    CHECK_OK(eits_mask_row(ctx, 5, 1));
    tare(ctx, 1, 1);
    reconstruct(ctx, 3, 0, before);
    CHECK_OK(eits_save(ctx, saved, size));
    for (int i = 0; i < 16; ++i)
        CHECK(saved[size + (size_t)i] == 0xC3);
    /* a tare that was given up; then a context laid out again, as after another model's turn */
    for (int again = 0; again < 2; ++again) {
        if (again)
            CHECK_OK(
                eits_init(ctx, eits_workspace_size(&bench[0].c.model, 0), &bench[0].c.model, &ctx));
        CHANGE_OPTIONS(ctx, o.iterations = 7);
        CHECK_OK(eits_mask_row(ctx, 5, 0));
        CHECK_OK(eits_mask_row(ctx, 6, 1));
        CHECK_OK(eits_reference_begin(ctx, 4));
        eits_real frame[SMALL_ROWS];
        small_reference(&bench[0].c.model, 5, frame);
        CHECK_OK(eits_reference_add(ctx, frame, SMALL_ROWS));
        ctx->solver.warm = 1;
        CHECK_OK(eits_restore(ctx, saved, size));
        CHECK(ctx->solver.warm == 0);
        CHECK_EQUAL(eits_get_options(ctx)->iterations, 33);
        CHECK(eits_is_masked(ctx, 5) && !eits_is_masked(ctx, 6));
        reconstruct(ctx, 3, 0, after);
        CHECK(memcmp(before, after, sizeof before) == 0);
        /* the learning that was under way is none any more */
        CHECK_REFUSED(eits_reference_add(ctx, frame, SMALL_ROWS));
    }
    free(memory);
}

RUN_TESTS("access", dense_bench_close(&bench[0]), dense_bench_close(&bench[1]))
