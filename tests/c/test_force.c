/* The section LOAD: the force of a touch, compared with a computation in double, and the values
 * that a reader rejects. */
#include "steps.h"

static const small_spec TINY = {.rank = 3, .side = 3};
enum { HEAD = 32, MAX = 1024 };

/* A section of 3 points with an order, and its bytes. */
static uint32_t section_of(uint8_t *bytes, uint32_t order)
{
    static const float table[] = {0, 2, 3, 0, 1, 5};
    static const float gain[] = {0.9f,   0.25f, -0.125f, 3.5f,   -0.3f, 0.2f,  0.05f, 0.1f,
                                 -0.15f, 0.35f, 0.4f,    -0.45f, 0.11f, 0.21f, -0.31f};
    const uint32_t terms = (order + 1) * (order + 2) / 2;
    memset(bytes, 0, MAX);
    small_put_u32(bytes, 3);
    small_put_u32(bytes + 4, order);
    small_put_f32(bytes + 8, 10.0f);
    small_put_f32(bytes + 12, 1.5f);
    small_put_f32(bytes + 16, 0.02f);
    memcpy(bytes + HEAD, table, sizeof table);
    memcpy(bytes + HEAD + sizeof table, gain, terms * sizeof gain[0]);
    return HEAD + (uint32_t)sizeof table + 4 * terms;
}

static eits_status open_with(const uint8_t *bytes, uint32_t size, eits_model *model,
                             small_model *kept)
{
    *kept = small_model_with(TINY, "LOAD", bytes, size);
    return eits_model_open(model, kept->blob, kept->size);
}

static eits_status refused(const uint8_t *bytes, uint32_t size)
{
    return small_model_try(small_model_with(TINY, "LOAD", bytes, size));
}

static eits_status with_word(uint32_t order, uint32_t at, uint32_t word)
{
    uint8_t bytes[MAX];
    const uint32_t size = section_of(bytes, order);
    small_put_u32(bytes + at, word);
    return refused(bytes, size);
}

static eits_status with_number(uint32_t at, float number)
{
    uint32_t word;
    memcpy(&word, &number, sizeof word);
    return with_word(1, at, word);
}

static double gain_by_hand(const float *c, uint32_t order, double u, double v)
{
    double gain = 0;
    for (uint32_t degree = 0; degree <= order; ++degree) {
        for (uint32_t b = 0; b <= degree; ++b)
            gain += (double)*c++ * pow(u, degree - b) * pow(v, b);
    }
    return fmin(fmax(gain, 0.25), 4.0);
}

TEST(forces_are_those_of_the_table)
{
    for (uint32_t order = 0; order <= EITS_MAX_FORCE_ORDER; ++order) {
        uint8_t bytes[MAX];
        eits_model model;
        small_model kept;
        CHECK_OK(open_with(bytes, section_of(bytes, order), &model, &kept));
        for (int i = 0; i < 500; ++i) {
            /* of either sign */
            const double x = -16 + 0.064 * i, y = 12 * sin(i), strength = 6 * cos(0.37 * i);
            const double away = hypot(x, y) / 10, inward = away > 1.5 ? 1.5 / away : 1;
            const double s = fabs(strength) * gain_by_hand(model.force.gain, order, x / 10 * inward,
                                                           y / 10 * inward);
            const double force = fmin(s <= 2 ? s / 2 : 1 + 4 * (s - 2), 10);
            const double got =
                (double)eits_force_n(&model, (eits_real)x, (eits_real)y, (eits_real)strength);
            CHECK_NEAR(got, force, 200 * EPS * fmax(force, 1));
        }
        CHECK(eits_force_n(&model, 3, 4, 0) == 0);
        const eits_real ends[] = {R(1e30), R(-1e30), BOTH_WIDTHS(FLT_MAX, (eits_real)DBL_MAX)};
        for (int k = 0; k < 3; ++k) { /* finite whatever is asked */
            CHECK(eits_force_n(&model, 0, 0, ends[k]) == 10);
            const eits_real out = eits_force_n(&model, ends[k], -ends[k], 2);
            CHECK(out >= 0 && out <= 10);
        }
        small_model_free(&kept);
    }
}

TEST(no_calibration_no_force)
{
    small_model made = small_model_make(TINY);
    eits_model model;
    CHECK_OK(eits_model_open(&model, made.blob, made.size));
    CHECK(model.force.head == NULL && eits_force_n(&model, 1, 2, 3) == 0);
    small_model_free(&made);
}

