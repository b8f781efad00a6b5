#include "small_model.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char TAGS[SMALL_SECTIONS + 2][5] = {"DIMS", "PROT", "FOLD", "VREF", "REDU",
                                                 "SENS", "COLW", "GRID", "DEFS", "GOLD",
                                                 "SCAL", "WHIT", "META", "FLDS", "XTRS"};
enum { DIMS, PROT, FOLD, VREF, REDU, SENS, COLW, GRID, DEFS, GOLD, SCAL, WHIT, META, FLDS };

void *small_aligned(void **memory, size_t size)
{
    *memory = calloc(1, size + 64);
    if (*memory == NULL)
        abort();
    const uintptr_t at = ((uintptr_t)*memory + 63u) & ~(uintptr_t)63u;
    return (void *)at;
}

static double *doubles(size_t count)
{
    double *made = calloc(count, sizeof *made);
    if (made == NULL)
        abort();
    return made;
}

double small_random(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (double)(*state >> 11) / 4503599627370496.0 - 1.0;
}

void small_put_u16(uint8_t *at, uint32_t value)
{
    at[0] = (uint8_t)value;
    at[1] = (uint8_t)(value >> 8);
}

void small_put_u32(uint8_t *at, uint32_t value)
{
    small_put_u16(at, value);
    small_put_u16(at + 2, value >> 16);
}

void small_put_f32(uint8_t *at, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, 4);
    small_put_u32(at, bits);
}

