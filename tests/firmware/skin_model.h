/* .eitm models of the sheet in sheet.h, for the firmware's tests: any protocol of up to 255
 * electrodes. */
#ifndef FW_TEST_SKIN_MODEL_H
#define FW_TEST_SKIN_MODEL_H

#include "eitskin/eitskin.h"
#include "sheet.h"

typedef struct skin_spec {
    uint32_t electrodes; /* of the protocol; the sheet's are 16 */
    /* pairs (d, d + step); 1, 1 is adjacent and 8, 1 opposite */
    uint32_t drive_step, measure_step;
    uint32_t rank, side; /* side x side pixels, at least rank of them */
    /* every so many-th row is measured with V+ and V- exchanged; 0: none */
    uint32_t turned;
    uint32_t order;   /* the k-th drive is order * k modulo their number; 0: in sequence */
    int fields;       /* with the currents' fields, so that drives can be tracked */
    int wrong_golden; /* the golden image differs from the core's */
} skin_spec;

typedef struct skin_model {
    void *memory; /* to be freed */
    uint8_t *blob;
    size_t size;
    uint32_t crc; /* of the whole file */
} skin_model;

skin_model skin_model_make(const skin_spec *spec);
void skin_model_free(skin_model *model);

extern const skin_spec SKIN_ADJACENT, SKIN_OPPOSITE, SKIN_BY_SEVEN, SKIN_WITH_FIELDS;

#endif
