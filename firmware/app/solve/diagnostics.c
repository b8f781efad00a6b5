#include "app/solve/diagnostics.h"

static void report_electrodes(fw_faults *faults, eits_fault code, uint64_t which,
                              fw_fault_detail detail)
{
    for (uint32_t e = 0; e < FW_ELECTRODES; ++e) {
        detail.index = (int32_t)e;
        fw_fault_observe(faults, code, (which >> e & 1u) != 0, detail);
    }
}

void fw_diagnostics_open(fw_faults *faults, uint32_t frame, uint64_t open)
{
    report_electrodes(faults, EITS_FAULT_ELECTRODE_OPEN, open, (fw_fault_detail){.frame = frame});
}

/* The only other bit than e; -1 where there are more or fewer. */
static int32_t partner(uint64_t which, uint32_t e)
{
    const uint64_t others = which & ~((uint64_t)1 << e);
    int32_t other = 0;
    if (others == 0 || (others & (others - 1u)) != 0)
        return -1;
    while ((others >> other & 1u) == 0)
        ++other;
    return other;
}

static void report_bridged(fw_faults *faults, uint32_t frame, uint64_t bridged)
{
    const uint32_t words[5] = {(uint32_t)bridged, (uint32_t)(bridged >> 32)};
    for (uint32_t e = 0; e < FW_ELECTRODES; ++e) {
        const bool is = (bridged >> e & 1u) != 0;
        const int32_t other = is ? partner(bridged, e) : 0;
        fw_fault_observe(
            faults, EITS_FAULT_BRIDGED, is,
            (fw_fault_detail){.frame = frame, .index = (int32_t)e, .value = other, .words = words});
    }
}

void fw_diagnostics_skin(fw_faults *faults, uint32_t frame, const eits_info *info)
{
    const fw_fault_detail detail = {.frame = frame,
                                    .value = (int32_t)(1000 * info->model_mismatch + 0.5f)};
    report_bridged(faults, frame, info->bridged_electrodes);
    report_electrodes(faults, EITS_FAULT_ELECTRODE_NOISY, info->noisy_electrodes,
                      (fw_fault_detail){.frame = frame});
    fw_fault_observe(faults, EITS_FAULT_MODEL_MISMATCH,
                     (info->diagnostics & EITS_DIAGNOSTIC_MODEL_MISMATCH) != 0, detail);
}

void fw_diagnostics_reference(fw_faults *faults, uint32_t frame, const eits_info *info)
{
    fw_fault_observe(faults, EITS_FAULT_STALE_REFERENCE,
                     (info->diagnostics & EITS_DIAGNOSTIC_STALE_REFERENCE) != 0,
                     (fw_fault_detail){.frame = frame});
    fw_fault_observe(faults, EITS_FAULT_UNLIKE_MODEL,
                     (info->diagnostics & EITS_DIAGNOSTIC_UNLIKE_MODEL) != 0,
                     (fw_fault_detail){.frame = frame});
}

void fw_diagnostics_head(eits_packet_solved *head, const eits_info *info, const fw_quality *quality,
                         const eits_options *options)
{
    const bool saturated =
        quality->saturated > 0 && (options->diagnostics & EITS_DIAGNOSTIC_SATURATED) != 0;
    head->diagnostics = info->diagnostics | (saturated ? EITS_DIAGNOSTIC_SATURATED : 0u);
    head->saturated = (uint16_t)(info->saturated + quality->saturated);
    head->outliers = (uint16_t)info->outliers;
    head->model_mismatch = info->model_mismatch;
    head->open_electrodes = info->open_electrodes;
    head->bridged_electrodes = info->bridged_electrodes;
    head->noisy_electrodes = info->noisy_electrodes;
}