uint32_t small_get_u32(const uint8_t *at)
{
    return (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

/* towards zero, too small becomes zero: good enough for tests */
uint16_t small_half(double value)
{
    int exponent;
    const double fraction = frexp(fabs(value), &exponent); /* in [0.5, 1) */
    const uint32_t sign = value < 0 ? 0x8000u : 0;
    if (value == 0 || exponent < -13)
        return (uint16_t)sign;
    return (uint16_t)(sign | (uint32_t)(exponent + 14) << 10 |
                      (uint32_t)((fraction * 2 - 1) * 1024));
}

static void fill_protocol(uint8_t *protocol, uint8_t *fold)
{
    uint8_t rows[SMALL_ROWS][4];
    uint32_t count = 0, pairs = 0;
    for (uint32_t d = 0; d < SMALL_ELECTRODES; ++d) {
        for (uint32_t k = 0; k < SMALL_ELECTRODES; ++k) {
            const uint32_t d2 = (d + 1) % SMALL_ELECTRODES, k2 = (k + 1) % SMALL_ELECTRODES;
            if (d == k || d2 == k || d == k2)
                continue;
            const uint8_t row[4] = {(uint8_t)d, (uint8_t)d2, (uint8_t)k, (uint8_t)k2};
            memcpy(rows[count++], row, 4);
        }
    }
    for (uint32_t i = 0; i < SMALL_ROWS; ++i) {
        for (uint32_t j = i + 1; j < SMALL_ROWS; ++j) {
            uint8_t *at = fold + 8 * pairs;
            if (rows[i][0] != rows[j][2] || rows[i][2] != rows[j][0])
                continue;
            small_put_u16(at, i);
            small_put_u16(at + 4, 1);
            if (pairs == SMALL_PAIRS) { /* the last pair is not folded */
                small_put_u16(at + 2, EITS_FOLD_NONE);
                small_put_u16(at + 8, j);
                small_put_u16(at + 10, EITS_FOLD_NONE);
                small_put_u16(at + 12, 1);
            } else {
                small_put_u16(at + 2, j);
            }
            ++pairs;
        }
    }
    if (count != SMALL_ROWS || pairs != SMALL_PAIRS + 1)
        abort();
    /* measured the other way round: the reciprocal's sign turns */
    for (uint32_t k = 2; k < SMALL_PAIRS; k += 5) {
        uint8_t *row = rows[fold[8 * k + 2]], kept = row[2];
        row[2] = row[3];
        row[3] = kept;
        small_put_u16(fold + 8 * k + 4, 0xFFFFu);
    }
    memcpy(protocol, rows, sizeof rows);
}

/* The cells of the image that are kept, in order; returns their number. */
static uint32_t kept_cells(const small_spec *spec, uint32_t cells[64 * 64])
{
    uint32_t n = 0;
    for (uint32_t cell = 0; cell < spec->side * spec->side; ++cell) {
        const double x = cell % spec->side + 0.5 - 0.5 * spec->side,
                     y = cell / spec->side + 0.5 - 0.5 * spec->side;
        if (!spec->round || x * x + y * y < 0.25 * spec->side * spec->side)
            cells[n++] = cell;
    }
    return n;
}

static double wave(uint32_t order, uint32_t place, uint32_t side)
{
    const double pi = 3.14159265358979323846;
    return sqrt((order == 0 ? 1.0 : 2.0) / side) * cos(pi * order * (place + 0.5) / side);
}

/* w_i of P = diag(w) U' and S = diag(s w) V'. */
static double whitening(uint32_t i)
{
    return 1 / sqrt(pow(SMALL_DECAY, 2.0 * i) + SMALL_REGULARISATION);
}

/* S (column after column, rank numbers each) in double. */
static double *make_s(const small_spec *spec, const uint32_t *cells, uint32_t n)
{
    const uint32_t side = spec->side, rank = spec->rank;
    double *s = doubles((size_t)n * rank);
    uint64_t state = 77;
    uint32_t across = 1;
    while (across * across < rank)
        ++across;
    for (uint32_t j = 0; j < n; ++j) {
        for (uint32_t i = 0; i < rank; ++i) {
            double value = i == j;
            if (spec->shape == SMALL_RANDOM)
                value = small_random(&state) / sqrt(n);
            else if (spec->shape != SMALL_IDENTITY)
                value = wave(i % across, cells[j] % side, side) *
                        wave(i / across, cells[j] / side, side);
            if (spec->shape == SMALL_WHITENED)
                value *= pow(SMALL_DECAY, i) * whitening(i);
            s[(size_t)j * rank + i] = value;
        }
    }
    return s;
}

/* The greatest eigenvalue of S S', by many steps of power iteration. */
static double greatest_eigenvalue(const double *s, uint32_t rank, uint32_t n)
{
    double *v = doubles(rank), *w = doubles(rank), value = 0;
    uint64_t state = 5;
    for (uint32_t i = 0; i < rank; ++i)
        v[i] = small_random(&state);
    for (int step = 0; step < 300; ++step) {
        double norm = 0;
        memset(w, 0, rank * sizeof *w);
        for (uint32_t j = 0; j < n; ++j) {
            double dot = 0;
            for (uint32_t i = 0; i < rank; ++i)
                dot += s[(size_t)j * rank + i] * v[i];
            for (uint32_t i = 0; i < rank; ++i)
                w[i] += s[(size_t)j * rank + i] * dot;
        }
        for (uint32_t i = 0; i < rank; ++i)
            norm += w[i] * w[i];
        value = sqrt(norm);
        for (uint32_t i = 0; i < rank; ++i)
            v[i] = w[i] / value;
    }
    free(v);
    free(w);
    return value;
}

static void store_s(const small_spec *spec, const double *s, uint32_t n, uint32_t stride,
                    uint8_t *sens, uint8_t *scal)
{
    const uint32_t rank = spec->rank;
    for (uint32_t j = 0; j < n; ++j) {
        const double *column = s + (size_t)j * rank;
        double largest = 1e-6;
        for (uint32_t i = 0; i < rank; ++i)
            largest = fabs(column[i]) > largest ? fabs(column[i]) : largest;
        const float scale = (float)(largest * (1 + 0.1 * (j % 3)) /
                                    (spec->storage == EITS_STORAGE_I8 ? 127.0 : 32767.0));
        small_put_f32(scal + 4 * j, scale);
        for (uint32_t i = 0; i < rank; ++i) {
            const size_t at = (size_t)j * stride + i;
            switch (spec->storage) {
            case EITS_STORAGE_F32:
                small_put_f32(sens + 4 * at, (float)column[i]);
                break;
            case EITS_STORAGE_F16:
                small_put_u16(sens + 2 * at, small_half(column[i]));
                break;
            case EITS_STORAGE_I16:
                small_put_u16(sens + 2 * at, (uint32_t)(int32_t)lrint(column[i] / (double)scale));
                break;
            case EITS_STORAGE_I8:
                sens[at] = (uint8_t)(int8_t)lrint(column[i] / (double)scale);
                break;
            }
        }
    }
}

/* Each electrode's current goes in at its point of a circle of radius R around the image: E = (z -
 * p) / |z - p|^2, times R / 20 mm; the mirror of the circle is a = R, b = conj(z) / R. */
static void fill_fields(const small_spec *spec, const uint32_t *cells, uint32_t n, uint8_t *flds)
{
    const double pixel = spec->pixel_mm > 0 ? (double)spec->pixel_mm : 6.0, half = 0.5 * spec->side,
                 radius = 0.75 * spec->side * pixel;
    small_put_f32(flds, 20.0f);
    small_put_f32(flds + 4, 3.0f);
    for (uint32_t j = 0; j < n; ++j) {
        uint8_t *column = flds + 16 + 2 * (size_t)j * SMALL_FIELDS_STRIDE;
        const double x = pixel * (cells[j] % spec->side + 0.5 - half),
                     y = pixel * (cells[j] / spec->side + 0.5 - half);
        for (uint32_t e = 0; e < SMALL_ELECTRODES; ++e) {
            const double angle = 6.28318530717958647692 * e / SMALL_ELECTRODES;
            const double dx = x - radius * cos(angle), dy = y - radius * sin(angle),
                         unit = radius / 20 / (dx * dx + dy * dy);
            small_put_u16(column + 2 * e, small_half(unit * dx));
            small_put_u16(column + 2 * (SMALL_ELECTRODES + e), small_half(unit * dy));
        }
        const double mirror[4] = {radius, 0, x / radius, -y / radius};
        for (uint32_t k = 0; k < 4; ++k)
            small_put_u16(column + 2 * (2 * SMALL_ELECTRODES + k), small_half(mirror[k]));
    }
}

/* P_i . P_j of what was written. */
static double product_of_rows(const uint8_t *redu, uint32_t stride, uint32_t i, uint32_t j)
{
    double sum = 0;
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
        float a, b;
        memcpy(&a, redu + 4 * ((size_t)k * stride + i), 4);
        memcpy(&b, redu + 4 * ((size_t)k * stride + j), 4);
        sum += (double)a * (double)b;
    }
    return sum;
}

/* Writes into the section WHIT how P and S were whitened, as the builder states it; returns 0 if
 * they have another form. */
static int fill_row_form(const small_spec *spec, const double *s, uint32_t n, uint32_t stride,
                         const uint8_t *redu, uint8_t *whit)
{
    double energy[1024] = {0}, square[1024] = {0}, s1 = 0, s1_square = 0, mu = 0;
    uint32_t weakest = 0;
    for (uint32_t i = 0; i < spec->rank; ++i) {
        energy[i] = product_of_rows(redu, stride, i, i);
        square[i] = 0;
        for (uint32_t j = 0; j < n; ++j)
            square[i] += s[(size_t)j * spec->rank + i] * s[(size_t)j * spec->rank + i];
        if (!(energy[i] > 0))
            return 0;
        for (uint32_t j = 0; j < i; ++j) {
            if (fabs(product_of_rows(redu, stride, i, j)) > 1e-5 * sqrt(energy[i] * energy[j]))
                return 0;
        }
        weakest = energy[i] > energy[weakest] ? i : weakest;
        if (square[i] / energy[i] > s1 * s1) {
            s1 = sqrt(square[i] / energy[i]);
            s1_square = square[i];
        }
    }
    mu = (1 - square[weakest]) / energy[weakest];
    for (uint32_t i = 0; i < spec->rank; ++i) {
        if (fabs(square[i] + mu * energy[i] - 1) > 0.01)
            return 0;
    }
    small_put_f32(whit, mu > 0 ? (float)(mu / (s1 * s1)) : 0);
    small_put_f32(whit + 4, (float)s1);
    small_put_f32(whit + 8, (float)s1_square);
    for (uint32_t i = 0; i < spec->rank; ++i) {
        uint8_t *row = whit + 16 + 4 * i;
        small_put_f32(row, (float)(1 / (sqrt(energy[i]) * s1)));
        small_put_f32(row + 4 * stride, (float)(square[i] / energy[i] / (s1 * s1)));
        small_put_f32(row + 8 * stride, (float)energy[i]);
        small_put_f32(row + 12 * stride, (float)(square[i] / energy[i]));
    }
    return 1;
}

/* Returns whether the model says how it was whitened. */
static int fill_sections(const small_spec *spec, uint32_t stride,
                         uint8_t *const at[SMALL_SECTIONS + 2])
{
    uint32_t cells[64 * 64];
    const uint32_t n = kept_cells(spec, cells);
    const int identity = spec->shape == SMALL_IDENTITY;
    double *s = make_s(spec, cells, n);
    const double factor = spec->lipschitz_factor > 0 ? spec->lipschitz_factor : 1.02;
    const uint32_t whole[10] = {SMALL_ELECTRODES,    SMALL_ROWS, SMALL_FOLDED,
                                spec->rank,          stride,     n,
                                spec->side,          spec->side, (uint32_t)spec->storage,
                                (uint32_t)spec->kind};
    for (uint32_t i = 0; i < 10; ++i)
        small_put_u32(at[DIMS] + 4 * i, whole[i]);
    const float pixel = spec->pixel_mm > 0 ? spec->pixel_mm : 6.0f,
                corner = -0.5f * pixel * (float)spec->side;
    const float numbers[6] = {
        pixel, corner, corner, 1e-3f, (float)(factor * greatest_eigenvalue(s, spec->rank, n)),
        1.0f};
    for (uint32_t i = 0; i < 6; ++i)
        small_put_f32(at[DIMS] + 40 + 4 * i, numbers[i]);
    store_s(spec, s, n, stride, at[SENS], at[SCAL]);
    fill_protocol(at[PROT], at[FOLD]);
    uint64_t state = 20240918;
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
        small_put_f32(at[VREF] + 4 * k, 1.0f + 0.5f * (float)small_random(&state));
        for (uint32_t i = 0; i < spec->rank; ++i) {
            float value = identity ? (float)(i == k) : 0.3f * (float)small_random(&state);
            if (spec->shape == SMALL_WHITENED)
                value = (float)(whitening(i) * wave(i, k, SMALL_FOLDED));
            small_put_f32(at[REDU] + 4 * ((size_t)k * stride + i), value);
        }
    }
    for (uint32_t j = 0; j < n; ++j) {
        small_put_f32(at[COLW] + 4 * j, identity ? 1.0f : 0.02f + 0.001f * (float)(j % 7));
        small_put_u16(at[GRID] + 4 * j, cells[j] % spec->side);
        small_put_u16(at[GRID] + 4 * j + 2, cells[j] / spec->side);
    }
    small_put_u32(at[DEFS], 60);
    small_put_u32(at[DEFS] + 4, 8);
    const float defaults[12] = {0.03f, 0.3f,  1.2f, 0.3f, 0.2f,  0.003f,
                                3.0f,  40.0f, 9.0f, 0.0f, 25.0f, 1e-3f};
    for (uint32_t i = 0; i < 12; ++i)
        small_put_f32(at[DEFS] + 8 + 4 * i, defaults[i]);
    for (uint32_t i = 0; i < 2 * SMALL_ROWS; ++i)
        small_put_f32(at[GOLD] + 4 * i, 1.0f + 0.01f * (float)small_random(&state));
    memcpy(at[META], "{}", 2);
    if (spec->fields)
        fill_fields(spec, cells, n, at[FLDS]);
    const int says = fill_row_form(spec, s, n, stride, at[REDU], at[WHIT]);
    free(s);
    return says;
}

