/* The workspace: its size, its bounds, contexts beside each other; the options; the self-test. */
#include "steps.h"

static dense_bench b;

/* The size is a constant expression: this compiles only if it is. */
static uint8_t constant[EITS_WORKSPACE_SIZE(40, 21, 12, 36, 36, 0, 1)];

/* The workspace of a model has the size that the macro gives, and ends where its last array ends.
 * */
static void check_size(small_spec spec, int prepared)
{
    small_model made = small_model_make(spec);
    eits_model m;
    CHECK_OK(eits_model_open(&m, made.blob, made.size));
    const size_t size = eits_workspace_size(&m, prepared);
    CHECK_EQUAL(size,
                EITS_WORKSPACE_SIZE(m.n_rows, m.n_folded, m.rank, m.n_pixels, (size_t)m.nx * m.ny,
                                    m.fields.at.data != NULL ? m.n_electrodes : 0, prepared));
    CHECK_EQUAL(size % 16, 0);
    void *memory;
    eits_context *ctx;
    uint8_t *workspace = small_aligned(&memory, size);
    CHECK_OK(eits_init(workspace, size, &m, &ctx));
    const uint8_t *cache_end = ctx->columns.wanted + EITS_ALIGN16(EITS_CACHED(m.n_pixels));
    const uint8_t *end = prepared ? (uint8_t *)ctx->solver.working_panels +
                                        EITS_REALS(EITS_PANEL_COLUMNS(m.n_pixels) * m.rank)
                                  : cache_end;
    /* nothing is missing; panels may need room to be aligned */
    const size_t spare = (size_t)(workspace + size - end);
    CHECK(prepared ? spare <= EITS_LINE - 16 : spare == 0);
    CHECK((uintptr_t)ctx->columns.panels % EITS_LINE == 0);
    CHECK((ctx->columns.panels != NULL) == prepared &&
          (ctx->solver.working_panels != NULL) == prepared);
    CHECK((uint8_t *)ctx == workspace);
    CHECK(((uintptr_t)ctx->frame.y | (uintptr_t)ctx->projection.basis |
           (uintptr_t)eits_get_coefficients(ctx) | (uintptr_t)ctx->scratch.index) %
              16 ==
          0);
    free(memory);
    small_model_free(&made);
}

TEST(sizes_agree)
{
    static const uint32_t ranks[] = {1, 3, 8, 12, 20}, sides[] = {3, 4, 6, 13};
    CHECK_EQUAL(eits_workspace_size(NULL, 0), 0);
    CHECK_EQUAL(eits_workspace_size(NULL, 1), 0);
    for (size_t r = 0; r < COUNT_OF(ranks); ++r) {
        for (size_t k = 0; IN_TABLE(k, sides); ++k) {
            const small_spec square = {.rank = ranks[r], .side = sides[k]},
                             round = {.rank = ranks[r], .side = sides[k], .round = 1};
            check_size(square, 0);
            check_size(square, 1);
            check_size(round, 0);
            check_size(round, 1);
        }
    }
    CHECK(sizeof constant > 0 && sizeof constant % 16 == 0);
}

TEST(refused_workspaces)
{
    small_model made = small_model_make((small_spec){.rank = 12, .side = 6});
    eits_model m;
    eits_context *ctx = NULL;
    CHECK_OK(eits_model_open(&m, made.blob, made.size));
    const size_t size = eits_workspace_size(&m, 0), prepared = eits_workspace_size(&m, 1);
    CHECK_EQUAL(prepared, sizeof constant);
    CHECK(prepared > size);
    void *memory;
    uint8_t *workspace = small_aligned(&memory, prepared + 16);
    CHECK_REFUSED(eits_init(workspace, size, &m, NULL));
    CHECK_REFUSED(eits_init(workspace, size, NULL, &ctx));
    CHECK_REFUSED(eits_init(NULL, size, &m, &ctx));
    CHECK_EQUAL(eits_init(workspace, 0, &m, &ctx), EITS_E_WORKSPACE);
    CHECK_EQUAL(eits_init(workspace, size - 1, &m, &ctx), EITS_E_WORKSPACE);
    for (size_t shift = 1; shift < 16; ++shift)
        CHECK_EQUAL(eits_init(workspace + shift, prepared, &m, &ctx), EITS_E_WORKSPACE);
    CHECK(ctx == NULL);
    CHECK_OK(eits_init(workspace, size, &m, &ctx));
    CHECK(ctx->columns.panels == NULL);
    CHECK_OK(eits_init(workspace, prepared - 1, &m, &ctx));
    CHECK(ctx->columns.panels == NULL); /* not enough for the copy: it is left out */
    CHECK_OK(eits_init(workspace, prepared, &m, &ctx));
    CHECK(ctx->columns.panels != NULL);
    free(memory);
    small_model_free(&made);
}

