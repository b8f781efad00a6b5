/* What a user reaches of a context without looking into it: examined frames, and a state that is
 * put by and taken up again. */
#include "steps.h"

enum { RANK = 13, SIDE = 6, N = SIDE * SIDE };
static const small_spec WHITENED = {.rank = RANK, .side = SIDE, .shape = SMALL_WHITENED};

/* The size is a constant expression. */
static uint8_t constant[EITS_SAVED_SIZE(SMALL_ROWS)];

static void tare(eits_context *ctx, uint64_t state, double gain)
{
    eits_real reference[SMALL_ROWS], frame[SMALL_ROWS];
    small_reference(eits_get_model(ctx), gain, reference);
    CHECK_OK(eits_reference_begin(ctx, 6));
    for (int k = 0; k < 6; ++k) {
        vary(frame, reference, 1e-4, &state);
        CHECK_OK(eits_reference_add(ctx, frame, SMALL_ROWS));
    }
    CHECK_OK(eits_reference_finish(ctx));
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
    small_model made = small_model_make(WHITENED);
    small_context c;
    eits_real image[N];
    eits_reference_info reference;
    small_context_open(&c, &made, 0);
    CHECK(eits_get_model(c.ctx) == &c.model);
    CHECK_REFUSED(eits_get_reference(NULL, &reference));
    CHECK_REFUSED(eits_get_reference(c.ctx, NULL));
    CHECK_OK(eits_get_reference(c.ctx, &reference));
    CHECK(!reference.ready && reference.count == 0);
    CHECK_OK(eits_mask_row(c.ctx, 2, 1));
    CHECK(eits_is_masked(c.ctx, 2) && !eits_is_masked(c.ctx, 3));
    tare(c.ctx, 1, 2);
    CHECK_OK(eits_get_reference(c.ctx, &reference));
    CHECK(reference.ready && reference.count == 6 && reference.noise_v > 0);
    CHECK_NEAR(reference.gain, 0.5, 1e-3);
    CHECK_NEAR(reference.correlation, 1, 1e-3);
    CHECK(isnan((double)reference.v0[2]) && isfinite((double)reference.v0[3]));
    tare(c.ctx, 1, 1);
    reconstruct(c.ctx, 3, 1, image);
    CHECK(memcmp(eits_get_image(c.ctx), image, sizeof image) == 0);
    CHECK_EQUAL(eits_get_row_states(c.ctx)[0] & EITS_ROW_UNKNOWN, EITS_ROW_UNKNOWN);
    CHECK_EQUAL(eits_get_row_states(c.ctx)[2] & EITS_ROW_MASKED, EITS_ROW_MASKED);
    CHECK_EQUAL(eits_get_electrode_states(c.ctx)[0], 0);
    /* the data that the solver saw, given again, give the same image; so do those that it has */
    eits_real y[RANK];
    memcpy(y, eits_get_reduced_data(c.ctx), sizeof y);
    CHECK_OK(eits_solve(c.ctx, NULL));
    CHECK(memcmp(eits_get_image(c.ctx), image, sizeof image) == 0);
    reconstruct(c.ctx, 4, 1, NULL);
    CHECK(memcmp(eits_get_image(c.ctx), image, sizeof image) != 0);
    CHECK_OK(eits_solve(c.ctx, y));
    CHECK(memcmp(eits_get_image(c.ctx), image, sizeof image) == 0);
    small_context_close(&c);
    small_model_free(&made);
}

/* Frames between, of other rows, change neither image nor touches of those that are solved. */
TEST(examined_frames_leave_no_trace)
{
    small_model made = small_model_make(WHITENED);
    small_context c[2];
    eits_real frame[SMALL_ROWS], image[2][N];
    for (int k = 0; k < 2; ++k) {
        small_context_open(&c[k], &made, 0);
        CHECK_EQUAL(eits_examine(c[k].ctx, frame, SMALL_ROWS), EITS_E_NO_REFERENCE);
        tare(c[k].ctx, 1, 1);
    }
    CHECK_REFUSED(eits_examine(NULL, frame, SMALL_ROWS));
    CHECK_REFUSED(eits_examine(c[0].ctx, NULL, SMALL_ROWS));
    CHECK_EQUAL(eits_examine(c[0].ctx, frame, SMALL_ROWS - 1), EITS_E_FRAME_LENGTH);
    for (uint32_t round = 0; round < 6; ++round) {
        const uint32_t unknown = round / 3;
        make_frame(c[1].ctx, 40 + round, (round + 1) % 4, frame);
        CHECK_OK(eits_examine(c[1].ctx, frame, SMALL_ROWS));
        CHECK_EQUAL(eits_get_info(c[1].ctx)->masked, (round + 1) % 4);
        CHECK_EQUAL(eits_get_info(c[1].ctx)->iterations, 0);
        for (int k = 0; k < 2; ++k)
            reconstruct(c[k].ctx, round, unknown, image[k]);
        CHECK(memcmp(image[0], image[1], sizeof image[0]) == 0);
        CHECK(eits_get_info(c[0].ctx)->lambda == eits_get_info(c[1].ctx)->lambda);
    }
    /* all is unknown: said, and the next frame is as ever */
    for (int i = 0; i < SMALL_ROWS; ++i)
        frame[i] = R(NAN);
    CHECK_EQUAL(eits_examine(c[1].ctx, frame, SMALL_ROWS), EITS_E_FRAME_CHANNELS);
    for (int k = 0; k < 2; ++k)
        reconstruct(c[k].ctx, 9, 0, image[k]);
    CHECK(memcmp(image[0], image[1], sizeof image[0]) == 0);
    small_context_close(&c[0]);
    small_context_close(&c[1]);
    small_model_free(&made);
}

