/* Models of which any byte is changed, under a right checksum: refused, or all must still hold. */
#include "steps.h"

/* Whatever opens has defaults that its own context accepts again, runs, and never shows a number
 * that is not finite. */
static void use(const small_model *made)
{
    eits_model model;
    if (eits_model_open(&model, made->blob, made->size) != EITS_OK)
        return;
    const size_t size = eits_workspace_size(&model, 1);
    void *memory;
    eits_context *ctx;
    uint8_t *workspace = small_aligned(&memory, size);
    CHECK_OK(eits_init(workspace, size, &model, &ctx));
    eits_options options = *eits_get_options(ctx);
    CHECK_OK(eits_set_options(ctx, &options));
    options.iterations = options.iterations < 25 ? options.iterations : 25;
    options.second_pass = 1;
    CHECK_OK(eits_set_options(ctx, &options));
    eits_real difference = 0;
    (void)eits_self_test(ctx, &difference);
    for (uint32_t j = 0; j < model.n_pixels; ++j)
        CHECK(isfinite((double)eits_get_image(ctx)[j]));
    eits_touch touches[EITS_MAX_TOUCHES];
    uint32_t count = 99;
    CHECK_OK(eits_find_touches(ctx, touches, EITS_MAX_TOUCHES, &count));
    CHECK(count <= EITS_MAX_TOUCHES);
    for (uint32_t k = 0; k < count && k < EITS_MAX_TOUCHES; ++k) {
        CHECK(isfinite((double)touches[k].x_mm) && isfinite((double)touches[k].y_mm) &&
              touches[k].radius_mm > 0);
        CHECK(isfinite((double)touches[k].strength_s_per_m_mm2) &&
              isfinite((double)touches[k].explained));
    }
    free(memory);
}

TEST(every_byte_changed_and_sealed)
{
    static const uint8_t changes[] = {0xFF, 0x80, 0x40, 0x01};
    for (int storage = 0; storage < 4; ++storage) {
        const small_spec spec = {.rank = 3,
                                 .side = 3,
                                 .storage = (eits_storage)storage,
                                 .kind = (eits_data_kind)(storage % 3),
                                 .fields = storage == 0};
        small_model made = small_model_make(spec);
        for (size_t at = 16; at < made.size; ++at) {
            for (size_t c = 0; c < sizeof changes; ++c) {
                made.blob[at] ^= changes[c];
                small_model_seal(&made);
                use(&made);
                made.blob[at] ^= changes[c];
            }
        }
        small_model_free(&made);
    }
}

TEST(many_bytes_changed_and_sealed)
{
    uint64_t state = 99;
    for (int round = 0; round < 2000; ++round) {
        const small_spec spec = {
            .rank = 3, .side = 3, .storage = (eits_storage)(round % 4), .fields = round % 2};
        small_model made = small_model_make(spec);
        const int changes = 1 + round % 7;
        for (int c = 0; c < changes; ++c) {
            const size_t at =
                16 + (size_t)((small_random(&state) + 1) / 2 * (double)(made.size - 16));
            made.blob[at] = (uint8_t)(128 + 127 * small_random(&state));
        }
        small_model_seal(&made);
        use(&made);
        small_model_free(&made);
    }
}

RUN_TESTS("model_bytes")
