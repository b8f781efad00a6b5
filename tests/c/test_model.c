/* Opening models: good ones, and each way in which the header, the checksum or the section table
 * can be wrong. */
#include "steps.h"

static const small_spec TINY = {.rank = 3, .side = 3};

/* Opens a model; if that fails, the structure must be unchanged. */
static eits_status open_untouched(const void *blob, size_t size)
{
    eits_model model, before;
    memset(&model, 0xA5, sizeof model);
    memcpy(&before, &model, sizeof model);
    const eits_status status = eits_model_open(&model, blob, size);
    CHECK(status == EITS_OK || memcmp(&model, &before, sizeof model) == 0);
    return status;
}

static eits_status open_small(const small_model *model)
{
    return open_untouched(model->blob, model->size);
}

TEST(good_models_open)
{
    for (int storage = 0; storage < 4; ++storage) {
        const int integer = storage >= EITS_STORAGE_I16;
        const small_spec spec = {
            .rank = 10, .side = 5, .storage = (eits_storage)storage, .kind = EITS_DATA_LOG_RATIO};
        small_model made = small_model_make(spec);
        eits_model model;
        CHECK_OK(eits_model_open(&model, made.blob, made.size));
        CHECK_EQUAL(model.n_electrodes, 8);
        CHECK_EQUAL(model.n_rows, 40);
        CHECK_EQUAL(model.n_folded, 21);
        CHECK_EQUAL(model.rank, 10);
        CHECK_EQUAL(model.n_pixels, 25);
        CHECK(model.nx == 5 && model.ny == 5);
        CHECK_EQUAL(model.data_kind, EITS_DATA_LOG_RATIO);
        CHECK_NEAR(model.pixel_mm, 6, 0);
        CHECK_NEAR(model.origin_x_mm, -15, 0);
        CHECK_NEAR(model.origin_y_mm, -15, 0);
        CHECK_NEAR(model.current_a, 1e-3, 1e-10);
        CHECK(model.lipschitz > 0.1f && model.lipschitz < 10.0f);
        CHECK_NEAR(model.noise_gain, 1, 0);
        CHECK(model.protocol_hash == eits_protocol_hash(8, 40, model.protocol));
        CHECK(model.protocol == small_model_section(&made, "PROT", NULL));
        CHECK((const uint8_t *)model.fold == small_model_section(&made, "FOLD", NULL));
        CHECK((const uint8_t *)model.v_ref == small_model_section(&made, "VREF", NULL));
        CHECK((const uint8_t *)model.column_weight == small_model_section(&made, "COLW", NULL));
        CHECK((const uint8_t *)model.pixel == small_model_section(&made, "GRID", NULL));
        CHECK((const uint8_t *)model.defaults == small_model_section(&made, "DEFS", NULL));
        CHECK((const uint8_t *)model.golden.reference == small_model_section(&made, "GOLD", NULL));
        CHECK(model.golden.frame == model.golden.reference + 40 &&
              model.golden.image == model.golden.frame + 40);
        CHECK(model.reduction.data == small_model_section(&made, "REDU", NULL) &&
              model.reduction.scale == NULL);
        CHECK(model.reduction.rows == 10 && model.reduction.cols == 21 &&
              model.reduction.stride == 16);
        CHECK_EQUAL(model.reduction.storage, EITS_STORAGE_F32);
        CHECK(model.sensitivity.data == small_model_section(&made, "SENS", NULL));
        CHECK(model.sensitivity.rows == 10 && model.sensitivity.cols == 25 &&
              model.sensitivity.stride == 16);
        CHECK_EQUAL(model.sensitivity.storage, storage);
        CHECK((model.sensitivity.scale != NULL) == integer);
        CHECK(model.meta_size == 2 && memcmp(model.meta, "{}", 2) == 0);
        CHECK_EQUAL(model.defaults->iterations, 60);
        CHECK_NEAR(model.defaults->touch_seed_radius_mm, 9, 0);
        CHECK(model.fold[2].sign == -1 && model.fold[0].sign == 1 &&
              model.fold[20].second == EITS_FOLD_NONE);
        small_model_free(&made);
    }
}

