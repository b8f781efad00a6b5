#include "app/link/scanning.h"

#include "app/acquire/acquire.h"
#include "app/clock.h"
#include "app/link/report.h"
#include "app/link/state.h"
#include "app/link/tracks.h"
#include "app/safety/current_enable.h"
#include "app/safety/faults.h"
#include "app/solve/solve.h"
#include "app/solve/tare.h"

enum { PROBE_US = 500000 }; /* more than two bursts of 1024 samples and 50 ms of settling take */

/* Answer a tare that cannot continue. */
static void fail_tare(fw_host_link *link)
{
    const int32_t why = EITS_E_REFERENCE_SHORT;
    if (fw_tare_abort(link->solve))
        fw_send_tare_reply(link, (fw_answer){.status = EITS_REPLY_CORE, .detail = {why}});
}

static bool measurable(const fw_host_link *link)
{
    return fw_solve_model(link->solve) != NULL && !link->upload.active;
}

void fw_scanning_restart(fw_host_link *link)
{
    const fw_status stopped = fw_acquire_stop(link->acquire);
    fw_tracks_restart(link);
    const fw_scan_table table = fw_solve_table(link->solve);
    const fw_started started = fw_acquire_start(
        link->acquire, stopped, measurable(link) ? &table : NULL, fw_solve_frames(link->solve));
    if (started.status != FW_OK)
        fail_tare(link);
    if (started.new_phase)
        fw_solve_phase_changed(link->solve);
}

void fw_scanning_watch(fw_host_link *link)
{
    if (fw_acquire_stalled(link->acquire)) {
        fw_fault_set(link->safety, EITS_FAULT_SCAN_STALLED, true, (fw_fault_detail){0});
        fail_tare(link);
        fw_scanning_restart(link);
    } else if (fw_acquire_retry_due(link->acquire) && measurable(link)) {
        fw_scanning_restart(link);
    }
}

void fw_scanning_probed(fw_host_link *link)
{
    const fw_probe *probe = fw_acquire_probed(link->acquire);
    if (probe == NULL)
        return;
    if (fw_probe_done(probe)) {
        const uint32_t samples = probe->setup.settings.samples;
        const eits_packet_probed head = {.request = link->probe_request,
                                         .start_us = probe->start_us,
                                         .switched_us = probe->switched_us,
                                         .samples = (uint16_t)samples,
                                         .lost = probe->lost};
        (void)fw_tx_queue_send(&link->tx_queue, EITS_PACKET_PROBED, &head, sizeof head,
                               probe->codes, samples * sizeof probe->codes[0]);
    } else if (fw_now_us(link->board) - probe->began_us < PROBE_US) {
        return;
    } else {
        fw_send_reply(link, EITS_PACKET_PROBE, link->probe_request,
                      fw_refuse(EITS_REPLY_RANGE, offsetof(eits_command_probe, samples), 0));
    }
    fw_scanning_restart(link);
}

void fw_scanning_current_changed(void *link)
{
    fw_host_link *self = link;
    if (!fw_current_allowed(self->safety)) {
        self->stream.what = 0;
        fail_tare(self);
    }
    fw_scanning_restart(self);
}
