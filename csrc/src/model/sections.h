/* What readers of a model's sections share: a section's place, and numbers out of its bytes. */
#ifndef EITSKIN_SECTIONS_H
#define EITSKIN_SECTIONS_H

#include "eitskin/model.h"

#include <string.h>

typedef struct eits_section {
    const uint8_t *data; /* NULL where absent */
    uint32_t size;
} eits_section;

static inline float eits_read_f32(const uint8_t *bytes)
{
    float value;
    memcpy(&value, bytes, sizeof value);
    return value;
}

/* Finite without libm, and whatever -ffast-math a caller may have set: by the exponent's bits. */
static inline int eits_is_finite_f32(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return (bits & 0x7F800000u) != 0x7F800000u;
}

/* Finite, and from `low` to `high`. */
static inline int eits_between(float value, float low, float high)
{
    return eits_is_finite_f32(value) && value >= low && value <= high;
}

/* Section LOAD, where there is one, into model->force: the calibration of forces.
 * Errors: EITS_E_MODEL_SECTION (wrong size), EITS_E_MODEL_VALUE (numbers out of range, or points
 * that do not ascend from zero). */
eits_status eits_read_force(eits_model *model, const eits_section *found);

/* Section WHIT, where there is one, into model->row_form; model->reduction is known and finite.
 * Errors: EITS_E_MODEL_SECTION (wrong size), EITS_E_MODEL_VALUE (does not fit P). */
eits_status eits_read_row_form(eits_model *model, const eits_section *found);

/* Section UNCE, where there is one, into model->uncertainty; model->rank and row_form are known.
 * Errors: EITS_E_MODEL_SECTION (wrong size), EITS_E_MODEL_VALUE (numbers that are not finite, a
 * variance below 0, or a model that does not say how it was whitened). */
eits_status eits_read_uncertainty(eits_model *model, const eits_section *found);

/* Section GEOM, where there is one, into model->uncertainty; that and model->n_folded are known.
 * Errors: EITS_E_MODEL_SECTION (wrong size), EITS_E_MODEL_VALUE (numbers that are out of range, or
 * a model without UNCE). */
eits_status eits_read_places(eits_model *model, const eits_section *found);

/* Section MOVE, where there is one, into model->uncertainty; GEOM and model->n_folded are known.
 * Errors: EITS_E_MODEL_SECTION (wrong size), EITS_E_MODEL_VALUE (numbers that are out of range, or
 * a model without GEOM). */
eits_status eits_read_moves(eits_model *model, const eits_section *found);

/* Section PREC, where there is one, into model->precision; row_form is known.
 * Errors: EITS_E_MODEL_SECTION (wrong size), EITS_E_MODEL_VALUE (numbers that are not finite, a
 * variance below 0, or a model that says how it was whitened besides). */
eits_status eits_read_precision(eits_model *model, const eits_section *found);

/* Section PLAC, where there is one, into model->place_factor.
 * Errors: EITS_E_MODEL_SECTION (wrong size), EITS_E_MODEL_VALUE (no number from 0 on). */
eits_status eits_read_place_factor(eits_model *model, const eits_section *found);

/* Section ORDR, where there is one, into model->scan_order and scan_place; the protocol is known.
 * Errors: EITS_E_MODEL_SECTION (wrong size), EITS_E_MODEL_VALUE (not each drive once, whole). */
eits_status eits_read_scan_order(eits_model *model, const eits_section *found);

#endif