/* Everything that a context does, with many touches and rows left out. */
static void exercise(eits_context *ctx, uint64_t *state)
{
    eits_real reference[SMALL_ROWS], frame[SMALL_ROWS], frames[8][SMALL_ROWS];
    eits_touch touches[EITS_MAX_TOUCHES];
    uint32_t count;
    small_reference(ctx->model, 1, reference);
    for (int k = 0; k < 8; ++k)
        vary(frames[k], reference, 1e-4, state);
    LEARN(ctx, 8, frames);
    CHANGE_OPTIONS(ctx, o.touch_min_fraction = 0, o.touch_threshold = 0,
                   o.max_touches = EITS_MAX_TOUCHES, o.warm_start = 1, o.sign = EITS_SIGN_BOTH);
    for (int k = 0; k < 6; ++k) {
        for (int i = 0; i < SMALL_ROWS; ++i)
            frame[i] = small_random(state) < -0.9 + 0.2 * k
                           ? R(NAN)
                           : reference[i] * (eits_real)(1 + 0.2 * small_random(state));
        const eits_status status = eits_reconstruct(ctx, frame, SMALL_ROWS, NULL, NULL);
        CHECK(status == EITS_OK || status == EITS_E_FRAME_ROWS);
        CHECK_OK(eits_find_touches(ctx, touches, EITS_MAX_TOUCHES, &count));
    }
}

TEST(nothing_is_written_beside_the_workspace)
{
    enum { GUARD = 64 };
    for (int prepared = 0; prepared < 2; ++prepared) {
        for (uint32_t rank = 1; rank <= 24; rank += 23) {
            const small_spec spec = {.rank = rank, .side = 5, .shape = SMALL_WAVES, .round = 1};
            small_model made = small_model_make(spec);
            eits_model m;
            CHECK_OK(eits_model_open(&m, made.blob, made.size));
            const size_t size = eits_workspace_size(&m, prepared);
            void *memory, *copy_memory;
            uint8_t *whole = small_aligned(&memory, size + 2 * GUARD),
                    *copy = small_aligned(&copy_memory, made.size);
            memset(whole, 0xC3, size + 2 * GUARD);
            memcpy(copy, made.blob, made.size);
            eits_context *ctx;
            uint64_t state = 101;
            CHECK_OK(eits_init(whole + GUARD, size, &m, &ctx));
            exercise(ctx, &state);
            for (int i = 0; i < GUARD; ++i)
                CHECK(whole[i] == 0xC3 && whole[GUARD + size + (size_t)i] == 0xC3);
            CHECK(memcmp(copy, made.blob, made.size) == 0); /* the model is only read */
            free(memory);
            free(copy_memory);
            small_model_free(&made);
        }
    }
}

/* Two contexts on one model, used in turn, give what each gives alone; whatever the workspace held
 * before. */
TEST(contexts_are_independent)
{
    small_model made = small_model_make((small_spec){.rank = 12, .side = 6});
    eits_real alone[2][36], image[36], frames[2][SMALL_ROWS], references[2][SMALL_ROWS];
    uint64_t state = 102;
    small_context c[2];
    small_context_open(&c[0], &made, 0);
    small_context_open(&c[1], &made, 1);
    for (int k = 0; k < 2; ++k) {
        small_reference(&c[k].model, k == 0 ? 1 : -3, references[k]);
        vary(frames[k], references[k], 0.2, &state);
        CHECK_OK(eits_reference_set(c[k].ctx, references[k], SMALL_ROWS));
        CHECK_OK(eits_reconstruct(c[k].ctx, frames[k], SMALL_ROWS, alone[k], NULL));
    }
    CHECK(memcmp(alone[0], alone[1], sizeof image) != 0);
    for (int round = 0; round < 6; ++round) {
        CHECK_OK(eits_reconstruct(c[round % 2].ctx, frames[round % 2], SMALL_ROWS, image, NULL));
        CHECK(memcmp(image, alone[round % 2], sizeof image) == 0);
    }
    const size_t size = eits_workspace_size(&c[0].model, 0);
    void *workspace = c[0].ctx;
    memset(workspace, 0xFF, size); /* all NaN */
    CHECK_OK(eits_init(workspace, size, &c[0].model, &c[0].ctx));
    CHECK_OK(eits_reference_set(c[0].ctx, references[0], SMALL_ROWS));
    CHECK_OK(eits_reconstruct(c[0].ctx, frames[0], SMALL_ROWS, image, NULL));
    CHECK(memcmp(image, alone[0], sizeof image) == 0);
    small_context_close(&c[0]);
    small_context_close(&c[1]);
    small_model_free(&made);
}

