/* Open an .eitm model in place. Every length, offset and index is checked before it is followed. */
#include "eitskin/model.h"
#include "eitskin/solve.h"

#include "base/arithmetic.h"
#include "model/options.h"
#include "model/sections.h"

#include <string.h>

enum {
    HEADER_SIZE = 64,
    ENTRY_SIZE = 16,
    DIMS_SIZE = 64,
    FIELDS_HEAD = 16,
    MIRROR_ROWS = 4,
    MAX_SECTIONS = 256
};

typedef struct sections {
    eits_section dims, prot, fold, vref, redu, sens, scal, colw, grid, defs, gold, meta, flds,
        force, whit, unce, geom, move, rowe, prec, plac, ordr, sums;
} sections;

/* memcpy is used since a cast would read through a pointer of another type, and entries of the
 * header need not lie at a word's boundary. Compilers make one load of it. */
static uint32_t read_u32(const uint8_t *bytes)
{
    uint32_t value;
    memcpy(&value, bytes, sizeof value);
    return value;
}

static uint16_t read_u16(const uint8_t *bytes)
{
    uint16_t value;
    memcpy(&value, bytes, sizeof value);
    return value;
}

/* Numbers must be finite: the products spread one NaN or infinity to every pixel, and no later
 * check could name its source. */
static int all_finite(const float *values, size_t count)
{
    for (size_t i = 0; i < count; ++i) {
        if (!eits_is_finite_f32(values[i]))
            return 0;
    }
    return 1;
}

uint32_t eits_crc32(uint32_t crc, const void *bytes, size_t size)
{
    /* the loop takes four bits at a time: a table of 16 words is small enough for flash and fast
     * enough for a model */
    static const uint32_t table[16] = {
        0x00000000u, 0x1DB71064u, 0x3B6E20C8u, 0x26D930ACu, 0x76DC4190u, 0x6B6B51F4u,
        0x4DB26158u, 0x5005713Cu, 0xEDB88320u, 0xF00F9344u, 0xD6D6A3E8u, 0xCB61B38Cu,
        0x9B64C2B0u, 0x86D3D2D4u, 0xA00AE278u, 0xBDBDF21Cu,
    };
    const uint8_t *p = bytes;
    crc = ~crc;
    for (size_t i = 0; i < size; ++i) {
        crc ^= p[i];
        crc = (crc >> 4) ^ table[crc & 15u];
        crc = (crc >> 4) ^ table[crc & 15u];
    }
    return ~crc;
}

uint64_t eits_protocol_hash(uint32_t n_electrodes, uint32_t n_rows, const uint8_t *table)
{
    /* The counts are hashed first: a table that begins like another one then has a different hash.
     * They are hashed byte by byte, so that a big-endian writer makes the same number. */
    const uint8_t head[4] = {(uint8_t)n_electrodes, (uint8_t)(n_electrodes >> 8), (uint8_t)n_rows,
                             (uint8_t)(n_rows >> 8)};
    uint64_t hash = 0xCBF29CE484222325u;
    for (size_t i = 0; i < sizeof head; ++i)
        hash = (hash ^ head[i]) * 0x100000001B3u;
    for (size_t i = 0; i < (size_t)n_rows * 4u; ++i)
        hash = (hash ^ table[i]) * 0x100000001B3u;
    return hash;
}

/* Magic, version, length and checksum are checked in this order, and each is reported only if those
 * before hold: a text file is not reported as damaged, nor a newer format as one with a wrong
 * checksum. */
static eits_status check_header(const uint8_t *bytes, size_t size)
{
    if (size < 4 || memcmp(bytes, "EITM", 4) != 0)
        return EITS_E_MODEL_MAGIC;
    if (size < HEADER_SIZE)
        return EITS_E_MODEL_TRUNCATED;
    if (read_u16(bytes + 4) != EITS_MODEL_MAJOR)
        return EITS_E_MODEL_VERSION;
    const uint32_t total = read_u32(bytes + 8);
    if (total < HEADER_SIZE || total % EITS_MODEL_ALIGNMENT != 0)
        return EITS_E_MODEL_VALUE;
    /* More bytes than the total may follow: a flash bank is longer than its model. */
    if (size < total)
        return EITS_E_MODEL_TRUNCATED;
    if (eits_crc32(0, bytes + 16, total - 16u) != read_u32(bytes + 12))
        return EITS_E_MODEL_CRC;
    return EITS_OK;
}