small_model small_model_lay_out(uint32_t count, const char (*tags)[5], const uint32_t *sizes,
                                uint32_t required, uint8_t **at)
{
    uint32_t total = 64 + 16 * count, offset = total;
    for (uint32_t p = 0; p < count; ++p)
        total += (sizes[p] + 15u) & ~15u;
    small_model made = {.size = total};
    made.blob = small_aligned(&made.memory, total);
    for (uint32_t p = 0; p < count; ++p) {
        uint8_t *entry = made.blob + 64 + 16 * p;
        memcpy(entry, tags[p], 4);
        small_put_u32(entry + 4, offset);
        small_put_u32(entry + 8, sizes[p]);
        small_put_u32(entry + 12, p < required);
        at[p] = made.blob + offset;
        offset += (sizes[p] + 15u) & ~15u;
    }
    memcpy(made.blob, "EITM", 4);
    small_put_u16(made.blob + 4, 1);
    small_put_u32(made.blob + 8, total);
    small_put_u32(made.blob + 16, count);
    return made;
}

void small_model_hash(small_model *model, uint32_t electrodes, uint32_t rows, const uint8_t *table)
{
    const uint64_t hash = eits_protocol_hash(electrodes, rows, table);
    memcpy(model->blob + 24, &hash, sizeof hash);
}