TEST(default_options)
{
    small_model made = small_model_make((small_spec){.rank = 3, .side = 3});
    /* more touches than a context holds */
    small_put_u32(small_model_section(&made, "DEFS", NULL) + 4, 99);
    small_model_seal(&made);
    eits_model m;
    eits_options o;
    CHECK_OK(eits_model_open(&m, made.blob, made.size));
    CHECK_REFUSED(eits_options_default(NULL, &o));
    CHECK_REFUSED(eits_options_default(&m, NULL));
    CHECK_OK(eits_options_default(&m, &o));
    CHECK(o.iterations == 60 && o.max_touches == EITS_MAX_TOUCHES &&
          o.max_masked == SMALL_ROWS / 2);
    CHECK(o.gap_every >= 1 && o.sign == EITS_SIGN_INCREASE && o.warm_start == 0 &&
          o.project_reference == 1);
    CHECK(o.lambda_abs == 0 && o.gap_rel == 0 && o.saturation_v == 0 && o.touch_sweeps >= 1);
    CHECK_NEAR(o.lambda_rel, 0.03f, 0);
    CHECK_NEAR(o.lambda_noise_factor, 0.3f, 0);
    CHECK_NEAR(o.detection_factor, 1.2f, 0);
    CHECK_NEAR(o.touch_threshold, 0.2f, 0);
    CHECK_NEAR(o.touch_min_fraction, 0.003f, 0);
    CHECK_NEAR(o.touch_min_radius_mm, 3, 0);
    CHECK_NEAR(o.touch_max_radius_mm, 40, 0);
    CHECK_NEAR(o.touch_seed_radius_mm, 9, 0);
    CHECK_NEAR(o.touch_change_s_per_m, 0, 0);
    CHECK_NEAR(o.touch_radius_weight, 1e-3f, 0);
    CHECK_NEAR(o.follow_mm, 25, 0);
    const eits_options usual = o;
    CHECK_REFUSED(eits_options_track(NULL));
    CHECK_OK(eits_options_track(&o));
    CHECK_NEAR(o.detection_factor, 0.75 * 1.2f, 1e-7);
    o.detection_factor = usual.detection_factor; /* and nothing else */
    uint32_t count = 0;
    const eits_option *option = eits_option_table(&count);
    CHECK(count > 0);
    for (uint32_t k = 0; k < count; ++k)
        CHECK(memcmp((const char *)&o + option[k].offset, (const char *)&usual + option[k].offset,
                     option[k].size) == 0);
    small_model_free(&made);
}

#define WORD(field, value) {offsetof(eits_options, field), 1, (value)}
#define REAL(field, value) {offsetof(eits_options, field), 0, (value)}
#define REAL_WRONG(field)                                                                \
    REAL(field, NAN), REAL(field, INFINITY), REAL(field, -INFINITY), REAL(field, -1e-3), \
        REAL(field, 1.1e30)