TEST(sections_of_another_size)
{
    uint8_t bytes[MAX];
    for (uint32_t order = 0; order <= EITS_MAX_FORCE_ORDER; ++order) {
        const uint32_t size = section_of(bytes, order);
        CHECK_OK(refused(bytes, size));
        CHECK_EQUAL(refused(bytes, size - 4), EITS_E_MODEL_SECTION);
        CHECK_EQUAL(refused(bytes, size + 4), EITS_E_MODEL_SECTION);
    }
    CHECK_EQUAL(refused(bytes, 0), EITS_E_MODEL_SECTION);
    CHECK_EQUAL(refused(bytes, HEAD - 1), EITS_E_MODEL_SECTION);
    CHECK_EQUAL(refused(bytes, HEAD), EITS_E_MODEL_SECTION);
}

TEST(numbers_out_of_range)
{
    const uint32_t counts[] = {0, 1, 65, 0x40000003u, 0xFFFFFFFFu};
    for (size_t k = 0; IN_TABLE(k, counts); ++k)
        CHECK_EQUAL(with_word(1, 0, counts[k]), EITS_E_MODEL_VALUE);
    CHECK_EQUAL(with_word(1, 4, 5), EITS_E_MODEL_VALUE);
    CHECK_EQUAL(with_word(1, 4, 0xFFFFFFFFu), EITS_E_MODEL_VALUE);
    CHECK_EQUAL(with_word(1, 0, 2), EITS_E_MODEL_SECTION); /* in range, but not of this size */
    CHECK_EQUAL(with_number(8, 0.0f), EITS_E_MODEL_VALUE);
    CHECK_EQUAL(with_number(8, NAN), EITS_E_MODEL_VALUE);
    CHECK_EQUAL(with_number(12, -0.5f), EITS_E_MODEL_VALUE);
    CHECK_EQUAL(with_number(12, 1001.0f), EITS_E_MODEL_VALUE);
    CHECK_EQUAL(with_number(16, -0.1f), EITS_E_MODEL_VALUE);
    CHECK_EQUAL(with_number(16, INFINITY), EITS_E_MODEL_VALUE);
    CHECK_EQUAL(with_number(16, 1.5e30f), EITS_E_MODEL_VALUE);
    for (uint32_t k = 0; k < 3; ++k) { /* strengths, forces */
        for (uint32_t list = 0; list < 2; ++list) {
            const uint32_t at = HEAD + 12 * list + 4 * k;
            const float wrong[] = {-1.0f, NAN, INFINITY, 2e30f, k == 0 ? 0.5f : 0.0f};
            for (size_t w = 0; IN_TABLE(w, wrong); ++w)
                CHECK_EQUAL(with_number(at, wrong[w]), EITS_E_MODEL_VALUE);
        }
    }
    /* as much as the next: no way back */
    CHECK_EQUAL(with_number(HEAD + 4, 3.0f), EITS_E_MODEL_VALUE);
    for (uint32_t k = 0; k < 3; ++k) {
        const float wrong[] = {NAN, -INFINITY, 2e6f, -2e6f};
        for (size_t w = 0; IN_TABLE(w, wrong); ++w)
            CHECK_EQUAL(with_number(HEAD + 24 + 4 * k, wrong[w]), EITS_E_MODEL_VALUE);
    }
}

/* Touches carry the force of their own place and strength. */
TEST(touches_have_forces)
{
    uint8_t bytes[MAX];
    const small_spec spec = {.rank = 24, .side = 12, .shape = SMALL_WAVES};
    dense_bench b = {0};
    eits_context *ctx =
        dense_bench_take(&b, small_model_with(spec, "LOAD", bytes, section_of(bytes, 2)), 0);
    eits_touch touches[EITS_MAX_TOUCHES];
    eits_real frame[SMALL_ROWS];
    uint32_t count = 0;
    CHANGE_OPTIONS(ctx, o.sign = EITS_SIGN_BOTH, o.detection_factor = 0);
    small_reference(ctx->model, 1, frame);
    CHECK_OK(eits_reference_set(ctx, frame, SMALL_ROWS));
    for (uint32_t i = 0; i < SMALL_ROWS; ++i)
        frame[i] *= (eits_real)(1 + 0.05 * sin(1.7 * i));
    CHECK_OK(eits_reconstruct(ctx, frame, SMALL_ROWS, NULL, NULL));
    CHECK_OK(eits_find_touches(ctx, touches, EITS_MAX_TOUCHES, &count));
    CHECK(count > 0);
    for (uint32_t k = 0; k < count; ++k) {
        const eits_touch *t = &touches[k];
        CHECK(t->force_n > 0 &&
              t->force_n == eits_force_n(ctx->model, t->x_mm, t->y_mm, t->strength_s_per_m_mm2));
    }
    dense_bench_close(&b);
}

RUN_TESTS("force")
