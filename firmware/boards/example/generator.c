/* The generator: a digital-to-analog converter plays one period of a sine from a table, a point in
 * each microsecond. Its frequencies are 1 MHz divided by the number of points.
 *
 * On a real board `start` fills the table and starts a timer and a DMA channel; here two variables
 * stand for these. */
#include "example.h"

enum { MIN_POINTS = 4, MAX_POINTS = 1000 };
#define POINTS_PER_S_MILLIHZ 1000000000u

static uint32_t points; /* 0: off, at mid-scale */
static uint32_t started_us;

static uint32_t points_for(uint32_t millihz)
{
    const uint32_t count = millihz == 0 ? 0 : (POINTS_PER_S_MILLIHZ + millihz / 2) / millihz;
    return count >= MIN_POINTS && count <= MAX_POINTS ? count : 0;
}

static fw_tone nearest(const void *ctx, uint32_t millihz)
{
    const uint32_t count = points_for(millihz);
    (void)ctx;
    if (count == 0)
        return (fw_tone){0, 0};
    return (fw_tone){(POINTS_PER_S_MILLIHZ + count / 2) / count, UINT64_MAX / count};
}

static fw_status start(void *ctx, uint32_t millihz)
{
    points = points_for(millihz);
    started_us = mps2_time_us(ctx);
    return points == 0 ? FW_E_RANGE : FW_OK;
}

static fw_status stop(void *ctx)
{
    (void)ctx;
    points = 0;
    return FW_OK;
}

const fw_generator_ops example_generator_ops = {nearest, start, stop};

uint32_t example_generator_period_us(uint32_t *since_us)
{
    *since_us = started_us;
    return points;
}