/* Sections are found by tag, since a writer may put them in any order. */
static eits_section *find_slot(sections *found, const uint8_t *tag)
{
    static const char tags[] =
        "DIMSPROTFOLDVREFREDUSENSSCALCOLWGRIDDEFSGOLDMETAFLDSLOADWHITUNCEGEOMMOVEROWEPREC"
        "PLACORDRSUMS";
    eits_section *slots[] = {&found->dims, &found->prot, &found->fold, &found->vref,  &found->redu,
                             &found->sens, &found->scal, &found->colw, &found->grid,  &found->defs,
                             &found->gold, &found->meta, &found->flds, &found->force, &found->whit,
                             &found->unce, &found->geom, &found->move, &found->rowe,  &found->prec,
                             &found->plac, &found->ordr, &found->sums};
    for (size_t i = 0; i < sizeof slots / sizeof slots[0]; ++i) {
        if (memcmp(tags + 4 * i, tag, 4) == 0)
            return slots[i];
    }
    return NULL;
}

/* The offset is compared with the total first, and the size with the bytes behind the offset: the
 * sum of both could pass 2^32 and look small. The count is limited for the same reason, before it
 * is multiplied. */
static eits_status read_table(sections *found, const uint8_t *bytes)
{
    const uint32_t total = read_u32(bytes + 8);
    const uint32_t count = read_u32(bytes + 16);
    if (count > MAX_SECTIONS || HEADER_SIZE + count * ENTRY_SIZE > total)
        return EITS_E_MODEL_SECTION;
    for (uint32_t i = 0; i < count; ++i) {
        const uint8_t *entry = bytes + HEADER_SIZE + (size_t)i * ENTRY_SIZE;
        const uint32_t offset = read_u32(entry + 4);
        const uint32_t size = read_u32(entry + 8);
        const uint32_t required = read_u32(entry + 12) & 1u;
        if (offset % EITS_MODEL_ALIGNMENT != 0 || offset < HEADER_SIZE + count * ENTRY_SIZE ||
            offset > total || size > total - offset)
            return EITS_E_MODEL_SECTION;
        eits_section *slot = find_slot(found, entry);
        if (slot == NULL) {
            if (required)
                /* a later minor version must not add a section that older readers must know */
                return EITS_E_MODEL_VERSION;
            continue;
        }
        /* A tag must not occur twice: the section in force would depend on the reader. */
        if (slot->data != NULL)
            return EITS_E_MODEL_SECTION;
        slot->data = bytes + offset;
        slot->size = size;
    }
    return EITS_OK;
}

static int has_size(const eits_section *s, size_t size)
{
    return s->data != NULL && s->size == size;
}

/* With these bounds every size in check_sizes is below 2^30, so that none wraps if size_t has 32
 * bits. */
