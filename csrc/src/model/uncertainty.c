/* Read section UNCE: four numbers, then two lower triangles of rank (rank + 1) / 2 float32 each.
 *
 * The section's bytes are used in place, by pointers into them. Both triangles are second moments,
 * so a diagonal below zero shows a damaged or invented file. Whether they are positive semidefinite
 * is checked by eits_init, which has the memory for it (diagnostics/second_moment.c). */
#include "base/arithmetic.h"
#include "model/sections.h"

enum { HEAD = 16 };

static int is_second_moment(const float *triangle, uint32_t rank)
{
    for (uint32_t i = 0; i < rank; ++i) {
        const float *row = triangle + (size_t)i * (i + 1u) / 2u;
        for (uint32_t j = 0; j <= i; ++j) {
            if (!eits_between(row[j], j < i ? -1e30f : 0, 1e30f))
                return 0;
        }
    }
    return 1;
}

/* Read section PREC: one such triangle, the precision of the rows. */
eits_status eits_read_precision(eits_model *model, const eits_section *section)
{
    const size_t folded = model->n_folded, numbers = folded * (folded + 1u) / 2u;
    const float *triangle = (const float *)(const void *)section->data;
    if (triangle == NULL)
        return EITS_OK;
    if (section->size != 4u * numbers)
        return EITS_E_MODEL_SECTION;
    if (model->row_form.scale != NULL || !is_second_moment(triangle, model->n_folded))
        return EITS_E_MODEL_VALUE;
    model->precision = triangle;
    return EITS_OK;
}

eits_status eits_read_place_factor(eits_model *model, const eits_section *section)
{
    if (section->data == NULL)
        return EITS_OK;
    if (section->size != sizeof model->place_factor)
        return EITS_E_MODEL_SECTION;
    model->place_factor = eits_read_f32(section->data);
    return eits_between(model->place_factor, 0, 1e30f) ? EITS_OK : EITS_E_MODEL_VALUE;
}

/* Returns 1 if the numbers are small enough that sums of their squares are finite. */
static int are_places(const float *values, uint32_t count)
{
    for (uint32_t i = 0; i < count; ++i) {
        if (!eits_between(values[i], -1e6f, 1e6f))
            return 0;
    }
    return 1;
}

/* Read section GEOM: for each fold, one number per row of the matrix. The number of rows follows
 * from the section's size. */
eits_status eits_read_places(eits_model *model, const eits_section *section)
{
    const float *values = (const float *)(const void *)section->data;
    const uint32_t row_size = 4u * model->n_folded;
    if (values == NULL)
        return EITS_OK;
    if (section->size == 0 || section->size % row_size != 0 ||
        section->size / row_size > EITS_MAX_PLACE_ROWS)
        return EITS_E_MODEL_SECTION;
    if (!are_places(values, section->size / 4u) || model->uncertainty.errors == NULL)
        return EITS_E_MODEL_VALUE;
    model->uncertainty.places = values;
    model->uncertainty.place_rows = section->size / row_size;
    return EITS_OK;
}

/* Read section MOVE: the counts of rows, terms and rows of the rest; then `rows` numbers per fold,
 * `rows` numbers per axis and term, and the rest's numbers per fold. */
eits_status eits_read_moves(eits_model *model, const eits_section *section)
{
    uint32_t head[4];
    if (section->data == NULL)
        return EITS_OK;
    if (section->size < sizeof head)
        return EITS_E_MODEL_SECTION;
    memcpy(head, section->data, sizeof head);
    const uint32_t rows = head[0], terms = head[1], rest = head[2], folds = model->n_folded;
    const float *values = (const float *)(const void *)(section->data + sizeof head);
    if (rows == 0 || rows > EITS_MAX_PLACE_ROWS || rest > EITS_MAX_PLACE_ROWS ||
        (terms != 1 && terms != 3 && terms != 6 && terms != 10 && terms != EITS_MAX_MOVE_TERMS) ||
        section->size != sizeof head + 4u * (rows * (folds + 2u * terms) + rest * folds))
        return EITS_E_MODEL_SECTION;
    if (!are_places(values, rows * (folds + 2u * terms) + rest * folds) ||
        model->uncertainty.places == NULL)
        return EITS_E_MODEL_VALUE;
    model->uncertainty.moved = values;
    model->uncertainty.moves = values + (size_t)rows * folds;
    model->uncertainty.rest = model->uncertainty.moves + (size_t)rows * 2u * terms;
    model->uncertainty.move_rows = rows;
    model->uncertainty.rest_rows = rest;
    model->uncertainty.move_terms = terms;
    return EITS_OK;
}

/* Read section ROWE: the counts of vectors, of rows and of terms, and a distance; then vectors and
 * rows for each fold, and `rows` numbers per metric, axis and term. */
eits_status eits_read_row_errors(eits_model *model, const eits_section *section)
{
    uint32_t head[3];
    if (section->data == NULL)
        return EITS_OK;
    if (section->size < HEAD)
        return EITS_E_MODEL_SECTION;
    memcpy(head, section->data, sizeof head);
    const uint32_t count = head[0], rows = head[1], terms = head[2], folds = model->n_folded;
    const float distance = eits_read_f32(section->data + sizeof head);
    const float *values = (const float *)(const void *)(section->data + HEAD);
    if (count == 0 || count > EITS_MAX_PLACE_ROWS || rows == 0 || rows > EITS_MAX_PLACE_ROWS ||
        terms == 0 || terms != model->uncertainty.move_terms ||
        section->size != HEAD + 4u * (folds * (count + rows) + 4u * terms * rows))
        return EITS_E_MODEL_SECTION;
    if (!are_places(values, folds * (count + rows) + 4u * terms * rows) ||
        !eits_between(distance, 1e-6f, 1e6f))
        return EITS_E_MODEL_VALUE;
    const float *moved = values + (size_t)count * folds, *moves = moved + (size_t)rows * folds;
    model->row_errors = (eits_row_errors){.vectors = values,
                                          .count = count,
                                          .distance = distance,
                                          .moved = moved,
                                          .moves = {moves, moves + 2u * (size_t)terms * rows},
                                          .move_rows = rows};
    return EITS_OK;
}

eits_status eits_read_uncertainty(eits_model *model, const eits_section *section)
{
    const size_t numbers = (size_t)model->rank * (model->rank + 1u) / 2u;
    if (section->data == NULL)
        return EITS_OK;
    if (section->size != HEAD + 8u * numbers)
        return EITS_E_MODEL_SECTION;
    const float *triangles = (const float *)(const void *)(section->data + HEAD);
    uint32_t flags;
    memcpy(&flags, section->data, sizeof flags);
    const eits_uncertainty found = {.errors = triangles,
                                    .drift = triangles + numbers,
                                    .row_gains = flags & 1u,
                                    .errors_rms = eits_read_f32(section->data + 4),
                                    .shapes_rms = eits_read_f32(section->data + 8)};
    if (model->row_form.scale == NULL || !is_second_moment(found.errors, model->rank) ||
        !is_second_moment(found.drift, model->rank) || !eits_between(found.errors_rms, 0, 1e30f) ||
        !eits_between(found.shapes_rms, 0, 1e30f))
        return EITS_E_MODEL_VALUE;
    model->uncertainty = found;
    return EITS_OK;
}
