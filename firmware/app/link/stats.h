/* The time that each stage takes: last, worst, and the 99th percentile, from bins that are an
 * eighth of an octave wide. */
#ifndef FW_STATS_H
#define FW_STATS_H

#include "eitskin/link.h"

#include <stdbool.h>

enum { FW_STATS_BINS = 8 + 8 * 24 }; /* up to 2^27 us; the last bin counts all longer times */

typedef struct fw_stage {
    uint32_t count, last_us, worst_us;
    uint32_t bin[FW_STATS_BINS];
} fw_stage;

typedef struct fw_stats {
    fw_stage stage[EITS_STAGES];
} fw_stats;

/* Return the bin of a time (each of 0 to 7 us has its own), and the longest time of a bin. */
uint32_t fw_stats_bin(uint32_t us);
uint32_t fw_stats_edge(uint32_t bin);

void fw_stats_clear(fw_stats *stats);
void fw_stats_add(fw_stats *stats, eits_stage stage, uint32_t us);

/* Return the statistics of a stage. p99 is the lowest edge of a bin that at least 99 % of the times
 * do not exceed, but at most the worst time. */
eits_stage_stats fw_stats_of(const fw_stats *stats, eits_stage stage);

#endif
