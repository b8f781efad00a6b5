/* Checks the rows of a frame before it is solved and, while there is no reference, the electrodes.
 */
#ifndef FW_QUALITY_H
#define FW_QUALITY_H

#include "app/solve/constants.h"
#include "app/solve/engine.h"
#include "eitskin/link.h"

typedef struct fw_quality {
    uint32_t saturated, first_saturated; /* rows that are not masked */
    /* bit e: electrode e is open, compared with the model */
    uint64_t open;
    bool checked;                       /* reciprocity could be checked */
    uint32_t worst_row, worst_permille; /* of the frame's rms */
} fw_quality;

/* Call this first: marks the rows that the frame has measured, and clears the others, which hold
 * values of earlier frames. */
void fw_quality_prepare(fw_engine *engine, fw_frame *frame);

/* Check a prepared frame whose measured rows have volts and the scan's quality bits. Sets the
 * remaining bits, copies reciprocal rows unless both are used as measured, and sets rows to NaN
 * that must not be used.
 *
 * With a reference the core finds open electrodes (diagnostics.h). Without one, `by_model` looks
 * for them here, and also in the frames of a tare, so that no reference is learned with an
 * electrode off. An electrode is open if at least three significant rows use it and each of them is
 * dead or saturated. The model gives the proportions between rows, and the frame gives the scale. A
 * row is dead below 0.6 % of the rms voltage; noise above a third of that hides an open electrode
 * until there is a reference. */
void fw_quality_check(fw_engine *engine, fw_frame *frame, bool by_model, fw_quality *quality);

#endif
