#include "skin_model.h"

#include "small_model.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

const skin_spec SKIN_ADJACENT = {
    .electrodes = 16, .drive_step = 1, .measure_step = 1, .rank = 24, .side = 8};
const skin_spec SKIN_OPPOSITE = {
    .electrodes = 16, .drive_step = 8, .measure_step = 1, .rank = 20, .side = 8};
const skin_spec SKIN_BY_SEVEN = {
    .electrodes = 16, .drive_step = 1, .measure_step = 1, .rank = 24, .side = 8, .order = 7};

const skin_spec SKIN_WITH_FIELDS = {.electrodes = 16,
                                    .drive_step = 1,
                                    .measure_step = 1,
                                    .rank = 24,
                                    .side = 8,
                                    .order = 7,
                                    .fields = 1};

enum { MAX_ROWS = 4096, SECTIONS = 13 };
static const char TAGS[SECTIONS][5] = {"DIMS", "PROT", "FOLD", "VREF", "REDU", "SENS", "COLW",
                                       "GRID", "DEFS", "GOLD", "META", "ORDR", "FLDS"};
enum { DIMS, PROT, FOLD, VREF, REDU, SENS, COLW, GRID, DEFS, GOLD, META, ORDR, FLDS };

typedef struct draft {
    uint32_t n_rows, n_folded;
    uint8_t rows[MAX_ROWS][4];
    eits_fold fold[MAX_ROWS];
    float volts[MAX_ROWS], touched[MAX_ROWS];
} draft;

static int same_pair(const uint8_t *a, const uint8_t *b) /* 1, -1 turned, or 0 */
{
    return a[0] == b[0] && a[1] == b[1] ? 1 : (a[0] == b[1] && a[1] == b[0] ? -1 : 0);
}

static void draft_rows(draft *d, const skin_spec *spec)
{
    const uint32_t n = spec->electrodes;
    for (uint32_t i = 0; i < n; ++i) {
        for (uint32_t k = 0; k < n; ++k) {
            uint8_t row[4] = {(uint8_t)i, (uint8_t)((i + spec->drive_step) % n), (uint8_t)k,
                              (uint8_t)((k + spec->measure_step) % n)};
            if (row[0] == row[2] || row[0] == row[3] || row[1] == row[2] || row[1] == row[3] ||
                d->n_rows == MAX_ROWS)
                continue;
            if (spec->turned != 0 && d->n_rows % spec->turned == spec->turned - 1) {
                row[2] = row[3];
                row[3] = (uint8_t)k;
            }
            memcpy(d->rows[d->n_rows++], row, 4);
        }
    }
    uint8_t taken[MAX_ROWS] = {0};
    for (uint32_t i = 0; i < d->n_rows; ++i) {
        if (taken[i])
            continue;
        eits_fold fold = {.first = (uint16_t)i, .second = EITS_FOLD_NONE, .sign = 1};
        for (uint32_t j = i + 1; j < d->n_rows && fold.second == EITS_FOLD_NONE; ++j) {
            const int straight =
                same_pair(d->rows[i], d->rows[j]) * same_pair(d->rows[i] + 2, d->rows[j] + 2);
            const int crossed =
                same_pair(d->rows[i], d->rows[j] + 2) * same_pair(d->rows[i] + 2, d->rows[j]);
            const int sign = straight != 0 ? straight : crossed;
            if (sign == 0 || taken[j])
                continue;
            fold.second = (uint16_t)j;
            fold.sign = (int16_t)sign;
            taken[j] = 1;
        }
        d->fold[d->n_folded++] = fold;
    }
}

static void draft_volts(draft *d)
{
    static sheet untouched, touched;
    sheet_init(&untouched);
    sheet_init(&touched);
    sheet_touch(&touched, 2, -1.5, 1.6, 4);
    sheet_solve(&touched);
    for (uint32_t i = 0; i < d->n_rows; ++i) {
        uint8_t at[4];
        for (int k = 0; k < 4; ++k)
            at[k] = d->rows[i][k] % SHEET_ELECTRODES;
        d->volts[i] = (float)sheet_volts(&untouched, at);
        d->touched[i] = (float)sheet_volts(&touched, at);
    }
}

static double wave(uint32_t order, uint32_t place, uint32_t side)
{
    return sqrt((order == 0 ? 1.0 : 2.0) / side) * cos(acos(-1.0) * order * (place + 0.5) / side);
}

static void put_order(uint8_t *at, const draft *d, const skin_spec *spec)
{
    const uint32_t drives = spec->electrodes, step = spec->order == 0 ? 1 : spec->order;
    uint32_t place = 0;
    for (uint32_t k = 0; k < drives; ++k) {
        for (uint32_t row = 0; row < d->n_rows; ++row) {
            if (d->rows[row][0] != step * k % drives)
                continue;
            small_put_u16(at + 2 * (size_t)place, row);
            small_put_u16(at + 2 * ((size_t)d->n_rows + row), place++);
        }
    }
}

static uint32_t fields_stride(const skin_spec *spec)
{
    return (2 * spec->electrodes + 4 + 7u) & ~7u;
}

/* Currents that enter on a circle around the image; not symmetric. */
static void fill_fields(const skin_spec *spec, uint8_t *flds)
{
    const double pixel = 6, half = 0.5 * spec->side, radius = 0.6 * spec->side * pixel;
    small_put_f32(flds, 20.0f);
    small_put_f32(flds + 4, 3.0f);
    for (uint32_t j = 0; j < spec->side * spec->side; ++j) {
        uint8_t *column = flds + 16 + 2 * (size_t)j * fields_stride(spec);
        const double x = pixel * (j % spec->side + 0.5 - half);
        const double y = pixel * (j / spec->side + 0.5 - half);
        for (uint32_t e = 0; e < spec->electrodes; ++e) {
            const double angle = 2 * acos(-1.0) * e / spec->electrodes;
            const double dx = x - radius * cos(angle), dy = y - radius * sin(angle);
            const double unit = radius / 20 / (dx * dx + dy * dy);
            small_put_u16(column + 2 * e, small_half(unit * dx));
            small_put_u16(column + 2 * (spec->electrodes + e), small_half(unit * dy));
        }
    }
}