TEST(options_out_of_range)
{
    static const struct {
        size_t offset;
        int whole;
        double value;
    } wrong[] = {
        WORD(iterations, 0),
        WORD(gap_every, 0),
        WORD(max_touches, EITS_MAX_TOUCHES + 1),
        WORD(sign, 3),
        WORD(sign, 4294967295.0),
        WORD(warm_start, 2),
        WORD(project_reference, 2),
        WORD(touch_sweeps, 1001),
        REAL_WRONG(lambda_abs),
        REAL_WRONG(lambda_rel),
        REAL(lambda_rel, 1.001),
        REAL_WRONG(lambda_noise_factor),
        REAL_WRONG(detection_factor),
        REAL_WRONG(gap_rel),
        REAL(gap_rel, 1.001),
        REAL_WRONG(saturation_v),
        REAL_WRONG(touch_threshold),
        REAL(touch_threshold, 1.001),
        REAL_WRONG(touch_min_fraction),
        REAL(touch_min_fraction, 1.001),
        REAL_WRONG(touch_min_radius_mm),
        REAL(touch_min_radius_mm, 0),
        REAL(touch_min_radius_mm, 9.1),
        REAL_WRONG(touch_max_radius_mm),
        REAL(touch_max_radius_mm, 8.9),
        REAL_WRONG(touch_seed_radius_mm),
        REAL(touch_seed_radius_mm, 2.9),
        REAL(touch_seed_radius_mm, 40.1),
        REAL_WRONG(touch_change_s_per_m),
        REAL_WRONG(touch_radius_weight),
        REAL_WRONG(follow_mm),
        REAL_WRONG(regularisation_noise_factor),
    };
    eits_context *ctx = dense_bench_open(&b, (small_spec){.rank = 3, .side = 3}, 0);
    const eits_options before = *eits_get_options(ctx);
    CHECK_REFUSED(eits_set_options(NULL, &before));
    CHECK_REFUSED(eits_set_options(ctx, NULL));
    for (size_t k = 0; IN_TABLE(k, wrong); ++k) {
        eits_options o = before;
        const uint32_t whole = wrong[k].whole ? (uint32_t)wrong[k].value : 0;
        const eits_real real = (eits_real)wrong[k].value;
        memcpy((uint8_t *)&o + wrong[k].offset, wrong[k].whole ? (const void *)&whole : &real,
               wrong[k].whole ? 4 : sizeof real);
        CHECK_REFUSED(eits_set_options(ctx, &o));
        CHECK(memcmp(eits_get_options(ctx), &before, sizeof before) == 0);
    }
    eits_options o = before; /* all limits that are still allowed, at once */
    o.iterations = o.gap_every = UINT32_MAX;
    o.max_touches = 0;
    o.max_masked = UINT32_MAX;
    o.touch_sweeps = 1000;
    o.lambda_rel = o.gap_rel = o.touch_threshold = o.touch_min_fraction = 1;
    o.lambda_abs = o.detection_factor = o.lambda_noise_factor = o.saturation_v = o.follow_mm =
        o.touch_change_s_per_m = R(1e30);
    o.regularisation_noise_factor = R(1e30);
    o.touch_min_radius_mm = o.touch_seed_radius_mm = o.touch_max_radius_mm = R(1e-6);
    CHECK_OK(eits_set_options(ctx, &o));
    CHECK(memcmp(eits_get_options(ctx), &o, sizeof o) == 0);
}

/* A golden image that is what this build gives: no difference. One pixel changed: just that
 * difference is reported. */
TEST(self_test)
{
    small_model made = small_model_make((small_spec){.rank = 12, .side = 6});
    small_context c;
    eits_real difference = 9, image[36];
    uint8_t *golden = small_model_section(&made, "GOLD", NULL) + 4 * 2 * SMALL_ROWS;
    small_context_open(&c, &made, 1);
    CHECK_REFUSED(eits_self_test(NULL, &difference));
    CHECK_REFUSED(eits_self_test(c.ctx, NULL));
    CHECK_OK(eits_self_test(c.ctx, &difference));
    double peak = 0;
    for (int j = 0; j < 36; ++j)
        peak = fmax(peak, fabs((double)eits_get_image(c.ctx)[j]));
    CHECK(peak > 0);
    /* against an image of zeros: the absolute difference */
    CHECK_NEAR(difference, peak, 2 * EPS * peak);
    memcpy(image, eits_get_image(c.ctx), sizeof image);
    small_context_close(&c);
    for (int j = 0; j < 36; ++j)
        small_put_f32(golden + 4 * j, (float)image[j]);
    small_model_seal(&made);
    for (int prepared = 0; prepared < 2; ++prepared) {
        small_context_open(&c, &made, prepared);
        CHECK_OK(eits_self_test(c.ctx, &difference));
        /* the very bits; in double, the rounding of the stored image */
        CHECK_NEAR(difference, 0, BOTH_WIDTHS(0, 1e-7));
        CHECK(c.ctx->reference.ready);
        CHECK_NEAR(c.ctx->reference.v0[3], c.model.golden.reference[3], 0);
        /* a context as before: learning starts from nothing */
        eits_real frames[4][SMALL_ROWS];
        for (int k = 0; k < 4; ++k)
            small_reference(&c.model, 1, frames[k]);
        LEARN(c.ctx, 4, frames);
        CHECK(c.ctx->reference.noise_v <= R(1e-6));
        small_context_close(&c);
    }
    small_put_f32(golden + 4 * 7, (float)(image[7] + (eits_real)(0.25 * peak)));
    small_model_seal(&made);
    small_context_open(&c, &made, 1);
    CHECK_OK(eits_self_test(c.ctx, &difference));
    const double stated_peak = fmax(peak, (double)image[7] + 0.25 * peak);
    CHECK_NEAR(difference, 0.25 * peak / stated_peak, 1e-6);
    small_context_close(&c);
    memset(golden - 8 * SMALL_ROWS, 0, 4 * SMALL_ROWS); /* a reference of zeros is none */
    small_model_seal(&made);
    small_context_open(&c, &made, 1);
    CHECK_EQUAL(eits_self_test(c.ctx, &difference), EITS_E_FRAME_ZERO);
    small_context_close(&c);
    small_model_free(&made);
}

