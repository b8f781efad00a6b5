/* Numbers inside a model: out of range, not finite. */
#include "model/sections.h"
#include "steps.h"

static const small_spec TINY = {.rank = 3, .side = 3};

/* Open with one 32-bit word of a section changed. */
static eits_status with_word(small_spec spec, const char *tag, uint32_t at, uint32_t word)
{
    small_model made = small_model_make(spec);
    small_put_u32(small_model_section(&made, tag, NULL) + at, word);
    return small_model_try(made);
}

static eits_status with_number(small_spec spec, const char *tag, uint32_t at, float number)
{
    uint32_t word;
    memcpy(&word, &number, 4);
    return with_word(spec, tag, at, word);
}

/* Every third of 8 drives of 5 rows; rows i and j of the scan then change places, and word `at` of
 * the section becomes `value`. */
static eits_status with_order(uint32_t i, uint32_t j, uint32_t at, uint32_t value, uint32_t size)
{
    enum { ROWS = 40 };
    uint8_t bytes[4 * ROWS + 4] = {0};
    uint32_t order[ROWS];
    for (uint32_t k = 0; k < ROWS; ++k)
        order[k] = 5 * (k / 5 * 3 % 8) + k % 5;
    const uint32_t kept = order[i];
    order[i] = order[j];
    order[j] = kept;
    for (uint32_t k = 0; k < ROWS; ++k) {
        small_put_u16(bytes + 2 * k, order[k]);
        small_put_u16(bytes + 2 * (ROWS + order[k]), k);
    }
    if (at < 2 * ROWS)
        small_put_u16(bytes + 2 * at, value);
    small_model made = small_model_with(TINY, "ORDR", bytes, size);
    eits_model model;
    const eits_status status = eits_model_open(&model, made.blob, made.size);
    if (status == EITS_OK)
        CHECK(model.scan_order[6] == 16 && model.scan_place[16] == 6);
    small_model_free(&made);
    return status;
}

TEST(orders_have_each_drive_once_and_whole)
{
    CHECK_OK(with_order(0, 0, 80, 0, 160));
    CHECK_EQUAL(with_order(0, 0, 80, 0, 158), EITS_E_MODEL_SECTION);
    CHECK_EQUAL(with_order(0, 0, 80, 0, 164), EITS_E_MODEL_SECTION);
    CHECK_EQUAL(with_order(0, 0, 0, 40, 160), EITS_E_MODEL_VALUE);   /* no row */
    CHECK_EQUAL(with_order(0, 0, 5, 0, 160), EITS_E_MODEL_VALUE);    /* row 0 twice */
    CHECK_EQUAL(with_order(0, 0, 40, 1, 160), EITS_E_MODEL_VALUE);   /* another place */
    CHECK_EQUAL(with_order(0, 0, 79, 999, 160), EITS_E_MODEL_VALUE); /* no place */
    CHECK_EQUAL(with_order(6, 7, 80, 0, 160), EITS_E_MODEL_VALUE);   /* rows of a drive turned */
    CHECK_EQUAL(with_order(0, 1, 80, 0, 160), EITS_E_MODEL_VALUE);   /* the first no drive's */
    CHECK_EQUAL(with_order(4, 9, 80, 0, 160), EITS_E_MODEL_VALUE);   /* drives mixed */
}

TEST(an_order_is_read_only_within_its_section)
{
    /* Two rows, each a drive. The bytes after each table are such that row 2, which does not exist,
     * could be the second in the order. */
    enum { ROWS = 2 };
    static const uint8_t protocol[4 * (ROWS + 1)] = {0, 1, 2, 3, 1, 2, 3, 0, 2, 3, 0, 1};
    static const uint16_t orders[2][2 * ROWS + 1] = {{0, 1, 0, 1, 1}, {0, 2, 0, 1, 1}};
    static const eits_status expected[2] = {EITS_OK, EITS_E_MODEL_VALUE};
    for (uint32_t k = 0; k < 2; ++k) {
        eits_model model = {.n_rows = ROWS, .protocol = protocol};
        const eits_section found = {(const uint8_t *)orders[k], 4 * ROWS};
        CHECK_EQUAL(eits_read_scan_order(&model, &found), expected[k]);
    }
}

