/* Small .eitm models made in memory, for tests. Bytes are written here field by field, apart from
 * the core's reader. */
#ifndef EITSKIN_TEST_SMALL_MODEL_H
#define EITSKIN_TEST_SMALL_MODEL_H

#include "context/context.h"
#include "eitskin/eitskin.h"

/* 8 electrodes, adjacent: 40 rows in 19 reciprocal pairs, every fifth measured the other way round,
 * and 2 single rows. */
#define SMALL_DECAY          0.75
#define SMALL_REGULARISATION 0.01
enum {
    SMALL_ELECTRODES = 8,
    SMALL_ROWS = 40,
    SMALL_PAIRS = 19,
    SMALL_FOLDED = 21,
    SMALL_SECTIONS = 13,
    SMALL_FIELDS_STRIDE = 24
};

typedef enum small_shape {
    SMALL_RANDOM = 0,
    /* P and S are (as far as shapes go) identities and weights are 1, so that results can be
     * said beforehand */
    SMALL_IDENTITY,
    /* the rows of S are orthonormal cosines over the image, the lowest first: discs can be
     * fitted */
    SMALL_WAVES,
    /* as the builder whitens: the same, singular values SMALL_DECAY^i, regularisation
     * SMALL_REGULARISATION, and P's rows likewise */
    SMALL_WHITENED
} small_shape;

typedef struct small_spec {
    uint32_t rank, side; /* an image of side x side pixels, at most 64 */
    int round;           /* only the pixels whose centre lies in the inscribed circle are kept */
    eits_storage storage;
    eits_data_kind kind;
    small_shape shape;
    /* the stated constant over the true greatest eigenvalue of S S'; 0: 1.02 */
    double lipschitz_factor;
    float pixel_mm; /* 0: 6 mm */
    /* with section FLDS: currents at points on a circle around the image, whose mirror it is */
    int fields;
    int spare; /* with fields: one more section that readers skip, XTRS, to be replaced */
} small_spec;

typedef struct small_model {
    void *memory; /* to be freed */
    uint8_t *blob;
    size_t size;
} small_model;

/* Never fails: aborts where memory is short. */
small_model small_model_make(small_spec spec);
void small_model_free(small_model *model);

/* A copy with an optional section `tag` in place of the one that readers skip; `model` has float
 * storage. */
small_model small_model_with_section(const small_model *model, const char *tag, const void *section,
                                     uint32_t size);

/* A model of this spec with such a section. */
small_model small_model_with(small_spec spec, const char *tag, const void *section, uint32_t size);

/* Seals, tries to open and frees it. */
eits_status small_model_try(small_model model);

/* Columns of S in groups of three that are alike but for `off` of one number each, every seventh
 * zero; `model` has float storage. */
void small_model_depend(small_model *model, uint32_t pixels, uint32_t rank, double off);

/* Room for `count` sections of these tags and sizes, the first `required` of them required; the
 * table and the header but for checksum and hash. `at` gets where each section is. */
small_model small_model_lay_out(uint32_t count, const char (*tags)[5], const uint32_t *sizes,
                                uint32_t required, uint8_t **at);

/* Write the protocol's hash again. */
void small_model_hash(small_model *model, uint32_t electrodes, uint32_t rows, const uint8_t *table);

/* Write the checksum again after bytes were changed. */
void small_model_seal(small_model *model);

/* The start of the section with this tag, and its 16-byte entry in the table of sections. Both
 * abort if there is no such section. */
uint8_t *small_model_section(const small_model *model, const char *tag, uint32_t *size);
uint8_t *small_model_entry(const small_model *model, const char *tag);

/* Little-endian numbers at any place. */
void small_put_u16(uint8_t *at, uint32_t value);
void small_put_u32(uint8_t *at, uint32_t value);
void small_put_f32(uint8_t *at, float value);
uint16_t small_half(double value);
uint32_t small_get_u32(const uint8_t *at);

/* A context with its own aligned workspace. */
typedef struct small_context {
    void *memory;
    eits_model model;
    eits_context *ctx;
} small_context;
void small_context_open(small_context *context, const small_model *model, int prepared);
void small_context_close(small_context *context);

/* Sets fields of the options, each said as `o.field = value`; the others stay. */
#define CHANGE_OPTIONS(ctx, ...)                         \
    do {                                                 \
        eits_options o = *eits_get_options(ctx);         \
        __VA_ARGS__;                                     \
        CHECK_EQUAL(eits_set_options(ctx, &o), EITS_OK); \
    } while (0)

/* `gain` times the frame that agrees with the model's v_ref on every row. */
void small_reference(const eits_model *model, double gain, eits_real *frame);

/* `size` zeroed bytes from a 64-byte boundary; free(*memory). */
void *small_aligned(void **memory, size_t size);

/* A uniform random number in [-1, 1): a fixed generator, the same on every machine. */
double small_random(uint64_t *state);

/* Such numbers as the reduced data of a context. */
void small_new_data(eits_context *ctx, uint64_t state);

/* Whether each field is the same: there may be padding between them. */
int small_same_touch(const eits_touch *a, const eits_touch *b);

#endif