small_model small_model_make(small_spec spec)
{
    static const uint32_t item[] = {4, 2, 2, 1};
    uint32_t cells[64 * 64];
    if (spec.side > 64)
        abort();
    const uint32_t sections = SMALL_SECTIONS + (spec.fields == 0 ? 0 : spec.spare == 0 ? 1u : 2u);
    const uint32_t n = kept_cells(&spec, cells), stride = (spec.rank + 7u) & ~7u;
    const uint32_t sizes[SMALL_SECTIONS + 2] = {64,
                                                SMALL_ROWS * 4,
                                                SMALL_FOLDED * 8,
                                                SMALL_FOLDED * 4,
                                                SMALL_FOLDED * stride * 4,
                                                n * stride * item[spec.storage],
                                                n * 4,
                                                n * 4,
                                                64,
                                                (2 * SMALL_ROWS + n) * 4,
                                                n * 4,
                                                16 + 16 * stride,
                                                2,
                                                16 + n * SMALL_FIELDS_STRIDE * 2,
                                                16};
    const int integer = spec.storage == EITS_STORAGE_I16 || spec.storage == EITS_STORAGE_I8;
    uint8_t *at[SMALL_SECTIONS + 2] = {NULL};
    small_model made = small_model_lay_out(sections, TAGS, sizes, SCAL + (integer != 0), at);
    if (!integer) /* an absent scale is written under a tag that readers skip */
        memcpy(small_model_entry(&made, "SCAL"), "XTRA", 4);
    if (!fill_sections(&spec, stride, at))
        memcpy(small_model_entry(&made, "WHIT"), "XTRW", 4); /* readers skip it */
    small_model_hash(&made, SMALL_ELECTRODES, SMALL_ROWS, at[PROT]);
    small_model_seal(&made);
    return made;
}

