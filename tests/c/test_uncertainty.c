/* The section UNCE: the model's errors, and the values that a reader rejects. */
#include "base/vec.h"
#include "check.h"
#include "small_model.h"

#include <math.h>
#include <stdlib.h>

enum { RANK = 4, PACKED = RANK * (RANK + 1) / 2, HEAD = 16, SIZE = HEAD + 2 * PACKED * 4 };

static const small_spec WHITENED = {.rank = RANK, .side = 5, .shape = SMALL_WHITENED};
static const small_spec PLAIN = {.rank = RANK, .side = 5};

/* Two diagonal triangles, i + 1 and 10 (i + 1), and a head. */
static void section_of(uint8_t *bytes)
{
    memset(bytes, 0, SIZE);
    small_put_u32(bytes, 1);
    small_put_f32(bytes + 4, 0.04f);
    small_put_f32(bytes + 8, 0.11f);
    for (uint32_t i = 0; i < RANK; ++i) {
        small_put_f32(bytes + HEAD + 4 * (i * (i + 1) / 2 + i), (float)(i + 1));
        small_put_f32(bytes + HEAD + 4 * (PACKED + i * (i + 1) / 2 + i), 10.0f * (float)(i + 1));
    }
}

static eits_status opened(small_spec spec, const uint8_t *bytes, uint32_t size)
{
    small_model bare = small_model_make(spec),
                made = small_model_with_section(&bare, "UNCE", bytes, size);
    eits_model model;
    const eits_status status = eits_model_open(&model, made.blob, made.size);
    small_model_free(&bare);
    small_model_free(&made);
    return status;
}

static void it_is_read_in_place(void)
{
    uint8_t bytes[SIZE];
    section_of(bytes);
    small_model bare = small_model_make(WHITENED),
                made = small_model_with_section(&bare, "UNCE", bytes, SIZE);
    eits_model model;
    CHECK_EQUAL(eits_model_open(&model, bare.blob, bare.size), EITS_OK);
    CHECK(model.uncertainty.errors == NULL && model.uncertainty.row_gains == 0);
    CHECK_EQUAL(eits_model_open(&model, made.blob, made.size), EITS_OK);
    const eits_uncertainty *u = &model.uncertainty;
    CHECK(u->row_gains == 1 && u->errors_rms == 0.04f && u->shapes_rms == 0.11f);
    for (uint32_t i = 0; i < RANK; ++i) {
        for (uint32_t j = 0; j <= i; ++j) {
            const uint32_t at = i * (i + 1) / 2 + j;
            CHECK(u->errors[at] == (i == j ? (float)(i + 1) : 0));
            CHECK(u->drift[at] == (i == j ? 10.0f * (float)(i + 1) : 0));
        }
    }
    small_model_free(&bare);
    small_model_free(&made);
}

static void what_is_no_second_moment_is_refused(void)
{
    /* place and value: NaN, variances below 0, shares below 0 or infinite */
    static const struct {
        uint32_t at;
        float value;
    } bad[] = {{HEAD, -1},
               {HEAD + 4 * PACKED, -1},
               {HEAD + 4, (float)NAN},
               {HEAD + 4 * (PACKED + 1), (float)INFINITY},
               {HEAD + 4 * (PACKED - 1), 2e30f},
               {4, -0.1f},
               {8, (float)NAN}};
    uint8_t bytes[SIZE + 4];
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; ++k) {
        section_of(bytes);
        small_put_f32(bytes + bad[k].at, bad[k].value);
        CHECK_EQUAL(opened(WHITENED, bytes, SIZE), EITS_E_MODEL_VALUE);
    }
    section_of(bytes);
    small_put_f32(bytes + HEAD + 4, -0.5f); /* a covariance may be below 0 */
    CHECK_EQUAL(opened(WHITENED, bytes, SIZE), EITS_OK);
    CHECK_EQUAL(opened(WHITENED, bytes, SIZE - 4), EITS_E_MODEL_SECTION);
    memset(bytes + SIZE, 0, 4);
    CHECK_EQUAL(opened(WHITENED, bytes, SIZE + 4), EITS_E_MODEL_SECTION);
    /* without section WHIT there is no noise to weigh the errors against */
    CHECK_EQUAL(opened(PLAIN, bytes, SIZE), EITS_E_MODEL_VALUE);
}

