/* Read section WHIT of a model: the numbers with which P and S were whitened.
 *
 * The frame's whitening and the diagnostics compute with these numbers and never with P's rows
 * again, so a section that does not fit P would spoil images without any error. Each row is
 * therefore compared with P here, once, when the model is opened: rank x n_folded
 * multiply-accumulates. */
#include "model/constants.h"
#include "model/sections.h"

#include <float.h>

enum { ROW_FORM_HEAD = 16 };

/* Returns 1 if both differ by at most `tolerance`, relative; 0 for NaN. The numbers span many
 * orders of magnitude, so the tolerance is relative and not absolute. */
static int near(float value, float wanted, float tolerance)
{
    return eits_between(value, wanted - tolerance * wanted, wanted + tolerance * wanted);
}

/* Returns 1 if the numbers of row i agree with each other and with P. */
static int row_fits(const eits_model *model, const eits_row_form *form, uint32_t i)
{
    const float *p = model->reduction.data;
    const float s1 = form->s1, energy = form->energy[i], square = form->square[i],
                unit = form->scale[i] * s1;
    float sum = 0;
    for (uint32_t k = 0; k < model->n_folded; ++k) {
        const float value = p[(size_t)k * model->reduction.stride + i];
        /* the sum runs in the order of the columns; the tolerance is far above the effect of
         * another order */
        sum += value * value;
    }
    return form->strength[i] >= 0 && square >= 0 && eits_between(energy, FLT_MIN, 1e30f) &&
           eits_between(form->scale[i], FLT_MIN, 1e30f) && near(sum, energy, EITS_FORM_TOLERANCE) &&
           near(unit * unit * energy, 1, EITS_FORM_TOLERANCE) &&
           near(square * energy + form->mu * (s1 * s1) * energy, 1, EITS_FORM_WEIGHT_TOLERANCE) &&
           eits_between(form->strength[i] * (s1 * s1) - square, -EITS_FORM_TOLERANCE * (s1 * s1),
                        EITS_FORM_TOLERANCE * (s1 * s1));
}

/* Read the section if the model has one: three numbers, then four rows of the stride. */
eits_status eits_read_row_form(eits_model *model, const eits_section *found)
{
    const uint32_t rank = model->rank, stride = model->reduction.stride;
    if (found->data == NULL)
        return EITS_OK;
    if (found->size != ROW_FORM_HEAD + 16u * stride)
        return EITS_E_MODEL_SECTION;
    const float *rows = (const float *)(const void *)(found->data + ROW_FORM_HEAD);
    const eits_row_form form = {.mu = eits_read_f32(found->data),
                                .s1 = eits_read_f32(found->data + 4),
                                .s1_square = eits_read_f32(found->data + 8),
                                .scale = rows,
                                .strength = rows + stride,
                                .energy = rows + 2 * stride,
                                .square = rows + 3 * stride};
    float greatest = 0;
    int fits = eits_between(form.mu, 0, 1e30f) && eits_between(form.s1, 1e-15f, 1e15f) &&
               eits_between(form.s1_square, FLT_MIN, EITS_FORM_MAX_NORM);
    for (uint32_t i = 0; fits && i < rank; ++i) {
        fits = row_fits(model, &form, i);
        greatest = form.square[i] > greatest ? form.square[i] : greatest;
    }
    if (!fits || !near(greatest, form.s1 * form.s1, EITS_FORM_TOLERANCE))
        return EITS_E_MODEL_VALUE;
    model->row_form = form;
    return EITS_OK;
}