/* Checksums of the set: as they are, nothing is said; one of another core, and the image is right
 * all the same: refused; another revision's are not looked at. No float64 core has any. */
TEST(self_test_sums)
{
    small_model plain =
        small_model_make((small_spec){.rank = 12, .side = 6, .shape = SMALL_WHITENED, .fields = 1});
    small_context c;
    uint32_t words[1 + EITS_SELF_TEST_SUMS] = {EITS_SELF_TEST_REVISION};
    eits_real difference;
    small_context_open(&c, &plain, 0);
    CHECK_REFUSED(eits_self_test_sums(NULL, words + 1));
    CHECK_REFUSED(eits_self_test_sums(c.ctx, NULL));
    CHECK_EQUAL(eits_self_test_sums(c.ctx, words + 1), BOTH_WIDTHS(EITS_OK, EITS_E_ARITHMETIC));
    CHECK_OK(eits_self_test(c.ctx, &difference));
    float *golden = (float *)(void *)(small_model_section(&plain, "GOLD", NULL) + 8 * SMALL_ROWS);
    for (int j = 0; j < 36; ++j)
        small_put_f32((uint8_t *)(golden + j), (float)eits_get_image(c.ctx)[j]);
    small_context_close(&c);
    for (int k = 1; k <= EITS_SELF_TEST_SUMS; ++k) {
        for (int j = 1; j < k && BOTH_WIDTHS(1, 0); ++j)
            CHECK(words[k] != words[j]);
    }
    static const struct {
        int word;
        uint32_t add, size;
        eits_status opened, tested;
    } cases[] = {
        {1, 0, sizeof words, EITS_OK, EITS_OK},
        {1, 1, sizeof words, EITS_OK, BOTH_WIDTHS(EITS_E_ARITHMETIC, EITS_OK)},
        {EITS_SELF_TEST_SUMS, 1, sizeof words, EITS_OK, BOTH_WIDTHS(EITS_E_ARITHMETIC, EITS_OK)},
        {0, 1, sizeof words, EITS_OK, EITS_OK}, /* revision */
        {1, 1, sizeof words - 4, EITS_OK, EITS_OK},
        {1, 1, 4, EITS_OK, EITS_OK},
        {1, 0, sizeof words - 1, EITS_E_MODEL_SECTION, EITS_OK},
        {1, 0, 0, EITS_E_MODEL_SECTION, EITS_OK},
    };
    for (size_t k = 0; IN_TABLE(k, cases); ++k) {
        words[cases[k].word] += cases[k].add;
        small_model made = small_model_with_section(&plain, "SUMS", words, cases[k].size);
        eits_model model;
        CHECK_EQUAL(eits_model_open(&model, made.blob, made.size), cases[k].opened);
        if (cases[k].opened == EITS_OK) {
            small_context_open(&c, &made, (int)k % 2);
            CHECK_EQUAL(eits_self_test(c.ctx, &difference), cases[k].tested);
            CHECK_NEAR(difference, 0, BOTH_WIDTHS(0, 1e-6));
            CHECK_NEAR(c.ctx->reference.v0[3], c.model.golden.reference[3], 0);
            CHECK(c.ctx->options.iterations == model.defaults->iterations);
            small_context_close(&c);
        }
        small_model_free(&made);
        words[cases[k].word] -= cases[k].add;
    }
    memset(small_model_section(&plain, "GOLD", NULL), 0, 4 * SMALL_ROWS);
    small_model_seal(&plain);
    small_model made = small_model_with_section(&plain, "SUMS", words, sizeof words);
    small_context_open(&c, &made, 0); /* no reference, no sums */
    CHECK_EQUAL(eits_self_test_sums(c.ctx, words + 1),
                BOTH_WIDTHS(EITS_E_FRAME_ZERO, EITS_E_ARITHMETIC));
    CHECK_EQUAL(eits_self_test(c.ctx, &difference), EITS_E_FRAME_ZERO);
    small_context_close(&c);
    small_model_free(&made);
    small_model_free(&plain);
}

RUN_TESTS("context", dense_bench_close(&b))