static eits_status read_dims(eits_model *model, const eits_section *dims)
{
    if (!has_size(dims, DIMS_SIZE))
        return EITS_E_MODEL_SECTION;
    const uint8_t *p = dims->data;
    model->n_electrodes = read_u32(p);
    model->n_rows = read_u32(p + 4);
    model->n_folded = read_u32(p + 8);
    model->rank = read_u32(p + 12);
    const uint32_t stride = read_u32(p + 16);
    model->n_pixels = read_u32(p + 20);
    model->nx = read_u32(p + 24);
    model->ny = read_u32(p + 28);
    const uint32_t storage = read_u32(p + 32);
    const uint32_t kind = read_u32(p + 36);
    model->pixel_mm = eits_read_f32(p + 40);
    model->origin_x_mm = eits_read_f32(p + 44);
    model->origin_y_mm = eits_read_f32(p + 48);
    model->current_a = eits_read_f32(p + 52);
    model->lipschitz = eits_read_f32(p + 56);
    model->noise_gain = eits_read_f32(p + 60);
    if (model->n_electrodes < 4 || model->n_electrodes > 255 || model->n_rows == 0 ||
        model->n_rows >= EITS_MAX_ROWS || model->n_folded == 0 || model->n_folded > model->n_rows ||
        model->rank == 0 || model->rank > EITS_MAX_RANK || stride != ((model->rank + 7u) & ~7u) ||
        model->n_pixels == 0 || model->n_pixels > EITS_MAX_PIXELS || model->nx == 0 ||
        model->ny == 0 || model->nx > 4096u || model->ny > 4096u || storage > EITS_STORAGE_I8 ||
        kind > EITS_DATA_LOG_RATIO)
        return EITS_E_MODEL_VALUE;
    const float numbers[] = {model->pixel_mm,  model->origin_x_mm, model->origin_y_mm,
                             model->current_a, model->lipschitz,   model->noise_gain};
    /* the inverse of the Lipschitz constant must be finite */
    if (!all_finite(numbers, sizeof numbers / sizeof numbers[0]) || model->pixel_mm <= 0.0f ||
        model->lipschitz < 0x1p-126f || model->current_a <= 0.0f || model->noise_gain < 0.0f)
        return EITS_E_MODEL_VALUE;
    model->data_kind = (eits_data_kind)kind;
    model->reduction.rows = model->rank;
    model->reduction.cols = model->n_folded;
    model->reduction.stride = stride;
    model->reduction.storage = EITS_STORAGE_F32;
    model->sensitivity.rows = model->rank;
    model->sensitivity.cols = model->n_pixels;
    model->sensitivity.stride = stride;
    model->sensitivity.storage = (eits_storage)storage;
    return EITS_OK;
}

/* Each section must have exactly the bytes that the dimensions ask for. After this check a pointer
 * into it may be followed to the end of its array without another look at the file. */
static eits_status check_sizes(const eits_model *model, const sections *found)
{
    static const uint8_t item_size[] = {4, 2, 2, 1};
    const eits_storage storage = model->sensitivity.storage;
    const size_t folded = model->n_folded, pixels = model->n_pixels,
                 stride = model->sensitivity.stride;
    const int integer = storage == EITS_STORAGE_I16 || storage == EITS_STORAGE_I8;
    const int right = has_size(&found->prot, (size_t)model->n_rows * 4) &&
                      has_size(&found->fold, folded * sizeof(eits_fold)) &&
                      has_size(&found->vref, folded * 4) &&
                      has_size(&found->redu, folded * stride * 4) &&
                      has_size(&found->sens, pixels * stride * item_size[storage]) &&
                      has_size(&found->colw, pixels * 4) &&
                      (integer ? has_size(&found->scal, pixels * 4) : found->scal.data == NULL) &&
                      has_size(&found->grid, pixels * sizeof(eits_pixel)) &&
                      has_size(&found->defs, sizeof(eits_defaults)) &&
                      has_size(&found->gold, ((size_t)model->n_rows * 2 + pixels) * 4);
    return right ? EITS_OK : EITS_E_MODEL_SECTION;
}

