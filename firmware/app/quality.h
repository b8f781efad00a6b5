/* What is wrong with a frame: rows and electrodes, before the solver sees it. */
#ifndef FW_QUALITY_H
#define FW_QUALITY_H

#include "app/engine.h"
#include "eitskin/link.h"

/* A row takes part in the judgement of its electrodes where its expected magnitude is at least this share of the rms of all
 * rows, and ten times the limit below. */
#define FW_OPEN_SIGNIFICANT 0.3f
/* Such a row is dead where it has fallen below this share of what is expected, or below so many times the noise that a tare
 * learned (of 100 rows of noise alone, the greatest exceeds it in one frame of 2,000). */
#define FW_OPEN_SHARE 0.02f
#define FW_OPEN_NOISE 5.0f
#define FW_OPEN_LEAST_ROWS 3u
/* Reciprocal rows disagree by more than this share of the frame's rms. Channels whose gains differ by a few parts in a hundred,
 * which a tare takes out, give half of it (scene real_board: 0.054); electrodes that are mixed up give far more. */
#define FW_RECIPROCITY_SHARE 0.1f

typedef struct fw_findings {
    uint32_t saturated, first_saturated; /* rows */
    uint32_t open;                       /* bit e: electrode e is open */
    bool checked;                        /* reciprocity could be judged */
    uint32_t worst_row, worst_permille;  /* of the frame's rms */
} fw_findings;

/* Before all else: notes which rows the frame measured, and clears what the others hold from earlier frames. */
void fw_quality_prepare(fw_engine *engine, fw_frame *frame);

/* Judge and finish a prepared frame whose measured rows have volts and the scan's quality bits: sets the remaining bits, copies
 * reciprocals where they are not to be used as measured, and makes rows that must not be used NaN.
 *
 * An electrode is open where every significant row that uses it is dead or saturated, and there are at least three of them.
 * Without current, or with an input that floats, all of its rows fail at once. A touch that conducts ten times as well as
 * the skin leaves a tenth of a voltage at the least, were it over the electrode and all its neighbours; smaller ones leave some
 * of its rows as they were. Only a metal plate across four electrodes and more is taken for open ones. Before a tare the limit
 * is 0.6 % of the rms voltage: noise above a third of that hides an open electrode until there is a tare. */
void fw_quality_judge(fw_engine *engine, fw_frame *frame, fw_findings *findings);

#endif
