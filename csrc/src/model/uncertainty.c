/* Section UNCE: four numbers, then two lower triangles of rank (rank + 1) / 2 float32 each.
 *
 * In: the section's bytes, in place. Out: pointers into them. Both triangles are second moments, so
 * a diagonal below zero is a damaged or made-up file; whether they are positive semidefinite is not
 * checked here, for what uses them (evidence/covariance.c) adds noise and holds its pivots up. */
#include "model/uncertainty.h"

#include "base/vec.h"

#include <string.h>

enum { HEAD = 16 };

static int is_second_moment(const float *triangle, uint32_t rank)
{
    for (uint32_t i = 0; i < rank; ++i) {
        const float *row = triangle + (size_t)i * (i + 1u) / 2u;
        for (uint32_t j = 0; j <= i; ++j) {
            if (!(row[j] >= -1e30f && row[j] <= 1e30f))
                return 0;
        }
        if (row[i] < 0)
            return 0;
    }
    return 1;
}

eits_status eits_read_uncertainty(eits_model *model, const uint8_t *bytes, uint32_t size)
{
    const size_t numbers = (size_t)model->rank * (model->rank + 1u) / 2u;
    eits_uncertainty found = {0};
    if (bytes == NULL)
        return EITS_OK;
    if (size != HEAD + 8u * numbers)
        return EITS_E_MODEL_SECTION;
    uint32_t flags;
    memcpy(&flags, bytes, sizeof flags);
    memcpy(&found.errors_rms, bytes + 4, sizeof found.errors_rms);
    memcpy(&found.shapes_rms, bytes + 8, sizeof found.shapes_rms);
    found.row_gains = flags & 1u;
    found.errors = (const float *)(const void *)(bytes + HEAD);
    found.drift = found.errors + numbers;
    if (model->row_form.scale == NULL || !is_second_moment(found.errors, model->rank) ||
        !is_second_moment(found.drift, model->rank) ||
        !(found.errors_rms >= 0 && found.errors_rms <= 1e30f) ||
        !(found.shapes_rms >= 0 && found.shapes_rms <= 1e30f))
        return EITS_E_MODEL_VALUE;
    model->uncertainty = found;
    return EITS_OK;
}