static eits_status check_tables(const eits_model *model)
{
    /* each row has two pairs: drive, then measurement */
    for (size_t i = 0; i < (size_t)model->n_rows * 4; i += 2) {
        const uint8_t *pair = model->protocol + i;
        if (pair[0] >= model->n_electrodes || pair[1] >= model->n_electrodes || pair[0] == pair[1])
            return EITS_E_MODEL_VALUE;
    }
    for (uint32_t i = 0; i < model->n_folded; ++i) {
        /* the sign is used as a factor: a number other than 1 or -1 would scale a row silently */
        const eits_fold fold = model->fold[i];
        if (fold.first >= model->n_rows ||
            (fold.second != EITS_FOLD_NONE && fold.second >= model->n_rows) ||
            (fold.sign != 1 && fold.sign != -1))
            return EITS_E_MODEL_VALUE;
    }
    for (uint32_t j = 0; j < model->n_pixels; ++j) {
        const eits_pixel at = model->pixel[j];
        if (at.ix >= model->nx || at.iy >= model->ny)
            return EITS_E_MODEL_VALUE;
        /* Cells must ascend, so that no two pixels share a cell of the image and a walk over the
         * kept pixels is a walk over the raster. */
        if (j > 0) {
            const eits_pixel before = model->pixel[j - 1];
            if (at.iy < before.iy || (at.iy == before.iy && at.ix <= before.ix))
                return EITS_E_MODEL_VALUE;
        }
    }
    return eits_protocol_hash(model->n_electrodes, model->n_rows, model->protocol) ==
                   model->protocol_hash
               ? EITS_OK
               : EITS_E_MODEL_VALUE;
}

/* A half with all bits of the exponent set is infinite or NaN; this is found without converting the
 * number. */
static int halves_finite(const uint16_t *values, size_t count)
{
    for (size_t i = 0; i < count; ++i) {
        if ((values[i] & 0x7C00u) == 0x7C00u)
            return 0;
    }
    return 1;
}

/* Returns 1 if the model's own defaults are valid options. */
static int defaults_in_range(const eits_model *model)
{
    const eits_defaults *d = model->defaults;
    eits_options own;
    (void)eits_options_default(model, &own); /* neither is NULL */
    return d->iterations <= EITS_MAX_MODEL_ITERATIONS &&
           d->solver <= (uint32_t)EITS_SOLVER_ACTIVE_SET &&
           d->touch_fit_left_out <=
               (EITS_TOUCH_FIT_ALL | EITS_GAIN_DRIFT_KEPT | EITS_TRACKS_REFERENCE) &&
           eits_between(d->mask_threshold, 0, 1) && eits_options_in_range(&own);
}

/* Integers of storage need no check, since each is a number. Their scales do. */
static eits_status check_numbers(const eits_model *model)
{
    const eits_matrix *s = &model->sensitivity;
    const size_t stored = (size_t)s->stride * s->cols;
    if (!all_finite(model->v_ref, model->n_folded) ||
        !all_finite(model->column_weight, model->n_pixels) ||
        !all_finite(model->reduction.data, (size_t)model->reduction.stride * model->n_folded) ||
        !all_finite(model->golden.reference, (size_t)model->n_rows * 2 + model->n_pixels) ||
        (s->scale != NULL && !all_finite(s->scale, s->cols)) ||
        (s->storage == EITS_STORAGE_F32 && !all_finite(s->data, stored)) ||
        (s->storage == EITS_STORAGE_F16 && !halves_finite(s->data, stored)))
        return EITS_E_MODEL_VALUE;
    if (!defaults_in_range(model))
        return EITS_E_MODEL_VALUE;
    return EITS_OK;
}

/* Read section FLDS, if the model has one: two numbers, then halves. */
static eits_status read_fields(eits_model *model, const eits_section *flds)
{
    if (flds->data == NULL)
        return EITS_OK;
    const uint32_t rows = 2u * model->n_electrodes + MIRROR_ROWS, stride = (rows + 7u) & ~7u;
    const size_t halves = (size_t)model->n_pixels * stride;
    /* without it (data other than differences), touches are fitted as if they did not interact */
    if (flds->size != FIELDS_HEAD + halves * 2u)
        return EITS_E_MODEL_SECTION;
    model->fields.volts = eits_read_f32(flds->data);
    model->fields.per_sheet = eits_read_f32(flds->data + 4);
    model->fields.at = (eits_matrix){.data = flds->data + FIELDS_HEAD,
                                     .rows = rows,
                                     .cols = model->n_pixels,
                                     .stride = stride,
                                     .storage = EITS_STORAGE_F16};
    if (!eits_between(model->fields.volts, 0, 1e30f) ||
        !eits_between(model->fields.per_sheet, 0, 1e30f) ||
        !halves_finite(model->fields.at.data, halves))
        return EITS_E_MODEL_VALUE;
    return EITS_OK;
}