/* A frame that is refused after it was folded leaves a basis that fits no frame: the next one, of
 * the same rows, must not take it. */
TEST(a_refused_frame_leaves_no_basis)
{
    small_model made = small_model_make(WHITENED);
    small_context c[2];
    eits_real frame[SMALL_ROWS], image[2][N];
    for (int k = 0; k < 2; ++k) {
        small_context_open(&c[k], &made, 0);
        eits_options o = *eits_get_options(c[k].ctx);
        o.max_masked = 2;
        CHECK_OK(eits_set_options(c[k].ctx, &o));
        tare(c[k].ctx, 1, 1);
        reconstruct(c[k].ctx, 7, 0, NULL);
    }
    /* two unknown rows, and a third that its reciprocal does not bear out */
    const eits_fold fold = c[0].model.fold[SMALL_FOLDED - 2];
    make_frame(c[0].ctx, 8, 2, frame);
    frame[fold.first] *= R(3);
    const eits_status status = eits_reconstruct(c[0].ctx, frame, SMALL_ROWS, NULL, NULL);
    CHECK(status == EITS_OK || status == EITS_E_FRAME_CHANNELS);
    for (int k = 0; k < 2; ++k)
        reconstruct(c[k].ctx, 8, 2, image[k]);
    CHECK(memcmp(image[0], image[1], sizeof image[0]) == 0);
    small_context_close(&c[0]);
    small_context_close(&c[1]);
    small_model_free(&made);
}

TEST(saved_and_restored)
{
    small_model made = small_model_make(WHITENED);
    small_context c;
    eits_real before[N], after[N];
    small_context_open(&c, &made, 0);
    CHECK_EQUAL(eits_saved_size(NULL), 0);
    const size_t size = eits_saved_size(&c.model);
    CHECK_EQUAL(size, sizeof constant);
    void *memory;
    uint8_t *saved = small_aligned(&memory, size + 16);
    memset(saved, 0xC3, size + 16);
    CHECK_REFUSED(eits_save(NULL, saved, size));
    CHECK_REFUSED(eits_save(c.ctx, NULL, size));
    CHECK_EQUAL(eits_save(c.ctx, saved, size - 1), EITS_E_WORKSPACE);
    CHECK_EQUAL(eits_save(c.ctx, saved + 8, size), EITS_E_WORKSPACE);
    CHECK_REFUSED(eits_restore(NULL, saved, size));
    CHECK_REFUSED(eits_restore(c.ctx, NULL, size));
    CHECK_EQUAL(eits_restore(c.ctx, saved, size - 1), EITS_E_WORKSPACE);
    CHECK_EQUAL(eits_restore(c.ctx, saved + 8, size), EITS_E_WORKSPACE);
    eits_options o = *eits_get_options(c.ctx);
    o.iterations = 33;
    CHECK_OK(eits_set_options(c.ctx, &o));
    CHECK_OK(eits_mask_row(c.ctx, 5, 1));
    tare(c.ctx, 1, 1);
    reconstruct(c.ctx, 3, 0, before);
    CHECK_OK(eits_save(c.ctx, saved, size));
    for (int i = 0; i < 16; ++i)
        CHECK(saved[size + (size_t)i] == 0xC3);
    /* a tare that was given up; then a context laid out again, as after another model's turn */
    for (int again = 0; again < 2; ++again) {
        if (again)
            CHECK_OK(eits_init(c.ctx, eits_workspace_size(&c.model, 0), &c.model, &c.ctx));
        o.iterations = 7;
        CHECK_OK(eits_set_options(c.ctx, &o));
        CHECK_OK(eits_mask_row(c.ctx, 5, 0));
        CHECK_OK(eits_mask_row(c.ctx, 6, 1));
        CHECK_OK(eits_reference_begin(c.ctx, 4));
        eits_real frame[SMALL_ROWS];
        small_reference(&c.model, 5, frame);
        CHECK_OK(eits_reference_add(c.ctx, frame, SMALL_ROWS));
        c.ctx->solver.warm = 1;
        c.ctx->tracker.count = 1;
        CHECK_OK(eits_restore(c.ctx, saved, size));
        CHECK(c.ctx->solver.warm == 0 && c.ctx->tracker.count == 0);
        CHECK_EQUAL(eits_get_options(c.ctx)->iterations, 33);
        CHECK(eits_is_masked(c.ctx, 5) && !eits_is_masked(c.ctx, 6));
        reconstruct(c.ctx, 3, 0, after);
        CHECK(memcmp(before, after, sizeof before) == 0);
        /* the learning that was under way is none any more */
        CHECK_REFUSED(eits_reference_add(c.ctx, frame, SMALL_ROWS));
    }
    free(memory);
    small_context_close(&c);
    small_model_free(&made);
}

RUN_TESTS("access")