static void fill(const skin_spec *spec, const draft *d, uint32_t stride,
                 uint8_t *const at[SECTIONS])
{
    const uint32_t n = spec->side * spec->side;
    const uint32_t whole[10] = {
        spec->electrodes, d->n_rows,  d->n_folded,      spec->rank,          stride, n,
        spec->side,       spec->side, EITS_STORAGE_F32, EITS_DATA_DIFFERENCE};
    for (uint32_t i = 0; i < 10; ++i)
        small_put_u32(at[DIMS] + 4 * i, whole[i]);
    const float corner = -3.0f * (float)spec->side,
                numbers[6] = {6, corner, corner, 1e-3f, 1.02f, 1};
    for (uint32_t i = 0; i < 6; ++i)
        small_put_f32(at[DIMS] + 40 + 4 * i, numbers[i]);
    uint64_t state = 7;
    uint32_t across = 1;
    while (across * across < spec->rank)
        ++across;
    for (uint32_t i = 0; i < d->n_rows; ++i) {
        memcpy(at[PROT] + 4 * i, d->rows[i], 4);
        small_put_f32(at[GOLD] + 4 * i, d->volts[i]);
        small_put_f32(at[GOLD] + 4 * (d->n_rows + i), d->touched[i]);
    }
    for (uint32_t k = 0; k < d->n_folded; ++k) {
        memcpy(at[FOLD] + 8 * k, &d->fold[k], 8);
        small_put_f32(at[VREF] + 4 * k, d->volts[d->fold[k].first]);
        for (uint32_t i = 0; i < spec->rank; ++i)
            small_put_f32(at[REDU] + 4 * ((size_t)k * stride + i),
                          0.3f * (float)small_random(&state));
    }
    for (uint32_t j = 0; j < n; ++j) {
        for (uint32_t i = 0; i < spec->rank; ++i)
            small_put_f32(at[SENS] + 4 * ((size_t)j * stride + i),
                          (float)(wave(i % across, j % spec->side, spec->side) *
                                  wave(i / across, j / spec->side, spec->side)));
        small_put_f32(at[COLW] + 4 * j, 0.02f);
        small_put_u16(at[GRID] + 4 * j, j % spec->side);
        small_put_u16(at[GRID] + 4 * j + 2, j / spec->side);
    }
    small_put_u32(at[DEFS], 30);
    small_put_u32(at[DEFS] + 4, 4);
    const float defaults[12] = {0.03f, 0.3f,  1.2f, 0.3f, 0.2f,  0.003f,
                                3.0f,  20.0f, 9.0f, 0.0f, 25.0f, 1e-3f};
    for (uint32_t i = 0; i < 12; ++i)
        small_put_f32(at[DEFS] + 8 + 4 * i, defaults[i]);
    memcpy(at[META], "{}", 2);
    put_order(at[ORDR], d, spec);
    if (spec->fields)
        fill_fields(spec, at[FLDS]);
}

static void seal(skin_model *made)
{
    small_put_u32(made->blob + 12, eits_crc32(0, made->blob + 16, made->size - 16));
    made->crc = eits_crc32(0, made->blob, made->size);
}

/* The golden image is the image that the core computes. */
static void make_golden(skin_model *made, uint8_t *golden_image, int wrong)
{
    small_context c;
    const small_model blob = {.blob = made->blob, .size = made->size};
    eits_real difference;
    small_context_open(&c, &blob, 0);
    if (eits_self_test(c.ctx, &difference) != EITS_OK)
        abort();
    memcpy(golden_image, c.ctx->solver.image, c.model.n_pixels * sizeof(float));
    if (wrong)
        small_put_f32(golden_image, c.ctx->solver.image[0] + 1e-6f);
    small_context_close(&c);
}

skin_model skin_model_make(const skin_spec *spec)
{
    static draft d;
    memset(&d, 0, sizeof d);
    draft_rows(&d, spec);
    draft_volts(&d);
    const uint32_t n = spec->side * spec->side, stride = (spec->rank + 7u) & ~7u;
    const uint32_t sizes[SECTIONS] = {64,
                                      4 * d.n_rows,
                                      8 * d.n_folded,
                                      4 * d.n_folded,
                                      4 * d.n_folded * stride,
                                      4 * n * stride,
                                      4 * n,
                                      4 * n,
                                      64,
                                      4 * (2 * d.n_rows + n),
                                      2,
                                      4 * d.n_rows,
                                      spec->fields ? 16 + 2 * n * fields_stride(spec) : 16};
    uint8_t *at[SECTIONS];
    small_model laid_out = small_model_lay_out(SECTIONS, TAGS, sizes, META, at);
    if (!spec->fields)
        memcpy(small_model_entry(&laid_out, "FLDS"), "NONE", 4);
    fill(spec, &d, stride, at);
    small_model_hash(&laid_out, spec->electrodes, d.n_rows, at[PROT]);
    skin_model made = {laid_out.memory, laid_out.blob, laid_out.size, 0};
    seal(&made);
    make_golden(&made, at[GOLD] + 8 * (size_t)d.n_rows, spec->wrong_golden);
    seal(&made);
    return made;
}

void skin_model_free(skin_model *model)
{
    free(model->memory);
    model->memory = NULL;
}