small_model small_model_with_section(const small_model *model, const char *tag, const void *section,
                                     uint32_t size)
{
    const uint32_t padded = (size + 15u) & ~15u;
    small_model made = {.size = model->size + padded};
    made.blob = small_aligned(&made.memory, made.size);
    memcpy(made.blob, model->blob, model->size);
    memset(made.blob + model->size, 0, padded);
    memcpy(made.blob + model->size, section, size);
    uint8_t *entry = small_model_entry(&made, "XTRA");
    memcpy(entry, tag, 4);
    small_put_u32(entry + 4, (uint32_t)model->size);
    small_put_u32(entry + 8, size);
    small_put_u32(made.blob + 8, (uint32_t)made.size);
    small_model_seal(&made);
    return made;
}

small_model small_model_with(small_spec spec, const char *tag, const void *section, uint32_t size)
{
    small_model bare = small_model_make(spec);
    const small_model made = small_model_with_section(&bare, tag, section, size);
    small_model_free(&bare);
    return made;
}

eits_status small_model_try(small_model model)
{
    eits_model opened;
    small_model_seal(&model);
    const eits_status status = eits_model_open(&opened, model.blob, model.size);
    small_model_free(&model);
    return status;
}

void small_model_free(small_model *model)
{
    free(model->memory);
    model->memory = NULL;
}