static eits_status with_place_factor(float factor, uint32_t size)
{
    uint8_t bytes[8] = {0};
    small_put_f32(bytes, factor);
    small_model made = small_model_with(TINY, "PLAC", bytes, size);
    eits_model model;
    const eits_status status = eits_model_open(&model, made.blob, made.size);
    if (status == EITS_OK)
        CHECK(model.place_factor == factor);
    small_model_free(&made);
    return status;
}

TEST(a_place_factor_is_a_number_from_0_on)
{
    CHECK_OK(with_place_factor(0, 4));
    CHECK_OK(with_place_factor(4.5f, 4));
    CHECK_EQUAL(with_place_factor(4.5f, 8), EITS_E_MODEL_SECTION);
    CHECK_EQUAL(with_place_factor(-1, 4), EITS_E_MODEL_VALUE);
    CHECK_EQUAL(with_place_factor(NAN, 4), EITS_E_MODEL_VALUE);
}

TEST(dimensions)
{
    static const struct {
        uint32_t at, wrong[5], count;
    } fields[] = {
        {0, {0, 3, 256, 0xFFFFFFFFu}, 4},       /* electrodes */
        {4, {0, 65535, 65536, 0xFFFFFFFFu}, 4}, /* rows */
        {8, {0, 41, 0xFFFFFFFFu}, 3},           /* folded rows, at most 40 */
        {12, {0, 1025, 0xFFFFFFFFu}, 3},        /* rank */
        {16, {0, 3, 7, 16, 0xFFFFFFFFu}, 5},    /* stride, 8 */
        {20, {0, 65536, 0xFFFFFFFFu}, 3},       /* pixels */
        /* nx, at least 3 for the pixels there are */
        {24, {0, 2, 4097, 0xFFFFFFFFu}, 4},
        {28, {0, 2, 4097, 0xFFFFFFFFu}, 4}, /* ny */
        {32, {4, 0xFFFFFFFFu}, 2},          /* storage */
        {36, {3, 0xFFFFFFFFu}, 2},          /* kind of data */
    };
    for (size_t f = 0; IN_TABLE(f, fields); ++f) {
        for (uint32_t i = 0; i < fields[f].count; ++i)
            CHECK_EQUAL(with_word(TINY, "DIMS", fields[f].at, fields[f].wrong[i]),
                        EITS_E_MODEL_VALUE);
    }
    /* in range, but different from what the sizes of the sections imply */
    CHECK_EQUAL(with_word(TINY, "DIMS", 4, 41), EITS_E_MODEL_SECTION);
    CHECK_EQUAL(with_word(TINY, "DIMS", 8, 20), EITS_E_MODEL_SECTION);
    CHECK_EQUAL(with_word(TINY, "DIMS", 20, 8), EITS_E_MODEL_SECTION);
    CHECK_EQUAL(with_word(TINY, "DIMS", 32, EITS_STORAGE_F16), EITS_E_MODEL_SECTION);
    /* no row folded: allowed, but not of this size */
    CHECK_EQUAL(with_word(TINY, "DIMS", 8, 40), EITS_E_MODEL_SECTION);
    for (uint32_t rank = 1024; rank <= 1025; ++rank) { /* the greatest, and one more */
        small_model large = small_model_make(TINY);
        uint8_t *dims = small_model_section(&large, "DIMS", NULL);
        small_put_u32(dims + 12, rank);
        small_put_u32(dims + 16, (rank + 7) / 8 * 8);
        CHECK_EQUAL(small_model_try(large),
                    rank == 1024 ? EITS_E_MODEL_SECTION : EITS_E_MODEL_VALUE);
    }
    /* the rank may be any with this stride */
    CHECK_OK(with_word(TINY, "DIMS", 12, 8));
    CHECK_OK(with_word(TINY, "DIMS", 24, 4096));
}

TEST(numbers_of_the_dimensions)
{
    for (uint32_t at = 40; at < 64; at += 4) {
        CHECK_EQUAL(with_number(TINY, "DIMS", at, NAN), EITS_E_MODEL_VALUE);
        CHECK_EQUAL(with_number(TINY, "DIMS", at, INFINITY), EITS_E_MODEL_VALUE);
        CHECK_EQUAL(with_number(TINY, "DIMS", at, -INFINITY), EITS_E_MODEL_VALUE);
        const int sign_free = at == 44 || at == 48;
        CHECK_EQUAL(with_number(TINY, "DIMS", at, -1.0f), sign_free ? EITS_OK : EITS_E_MODEL_VALUE);
        CHECK_EQUAL(with_number(TINY, "DIMS", at, 0.0f),
                    sign_free || at == 60 ? EITS_OK : EITS_E_MODEL_VALUE);
    }
    /* a Lipschitz constant whose inverse is a number, and one too small */
    CHECK_OK(with_number(TINY, "DIMS", 56, 0x1p-126f));
    CHECK_EQUAL(with_number(TINY, "DIMS", 56, 0x1p-127f), EITS_E_MODEL_VALUE);
}