TEST(null_and_misaligned)
{
    small_model made = small_model_make(TINY);
    eits_model model;
    CHECK_REFUSED(eits_model_open(NULL, made.blob, made.size));
    CHECK_REFUSED(eits_model_open(&model, NULL, made.size));
    void *memory;
    uint8_t *room = small_aligned(&memory, made.size + 16);
    for (size_t shift = 0; shift <= 16; ++shift) {
        memcpy(room + shift, made.blob, made.size);
        CHECK_EQUAL(open_untouched(room + shift, made.size),
                    shift % 16 == 0 ? EITS_OK : EITS_E_MODEL_ALIGNMENT);
    }
    free(memory);
    small_model_free(&made);
}

/* Each shorter blob lies in memory of just its size, so that the address sanitizer sees a read
 * beyond it. */
TEST(truncated_at_every_length)
{
    small_model made = small_model_make(TINY);
    for (size_t length = 0; length < made.size; ++length) {
        uint8_t *blob = malloc(length + (length == 0));
        if (blob == NULL)
            abort();
        memcpy(blob, made.blob, length);
        CHECK_EQUAL(open_untouched(blob, length),
                    length < 4 ? EITS_E_MODEL_MAGIC : EITS_E_MODEL_TRUNCATED);
        free(blob);
    }
    void *memory;
    uint8_t *longer = small_aligned(&memory, made.size + 100);
    memset(longer, 0xEE, made.size + 100);
    memcpy(longer, made.blob, made.size);
    /* what follows does not belong to the model */
    CHECK_OK(open_untouched(longer, made.size + 100));
    free(memory);
    small_model_free(&made);
}

TEST(every_byte_flipped_in_turn)
{
    small_model made = small_model_make(TINY);
    for (size_t at = 0; at < made.size; ++at) {
        for (unsigned bit = 0; bit < 9; ++bit) {
            const uint8_t change = (uint8_t)(bit < 8 ? 1u << bit : 0xFFu);
            made.blob[at] ^= change;
            const eits_status status = open_small(&made);
            if (at < 4)
                CHECK_EQUAL(status, EITS_E_MODEL_MAGIC);
            else if (at < 6)
                CHECK_EQUAL(status, EITS_E_MODEL_VERSION);
            else if (at < 8)
                CHECK_OK(status); /* another minor version */
            else if (at < 12)
                CHECK(status == EITS_E_MODEL_TRUNCATED || status == EITS_E_MODEL_VALUE ||
                      status == EITS_E_MODEL_CRC);
            else
                CHECK_EQUAL(status, EITS_E_MODEL_CRC);
            made.blob[at] ^= change;
        }
    }
    CHECK_OK(open_small(&made));
    small_model_free(&made);
}

TEST(header_fields)
{
    small_model made = small_model_make(TINY);
    const uint32_t total = (uint32_t)made.size;
    static const uint32_t wrong[] = {0, 16, 48, 63, 65, 72};
    for (size_t i = 0; IN_TABLE(i, wrong); ++i) {
        small_put_u32(made.blob + 8, wrong[i]);
        CHECK_EQUAL(open_small(&made), EITS_E_MODEL_VALUE);
    }
    small_put_u32(made.blob + 8, total + 16);
    CHECK_EQUAL(open_small(&made), EITS_E_MODEL_TRUNCATED);
    small_put_u32(made.blob + 8, 0xFFFFFFF0u);
    CHECK_EQUAL(open_small(&made), EITS_E_MODEL_TRUNCATED);
    small_put_u32(made.blob + 8, 64); /* a header alone, rightly sealed: no section at all */
    small_put_u32(made.blob + 16, 0);
    small_put_u32(made.blob + 12, eits_crc32(0, made.blob + 16, 48));
    CHECK_EQUAL(open_untouched(made.blob, 64), EITS_E_MODEL_SECTION);
    small_model_free(&made);
    made = small_model_make(TINY);
    for (uint32_t major = 0; major <= 300; ++major) {
        small_put_u16(made.blob + 4, major);
        CHECK_EQUAL(open_small(&made), major == 1 ? EITS_OK : EITS_E_MODEL_VERSION);
    }
    small_put_u16(made.blob + 4, 1);
    small_put_u16(made.blob + 6, 7);
    CHECK_OK(open_small(&made));
    made.blob[24] ^= 1;
    small_model_seal(&made);
    CHECK_EQUAL(open_small(&made), EITS_E_MODEL_VALUE); /* the protocol's hash */
    small_model_free(&made);
}

