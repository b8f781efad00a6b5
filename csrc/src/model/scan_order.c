/* Read section ORDR: the rows in the order in which they are measured, then the position of each
 * row in that order.
 *
 * Each list inverts the other, which is only possible for permutations: so they are checked without
 * extra memory. */
#include "model/sections.h"

static int begins_drive(const eits_model *model, uint32_t row)
{
    const uint8_t *drive = model->protocol + 4 * (size_t)row;
    return row == 0 || memcmp(drive, drive - 4, 2) != 0;
}

eits_status eits_read_scan_order(eits_model *model, const eits_section *found)
{
    const uint32_t rows = model->n_rows;
    const uint16_t *order = (const uint16_t *)(const void *)found->data;
    if (order == NULL)
        return EITS_OK;
    if (found->size != 4u * rows)
        return EITS_E_MODEL_SECTION;
    const uint16_t *place = order + rows;
    for (uint32_t i = 0; i < rows; ++i) {
        if (order[i] >= rows || place[order[i]] != i)
            return EITS_E_MODEL_VALUE;
        if (!begins_drive(model, order[i]) && (i == 0 || order[i] != order[i - 1] + 1u))
            return EITS_E_MODEL_VALUE;
    }
    model->scan_order = order;
    model->scan_place = place;
    return EITS_OK;
}