/* Open with rows `from` to before `to` of the protocol on these electrodes of so many, its hash
 * right. */
static eits_status with_rows(uint32_t count, uint32_t from, uint32_t to, uint32_t electrodes)
{
    small_model made = small_model_make(TINY);
    uint8_t *table = small_model_section(&made, "PROT", NULL);
    for (uint32_t i = from; i < to; ++i)
        small_put_u32(table + 4 * i, electrodes);
    small_put_u32(small_model_section(&made, "DIMS", NULL), count);
    small_model_hash(&made, count, SMALL_ROWS, table);
    return small_model_try(made);
}

static eits_status with_protocol_row(uint32_t row, uint32_t electrodes)
{
    return with_rows(SMALL_ELECTRODES, row, row + 1, electrodes);
}

static eits_status with_electrodes(uint32_t count)
{
    return with_rows(count, 0, SMALL_ROWS, 0x03020100u);
}

TEST(electrodes_folds_and_pixels)
{
    CHECK_EQUAL(with_electrodes(3), EITS_E_MODEL_VALUE);
    CHECK_OK(with_electrodes(4));
    CHECK_OK(with_electrodes(255));
    CHECK_EQUAL(with_electrodes(256), EITS_E_MODEL_VALUE);
    /* electrode 8 of 8 */
    static const uint32_t wrong[] = {0x03020108u, 0x03020800u, 0x03080100u, 0x08020100u,
                                     0xFF020100u,
                                     /* twice in a pair */
                                     0x03020101u, 0x02020100u};
    for (size_t i = 0; IN_TABLE(i, wrong); ++i) {
        CHECK_EQUAL(with_protocol_row(0, wrong[i]), EITS_E_MODEL_VALUE);
        CHECK_EQUAL(with_protocol_row(39, wrong[i]), EITS_E_MODEL_VALUE);
    }
    CHECK_OK(with_protocol_row(39, 0x07060504u));
    /* the hash is another */
    CHECK_EQUAL(with_word(TINY, "PROT", 4 * 39, 0x07060504u), EITS_E_MODEL_VALUE);
    static const struct {
        const char *name, *tag;
        uint32_t at, word, right;
    } cases[] = {{"first row 40 of 40", "FOLD", 0, 40u | 1u << 16, 0},
                 {"no first row", "FOLD", 8 * 20, 0xFFFFFFFFu, 0},
                 {"second row 40", "FOLD", 0, 40u << 16, 0},
                 {"no second row", "FOLD", 0, 0xFFFFu << 16, 1},
                 {"sign -1", "FOLD", 4, 0xFFFFu, 1},
                 {"sign 0", "FOLD", 4, 0, 0},
                 {"sign 2", "FOLD", 8 * 20 + 4, 2, 0},
                 {"sign -2", "FOLD", 4, 0xFFFEu, 0},
                 {"column 3 of 3", "GRID", 4 * 8, 3u | 2u << 16, 0},
                 {"row 3 of 3", "GRID", 4 * 8, 2u | 3u << 16, 0},
                 {"the pixel before again", "GRID", 4 * 8, 1u | 2u << 16, 0},
                 {"not by column", "GRID", 4 * 8, 2u << 16, 0},
                 {"not by row", "GRID", 4 * 8, 2u | 1u << 16, 0},
                 {"the next one's place", "GRID", 0, 1u, 0}};
    for (size_t k = 0; IN_TABLE(k, cases); ++k) {
        CASE(cases[k].name);
        CHECK_EQUAL(with_word(TINY, cases[k].tag, cases[k].at, cases[k].word),
                    cases[k].right ? EITS_OK : EITS_E_MODEL_VALUE);
    }
    CASE("");
    const small_spec single = {.rank = 1, .side = 1};
    CHECK_OK(with_word(single, "GRID", 0, 0));
    CHECK_EQUAL(with_word(single, "GRID", 0, 1), EITS_E_MODEL_VALUE); /* the only pixel outside */
    CHECK_EQUAL(with_word(single, "GRID", 0, 1u << 16), EITS_E_MODEL_VALUE);
}