/* One change to the entry of `tag`, sealed; the model is made again each time. */
static eits_status with_entry(small_spec spec, const char *tag, uint32_t field, uint32_t value)
{
    small_model made = small_model_make(spec);
    small_put_u32(small_model_entry(&made, tag) + field, value);
    small_model_seal(&made);
    const eits_status status = open_small(&made);
    small_model_free(&made);
    return status;
}

static uint32_t tag_of(const char *text)
{
    return small_get_u32((const uint8_t *)text);
}

TEST(missing_wrong_sized_and_misplaced_sections)
{
    static const char *const tags[] = {"DIMS", "PROT", "FOLD", "VREF", "REDU", "SENS",
                                       "COLW", "GRID", "DEFS", "GOLD", "SCAL"};
    const small_spec spec = {.rank = 3, .side = 3, .storage = EITS_STORAGE_I8};
    small_model made = small_model_make(spec);
    const uint32_t total = (uint32_t)made.size, table_end = 64 + 16 * SMALL_SECTIONS;
    for (size_t i = 0; IN_TABLE(i, tags); ++i) {
        const char *tag = tags[i];
        uint32_t size, offset = (uint32_t)(small_model_section(&made, tag, &size) - made.blob);
        CHECK_OK(with_entry(spec, tag, 12, 0)); /* the reader knows what it needs */
        small_model absent = small_model_make(spec);
        small_put_u32(small_model_entry(&absent, tag) + 12, 0);
        small_put_u32(small_model_entry(&absent, tag), tag_of("ZZZZ"));
        small_model_seal(&absent);
        CHECK_EQUAL(open_small(&absent), EITS_E_MODEL_SECTION);
        small_model_free(&absent);
        CHECK_EQUAL(with_entry(spec, tag, 8, size - 4), EITS_E_MODEL_SECTION);
        CHECK_EQUAL(with_entry(spec, tag, 8, size + 4), EITS_E_MODEL_SECTION);
        CHECK_EQUAL(with_entry(spec, tag, 8, 0), EITS_E_MODEL_SECTION);
        CHECK_EQUAL(with_entry(spec, tag, 8, total), EITS_E_MODEL_SECTION);
        /* offset + size wraps */
        CHECK_EQUAL(with_entry(spec, tag, 8, 0xFFFFFFF0u), EITS_E_MODEL_SECTION);
        /* no multiple of 16 */
        CHECK_EQUAL(with_entry(spec, tag, 4, offset + 4), EITS_E_MODEL_SECTION);
        CHECK_EQUAL(with_entry(spec, tag, 4, 0), EITS_E_MODEL_SECTION);
        /* over the table's last entry */
        CHECK_EQUAL(with_entry(spec, tag, 4, table_end - 16), EITS_E_MODEL_SECTION);
        CHECK_EQUAL(with_entry(spec, tag, 4, total), EITS_E_MODEL_SECTION);
        CHECK_EQUAL(with_entry(spec, tag, 4, total + 16), EITS_E_MODEL_SECTION);
        CHECK_EQUAL(with_entry(spec, tag, 4, 0xFFFFFFF0u), EITS_E_MODEL_SECTION);
    }
    small_model_free(&made);
    /* a scale where none belongs */
    CHECK_EQUAL(with_entry(TINY, "XTRA", 0, tag_of("SCAL")), EITS_E_MODEL_SECTION);
}

