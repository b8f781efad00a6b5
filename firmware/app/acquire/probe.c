#include "app/acquire/probe.h"

#include "app/acquire/scan.h"
#include "app/clock.h"
#include "eitskin/link.h"

#include <string.h>

enum { IDLE, FIRST, SECOND, DONE };

static fw_status join(const fw_probe *probe, uint32_t electrodes)
{
    const fw_multiplexers *multiplexers = &probe->board->multiplexers;
    return electrodes == EITS_PROBE_OPEN ? multiplexers->ops->all_off(multiplexers->ctx)
                                         : multiplexers->ops->join(multiplexers->ctx, electrodes);
}

/* Called from the capture's interrupt. */
static void probe_burst(void *user, const fw_burst *burst)
{
    fw_probe *probe = user;
    if (probe->state == FIRST) {
        (void)join(probe, probe->setup.joined);
        probe->switched_us = fw_now_us(probe->board);
        probe->state = SECOND;
    } else if (probe->state == SECOND) {
        memcpy(probe->codes, burst->samples,
               probe->setup.settings.samples * sizeof probe->codes[0]);
        probe->start_us = burst->start_us;
        probe->lost = burst->lost;
        probe->state = DONE;
    }
}

fw_status fw_probe_start(fw_probe *probe, const fw_board *board, const fw_probe_setup *setup)
{
    const fw_capture_ops *ops = board->capture.ops;
    const fw_scan_settings *s = &setup->settings;
    const fw_capture_setup bursts = {s->sample_rate_hz, s->samples,
                                     fw_burst_us(s) + s->settle_us + FW_SWITCH_US};
    probe->board = board;
    probe->setup = *setup;
    fw_status status = ops->configure(board->capture.ctx, &bursts, probe_burst, probe);
    if (status == FW_OK)
        status = join(probe, setup->before);
    probe->began_us = fw_now_us(board);
    probe->state = FIRST;
    if (status == FW_OK)
        status = ops->start(board->capture.ctx);
    if (status != FW_OK)
        fw_probe_stop(probe);
    return status;
}

void fw_probe_stop(fw_probe *probe)
{
    if (probe->state == IDLE)
        return;
    probe->board->capture.ops->stop(probe->board->capture.ctx);
    probe->state = IDLE;
    (void)join(probe, EITS_PROBE_OPEN);
}

bool fw_probe_active(const fw_probe *probe)
{
    return probe->state != IDLE;
}

bool fw_probe_done(const fw_probe *probe)
{
    return probe->state == DONE;
}