/* Read section SUMS: the self-test revision that made it, then one word per frame. Sums of another
 * revision cannot be compared and are ignored. */
static eits_status read_sums(eits_golden *golden, const eits_section *found)
{
    if (found->data == NULL)
        return EITS_OK;
    if (found->size < 4 || found->size % 4 != 0)
        return EITS_E_MODEL_SECTION;
    if (read_u32(found->data) == EITS_SELF_TEST_REVISION &&
        found->size == 4 + 4 * EITS_SELF_TEST_SUMS)
        golden->sums = (const uint32_t *)(const void *)(found->data + 4);
    return EITS_OK;
}

/* Point into the blob; nothing is copied. Sections begin at multiples of 16 bytes of a blob that
 * does, too, so that these casts give aligned pointers to any type. */
static void point_into(eits_model *model, const sections *found)
{
    model->protocol = found->prot.data;
    model->fold = (const eits_fold *)(const void *)found->fold.data;
    model->v_ref = (const float *)(const void *)found->vref.data;
    model->reduction.data = found->redu.data;
    model->sensitivity.data = found->sens.data;
    model->sensitivity.scale = (const float *)(const void *)found->scal.data;
    model->column_weight = (const float *)(const void *)found->colw.data;
    model->pixel = (const eits_pixel *)(const void *)found->grid.data;
    model->defaults = (const eits_defaults *)(const void *)found->defs.data;
    model->golden.reference = (const float *)(const void *)found->gold.data;
    model->golden.frame = model->golden.reference + model->n_rows;
    model->golden.image = model->golden.frame + model->n_rows;
    model->meta = (const char *)found->meta.data;
    model->meta_size = found->meta.size;
}

eits_status eits_model_open(eits_model *model, const void *blob, size_t size)
{
    if (model == NULL || blob == NULL)
        return EITS_E_ARGUMENT;
    if ((uintptr_t)blob % EITS_MODEL_ALIGNMENT != 0)
        return EITS_E_MODEL_ALIGNMENT;
    const uint8_t *bytes = blob;
    /* The model is opened into a local struct: if anything fails, the caller's model is unchanged.
     */
    eits_model opened = {0};
    sections found = {0};
    eits_status status = check_header(bytes, size);
    if (status == EITS_OK)
        status = read_table(&found, bytes);
    if (status == EITS_OK)
        status = read_dims(&opened, &found.dims);
    if (status == EITS_OK)
        status = check_sizes(&opened, &found);
    if (status != EITS_OK)
        return status;
    /* the hash in the header; check_tables compares it with the table itself */
    memcpy(&opened.protocol_hash, bytes + 24, sizeof opened.protocol_hash);
    point_into(&opened, &found);
    status = check_tables(&opened);
    if (status == EITS_OK)
        status = check_numbers(&opened);
    if (status == EITS_OK)
        status = read_fields(&opened, &found.flds);
    if (status == EITS_OK)
        status = eits_read_force(&opened, &found.force);
    if (status == EITS_OK)
        status = eits_read_row_form(&opened, &found.whit);
    if (status == EITS_OK)
        status = eits_read_uncertainty(&opened, &found.unce);
    if (status == EITS_OK)
        status = eits_read_places(&opened, &found.geom);
    if (status == EITS_OK)
        status = eits_read_moves(&opened, &found.move);
    if (status == EITS_OK)
        status = eits_read_row_errors(&opened, &found.rowe);
    if (status == EITS_OK)
        status = eits_read_precision(&opened, &found.prec);
    if (status == EITS_OK)
        status = eits_read_place_factor(&opened, &found.plac);
    if (status == EITS_OK)
        status = eits_read_scan_order(&opened, &found.ordr);
    if (status == EITS_OK)
        status = read_sums(&opened.golden, &found.sums);
    if (status == EITS_OK)
        *model = opened;
    return status;
}