TEST(unknown_and_repeated_sections)
{
    small_model made = small_model_make(TINY);
    uint8_t *meta = small_model_entry(&made, "META");
    memcpy(meta, "NEWS", 4);
    small_model_seal(&made);
    eits_model model;
    CHECK_OK(eits_model_open(&model, made.blob, made.size));
    CHECK(model.meta == NULL && model.meta_size == 0);
    small_put_u32(meta + 12, 1);
    small_model_seal(&made);
    CHECK_EQUAL(open_small(&made), EITS_E_MODEL_VERSION);
    small_put_u32(meta + 12, 0xFFFFFFFEu); /* flags that are not defined do not matter */
    small_model_seal(&made);
    CHECK_OK(open_small(&made));
    memcpy(meta, small_model_entry(&made, "VREF"), 16);
    small_model_seal(&made);
    CHECK_EQUAL(open_small(&made), EITS_E_MODEL_SECTION); /* the same section twice */
    small_model_free(&made);
    CHECK_OK(with_entry(TINY, "META", 12, 1)); /* known, though required */
    CHECK_OK(with_entry(TINY, "META", 8, 16)); /* up to the very end of the model */
    CHECK_EQUAL(with_entry(TINY, "META", 8, 17), EITS_E_MODEL_SECTION);
    CHECK_OK(with_entry(TINY, "META", 8, 0));
}

/* The sections about a model's whitening must agree with its P and with each other; a model may
 * also have none of them. */
TEST(row_forms)
{
    const small_spec spec = {.rank = 5, .side = 6, .shape = SMALL_WHITENED};
    small_model made = small_model_make(spec);
    uint32_t size;
    uint8_t *form = small_model_section(&made, "WHIT", &size);
    eits_model model;
    CHECK_OK(eits_model_open(&model, made.blob, made.size));
    CHECK_EQUAL(size, 16 + 16 * 8);
    CHECK(model.row_form.scale == (const float *)(const void *)(form + 16));
    CHECK_NEAR(model.row_form.mu, SMALL_REGULARISATION, 1e-6);
    for (uint32_t at = 0; at < size; at += 4) {
        const uint32_t kept = small_get_u32(form + at), row = (at - 16) / 32, i = (at - 16) / 4 % 8;
        const int counts = at == 4 || (at >= 16 && i < 5 && (row != 1 || i < 3) && row < 4);
        float value;
        memcpy(&value, form + at, 4);
        small_put_f32(form + at, value * 1.03f);
        small_model_seal(&made);
        if (counts)
            CHECK_EQUAL(open_small(&made), EITS_E_MODEL_VALUE);
        small_put_f32(form + at, (float)NAN);
        small_model_seal(&made);
        CHECK_EQUAL(open_small(&made),
                    at == 12 || (at >= 16 && i >= 5) ? EITS_OK : EITS_E_MODEL_VALUE);
        small_put_u32(form + at, kept);
    }
    small_model_free(&made);
    CHECK_EQUAL(with_entry(spec, "WHIT", 8, size - 4), EITS_E_MODEL_SECTION);
    CHECK_OK(with_entry(spec, "WHIT", 0, tag_of("ZZZZ")));
}

TEST(numbers_of_sections)
{
    static const uint32_t counts[] = {0,   1,   SMALL_SECTIONS - 1, 128,
                                      256, 257, 0x10000000u,        0xFFFFFFFFu};
    small_model made = small_model_make(TINY);
    for (size_t i = 0; IN_TABLE(i, counts); ++i) {
        small_put_u32(made.blob + 16, counts[i]);
        small_model_seal(&made);
        CHECK_EQUAL(open_small(&made),
                    counts[i] == SMALL_SECTIONS - 1 ? EITS_OK : EITS_E_MODEL_SECTION);
    }
    small_model_free(&made);
    /* a table that reaches beyond the blob, whose memory ends there */
    for (uint32_t count = 1; count <= 256; ++count) {
        uint8_t *blob = malloc(64);
        if (blob == NULL)
            abort();
        memset(blob, 0, 64);
        memcpy(blob, "EITM\1", 5);
        small_put_u32(blob + 8, 64);
        small_put_u32(blob + 16, count);
        small_put_u32(blob + 12, eits_crc32(0, blob + 16, 48));
        CHECK_EQUAL(open_untouched(blob, 64), EITS_E_MODEL_SECTION);
        free(blob);
    }
}

RUN_TESTS("model")