TEST(not_finite_in_each_section)
{
    static const char *const tags[] = {"VREF", "REDU", "SENS", "COLW", "GOLD"};
    static const float wrong[] = {NAN, -NAN, INFINITY, -INFINITY};
    small_model made = small_model_make(TINY);
    for (size_t i = 0; IN_TABLE(i, tags); ++i) {
        uint32_t size;
        (void)small_model_section(&made, tags[i], &size);
        for (uint32_t k = 0; k < 4; ++k) {
            /* each number, the padding of columns too */
            for (uint32_t at = 0; at < size; at += 4)
                CHECK_EQUAL(with_number(TINY, tags[i], at, wrong[k]), EITS_E_MODEL_VALUE);
        }
    }
    small_model_free(&made);
    const small_spec halves = {.rank = 3, .side = 3, .storage = EITS_STORAGE_F16};
    const small_spec bytes = {.rank = 3, .side = 3, .storage = EITS_STORAGE_I8};
    CHECK_OK(with_word(halves, "SENS", 0, 0x7BFFu));                        /* 65504 */
    CHECK_EQUAL(with_word(halves, "SENS", 0, 0x7C00u), EITS_E_MODEL_VALUE); /* infinity */
    CHECK_EQUAL(with_word(halves, "SENS", 0, 0xFC01u), EITS_E_MODEL_VALUE); /* NaN */
    CHECK_EQUAL(with_word(halves, "SENS", 9 * 16 - 4, 0x7E000000u), EITS_E_MODEL_VALUE);
    /* whole numbers are all finite */
    CHECK_OK(with_word(bytes, "SENS", 0, 0x7F80FF7Fu));
    CHECK_EQUAL(with_number(bytes, "SCAL", 0, NAN), EITS_E_MODEL_VALUE);
    CHECK_EQUAL(with_number(bytes, "SCAL", 4 * 8, INFINITY), EITS_E_MODEL_VALUE);
}

/* Section FLDS: of one size, its numbers finite and not negative, each half finite, the padding of
 * columns too. */
TEST(fields)
{
    const small_spec spec = {.rank = 3, .side = 3, .fields = 1};
    static const float wrong[] = {-1.0f, NAN, INFINITY, -INFINITY, 1.1e30f},
                       right[] = {0.0f, 1e-30f, 1.0f, 9e29f};
    for (uint32_t at = 0; at < 8; at += 4) {
        for (int k = 0; k < 5; ++k)
            CHECK_EQUAL(with_number(spec, "FLDS", at, wrong[k]), EITS_E_MODEL_VALUE);
        for (int k = 0; k < 4; ++k)
            CHECK_OK(with_number(spec, "FLDS", at, right[k]));
        /* reserved: not looked at */
        CHECK_OK(with_number(spec, "FLDS", at + 8, NAN));
    }
    uint32_t size;
    small_model made = small_model_make(spec);
    (void)small_model_section(&made, "FLDS", &size);
    CHECK_EQUAL(size, 16 + 9 * 2 * SMALL_FIELDS_STRIDE);
    for (uint32_t at = 16; at < size; at += 4) {
        CHECK_EQUAL(with_word(spec, "FLDS", at, 0x7C00u), EITS_E_MODEL_VALUE);
        CHECK_EQUAL(with_word(spec, "FLDS", at, 0xFE000000u), EITS_E_MODEL_VALUE);
        CHECK_OK(with_word(spec, "FLDS", at, 0x7BFFFBFFu));
    }
    static const uint32_t sizes[] = {0, 4, 16, 2};
    for (int k = 0; k < 8; ++k) {
        small_put_u32(small_model_entry(&made, "FLDS") + 8, k < 4   ? sizes[k]
                                                            : k % 2 ? size - sizes[k % 4]
                                                                    : size + sizes[k % 4]);
        small_model_seal(&made);
        eits_model model;
        const eits_status status = eits_model_open(&model, made.blob, made.size);
        CHECK_EQUAL(status, k == 4 ? EITS_OK : EITS_E_MODEL_SECTION);
    }
    small_model_free(&made);
    made = small_model_make(TINY);
    eits_model model;
    CHECK_OK(eits_model_open(&model, made.blob, made.size));
    CHECK(model.fields.at.data == NULL);
    small_model_free(&made);
}

