/* What is wrong with a frame's rows, and until there is a reference with its electrodes, before the
 * solver sees it. */
#ifndef FW_QUALITY_H
#define FW_QUALITY_H

#include "app/solve/constants.h"
#include "app/solve/engine.h"
#include "eitskin/link.h"

typedef struct fw_quality {
    uint32_t saturated, first_saturated; /* rows, masked ones apart */
    /* bit e: electrode e is open, as far as the model tells */
    uint32_t open;
    bool checked;                       /* reciprocity could be checked */
    uint32_t worst_row, worst_permille; /* of the frame's rms */
} fw_quality;

/* Before all else: notes which rows the frame measured, and clears what the others hold from
 * earlier frames. */
void fw_quality_prepare(fw_engine *engine, fw_frame *frame);

/* Judge and finish a prepared frame whose measured rows have volts and the scan's quality bits:
 * sets the remaining bits, copies reciprocals where they are not to be used as measured, and makes
 * rows that must not be used NaN.
 *
 * Against a reference the core finds open electrodes (diagnostics.h). Without one, and in the
 * frames of a tare, which must not be learned with an electrode off, `by_model` asks for them here:
 * an electrode is open where every significant row that uses it is dead or saturated, and there are
 * at least three of them. The model tells shares only, the frame itself gives the scale: the limit
 * is 0.6 % of the rms voltage, and noise above a third of that hides an open electrode until there
 * is a tare. */
void fw_quality_check(fw_engine *engine, fw_frame *frame, bool by_model, fw_quality *quality);

#endif
