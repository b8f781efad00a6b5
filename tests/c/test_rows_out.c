/* Rows left out of a taught model: filled in by the rows' precision (section PREC), F beside it;
 * and everything that a reader refuses. */
#include "steps.h"

#include "frame/whitening.h"

enum { RANK = 4, PACKED = SMALL_FOLDED * (SMALL_FOLDED + 1) / 2, SIZE = 4 * PACKED, OTHER = 10 };

static dense_bench b;
static const small_spec TAUGHT = {.rank = RANK, .side = 5, .shape = SMALL_IDENTITY};
static const small_spec WHITENED = {.rank = RANK, .side = 5, .shape = SMALL_WHITENED};

static uint8_t *entry(uint8_t *bytes, uint32_t i, uint32_t j)
{
    return bytes + 4 * (i * (i + 1) / 2 + j);
}

/* The identity, but fold 0 has a precision of 2 and leans on fold OTHER. */
static void section_of(uint8_t *bytes, float leaning)
{
    memset(bytes, 0, SIZE + 4);
    for (uint32_t i = 0; i < SMALL_FOLDED; ++i)
        small_put_f32(entry(bytes, i, i), i == 0 ? 2.0f : 1.0f);
    small_put_f32(entry(bytes, OTHER, 0), leaning);
}

/* A model with the section PREC; without WHIT, which the small identity has, where `taught`. */
static small_model with_precision(small_spec spec, int taught, const uint8_t *bytes, uint32_t size)
{
    small_model bare = small_model_make(spec);
    if (taught)
        memcpy(small_model_entry(&bare, "WHIT"), "XTRW", 4);
    const small_model made = small_model_with_section(&bare, "PREC", bytes, size);
    small_model_free(&bare);
    return made;
}

static eits_status opened(int taught, const uint8_t *bytes, uint32_t size)
{
    return small_model_try(with_precision(taught ? TAUGHT : WHITENED, taught, bytes, size));
}

TEST(what_is_no_precision_is_refused)
{
    uint8_t bytes[SIZE + 4];
    section_of(bytes, 0.5f);
    CHECK_OK(opened(1, bytes, SIZE));
    CHECK_EQUAL(opened(1, bytes, SIZE - 4), EITS_E_MODEL_SECTION);
    CHECK_EQUAL(opened(1, bytes, SIZE + 4), EITS_E_MODEL_SECTION);
    /* a model that says how it was whitened needs none */
    CHECK_EQUAL(opened(0, bytes, SIZE), EITS_E_MODEL_VALUE);
    small_put_f32(entry(bytes, 3, 3), -1);
    CHECK_EQUAL(opened(1, bytes, SIZE), EITS_E_MODEL_VALUE);
    section_of(bytes, (float)NAN);
    CHECK_EQUAL(opened(1, bytes, SIZE), EITS_E_MODEL_VALUE);
}

/* 16 directions are made from 21 folds: five missing folds can be filled in. With six missing ones
 * all of them would be guesses. */
TEST(as_many_are_filled_in_as_are_spare)
{
    enum { MANY = 16 };
    uint8_t bytes[SIZE + 4];
    section_of(bytes, 0.5f);
    const small_spec spec = {.rank = MANY, .side = 5, .shape = SMALL_IDENTITY};
    for (uint32_t out = 0; out <= SMALL_FOLDED - MANY + 1; ++out) {
        eits_real frame[SMALL_ROWS];
        eits_context *ctx = dense_bench_take(&b, with_precision(spec, 1, bytes, SIZE), 0);
        CHANGE_OPTIONS(ctx, o.project_reference = 0, o.diagnostics = 0, o.max_masked = SMALL_ROWS);
        small_reference(ctx->model, 1, frame);
        CHECK_OK(eits_reference_set(ctx, frame, SMALL_ROWS));
        for (uint32_t k = 0; k < out; ++k)
            lose_fold(ctx->model, k, frame);
        STAGE(ctx, frame);
        CHECK_EQUAL(ctx->whitening.form, out > 0 && out <= SMALL_FOLDED - MANY
                                             ? EITS_WHITENING_TRIANGLE
                                             : EITS_WHITENING_STORED);
    }
}

/* A frame without fold 0, `pivot` the precision of that fold. */
static void solved(float leaning, float pivot, eits_real wanted_scale, eits_whitening_form form)
{
    uint8_t bytes[SIZE + 4];
    eits_real frame[SMALL_ROWS];
    section_of(bytes, leaning);
    small_put_f32(entry(bytes, 0, 0), pivot);
    eits_context *ctx = dense_bench_take(&b, with_precision(TAUGHT, 1, bytes, SIZE), 0);
    CHANGE_OPTIONS(ctx, o.project_reference = 0, o.diagnostics = 0);
    small_reference(ctx->model, 1, frame);
    CHECK_OK(eits_reference_set(ctx, frame, SMALL_ROWS));
    for (uint32_t i = 0; i < SMALL_ROWS; ++i)
        frame[i] *= (eits_real)1.25;
    lose_fold(ctx->model, 0, frame);
    STAGE(ctx, frame);
    CHECK_EQUAL(ctx->whitening.form, form);
    const eits_real p = (eits_real)((const float *)ctx->model->reduction.data)[0];
    CHECK_NEAR(ctx->frame.y[0], wanted_scale * p * ctx->frame.d[OTHER], 1e-5);
}

TEST(a_row_leans_on_others_by_its_precision)
{
    /* d_0 = -.5 / 2 d_OTHER, F_00 = sqrt(1 - 1 / 2), y = d_0 / F_00 */
    solved(0.5f, 2.0f, (eits_real)(-0.25 / sqrt(0.5)), EITS_WHITENING_TRIANGLE);
    /* a precision of nothing cannot be divided by: the row is projected out, as without PREC */
    solved(0.5f, 0.0f, 0, EITS_WHITENING_STORED);
}

RUN_TESTS("rows out", dense_bench_close(&b))
