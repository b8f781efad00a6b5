/* Readers of a model's sections share these: a section's place, and checks of its numbers. */
#ifndef EITSKIN_SECTIONS_H
#define EITSKIN_SECTIONS_H

#include "eitskin/model.h"

#include <string.h>

typedef struct eits_section {
    const uint8_t *data; /* NULL if the section is absent */
    uint32_t size;
} eits_section;

static inline float eits_read_f32(const uint8_t *bytes)
{
    float value;
    memcpy(&value, bytes, sizeof value);
    return value;
}

/* Returns 1 if the value is finite. It tests the exponent's bits, without libm, so it works even if
 * a caller has set -ffast-math. */
static inline int eits_is_finite_f32(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return (bits & 0x7F800000u) != 0x7F800000u;
}

/* Returns 1 if the value is finite and from `low` to `high`. */
static inline int eits_between(float value, float low, float high)
{
    return eits_is_finite_f32(value) && value >= low && value <= high;
}

/* Read section LOAD, if there is one, into model->force: the calibration of forces. Errors:
 * EITS_E_MODEL_SECTION (wrong size), EITS_E_MODEL_VALUE (numbers out of range, or points that do
 * not ascend from zero). */
eits_status eits_read_force(eits_model *model, const eits_section *found);

/* Read section WHIT, if there is one, into model->row_form; model->reduction is known and finite.
 * Errors: EITS_E_MODEL_SECTION (wrong size), EITS_E_MODEL_VALUE (does not fit P). */
eits_status eits_read_row_form(eits_model *model, const eits_section *found);

/* Read section UNCE, if there is one, into model->uncertainty; model->rank and row_form are known.
 * Errors: EITS_E_MODEL_SECTION (wrong size), EITS_E_MODEL_VALUE (numbers that are not finite, a
 * variance below 0, or a model without section WHIT). */
eits_status eits_read_uncertainty(eits_model *model, const eits_section *found);

/* Read section GEOM, if there is one, into model->uncertainty; that and model->n_folded are known.
 * Errors: EITS_E_MODEL_SECTION (wrong size), EITS_E_MODEL_VALUE (numbers out of range, or a model
 * without UNCE). */
eits_status eits_read_places(eits_model *model, const eits_section *found);

/* Read section MOVE, if there is one, into model->uncertainty; GEOM and model->n_folded are known.
 * Errors: EITS_E_MODEL_SECTION (wrong size), EITS_E_MODEL_VALUE (numbers out of range, or a model
 * without GEOM). */
eits_status eits_read_moves(eits_model *model, const eits_section *found);

/* Read section ROWE, if there is one, into model->row_errors; MOVE and model->n_folded are known.
 * Errors: EITS_E_MODEL_SECTION (wrong size), EITS_E_MODEL_VALUE (numbers out of range, or a model
 * without MOVE). */
eits_status eits_read_row_errors(eits_model *model, const eits_section *found);

/* Read section PREC, if there is one, into model->precision; row_form is known. Errors:
 * EITS_E_MODEL_SECTION (wrong size), EITS_E_MODEL_VALUE (numbers that are not finite, a variance
 * below 0, or a model that also has section WHIT). */
eits_status eits_read_precision(eits_model *model, const eits_section *found);

/* Read section PLAC, if there is one, into model->place_factor. Errors: EITS_E_MODEL_SECTION (wrong
 * size), EITS_E_MODEL_VALUE (negative, or not a finite number). */
eits_status eits_read_place_factor(eits_model *model, const eits_section *found);

/* Read section ORDR, if there is one, into model->scan_order and scan_place; the protocol is known.
 * Errors: EITS_E_MODEL_SECTION (wrong size), EITS_E_MODEL_VALUE (the order does not have each drive
 * exactly once and whole). */
eits_status eits_read_scan_order(eits_model *model, const eits_section *found);

#endif
