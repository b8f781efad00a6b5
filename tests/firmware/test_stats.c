/* Times by bins: edges, the 99th percentile against sorting, the worst. */
#include "app/link/stats.h"
#include "check.h"
#include "small_model.h"

#include <stdlib.h>

static fw_stats stats;

static void test_bins(void)
{
    uint32_t last = 0;
    for (uint32_t us = 0; us < 3000000; us += us < 5000 ? 1 : us / 97) {
        const uint32_t bin = fw_stats_bin(us);
        CHECK(bin == last || bin == last + 1); /* no bin is skipped */
        CHECK(us <= fw_stats_edge(bin));
        CHECK(bin == 0 || us > fw_stats_edge(bin - 1));
        /* an eighth of an octave's lowest eighth */
        CHECK(us < 8 || (double)fw_stats_edge(bin) <= us * 1.125);
        last = bin;
    }
    CHECK_EQUAL(fw_stats_bin(UINT32_MAX), FW_STATS_BINS - 1);
    CHECK_EQUAL(fw_stats_bin((1u << 27) - 1), FW_STATS_BINS - 1);
}

static int by_size(const void *a, const void *b)
{
    const uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

static void test_percentile(void)
{
    static uint32_t times[1000];
    uint64_t state = 3;
    fw_stats_clear(&stats);
    CHECK_EQUAL(fw_stats_of(&stats, EITS_STAGE_SOLVE).p99_us, 0);
    for (uint32_t n = 1; n <= 1000; ++n) {
        times[n - 1] = (uint32_t)(5000 + 4900 * small_random(&state));
        fw_stats_add(&stats, EITS_STAGE_SOLVE, times[n - 1]);
        if (n % 50 != 0 && n > 3)
            continue;
        static uint32_t sorted[1000];
        for (uint32_t k = 0; k < n; ++k)
            sorted[k] = times[k];
        qsort(sorted, n, sizeof sorted[0], by_size);
        const uint32_t exact = sorted[(99 * n + 99) / 100 - 1],
                       edge = fw_stats_edge(fw_stats_bin(exact));
        const eits_stage_stats got = fw_stats_of(&stats, EITS_STAGE_SOLVE);
        CHECK_EQUAL(got.count, n);
        CHECK_EQUAL(got.last_us, times[n - 1]);
        CHECK_EQUAL(got.worst_us, sorted[n - 1]);
        CHECK_EQUAL(got.p99_us, edge < sorted[n - 1] ? edge : sorted[n - 1]);
    }
    CHECK_EQUAL(fw_stats_of(&stats, EITS_STAGE_SCAN).count, 0); /* stages are independent */
    fw_stats_add(&stats, EITS_STAGE_SCAN, UINT32_MAX);
    CHECK_EQUAL(fw_stats_of(&stats, EITS_STAGE_SCAN).p99_us, UINT32_MAX);
    fw_stats_clear(&stats);
    CHECK_EQUAL(fw_stats_of(&stats, EITS_STAGE_SOLVE).worst_us, 0);
}

int main(void)
{
    test_bins();
    test_percentile();
    return checks_report("stats");
}
