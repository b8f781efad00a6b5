#include "app/link/stats.h"

#include <string.h>

uint32_t fw_stats_bin(uint32_t us)
{
    uint32_t octave = 0; /* us >> octave lies in 8 to 15 */
    if (us < 8)
        return us;
    while (us >> octave > 15)
        ++octave;
    const uint32_t bin = 8 * octave + (us >> octave);
    return bin < FW_STATS_BINS ? bin : FW_STATS_BINS - 1u;
}

uint32_t fw_stats_edge(uint32_t bin)
{
    if (bin < 8)
        return bin;
    const uint32_t octave = bin / 8 - 1, mantissa = bin % 8 + 8;
    return ((mantissa + 1) << octave) - 1;
}

void fw_stats_clear(fw_stats *stats)
{
    memset(stats, 0, sizeof *stats);
}

void fw_stats_add(fw_stats *stats, eits_stage which, uint32_t us)
{
    fw_stage *stage = &stats->stage[which];
    ++stage->count;
    stage->last_us = us;
    if (us > stage->worst_us)
        stage->worst_us = us;
    ++stage->bin[fw_stats_bin(us)];
}

eits_stage_stats fw_stats_of(const fw_stats *stats, eits_stage which)
{
    const fw_stage *stage = &stats->stage[which];
    const uint32_t wanted = stage->count - stage->count / 100u; /* at least 99 % */
    uint32_t seen = 0, bin = 0;
    while (bin + 1 < FW_STATS_BINS && seen + stage->bin[bin] < wanted)
        seen += stage->bin[bin++];
    const uint32_t edge = fw_stats_edge(bin);
    const bool last = bin + 1 == FW_STATS_BINS;
    const uint32_t p99_us = edge < stage->worst_us && !last ? edge : stage->worst_us;
    return (eits_stage_stats){stage->count, stage->last_us, p99_us, stage->worst_us};
}