TEST(defaults)
{
    static const struct {
        uint32_t at;
        float low, high; /* the greatest and least number that are just too small or too great */
    } ranges[] = {
        {8, -0.01f, 1.01f},  {12, -0.01f, 1.1e30f}, {16, -0.01f, 1.1e30f}, {20, -0.01f, 1.01f},
        {24, -0.01f, 1.01f}, {28, -0.01f, 1.01f},   {32, 0.0f, 9.5f},      {36, 8.5f, 1.1e30f},
        {40, 2.9f, 40.5f},   {44, -0.01f, 1.1e30f}, {48, -0.01f, 1.1e30f}, {52, -0.01f, 1.1e30f},
    };
    CHECK_EQUAL(with_word(TINY, "DEFS", 0, 0), EITS_E_MODEL_VALUE); /* no iteration */
    CHECK_OK(with_word(TINY, "DEFS", 0, 1));
    CHECK_OK(with_word(TINY, "DEFS", 0, EITS_MAX_MODEL_ITERATIONS));
    CHECK_EQUAL(with_word(TINY, "DEFS", 0, EITS_MAX_MODEL_ITERATIONS + 1), EITS_E_MODEL_VALUE);
    for (size_t i = 0; IN_TABLE(i, ranges); ++i) {
        CHECK_EQUAL(with_number(TINY, "DEFS", ranges[i].at, ranges[i].low), EITS_E_MODEL_VALUE);
        CHECK_EQUAL(with_number(TINY, "DEFS", ranges[i].at, ranges[i].high), EITS_E_MODEL_VALUE);
        CHECK_EQUAL(with_number(TINY, "DEFS", ranges[i].at, NAN), EITS_E_MODEL_VALUE);
        CHECK_EQUAL(with_number(TINY, "DEFS", ranges[i].at, INFINITY), EITS_E_MODEL_VALUE);
    }
    /* less than an option may be */
    CHECK_EQUAL(with_number(TINY, "DEFS", 32, 1e-7f), EITS_E_MODEL_VALUE);
    for (uint32_t solver = 0; solver < 6; ++solver)
        CHECK_EQUAL(with_word(TINY, "DEFS", 56, solver),
                    solver <= EITS_SOLVER_ACTIVE_SET && solver != 2 ? EITS_OK : EITS_E_MODEL_VALUE);
    const uint32_t all = EITS_TOUCH_FIT_ALL | EITS_GAIN_DRIFT_KEPT | EITS_TRACKS_REFERENCE;
    for (uint32_t bits = 0; bits <= all + 1; ++bits)
        CHECK_EQUAL(with_word(TINY, "DEFS", 60, bits), bits <= all ? EITS_OK : EITS_E_MODEL_VALUE);
}

static void multiply_f32(uint8_t *at, float factor)
{
    const uint32_t word = small_get_u32(at);
    float number;
    memcpy(&number, &word, 4);
    small_put_f32(at, number * factor);
}

/* How the model was whitened: each number is checked against P, and s_1 against the greatest row.
 */
TEST(whitening_form)
{
    const small_spec spec = {.rank = 8, .side = 6, .shape = SMALL_WHITENED};
    CHECK_EQUAL(with_number(spec, "WHIT", 0, -1), EITS_E_MODEL_VALUE);
    CHECK_EQUAL(with_number(spec, "WHIT", 4, 0), EITS_E_MODEL_VALUE);
    CHECK_EQUAL(with_number(spec, "WHIT", 8, 2), EITS_E_MODEL_VALUE);

    small_model made = small_model_make(spec);
    eits_model model;
    CHECK_OK(eits_model_open(&model, made.blob, made.size));
    const uint32_t rank = model.rank, stride = model.reduction.stride;
    uint8_t *whit = small_model_section(&made, "WHIT", NULL);
    multiply_f32(whit, 0.25f); /* twice s_1, and all that goes with it: rows fit, s_1 does not */
    multiply_f32(whit + 4, 2);
    for (uint32_t i = 0; i < rank; ++i) {
        multiply_f32(whit + 16 + 4 * i, 0.5f);
        multiply_f32(whit + 16 + 4 * (stride + i), 0.25f);
    }
    small_model_seal(&made);
    CHECK_EQUAL(eits_model_open(&model, made.blob, made.size), EITS_E_MODEL_VALUE);
    small_model_free(&made);
}

RUN_TESTS("model_values")