void small_model_depend(small_model *model, uint32_t pixels, uint32_t rank, double off)
{
    uint32_t size;
    uint8_t *sens = small_model_section(model, "SENS", &size);
    const size_t column = size / pixels;
    for (size_t j = 0; j < pixels; ++j) {
        float *values = (float *)(void *)(sens + column * j);
        if (j % 7 == 0)
            memset(values, 0, column);
        else if (j % 3 != 0)
            memcpy(values, values - column / sizeof *values, column);
        values[j % rank] *= (float)(1 + off);
    }
}

void small_model_seal(small_model *model)
{
    small_put_u32(model->blob + 12, eits_crc32(0, model->blob + 16, model->size - 16));
}

uint8_t *small_model_entry(const small_model *model, const char *tag)
{
    for (uint32_t p = 0; p < small_get_u32(model->blob + 16); ++p) {
        uint8_t *entry = model->blob + 64 + 16 * p;
        if (memcmp(entry, tag, 4) == 0)
            return entry;
    }
    fprintf(stderr, "no section %s\n", tag);
    abort();
}

uint8_t *small_model_section(const small_model *model, const char *tag, uint32_t *size)
{
    const uint8_t *entry = small_model_entry(model, tag);
    if (size != NULL)
        *size = small_get_u32(entry + 8);
    return model->blob + small_get_u32(entry + 4);
}

void small_context_open(small_context *context, const small_model *model, int prepared)
{
    if (eits_model_open(&context->model, model->blob, model->size) != EITS_OK)
        abort();
    const size_t size = eits_workspace_size(&context->model, prepared);
    void *workspace = small_aligned(&context->memory, size);
    if (eits_init(workspace, size, &context->model, &context->ctx) != EITS_OK)
        abort();
}

void small_context_close(small_context *context)
{
    free(context->memory);
    context->memory = NULL;
}

void small_reference(const eits_model *model, double gain, eits_real *frame)
{
    for (uint32_t k = 0; k < model->n_folded; ++k) {
        const eits_fold fold = model->fold[k];
        frame[fold.first] = (eits_real)(gain * (double)model->v_ref[k]);
        if (fold.second != EITS_FOLD_NONE)
            frame[fold.second] = (eits_real)(gain * fold.sign * (double)model->v_ref[k]);
    }
}

void small_new_data(eits_context *ctx, uint64_t state)
{
    for (uint32_t i = 0; i < ctx->model->rank; ++i)
        ctx->frame.y[i] = (eits_real)small_random(&state);
}

int small_same_touch(const eits_touch *a, const eits_touch *b)
{
    return a->id == b->id && a->x_mm == b->x_mm && a->y_mm == b->y_mm &&
           a->radius_mm == b->radius_mm && a->strength_s_per_m_mm2 == b->strength_s_per_m_mm2 &&
           a->explained == b->explained && a->force_n == b->force_n &&
           a->confidence == b->confidence && a->x_variance_mm2 == b->x_variance_mm2 &&
           a->xy_covariance_mm2 == b->xy_covariance_mm2 && a->y_variance_mm2 == b->y_variance_mm2 &&
           a->long_x_mm == b->long_x_mm && a->long_y_mm == b->long_y_mm &&
           a->radius_sd_mm == b->radius_sd_mm;
}