/* Section GEOM: so many numbers a fold, of a model with UNCE. */
static void what_the_reference_tells_of_places_is_read_or_refused(void)
{
    enum { FOLD = 4 * SMALL_FOLDED, LARGEST = FOLD * (EITS_MAX_PLACE_ROWS + 1) };
    static uint8_t bytes[LARGEST];
    const eits_status of_size[][2] = {{0, EITS_E_MODEL_SECTION},
                                      {FOLD - 4, EITS_E_MODEL_SECTION},
                                      {LARGEST, EITS_E_MODEL_SECTION},
                                      {2 * FOLD, EITS_E_MODEL_VALUE}}; /* without UNCE */
    small_model bare = small_model_make(WHITENED);
    for (size_t k = 0; k < sizeof of_size / sizeof of_size[0]; ++k) {
        small_model made = small_model_with_section(&bare, "GEOM", bytes, (uint32_t)of_size[k][0]);
        eits_model model;
        CHECK_EQUAL(eits_model_open(&model, made.blob, made.size), of_size[k][1]);
        small_model_free(&made);
    }
    uint8_t errors[SIZE];
    section_of(errors);
    small_model whole = small_model_with_section(&bare, "UNCE", errors, SIZE);
    memcpy(small_model_entry(&whole, "META"), "XTRA", 4); /* room for another */
    const struct {
        float value;
        eits_status status;
    } of_value[] = {{1e6f, EITS_OK}, {-2e6f, EITS_E_MODEL_VALUE}, {(float)NAN, EITS_E_MODEL_VALUE}};
    for (size_t k = 0; k < sizeof of_value / sizeof of_value[0]; ++k) {
        small_put_f32(bytes + FOLD, of_value[k].value);
        small_model made = small_model_with_section(&whole, "GEOM", bytes, 2 * FOLD);
        eits_model model;
        CHECK_EQUAL(eits_model_open(&model, made.blob, made.size), of_value[k].status);
        CHECK(k > 0 || (model.uncertainty.place_rows == 2 &&
                        model.uncertainty.places[SMALL_FOLDED] == of_value[k].value));
        small_model_free(&made);
    }
    small_model_free(&whole);
    small_model_free(&bare);
}

static eits_status begun(const uint8_t *bytes)
{
    small_model bare = small_model_make(WHITENED),
                made = small_model_with_section(&bare, "UNCE", bytes, SIZE);
    eits_model model;
    CHECK_EQUAL(eits_model_open(&model, made.blob, made.size), EITS_OK);
    const size_t size = eits_workspace_size(&model, 0), whole = (size + 63u) & ~(size_t)63u;
    void *workspace = aligned_alloc(64, whole);
    eits_context *ctx = NULL;
    const eits_status status = eits_init(workspace, size, &model, &ctx);
    CHECK((status == EITS_OK) == (ctx != NULL));
    free(workspace);
    small_model_free(&bare);
    small_model_free(&made);
    return status;
}

/* Either matrix with diagonal elements d and others c d: of rank 4 its eigenvalues are d (1 - c)
 * and d (1 + 3 c). */
static void what_is_no_covariance_is_refused(void)
{
    const struct {
        float diagonal, other;
        eits_status status;
    } cases[] = {{1, 0, EITS_OK},
                 {1, 1, EITS_OK}, /* one direction alone */
                 {1e-20f, 1, EITS_OK},
                 {1e20f, 0.99f, EITS_OK},
                 {0, 0, EITS_OK},
                 {1, -1.0f / 3, EITS_OK},
                 {1, -0.34f, EITS_E_MODEL_VALUE}, /* each pair alone could be one */
                 {1e-20f, -0.4f, EITS_E_MODEL_VALUE},
                 {1, 1.1f, EITS_E_MODEL_VALUE},
                 {1e20f, -1.1f, EITS_E_MODEL_VALUE}};
    uint8_t bytes[SIZE];
    for (size_t k = 0; k < 2 * sizeof cases / sizeof cases[0]; ++k) {
        section_of(bytes);
        const uint32_t from = HEAD + (k % 2 == 0 ? 0u : 4u * PACKED);
        for (uint32_t i = 0; i < RANK; ++i) {
            for (uint32_t j = 0; j <= i; ++j)
                small_put_f32(bytes + from + 4 * (i * (i + 1) / 2 + j),
                              cases[k / 2].diagonal * (i == j ? 1 : cases[k / 2].other));
        }
        CHECK_EQUAL(begun(bytes), cases[k / 2].status);
    }
    section_of(bytes);
    small_put_f32(bytes + HEAD, 0);
    small_put_f32(bytes + HEAD + 4, 0.1f); /* of a variance of 0 */
    CHECK_EQUAL(begun(bytes), EITS_E_MODEL_VALUE);
}

int main(void)
{
    what_is_no_covariance_is_refused();
    what_the_reference_tells_of_places_is_read_or_refused();
    it_is_read_in_place();
    what_is_no_second_moment_is_refused();
    return checks_report("uncertainty");
}
