#include "app/solve/diagnostics.h"

#include "app/safety/faults.h"
#include "hal/hal.h"

static void report_electrodes(fw_safety *safety, eits_fault code, uint64_t which,
                              fw_fault_detail detail)
{
    for (uint32_t e = 0; e < FW_MAX_ELECTRODES; ++e) {
        detail.index = (int32_t)e;
        fw_fault_observe(safety, code, (which >> e & 1u) != 0, detail);
    }
}

void fw_diagnostics_open(fw_safety *safety, uint64_t open)
{
    report_electrodes(safety, EITS_FAULT_ELECTRODE_OPEN, open, (fw_fault_detail){0});
}

/* Return the only bit other than e, or -1 if there is not exactly one. */
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

static void report_bridged(fw_safety *safety, uint64_t bridged)
{
    const uint32_t words[5] = {(uint32_t)bridged, (uint32_t)(bridged >> 32)};
    for (uint32_t e = 0; e < FW_MAX_ELECTRODES; ++e) {
        const bool is = (bridged >> e & 1u) != 0;
        const int32_t other = is ? partner(bridged, e) : 0;
        fw_fault_observe(safety, EITS_FAULT_BRIDGED, is,
                         (fw_fault_detail){.index = (int32_t)e, .value = other, .words = words});
    }
}

void fw_diagnostics_skin(fw_safety *safety, const eits_info *info)
{
    const fw_fault_detail detail = {.value = (int32_t)(1000 * info->model_mismatch + 0.5f)};
    report_bridged(safety, info->bridged_electrodes);
    report_electrodes(safety, EITS_FAULT_ELECTRODE_NOISY, info->noisy_electrodes,
                      (fw_fault_detail){0});
    fw_fault_observe(safety, EITS_FAULT_MODEL_MISMATCH,
                     (info->diagnostics & EITS_DIAGNOSTIC_MODEL_MISMATCH) != 0, detail);
}

void fw_diagnostics_reference(fw_safety *safety, const eits_info *info)
{
    fw_fault_observe(safety, EITS_FAULT_STALE_REFERENCE,
                     (info->diagnostics & EITS_DIAGNOSTIC_STALE_REFERENCE) != 0,
                     (fw_fault_detail){0});
    fw_fault_observe(safety, EITS_FAULT_UNLIKE_MODEL,
                     (info->diagnostics & EITS_DIAGNOSTIC_UNLIKE_MODEL) != 0, (fw_fault_detail){0});
}

void fw_diagnostics_new_reference(fw_safety *safety)
{
    fw_fault_set(safety, EITS_FAULT_STALE_REFERENCE, false, (fw_fault_detail){0});
    fw_fault_set(safety, EITS_FAULT_UNLIKE_MODEL, false, (fw_fault_detail){0});
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
